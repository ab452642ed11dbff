"""Reference motions of an axis: one file a kind. `REFERENCES` names them.

To add a kind, write its file and add its name to this tuple.
"""

REFERENCES = ("sine", "plain_sine", "harmonic", "step", "ramp", "staircase", "scurve", "table")

BEFORE = 1.0 - 1e-15
"""Times a time at which a motion jumps: from there on it has jumped. A sample time counted up as k T lies beside it by
rounding."""
