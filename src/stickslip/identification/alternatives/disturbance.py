"""An external torque that moves the axis: the acceleration is then correlated with the misfit (closed-loop bias).

A disturbance d itself accelerates the axis, by up to d / J if the loop does not hold the axis against it, and the drive
then responds to that motion. Least squares interpret the correlation as a smaller inertia and a more delayed torque
column, with a smaller misfit, so the evidence of the regression cannot reveal it (Ljung 1999, 13.4; Van den Hof 1998).
The part of the misfit that moves the axis cannot be distinguished from noise of the torque column either: every part of
the bias is equally likely.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from stickslip.identification.alternatives.alternative import Alternative
from stickslip.identification.rows import SlidingRows

Array = np.ndarray[Any, np.dtype[np.float64]]


def no_columns(rows: SlidingRows) -> Array:
    """Return no columns: the effect is a bias of the other coefficients."""
    return np.zeros((rows.sign.size, 0))


DISTURBANCE = Alternative(
    "disturbance", no_columns, odds=0.2,
    cause="a torque from outside that moves the axis",
    remedy="record stronger accelerations, or without the disturbance",
)  # fmt: skip


def closed_loop_bias(residual: Array, gain: Array, weight: Array, inertia: float) -> Array:
    """Return the bias of the numbers if the whole misfit is a torque that moves the axis freely, shape (k,).

    Parameters
    ----------
    residual, weight : array, shape (n,)
        Misfit of the rows, N·m (N), and their information.
    gain : array, shape (k,)
        Covariance of the numbers with the inertia.
    inertia : float
        Inertia, kg·m² (kg).
    """
    return gain * float(weight @ residual**2) / max(abs(inertia), 1e-300)
