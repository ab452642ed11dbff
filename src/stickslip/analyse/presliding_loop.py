"""The loop in presliding as a linear sampled system of plant, drive and compensator, and its poles.

While every contact sticks, friction is a spring (and a damper) at the contact, and so is the law in a feedback
compensator, with the opposite sign. The plant is a chain of inertias (thesis figure 4.57) with the motor on the first
and the contact on the last. Its torque is held for a sample time and may be delayed; the drive is that of
`stickslip.control.composition`, linearised about rest.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any, Protocol

import numpy as np

from stickslip.control.linear import Gains
from stickslip.core.errors import ParameterError
from stickslip.machines.drivetrain import FREE, INPUTS, Drivetrain, LinearContact
from stickslip.models.model import Model
from stickslip.simulation.prescribed.motion import Samples, packed_numbers, torque_along

Array = np.ndarray[Any, np.dtype[np.float64]]

STEPS = 64
"""Steps per period for the describing function of a law."""
STABLE = 1e-9
"""Tolerance of the unit circle for rounding errors of a pole."""
TURNS = np.geomspace(1e-5 * math.pi, math.pi, 500)
"""Frequencies up to half the sample rate for a loop's sensitivity and crossover, rad per sample."""


def describing(model: Model, amplitude: float, frequency: float) -> LinearContact:
    """Return a law's describing function: its first harmonic along a sinusoid about rest.

    It is computed from the law's own `step` in the second period, so it is valid for every law: a sticking contact is a
    spring, one that starts to slip a softer spring with damping, Coulomb friction a damper of 4 F_C / (pi amplitude w).

    Parameters
    ----------
    model : Model
    amplitude : float
        rad
    frequency : float
        Hz
    """
    for name, value, unit in (("amplitude", amplitude, "rad"), ("frequency", frequency, "Hz")):
        if not (value > 0.0 and math.isfinite(value)):
            raise ParameterError(f"stability: {name} = {value:g} {unit} must be greater than 0 and finite")
    w = 2.0 * math.pi * frequency
    # Half-way between zeros of the velocity, where laws may jump.
    steps = np.arange(-1, 2 * STEPS)
    speeds = amplitude * w * np.cos(2.0 * math.pi * (steps + 0.5) / STEPS)
    times = (steps + 1.0) / (STEPS * frequency)
    samples = Samples(times, np.zeros(times.size), speeds[:-1].copy(), speeds[1:].copy())
    torque = torque_along(model.law, packed_numbers(model), model.parameters, samples)[-STEPS:]
    angle = 2.0 * math.pi * (np.arange(STEPS) + 0.5) / STEPS
    in_phase, in_step = float(torque @ np.sin(angle)), float(torque @ np.cos(angle))
    scale = 2.0 / (STEPS * amplitude)
    return LinearContact(
        max(scale * in_phase, 0.0), scale * in_step / w
    )  # the phase of a jump is only rounded


class Sampled(Protocol):
    """The interface of a controller for a loop."""

    @property
    def sample_time(self) -> float:
        """s"""
        ...

    @property
    def delay(self) -> float:
        """Delay of the torque, in samples; may be fractional."""
        ...

    def state_space(self) -> tuple[Array, Array, Array, float]:
        """Return A, B, C, D from measured angle to torque."""
        ...


