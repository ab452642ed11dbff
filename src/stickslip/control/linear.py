"""Linear controllers and their gains by pole placement; thesis 3.1.1.

T = kp (theta_d - theta) + kr theta_d' - kd theta' + ki integral of (theta_d - theta)

PR ("proportional with rate feedback", eq. 3.4) has kr = 0, PD (eq. 3.5) and PID (eq. 3.11) have kr = kd.

Besides the cascade of most drives, position P around velocity PI (`Cascade`).
"""

from __future__ import annotations

import functools
import math
from typing import Annotated, Any, NamedTuple, TypeVar

from stickslip.core.arguments import arguments_checked, constructor_checked
from stickslip.core.errors import ParameterError
from stickslip.core.reprs import making
from stickslip.core.spec import Par, fields_of
from stickslip.core.type_rules import is_number

K = TypeVar("K")


def _bounded(kind: type[K]) -> type[K]:
    """A named tuple of gains whose constructor refuses what is out of bounds: a negative gain drives the axis away."""
    inner: Any = kind.__new__

    @functools.wraps(inner)
    def new(cls: Any, *args: Any, **kwargs: Any) -> Any:
        made = inner(cls, *args, **kwargs)
        for f, value in zip(fields_of(kind), made):
            # What is no number is refused by its annotation, or by whatever calculates with it.
            if is_number(value) and (complaint := f.par.complaint(float(value))):
                unit = "" if f.par.unit == "-" else f" {f.par.unit}"
                raise ParameterError(f"{kind.__name__}: {f.name} = {value:g}{unit} {complaint}")
        return made

    kind.__new__ = new
    return kind


@constructor_checked
@_bounded
class Gains(NamedTuple):
    """Gains of the linear controller, none negative."""

    kp: Annotated[float, Par("N·m/rad", "k_p", "proportional gain", lower=0.0)]
    ki: Annotated[float, Par("N·m/(rad·s)", "k_i", "integral gain", lower=0.0, default=0.0)] = 0.0
    kd: Annotated[float, Par("N·m·s/rad", "k_d", "gain on the measured velocity", lower=0.0, default=0.0)] = (
        0.0
    )
    kr: Annotated[
        float, Par("N·m·s/rad", "k_r", "gain on the reference velocity", lower=0.0, default=0.0)
    ] = 0.0

    def __repr__(self) -> str:
        return making(self, Gains._field_defaults)

    def __eq__(self, other: object) -> bool:
        # As tuples, a PID and a cascade of the same four numbers would be one.
        return not isinstance(other, Cascade) and self[:] == other

    def __ne__(self, other: object) -> bool:
        return not self == other

    def __hash__(self) -> int:
        return hash(self[:])


@constructor_checked
@_bounded
class Cascade(NamedTuple):
    """Position P around velocity PI, as drives have it; only with a sample time.

    e_v = kv (theta_d - theta) + feed theta_d' - theta' is the error of the velocity, and
    T = kvp e_v + kvi integral of e_v. The integral rests while the torque is at its limit and e_v would drive it
    further (conditional integration).
    """

    kv: Annotated[float, Par("1/s", "K_v", "gain of the position loop", lower=0.0)]
    kvp: Annotated[float, Par("N·m·s/rad", "K_p", "gain of the velocity loop", lower=0.0)]
    kvi: Annotated[
        float, Par("N·m/rad", "K_i", "integral gain of the velocity loop, kvp over its reset time", lower=0.0)
    ] = 0.0
    feed: Annotated[float, Par("-", "", "part of the reference velocity that is fed forward", lower=0.0)] = (
        1.0
    )

    def __repr__(self) -> str:
        return making(self, Cascade._field_defaults)

    def __eq__(self, other: object) -> bool:
        # As tuples, a PID and a cascade of the same four numbers would be one.
        return not isinstance(other, Gains) and self[:] == other

    def __ne__(self, other: object) -> bool:
        return not self == other

    def __hash__(self) -> int:
        return hash(self[:])

    @property
    def pid(self) -> Gains:
        """The PID that it is, away from its limit and without a velocity filter, where ``feed`` is 1.

        With less, the integral term's position differs: kvi (1 - feed) theta is left out.
        """
        kp = self.kvp * self.kv + self.kvi * self.feed
        return Gains(kp, self.kvi * self.kv, self.kvp, self.kvp * self.feed)


class Compensation(NamedTuple):
    """A held friction law's torque in continuous time: ``gain`` times the law at a velocity."""

    velocity: str
    """``"reference"`` or ``"measured"``"""
    gain: float
    """Factor on the law's torque"""
    corner: float = 0.0
    """Of a second-order Butterworth low-pass on the velocity, rad/s; 0 for none"""


@arguments_checked
def pr(kp: float, kd: float) -> Gains:
    """Proportional with rate feedback: kp (N·m/rad) on the error, kd (N·m·s/rad) on the velocity; thesis eq. 3.4."""
    return Gains(kp=kp, kd=kd)


@arguments_checked
def pd(kp: float, kd: float) -> Gains:
    """Proportional with derivative: kp (N·m/rad) and kd (N·m·s/rad) on the error; thesis eq. 3.5."""
    return Gains(kp=kp, kd=kd, kr=kd)


@arguments_checked
def pid(kp: float, ki: float, kd: float) -> Gains:
    """Proportional, integral, derivative: kp (N·m/rad), ki (N·m/(rad·s)), kd (N·m·s/rad); thesis eq. 3.11."""
    return Gains(kp=kp, ki=ki, kd=kd, kr=kd)


@arguments_checked
def place(kind: str, inertia: float, bandwidth: float, damping: float = 1.0) -> Gains:
    """Gains that place the poles of the loop without friction; thesis eqs. 3.10 and 3.15.

    Parameters
    ----------
    kind : {"PR", "PD", "PID"}
    inertia : float
        kg·m²
    bandwidth : float
        Natural frequency of the poles, Hz. The PID's third pole lies at the same frequency (eq. 3.13). It is not the
        frequency up to which the closed loop follows: the zeros of PD and PID bring the crossover of the gain and the
        closed loop's -3 dB to a multiple of it, of a PID with damping 1 to some three and four times. `stability` says
        the crossover.
    damping : float
        Damping ratio of the pair.

    Raises
    ------
    ParameterError
        If a number is not positive or the kind is unknown.
    """
    given = (("inertia", inertia, " kg·m²"), ("bandwidth", bandwidth, " Hz"), ("damping", damping, ""))
    for name, value, unit in given:
        if not value > 0.0 or not math.isfinite(value):
            raise ParameterError(f"controller: {name} = {value:g}{unit} must be greater than 0 and finite")
    w = 2.0 * math.pi * bandwidth
    if not math.isfinite(w * w * w):
        raise ParameterError(f"controller: bandwidth = {bandwidth:g} Hz is out of range; give the loop's own")
    if kind == "PR":
        return pr(inertia * w * w, 2.0 * inertia * damping * w)
    if kind == "PD":
        return pd(inertia * w * w, 2.0 * inertia * damping * w)
    if kind == "PID":
        spread = 1.0 + 2.0 * damping
        return pid(inertia * w * w * spread, inertia * w**3, inertia * w * spread)
    meant = (
        f"did you mean {kind.upper()!r}?" if kind.upper() in LINEAR else f"choose from {', '.join(LINEAR)}"
    )
    raise ParameterError(f"controller: unknown kind {kind!r}; {meant}")


LINEAR = ("PR", "PD", "PID")
