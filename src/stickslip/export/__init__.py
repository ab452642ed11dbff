"""A law leaves Python: one file a target. `TARGETS` names them."""

TARGETS = ("c99", "python", "matlab", "st")