@dataclass(frozen=True)
class Drive:
    """The sampled controller.

    Attributes
    ----------
    gains : Gains
    law : LinearContact
        Law of the feedback compensator, while it sticks.
    gain : float
        Factor on the compensating torque.
    filter_hz : float
        Corner of the second-order Butterworth low-pass at the compensator's input; 0 for none.
    sample_time : float
        s
    delay : float
        Delay of the torque, in samples; may be fractional.
    """

    gains: Gains
    law: LinearContact = FREE
    gain: float = 1.0
    filter_hz: float = 0.0
    sample_time: float = 1e-3
    delay: float = 0.0

    def __post_init__(self) -> None:
        if not (self.sample_time > 0.0 and math.isfinite(self.sample_time)):
            raise ParameterError(
                f"stability: sample_time = {self.sample_time:g} s must be greater than 0 and finite"
            )
        if not 0.0 <= self.delay <= 100.0:
            raise ParameterError(f"stability: delay = {self.delay:g} samples must be from 0 to 100")

    def state_space(self) -> tuple[Array, Array, Array, float]:
        """Return A, B, C, D from measured angle to torque.

        States: the last angle, the integral of the error if it has a gain, and with a filter its input two samples ago
        and its last two outputs. The filter acts on the angle, which is equivalent to its difference.
        """
        t, g = self.sample_time, self.gains
        integral, filtered = g.ki > 0.0, self.filter_hz > 0.0
        size = 1 + integral + 3 * filtered
        a, b, c = np.zeros((size, size)), np.zeros((size, 1)), np.zeros((1, size))
        b[0, 0], c[0, 0], d = 1.0, g.kd / t, -g.kp - g.kd / t
        if integral:
            a[1, 0], a[1, 1], b[1, 0] = -0.5 * t, 1.0, -0.5 * t
            c[0, :2] += g.ki * a[1, :2]
            d += g.ki * b[1, 0]
        # The law: stiffness times the mean of the last two angles, damping times their difference.
        now = self.gain * (0.5 * self.law.stiffness + self.law.damping / t)
        last = self.gain * (0.5 * self.law.stiffness - self.law.damping / t)
        if not filtered:
            c[0, 0] += last
            return a, b, c, d + now
        x2, y1, y2 = size - 3, size - 2, size - 1
        forward, back_1, back_2 = self._filter()
        a[y1, 0], a[y1, x2], a[y1, y1], a[y1, y2], b[y1, 0] = (
            2.0 * forward,
            forward,
            -back_1,
            -back_2,
            forward,
        )
        a[x2, 0] = a[y2, y1] = 1.0
        c[0] += now * a[y1]
        c[0, y1] += last
        return a, b, c, d + now * forward

    def _filter(self) -> tuple[float, float, float]:
        """Return the weights of the low-pass, as in `stickslip.control.laws._seen`."""
        g = math.tan(min(math.pi * self.filter_hz * self.sample_time, 0.495 * math.pi))
        scale = 1.0 / (1.0 + math.sqrt(2.0) * g + g * g)
        return g * g * scale, 2.0 * (g * g - 1.0) * scale, (1.0 - math.sqrt(2.0) * g + g * g) * scale


@dataclass(frozen=True)
class Poles:
    """The least stable pole of a sampled loop.

    Attributes
    ----------
    radius : float
        Magnitude; below 1 the loop is stable.
    growth : float
        ln(radius) / sample time, 1/s.
    frequency : float
        Hz
    """

    radius: float
    growth: float
    frequency: float

    @property
    def stable(self) -> bool:
        """Whether a small motion decays."""
        return self.radius < 1.0


@lru_cache(maxsize=512)
def held(drivetrain: Drivetrain, sample_time: float, late: float) -> tuple[Array, Array, Array, Array]:
    """Return the matrices from sample to sample: A, B of the new torque, which acts after `late` samples, B of the
    previous one, C."""
    system, command = drivetrain.state_space(), INPUTS.index("command")
    first, then = system.over(sample_time * late), system.over(sample_time * (1.0 - late))
    into, before = then.held[:, [command]], first.held[:, [command]]
    return then.moved @ first.moved, into, then.moved @ before, system.c


