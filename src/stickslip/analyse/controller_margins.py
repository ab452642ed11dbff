"""Stability margins of a controller made of control laws on a machine, for a sticking and a sliding contact."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from stickslip.analyse.controller_loop import LinearController, linear_to, linearised
from stickslip.analyse.presliding_loop import Axis, Loop, Poles
from stickslip.analyse.stability import AMPLITUDES, SLOW, edge, stable
from stickslip.analyse.stability_result import Cycle
from stickslip.analyse.wording import quantity
from stickslip.control.controller import Controller
from stickslip.core.errors import ParameterError
from stickslip.core.messages import name_option, render
from stickslip.machines.drivetrain import Drivetrain, LinearContact
from stickslip.models.friction_levels import static_level

Array = np.ndarray[Any, np.dtype[np.float64]]
MOST, LEAST = 100.0, 0.01
"""Range of the factors on the torque."""
LATEST = 20.0
"""Range of the delay, samples."""
FAST = 50.0
"""Multiple of the velocity over which friction changes: fast sliding."""
DRAWN = 200
INTEGRATES = 1e-6
"""Distance from 1 of the pole of an integral action; larger for a leaky one."""
HUNTING = (
    "the loop integrates and friction holds {} at rest; whether it hunts (sticks and slips for ever) no poles tell: "
    'simulate a step of 60 s or more (`ss.simulate(machine, controller, ss.Reference("step", amplitude=0.1), 120.0)`, '
    "`stickslip simulate FILE.toml --json`) and read the metric limit_cycle_amplitude_rad"
)
"""Message for a loop that may hunt, with the static friction."""


@dataclass(frozen=True)
class LoopMargins:
    """One loop: while the contact sticks, or while it slides.

    Attributes
    ----------
    name : str
    poles : Poles
        The least stable one.
    torque : tuple of float
        The loop is stable for all factors on the controller's torque in this range, which contains 1; NaN if it is
        unstable.
    delay : float
        Additional delay of the torque that the loop tolerates, samples; NaN if it is unstable.
    phase : float
        Smallest phase margin at a crossover, degrees; infinite without crossover, NaN if the loop is unstable.
    crossover : float
        Crossover frequency, Hz; NaN without one.
    """

    name: str
    poles: Poles
    torque: tuple[float, float]
    delay: float
    phase: float
    crossover: float

    @property
    def gain_dB(self) -> tuple[float, float]:
        """Gain margins, dB: downwards (negative) and upwards; infinite beyond the range tested."""
        low, high = self.torque
        return (
            20.0 * math.log10(low) if not low <= LEAST else -math.inf,
            20.0 * math.log10(high) if not high >= MOST else math.inf,
        )

    def margins(self) -> str:
        """Return gain and phase margin as text."""
        low, high = self.gain_dB
        less = f", {low:.1f} dB" if math.isfinite(low) else ""
        more = f"{high:.1f} dB" if math.isfinite(high) else f"> {20.0 * math.log10(MOST):.0f} dB"
        turn = (
            f"phase margin {self.phase:.1f}° at the crossover, {quantity(self.crossover, 'Hz')}"
            if math.isfinite(self.phase)
            else "no crossover"
        )
        return f"{self.name}, gain margin {more}{less}; {turn}"

    def line(self) -> str:
        """Return a row of the table."""
        verdict = "stable" if self.poles.stable else "unstable"
        pole = f"{self.poles.growth:+9.1f}/s at {self.poles.frequency:5.1f} Hz"
        if not self.poles.stable:
            return f"{self.name:<10}{verdict:<10}{pole}"
        low, high = self.torque
        least = f"{low:.2g}" if low > LEAST else "0"
        most = f"{high:.2g}" if high < MOST else f"> {MOST:g}"
        late = f"{self.delay:.2g}" if self.delay < LATEST else f"> {LATEST:g}"
        return f"{self.name:<10}{verdict:<10}{pole}  {f'{least} to {most}':>14}{late:>16}"


@dataclass(frozen=True, eq=False, repr=False)
class ControllerStability:
    """A controller on a machine.

    Attributes
    ----------
    laws : tuple of str
        Its control laws, such as ``observer: disturbance_observer``.
    loops : tuple of LoopMargins
        Sticking, sliding.
    amplitude : float
        Of the small motion at the encoder, rad.
    stiffness : float
        Stiffness of the contact as seen by the encoder, N·m/rad.
    estimator_delay : float
        Of the velocity, s.
    softer : float
        Relative loss of contact stiffness that the sticking loop tolerates; NaN if the loop is unstable.
    cycle : Cycle or None
        Limit cycle of an unstable loop while the contact sticks.
    held : float
        Static friction that an integral action works against, N·m; 0 without either. Poles cannot tell whether such a
        loop will hunt (stick-slip limit cycle).
    linear_to : float
        Motion at the encoder up to which the laws are linear at the frequencies of both loops, rad; at most `reach`. If
        it is below `amplitude`, the poles are not reported (`is_linear`).
    frequency, response : arrays, shape (n,)
        Hz, and the transfer function from error to torque while the contact sticks, N·m/rad, complex.
    """

    laws: tuple[str, ...]
    loops: tuple[LoopMargins, ...]
    amplitude: float
    stiffness: float
    sample_time: float
    estimator_delay: float
    softer: float
    cycle: Cycle | None
    held: float
    linear_to: float
    frequency: Array
    response: Any

    @property
    def is_linear(self) -> bool:
        """Whether the controller is linear over the motion to which its poles apply."""
        return self.linear_to >= self.amplitude

    @property
    def told_cycle(self) -> Cycle | None:
        """The cycle, if the controller is linear up to it."""
        return self.cycle if self.linear_to >= self.reach else None

    @property
    def reach(self) -> float:
        """The largest motion in the report, rad: the small one, or the limit to which it grows."""
        return reach_of(self.amplitude, self.cycle)

    def _contact(self) -> str:
        """Return a text about the contact that holds the axis while it sticks."""
        if self.stiffness == 0.0:
            return "a contact without springs, which holds the axis where it sticks"
        return f"contact {self.stiffness:.1f} N·m/rad"

    def as_dict(self) -> dict[str, Any]:
        """Return plain data."""
        return {
            "laws": list(self.laws), "amplitude": self.amplitude, "contact_stiffness": self.stiffness,
            "sample_time": self.sample_time, "estimator_delay": self.estimator_delay, "softer": self.softer,
            "cycle": vars(self.told_cycle) if self.told_cycle else None, "held": self.held,
            "linear_to": self.linear_to, "linear": self.is_linear,
            "loops": [
                {
                    "name": loop.name, "stable": loop.poles.stable, "growth": loop.poles.growth,
                    "frequency": loop.poles.frequency, "torque": list(loop.torque), "delay": loop.delay,
                    "gain_margin_dB": list(loop.gain_dB), "phase_margin_deg": loop.phase,
                    "crossover_Hz": loop.crossover,
                } if self.is_linear else {"name": loop.name, "stable": None}
                for loop in self.loops
            ],
            "frequency": self.frequency.tolist(),
            "gain": np.abs(self.response).tolist(), "phase": np.unwrap(np.angle(self.response)).tolist(),
        }  # fmt: skip

    def __repr__(self) -> str:
        return "\n".join(["<ControllerStability:", *(f"  {line}" for line in self.lines())]) + ">"

    def lines(self) -> Iterator[str]:
        """Return the lines of the report."""
        yield f"controller: {'; '.join(self.laws)}"
        yield (
            f"sample time {1e3 * self.sample_time:g} ms, velocity {1e3 * self.estimator_delay:.3g} ms late; motion of "
            f"{quantity(self.amplitude, 'rad')} at the encoder, {self._contact()}"
        )
        if self.is_linear:
            yield from self._poles()
        if self.linear_to < self.reach:
            least = f"up to {quantity(self.linear_to, 'rad')}" if self.linear_to > 0.0 else "in no motion"
            yield render(
                f"the controller is linear about rest only {least}; beyond that it is another loop, which these lines "
                f"(of motion up to {quantity(self.reach, 'rad')}) do not describe: simulate it "
                f"({name_option('confirm')}, `stickslip rig run track`)"
            )
        if self.held > 0.0 and all(loop.poles.stable for loop in self.loops):
            yield HUNTING.format(quantity(self.held, "N·m"))

    def _poles(self) -> Iterator[str]:
        """Return poles and margins of both loops, and the limit cycle of an unstable one."""
        yield f"{'':<10}{'':<10}{'least stable pole':<22}{'torque times':>16}{'samples later':>16}"
        for loop in self.loops:
            yield loop.line()
        yield from (loop.margins() for loop in self.loops if loop.poles.stable)
        if math.isfinite(self.softer) and self.stiffness > 0.0:
            yield f"sticking, {100.0 * self.softer:.0f} % loss of contact stiffness tolerated"
        if found := self.told_cycle:
            # Describing function of a contact that slips increasingly; a contact that always slides holds nothing.
            larger = "" if self.loops[1].poles.stable else ", or a larger one, since sliding is unstable too"
            yield (
                "sticking, the motion grows without limit"
                if math.isinf(found.amplitude)
                else f"sticking, it ends in a cycle of {1e6 * found.amplitude:.0f} µrad at {found.frequency:.0f} Hz"
                + larger
            )
        elif self.cycle:
            yield "sticking, the motion grows to where the controller is not linear: poles do not show where it ends"


def reach_of(amplitude: float, cycle: Cycle | None) -> float:
    """Return the largest motion of a loop, rad; if it grows without limit, the largest one tested."""
    if cycle is None:
        return amplitude
    return min(cycle.amplitude, float(AMPLITUDES[-1]) * amplitude)


def controller_stability(axis: Axis, controller: Controller, delay: float = 0.0) -> ControllerStability:
    """Return poles and margins of a controller on an axis.

    Parameters
    ----------
    axis : Axis
    controller : Controller
    delay : float
        Of the torque, samples.

    Raises
    ------
    InputError
        If a law is not smooth about rest, or has a dead band there.
    ParameterError
        If `delay` is out of bounds.
    """
    if not 0.0 <= delay <= 100.0:
        raise ParameterError(f"stability: delay = {delay:g} samples must be from 0 to 100")
    drivetrain, drive = about(axis, controller, delay, axis.amplitude)
    free = linearised(controller, math.inf, axis.ringing, delay)
    sticking = margins("sticking", drivetrain, drive)
    softer = math.nan
    if sticking.poles.stable:
        softer = edge(lambda s: stable(drivetrain.softer(1.0 - s), drive), np.linspace(0.0, 1.0, 51))
    frequency = np.geomspace(0.1, 0.5 / drive.sample_time, DRAWN)
    estimator = controller.blocks["estimator"]
    late = estimator.law.delay(estimator.parameters, drive.sample_time) if estimator.law.delay else math.nan
    cycle = cycle_of(axis, controller, delay, sticking.poles)
    sliding = margins("sliding", slid(axis), free)
    straight = straight_to(axis, controller, reach_of(axis.amplitude, cycle), sticking.poles, sliding.poles)
    return ControllerStability(
        tuple(f"{part}: {block.law.name}" for part, block in controller.blocks.items()),
        (sticking, sliding), axis.amplitude, drivetrain.visible, drive.sample_time, late,
        softer, cycle, held_against(axis, controller, free), straight, frequency, -drive.response(frequency),
    )  # fmt: skip


def held_against(axis: Axis, controller: Controller, sliding: LinearController) -> float:
    """Return the static friction of the contact, N·m, if the controller (for sliding motion) integrates, else 0."""
    poles = np.linalg.eigvals(sliding.state_space()[0])
    # An integrating law with gain 0 has no such pole.
    declared = any(block.law.integrates for block in controller.blocks.values())
    if not declared or not np.any(np.abs(poles - 1.0) < INTEGRATES):
        return 0.0
    try:
        return max(static_level(axis.friction, direction) for direction in (1.0, -1.0))
    except ParameterError:  # a law that does not state its holding torque
        return 0.0


def straight_to(axis: Axis, controller: Controller, reach: float, *poles: Poles) -> float:
    """Return the motion, at most `reach`, up to which the controller is linear at the frequencies of these poles,
    rad."""
    every = {p.frequency if p.frequency >= SLOW else axis.ringing for p in poles}
    return min(linear_to(controller, reach, frequency) for frequency in every)


def slid(axis: Axis) -> Drivetrain:
    """Return the drivetrain during fast sliding: friction is a constant torque plus viscous damping."""
    law, p = axis.friction.law, axis.friction.parameters
    slope = 0.0
    if law.steady:
        fast = FAST * (float(law.velocity_scale(p)) if law.velocity_scale else 0.1)
        slope = float(law.steady(1.1 * fast, p) - law.steady(fast, p)) / (0.1 * fast)
    bearings = replace(axis.drivetrain.bearings, stiffness=0.0)
    return replace(axis.drivetrain, contact=LinearContact(0.0, slope), bearings=bearings)


def about(
    axis: Axis, controller: Controller, delay: float, amplitude: float
) -> tuple[Drivetrain, LinearController]:
    """Return drivetrain and controller at an amplitude of the encoder, with the laws at the loop's own frequency."""

    def at(frequency: float) -> tuple[Drivetrain, LinearController]:
        return axis.at(amplitude, frequency), linearised(controller, amplitude, frequency, delay)

    found = at(axis.ringing)
    for _ in range(2):
        frequency = Loop(*found).poles().frequency
        if frequency < SLOW:
            break
        found = at(frequency)
    return found


