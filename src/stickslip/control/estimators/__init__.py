"""How a controller gets the velocity from measured positions: one file an estimator. `ESTIMATORS` names them.

To add an estimator, write its file and add its name to this tuple.
"""

ESTIMATORS = (
    "backward_difference",
    "filtered_difference",
    "butterworth_difference",
    "luenberger",
    "kalman",
    "tracking_differentiator",
)
