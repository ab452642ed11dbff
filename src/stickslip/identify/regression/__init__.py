"""Linear least squares on the rows of a record: inverse dynamics, and several bands over certain sliding."""
