"""The small sweep of the tests, and the data set of one that was run."""

from pathlib import Path

import pyarrow.dataset

SMALL = Path(__file__).parents[1] / "sweep" / "small.toml"


def table(folder):
    found = pyarrow.dataset.dataset(
        folder / "data", partitioning="hive", exclude_invalid_files=True
    ).to_table()
    return found.sort_by([("controller", "ascending"), ("case", "ascending")])