@dataclass(frozen=True)
class Loop:
    """A drivetrain with a drive.

    Attributes
    ----------
    drivetrain : Drivetrain
    drive : Drive, or another `Sampled`
    measured : float
        Factor on the measured angle: 1, or that of a quantiser's describing function.
    """

    drivetrain: Drivetrain
    drive: Sampled
    measured: float = 1.0

    def matrix(self) -> Array:
        """Return the matrix of the closed loop from sample to sample."""
        whole = math.floor(self.drive.delay)
        part = self.drive.delay - whole
        ad, new, old, c = held(self.drivetrain, self.drive.sample_time, part)
        ac, bc, cc, dc = self.drive.state_space()
        c = self.measured * c
        n, m = ad.shape[0], ac.shape[0]
        late = whole + (part > 0.0)  # delayed torques
        out = np.zeros((n + m + late, n + m + late))
        out[:n, :n] = ad
        out[n : n + m, :n], out[n : n + m, n : n + m] = bc @ c, ac
        torque = np.hstack([dc * c, cc, np.zeros((1, late))])
        # Torques, newest first: this sample's, then the delayed ones.
        torques = np.vstack([torque, np.eye(n + m + late)[n + m :]])
        out[:n] += new @ torques[whole : whole + 1]
        if part > 0.0:
            out[:n] += old @ torques[whole + 1 : whole + 2]
        out[n + m :] = torques[:late]
        return out

    def sensitivity(self) -> float:
        """Return the largest magnitude of 1 / (1 + L) with the open-loop transfer function L; infinite if unstable.

        Usual loops have 1.2 to 2 (Åström and Hägglund, Advanced PID Control, 2006).
        """
        closed, opened = self.matrix(), replace(self, measured=0.0).matrix()
        if np.abs(np.linalg.eigvals(closed)).max() > 1.0 + STABLE:
            return math.inf
        # Closed and open loop differ by the measured angle: det(z - closed) / det(z - opened) = 1 + L.
        z = np.exp(1j * TURNS)[:, None, None] * np.eye(len(closed))
        _, size = np.linalg.slogdet(z - closed)
        _, alone = np.linalg.slogdet(z - opened)
        return float(np.exp(np.max(alone - size)))

    def opened(self, turns: Array) -> Any:
        """Return the open-loop transfer function L at angles in rad per sample, complex."""
        closed, opened = self.matrix(), replace(self, measured=0.0).matrix()
        z = np.exp(1j * turns)[:, None, None] * np.eye(len(closed))
        sign, size = np.linalg.slogdet(z - closed)
        sign_alone, alone = np.linalg.slogdet(z - opened)
        return sign / sign_alone * np.exp(size - alone) - 1.0

    def phase_margin(self) -> tuple[float, float]:
        """Return the phase margin, degrees, and the crossover frequency, Hz; infinite and NaN without crossover."""
        size = np.log(np.abs(self.opened(TURNS)))
        crossed = np.flatnonzero(size[:-1] * size[1:] < 0.0)
        if not crossed.size:
            return math.inf, math.nan
        low, high = TURNS[crossed], TURNS[crossed + 1]
        rising = size[crossed] < 0.0
        for _ in range(30):
            middle = np.sqrt(low * high)
            before = (np.abs(self.opened(middle)) < 1.0) == rising
            low, high = np.where(before, middle, low), np.where(before, high, middle)
        left = np.degrees(np.abs(np.angle(-self.opened(low))))
        least = int(np.argmin(left))
        return float(left[least]), float(low[least]) / (2.0 * math.pi * self.drive.sample_time)

    def poles(self) -> Poles:
        """Return the least stable pole."""
        found = np.linalg.eigvals(self.matrix())
        worst = found[np.argmax(np.abs(found))]
        radius, t = float(np.abs(worst)), self.drive.sample_time
        return Poles(
            radius, math.log(max(radius, 1e-300)) / t, abs(float(np.angle(worst))) / (2.0 * math.pi * t)
        )


@dataclass(frozen=True)
class Axis:
    """A drivetrain, the law of its contact, and the amplitude of motion at the encoder (rad) that counts as small."""

    drivetrain: Drivetrain
    friction: Model
    amplitude: float = math.pi * 2e-6

    @property
    def ringing(self) -> float:
        """Frequency of the whole inertia on the contact stiffness at the encoder, Hz."""
        stiff = self.at(self.amplitude, 100.0).visible
        return math.sqrt(max(stiff, 1e-9) / math.fsum(self.drivetrain.inertias)) / (2.0 * math.pi)

    def at(self, amplitude: float, frequency: float) -> Drivetrain:
        """Return the drivetrain with its contact at an amplitude of the encoder (rad) and a frequency (Hz)."""
        out = self.drivetrain
        # The amplitude at the contact depends on its stiffness, and that on the amplitude.
        for _ in range(3):
            moved = amplitude * (out.reach if out.contact.stiffness > 0.0 else 1.0)
            out = replace(self.drivetrain, contact=describing(self.friction, moved, frequency))
        return out
