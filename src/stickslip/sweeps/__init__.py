"""Studies over many cases: numbers of their runs varied, in blocks that are found again after an interruption."""
