"""The small sweep of the tests, and the data set of one that was run."""

from pathlib import Path

import numpy as np
import pandas as pd

SMALL = Path(__file__).parents[1] / "sweep" / "small.toml"


def table(folder):
    """All cases as a data frame, by controller and number."""
    parts = []
    for path in sorted((folder / "data").rglob("part-*.npz")):
        with np.load(path) as data:
            columns = {name: data[name] for name in data.files if name != "__about__"}
        parts.append(pd.DataFrame({"controller": path.parent.name.partition("=")[2], **columns}))
    return pd.concat(parts, ignore_index=True)
