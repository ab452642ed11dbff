"""Model-based feedback: the law runs on the measured velocity; thesis figure 3.4."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from stickslip.control.compensators._base import Compensator

__all__ = ["Feedback"]


@dataclass(frozen=True)
class Feedback(Compensator):
    """T_hat = gain * law(measured velocity).

    In continuous time the sign of the velocity is the exact limit: it changes where v passes through zero, and
    a feedback that cancels friction repels from there. With a sample time it is what the samples say.

    Attributes
    ----------
    model : Model
        The law and its parameters.
    gain : float
        Factor on the compensating torque; 1 cancels the whole model.
    filter_hz : float or None
        Corner of a second-order Butterworth low-pass on the velocity, Hz.
    lead : float
        0: only a reference can be led.
    deadband : float
        The law sees velocities below it, rad/s, as rest, so that a count of the encoder does not compensate a friction
        that is not there. Only with a sample time.
    offset : float
        Constant torque that acts against positive motion beside friction, N·m: it is given whole, whatever the gain.
        Only with a sample time.
    inertia_feedforward : float
        Inertia whose torque along the reference is given, kg·m² times the reference's acceleration. Only with a sample
        time.
    substeps : int
        Steps of the law into which a sample is divided, the velocity linear in between, 1 to 1000: the error of a step
        falls with them. Only with a sample time.
    """

    name: ClassVar[str] = "feedback"
    prefix: ClassVar[str] = "FB"
    velocity: ClassVar[str] = "measured"
