"""Levels of friction of any law: what it withstands at rest, the Coulomb torque, viscous friction.

The one place where they are read off a law: a law that holds at rest says what it withstands (`Law.holding`); one
that creeps there, on a steep slope or a smooth curve, withstands what its curve reaches where the slope has ended; and
beyond the Stribeck effect a line through the curve has Coulomb's level and the viscous slope.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from stickslip.core.errors import ParameterError
from stickslip.core.rebinding import NEGATIVE
from stickslip.core.spec import Surroundings
from stickslip.models.model import Model

USUAL_SCALE = 0.01
"""rad/s, over which a law's torque is taken to change where neither the law nor a bend of its curve says."""
FROM, TO, PER_DECADE = -9, 3, 100
"""Decades of velocity scales on which the end of a slope is looked for, and points in each."""
ENDED = 1e-3
"""Of its slope at rest, at which a curve's slope counts as ended."""
BEYOND = (5.0, 50.0)
"""Velocity scales between which a line is laid through the curve."""
STRAIGHT, FARTHER = 5e-3, 8
"""Of the level, by which the curve may leave its line; and how often the line is laid at twice the speed where it does
not: a smooth law's own scale is that of its slope at rest, and its Stribeck effect ends later."""
NO_LEVEL = 1e-9
"""Of the torque at speed: less than that at rest is rounding, and the law a viscous one."""

OCTAVE = 4
"""Of `SEEN`, velocities that lie from one to twice that one."""
SEEN = 2.0 ** (np.arange(-20 * OCTAVE, 10 * OCTAVE + 1) / OCTAVE)
"""Velocities at which a bend is looked for, 1e-6 to 1e3 rad/s."""
LATE = 1.5
"""The bend of exp(-(v/v_s)^2) over an octave is largest at so many v_s."""
LEAST = 1e-4
"""Share of the torque below which nothing bends."""
MUCH, SOME = 0.3, 0.05
"""Share of the largest bend from which one counts as the slowest, and as the fastest: a fall begins with a slight bend
at low velocity, and after it has ended there is none."""


class Bends(NamedTuple):
    """Velocities at which a sliding curve bends, rad/s; 0 of a straight line."""

    slowest: float
    fastest: float


class Levels(NamedTuple):
    """Levels of friction in one direction of motion.

    Attributes
    ----------
    fs, fc : float
        What the contact withstands at rest, and the Coulomb torque, N·m; positive in both directions.
    vs : float
        Stribeck velocity: at which the first has fallen to the second but for 1/e, rad/s.
    sigma2 : float
        Viscous friction, N·m·s/rad.
    delta_s : float
        Stribeck shape factor.
    """

    fs: float
    fc: float
    vs: float
    sigma2: float
    delta_s: float = 2.0


def levels_of(model: Model, direction: float = 1.0) -> Levels:
    """The levels of a law in a direction of motion (+1 or -1): its own parameters, or as its curve has them.

    Raises
    ------
    ParameterError
        If the law has no torque at constant velocity.
    """
    curve = _Curve(model, direction)
    if (own := _stated(curve, direction)) is not None:
        return own
    return Levels(curve.static, curve.coulomb, curve.stribeck_velocity, curve.viscous)


def static_level(model: Model, direction: float = 1.0) -> float:
    """What the contact withstands at rest in a direction (+1 or -1), N·m; of a law that creeps, where it lets go.

    Raises
    ------
    ParameterError
        If the law has no torque at constant velocity and does not say what it holds.
    """
    return _Curve(model, direction).static


def end_of_slope(model: Model) -> float:
    """The velocity at which a smooth sign, or another slope through rest, has ended in both directions, rad/s.

    0 of a law that withstands torque at rest, that has no torque at constant velocity, or whose curve has no bend.
    """
    law = model.law
    if law.steady is None or law.holding is not None or law.state_fields:
        return 0.0
    curves = [_Curve(model, side) for side in (1.0, -1.0)]
    return max(curve.end_of_slope for curve in curves) if all(curve.bend for curve in curves) else 0.0


def line_beyond(model: Model, direction: float = 1.0) -> tuple[float, float]:
    """Level, N·m, and slope, N·m·s/rad and not negative, of friction beyond the Stribeck effect, for +1 or -1.

    Raises
    ------
    ParameterError
        If the law has no torque at constant velocity.
    """
    curve = _Curve(model, direction)
    return curve.coulomb, curve.viscous


def bends_of(torque: Callable[[float], float]) -> Bends:
    """Where a torque against velocity, N·m against rad/s, bends much: of a smooth law where its sign has ended, and
    where its Stribeck effect has."""
    seen = np.array([_or_nan(torque, v) for v in SEEN.tolist()])
    end = int(np.argmin(np.isfinite(seen))) if not np.isfinite(seen).all() else seen.size
    if end < 2 * OCTAVE + 3:
        return Bends(0.0, 0.0)
    before, here, after = seen[: end - 2 * OCTAVE], seen[OCTAVE : end - OCTAVE], seen[2 * OCTAVE : end]
    bends = np.abs(after - 3.0 * here + 2.0 * before)  # 0 of any straight line
    bends[bends <= LEAST * np.abs(here)] = 0.0
    peaks = 1 + np.flatnonzero((bends[1:-1] >= bends[:-2]) & (bends[1:-1] > bends[2:]))
    if not peaks.size:
        return Bends(0.0, 0.0)
    at, share = SEEN[OCTAVE + peaks] / LATE, bends[peaks] / bends[peaks].max()
    return Bends(float(at[share >= MUCH][0]), float(at[share >= SOME][-1]))


def _or_nan(torque: Callable[[float], float], velocity: float) -> float:
    """The torque; NaN where a law written by hand is not defined so far out."""
    try:
        return torque(velocity)
    except ArithmeticError:
        return math.nan


