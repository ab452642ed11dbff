"""Read records from files: `read(path) -> Record`. Each format has its own module; `FORMATS` lists them.

To add a format, write its file (recognise, read, FORMAT) and add its name to that tuple in `reading.py`.
"""

from stickslip.readers.convert import Drive
from stickslip.readers.reading import FORMATS, open_table, read

__all__ = ["FORMATS", "Drive", "open_table", "read"]