def margins(name: str, drivetrain: Drivetrain, drive: LinearController) -> LoopMargins:
    """Return the poles and the margins for torque and delay."""
    loop = Loop(drivetrain, drive)
    poles = loop.poles()
    if not poles.stable:
        return LoopMargins(name, poles, (math.nan, math.nan), math.nan, math.nan, math.nan)

    def with_torque(factor: float) -> bool:
        return stable(drivetrain, replace(drive, factor=factor))

    high = edge(with_torque, np.geomspace(1.0, MOST, 81))
    low = edge(with_torque, np.geomspace(1.0, LEAST, 81))
    late = edge(
        lambda d: stable(drivetrain, replace(drive, delay=drive.delay + d)), np.linspace(0.0, LATEST, 201)
    )
    return LoopMargins(name, poles, (low, high), late, *loop.phase_margin())


def cycle_of(axis: Axis, controller: Controller, delay: float, first: Poles) -> Cycle | None:
    """Return the limit cycle of a loop that is unstable at the small amplitude."""
    if first.stable:
        return None

    def poles(amplitude: float) -> Poles:
        return Loop(*about(axis, controller, delay, amplitude)).poles()

    low = axis.amplitude
    for factor in AMPLITUDES[1:]:
        high = float(factor) * axis.amplitude
        if poles(high).stable:
            for _ in range(8):
                middle = math.sqrt(low * high)
                low, high = (low, middle) if poles(middle).stable else (middle, high)
            return Cycle(poles(low).frequency, low)
        low = high
    return Cycle(first.frequency, math.inf)