def independent(model: Model) -> Model:
    """The model without its dependences, at the surroundings for which its parameters hold."""
    law = model.law
    chosen = {c.name: "none" for c in law.choices if law.option(c).reads_surroundings}
    if not chosen:
        return model
    bare = law.having(**chosen)
    values: dict[str, Any] = model.parameters._asdict()
    return Model(bare, **{f.name: values[f.name] for f in bare.fields})


def _stated(curve: _Curve, direction: float) -> Levels | None:
    """The levels by the law's own parameters where it has Stribeck's curve and linear viscous friction, else None.

    A slope that is not steep meets the curve below its value at rest: what is withstood there is the curve's.
    """
    law, own = curve.law, curve.p
    if law.option_of("curve") != "stribeck" or law.option_of("viscous") != "linear":
        return None
    end = NEGATIVE if direction < 0.0 and law.option_of("symmetry") == "asymmetric" else ""
    fs, fc, vs, sigma2, shape = (
        float(getattr(own, name + end)) for name in ("fs", "fc", "vs", "sigma2", "delta_s")
    )
    creeps = law.holding is None and not law.state_fields
    return Levels(curve.static if creeps else fs, fc, vs, sigma2, shape)


class _Curve:
    """Torque of a law against constant velocity in one direction, and what is read off it."""

    def __init__(self, model: Model, direction: float) -> None:
        bare = independent(model)
        self.law, self.p, self.direction = bare.law, bare.parameters, direction
        self.bend = bends_of(self.torque).fastest if self.law.steady else 0.0
        stated = float(self.law.velocity_scale(self.p)) if self.law.velocity_scale else 0.0
        self.scale = stated or self.bend or USUAL_SCALE
        self._line: tuple[float, float] | None = None

    def torque(self, velocity: float) -> float:
        """N·m, at a velocity in the direction, rad/s."""
        if self.law.steady is None:
            raise ParameterError(
                f"law {self.law.name!r} has no torque at constant velocity; identify one with a sliding curve"
            )
        return self.direction * float(self.law.steady(self.direction * velocity, self.p))

    @property
    def coulomb(self) -> float:
        """Level of the line beyond the Stribeck effect, N·m; 0 where it is rounding."""
        return self._beyond()[0]

    @property
    def viscous(self) -> float:
        """Slope of that line, N·m·s/rad; not negative."""
        return self._beyond()[1]

    @property
    def static(self) -> float:
        """Withstood at rest, N·m."""
        if self.law.holding is not None:
            z = self.law.state(self.p)
            return abs(float(self.law.holding(self.direction, z, self.p, Surroundings())))
        v, torque = self._let_go()
        static = torque - self.viscous * v
        return static if static > NO_LEVEL * abs(self.torque(BEYOND[1] * self.scale)) else 0.0

    @property
    def end_of_slope(self) -> float:
        """At which the slope through rest has ended, rad/s."""
        return self._let_go()[0]

    @property
    def stribeck_velocity(self) -> float:
        """At which the static torque has fallen to Coulomb's but for 1/e, rad/s; the law's scale where none falls."""
        fall = self.static - self.coulomb
        if abs(fall) <= STRAIGHT * self.coulomb:
            return self.scale
        band = self.law.rest_band
        start = float(band(self.p)) if band else self._let_go()[0]
        for i, v in enumerate(v for v in self._speeds() if v > start):
            if (self.torque(v) - self.viscous * v - self.coulomb) / fall <= 1.0 / math.e:
                return v if i > 0 else self.scale  # it falls in a jump
        return self.scale

    def _speeds(self) -> list[float]:
        return [self.scale * 10.0 ** (i / PER_DECADE) for i in range(FROM * PER_DECADE, TO * PER_DECADE + 1)]

    def _let_go(self) -> tuple[float, float]:
        """Velocity (rad/s) and torque (N·m) where the slope through rest has ended: at once, where there is none."""
        speeds = self._speeds()
        before, torque = speeds[0], self.torque(speeds[0])
        at_rest = torque / before - self.viscous
        for v in speeds[1:]:
            following = self.torque(v)
            if (following - torque) / (v - before) - self.viscous <= ENDED * at_rest:
                return before, torque
            before, torque = v, following
        return before, torque

    def _beyond(self) -> tuple[float, float]:
        """Level and slope of the curve beyond its Stribeck effect: of the lines tried, the first that it keeps to, or
        the one that it leaves least."""
        if self._line is None:
            # The top of a Stribeck effect that ends late is straight, too: no line is laid before the last bend.
            start = self.bend if self.bend > BEYOND[0] * self.scale else self.scale
            tried: list[tuple[float, float, float]] = []
            while len(tried) <= FARTHER and (not tried or tried[-1][0] > STRAIGHT):
                tried.append(self._line_at(start * 2.0 ** len(tried)))
            _, *line = min(tried)
            self._line = line[0], line[1]
        return self._line

    def _line_at(self, scale: float) -> tuple[float, float, float]:
        """How far the curve leaves a line through it, in parts of its torque; the line's level and slope."""
        v = np.linspace(*BEYOND, 20) * scale
        torque = np.array([self.torque(x) for x in v.tolist()])
        span = float(v[-1])
        centred = v / span - np.mean(v / span)  # of size 1, whatever the unit of the speed
        slope = max(float(centred @ torque) / float(centred @ centred) / span, 0.0)
        size = float(np.mean(np.abs(torque))) or 1.0
        if slope * v[-1] <= NO_LEVEL * size:
            slope = 0.0
        level = float(np.mean(torque) - slope * np.mean(v))
        if abs(level) <= NO_LEVEL * size:
            level = 0.0
        return float(np.max(np.abs(torque - level - slope * v))) / size, level, slope
