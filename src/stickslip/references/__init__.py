"""What an axis is told to do: one file a kind. `REFERENCES` names them.

To add a kind, write its file and add its name to this tuple.
"""

REFERENCES = ("sine", "plain_sine", "harmonic", "step", "ramp", "staircase", "scurve", "table")
