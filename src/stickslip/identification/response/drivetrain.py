"""The response within a position loop, and its modes.

The response is the sampled one, from the torque command of a sample to the resulting position: it includes hold, delay,
amplifier and every mode. It is estimated with the excitation as instrument, P = S_ry / S_ru, which the closed loop does
not bias (Ljung 1999, 13.5).
"""

from __future__ import annotations

import importlib
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from stickslip.core.errors import InputError
from stickslip.core.record import Record
from stickslip.identification.estimate import Estimate, Identification, Picture, Trace
from stickslip.identification.fit.filters import cross_spectrum, spectrum
from stickslip.machines.drivetrain import Drivetrain, LinearContact
from stickslip.machines.two_mass import TwoMassAxis

Array = np.ndarray[Any, np.dtype[np.float64]]
Rows = np.ndarray[Any, np.dtype[np.intp]]
Complex = np.ndarray[Any, np.dtype[np.complex128]]

LOWEST = 5.0
"""Lowest frequency, Hz; windows of a response are four of its periods long."""
HIGHEST = 0.45
"""Highest frequency of a response, part of the sample rate."""
COHERENT = 0.5
MOST_DELAY = 20.0
"""Greatest delay of the torque that is searched, samples."""
PEAK = 2.0
"""Factor over the rigid axis's acceleration from which on there is a mode."""


@dataclass(frozen=True, eq=False)
class LoopResponse:
    """Sampled response of position to torque command.

    Attributes
    ----------
    name : str
    frequency : array, shape (n,)
        Hz, frequencies at which the excitation is detected (`COHERENT`).
    response : array of complex, shape (n,)
        rad/(N·m).
    coherence : array, shape (n,)
        Coherence of the position with the excitation.
    sample_time : float
        Sample period, s.
    """

    name: str
    frequency: Array
    response: Complex
    coherence: Array
    sample_time: float

    @property
    def gaps(self) -> tuple[tuple[float, float], ...]:
        """Gaps without detected frequencies between the lowest and the highest, Hz."""
        step = np.diff(self.frequency)
        wide = np.flatnonzero(step > 1.5 * np.min(step))
        return tuple((float(self.frequency[i]), float(self.frequency[i + 1])) for i in wide)

    @property
    def peak(self) -> float:
        """Frequency of the strongest resonance, as acceleration per torque, Hz."""
        return float(self.frequency[np.argmax(np.abs(self.response) * self.frequency**2)])


def loop_response(record: Record, name: str = "") -> LoopResponse:
    """Estimate the response from a record of `stickslip rig run resonance`.

    Parameters
    ----------
    record : Record
        Every sample: ``position``, ``position_reference``, ``torque_command``, and the excitation ``torque_setpoint``.
    name : str

    Raises
    ------
    InputError
        If the record is too short, or the position does not respond to the excitation.
    """
    dt = float(np.median(np.diff(record.time)))
    length = math.ceil(4.0 / (LOWEST * dt))
    if len(record) < 4 * length:
        raise InputError(
            f"{name}: {len(record) * dt:.3g} s hold fewer than four windows of {length * dt:.3g} s"
        )
    sent, command = record["torque_setpoint"], record["torque_command"]
    position = record["position"] - record["position_reference"]
    ru = cross_spectrum(sent, command, 1.0 / dt, length)
    ry = cross_spectrum(sent, position, 1.0 / dt, length)
    f, rr = spectrum(sent, 1.0 / dt, length)
    _, yy = spectrum(position, 1.0 / dt, length)
    inside = (f >= LOWEST) & (f <= HIGHEST / dt)
    coherence = np.abs(ry[inside]) ** 2 / (rr[inside] * yy[inside])
    seen = coherence >= COHERENT
    if seen.sum() < 10:
        raise InputError(f"{name}: the position does not answer to the excitation; excite the axis more")
    response = (ry[inside] / ru[inside])[seen]
    return LoopResponse(name, f[inside][seen], response.astype(np.complex128), coherence[seen], dt)


@dataclass(frozen=True)
class FittedDrivetrain:
    """Two inertias with a spring between them, from both responses.

    Attributes
    ----------
    axis : TwoMassAxis or None
        The encoder is on the motor; None if there is no mode in sliding.
    delay : float
        Delay of the torque in addition to hold and the response one sample later, samples.
    sliding, sticking : float
        Frequencies of the modes, Hz; that in sliding is NaN for a rigid axis.
    spread : tuple of float
        Standard deviations of the logarithms of load over motor, of the sticking mode, of the damping; and of the
        delay. Empty for a rigid axis.
    """

    axis: TwoMassAxis | None
    delay: float
    sliding: float
    sticking: float
    spread: tuple[float, ...] = ()


def fit_drivetrain(sliding: LoopResponse, sticking: LoopResponse, inertia: float) -> FittedDrivetrain:
    """Fit motor side, load side, spring, damping and delay to the logarithms of both responses by least squares.

    In sticking the load side stands still: its mode is that of the motor side on the spring. Further modes (an
    encoder's) are outliers here and are weighted down.

    Parameters
    ----------
    sliding, sticking : LoopResponse
    inertia : float
        Inertia of the whole axis, kg·m².

    Raises
    ------
    InputError
        If the sticking mode is not below the sliding one, as it must be.
    """
    free, held = sliding.peak, sticking.peak
    if over_rigid(sliding, inertia) < PEAK:
        return FittedDrivetrain(None, rigid_delay(sliding, inertia), math.nan, held)
    if not held < free:
        raise InputError(
            f"the mode while sticking, {held:.3g} Hz, must lie below that while sliding, {free:.3g} Hz; excite more"
        )
    optimize: Any = importlib.import_module("scipy.optimize")
    # A spring k between J1 and J2: free^2 = k / (4 pi^2) (1/J1 + 1/J2), held^2 = k / (4 pi^2 J1).
    begin = np.array(
        [math.log(1.0 / max(1e-3, (free / held) ** 2 - 1.0)), math.log(held), math.log(0.03), 0.0]
    )
    bands = [near(sliding, free), near(sticking, held)]
    ahead, turns = list[Array](), list[Array]()
    for r, rows in zip((sliding, sticking), bands, strict=True):
        ahead.append(np.angle((r.response / modelled(begin, r, inertia, r is sticking))[rows]))
        turns.append(turn_of(r)[rows])
    begin[3] = delay_told(np.concatenate(ahead), np.concatenate(turns))

    def residuals(x: Array) -> Array:
        parts: list[Array] = []
        for r, rows in zip((sliding, sticking), bands, strict=True):
            off: Complex = np.log(modelled(x, r, inertia, r is sticking)[rows] / r.response[rows])
            parts += [off.real, off.imag]
        return np.concatenate(parts)

    found = optimize.least_squares(residuals, begin, loss="soft_l1", f_scale=0.1)
    share, held, damping = (math.exp(float(v)) for v in found.x[:3])
    load = inertia / (1.0 + 1.0 / share)
    motor = inertia - load
    spring = motor * (2.0 * math.pi * held) ** 2
    axis = TwoMassAxis(motor, load, spring, min(damping, 0.5))
    free = math.sqrt(spring * (1.0 / motor + 1.0 / load)) / (2.0 * math.pi)
    # A Hann window spreads each line over its neighbours: half of them count as independent.
    level = 2.0 * float(found.fun @ found.fun) / (found.fun.size - 4)
    information: Array = np.asarray(found.jac.T @ found.jac, dtype=np.float64)
    spread = np.sqrt(np.diag(level * np.linalg.inv(information)))
    return FittedDrivetrain(axis, float(found.x[3]), free, held, tuple(float(s) for s in spread))


def over_rigid(r: LoopResponse, inertia: float) -> float:
    """Return the greatest acceleration per torque over that of a rigid axis."""
    return float(np.max(np.abs(r.response) * inertia * (2.0 * math.pi * r.frequency) ** 2))


def rigid_delay(r: LoopResponse, inertia: float) -> float:
    """Return the delay of a rigid axis's torque, samples, from the phase without the hold."""
    turn = turn_of(r)
    hold = (1.0 - np.exp(-1j * turn)) / (1j * turn)
    rest: Complex = -r.response * inertia * (2.0 * math.pi * r.frequency) ** 2 / hold
    return delay_told(np.angle(rest), turn)


def turn_of(r: LoopResponse) -> Array:
    """Return the phase of one sample at each frequency, rad."""
    return 2.0 * math.pi * r.frequency * r.sample_time


def delay_told(ahead: Array, turn: Array) -> float:
    """Return the delay, samples, that best explains the phase lead of a response over a model without it.

    A phase does not determine whole turns, and a bus's delay may be several samples: a grid of delays is tried first.
    """
    tried = np.arange(-1.0, MOST_DELAY, 0.05)
    off = (1.0 - np.cos(ahead + np.multiply.outer(tried, turn))).sum(axis=1)
    delay = float(tried[np.argmin(off)])
    rest = np.angle(np.exp(1j * (ahead + delay * turn)))
    return delay - float(np.sum(rest * turn) / np.sum(turn**2))


def near(r: LoopResponse, peak: float) -> Rows:
    """Return the rows of a response in which its mode dominates."""
    return np.flatnonzero((r.frequency > 0.3 * peak) & (r.frequency < 1.3 * peak))


def modelled(x: Array, r: LoopResponse, inertia: float, stuck: bool) -> Complex:
    """Return the response of two inertias; `x`: logs of load over motor, of the held mode, of the damping; delay."""
    share, held, damping = np.exp(x[:3])
    motor = inertia / (1.0 + share)
    load = inertia - motor
    spring = motor * (2.0 * math.pi * held) ** 2
    rub = 2.0 * damping * math.sqrt(spring / (1.0 / motor + 1.0 / load))
    plant = (
        Drivetrain((motor,), contact=LinearContact(spring, rub))  # its load side stands still
        if stuck
        else Drivetrain((motor, load), (spring,), dampers=(rub,))
    )
    turn = 1j * turn_of(r)
    hold = (1.0 - np.exp(-turn)) / turn
    return plant.state_space().response(r.frequency) * hold * np.exp(-turn * x[3])


def identified_drivetrain(
    responses: Sequence[LoopResponse], drivetrain: FittedDrivetrain, said: str
) -> Identification:
    """Return modes and delay as an identification without a law; `said` describes the PD that it tolerates."""
    estimates = [
        plain("mode_sticking", "Hz", "f_0", drivetrain.sticking),
        plain("delay", "samples", "d", drivetrain.delay),
    ]
    if drivetrain.axis:
        share, mode, damping, delay = drivetrain.spread
        motor, load = drivetrain.axis.inertias
        # Effect of a relative change of load over motor on load and motor, and so on spring and free mode.
        of_load, of_motor = share * motor / drivetrain.axis.inertia, share * load / drivetrain.axis.inertia
        estimates = [
            within("mode_sticking", "Hz", "f_0", drivetrain.sticking, mode * drivetrain.sticking),
            within("mode_sliding", "Hz", "f", drivetrain.sliding, math.hypot(mode, 0.5 * of_load) * drivetrain.sliding),
            within("damping", "-", "zeta", drivetrain.axis.damping, damping * drivetrain.axis.damping),
            within("delay", "samples", "d", drivetrain.delay, delay),
            within("spring", "N·m/rad", "k", drivetrain.axis.stiffness,
                   math.hypot(2.0 * mode, of_motor) * drivetrain.axis.stiffness),
            within("load_inertia", "kg·m²", "J_L", load, of_load * load),
        ]  # fmt: skip
    notes = [f"{said}."]
    for r in responses:
        if r.gaps:
            gaps = ", ".join(f"{a:.4g} to {b:.4g}" for a, b in r.gaps)
            notes.append(
                f"While {r.name} the position does not answer within: {gaps} Hz; nothing is known of these."
            )
    return Identification(
        "resonance", None, tuple(estimates), np.eye(len(estimates)), {}, tuple(notes), (),
        (picture_of(responses, drivetrain),), {"drivetrain": drivetrain, "responses": tuple(responses)},
    )  # fmt: skip


def plain(name: str, unit: str, symbol: str, value: float) -> Estimate:
    """Return a number read off a response, without an interval."""
    why = "read off the response, without an interval"
    return Estimate(name, unit, symbol, value, math.nan, math.nan, math.nan, False, why)


def within(name: str, unit: str, symbol: str, value: float, std: float) -> Estimate:
    """Return a number with its interval."""
    low, high = value - 1.96 * std, value + 1.96 * std
    why = "" if low > 0.0 and high <= 2.0 * low else "its interval is too wide"
    return Estimate(name, unit, symbol, value, std, low, high, not why, why)


def picture_of(responses: Sequence[LoopResponse], drivetrain: FittedDrivetrain) -> Picture:
    """Draw the acceleration per torque over the frequency, measured and fitted."""
    traces: list[Trace] = []
    for r, kind in zip(responses, ("points", "open points"), strict=True):
        f = r.frequency
        traces.append(Trace(f"measured while {r.name}", f, 20.0 * np.log10(np.abs(r.response) * f**2), kind))
        if drivetrain.axis:
            fitted = modelled(
                coordinates(drivetrain.axis, drivetrain), r, drivetrain.axis.inertia, r is responses[1]
            )
            traces.append(Trace(f"two inertias, {r.name}", f, 20.0 * np.log10(np.abs(fitted) * f**2)))
    modes = f"Mode at {drivetrain.sticking:.4g} Hz while sticking"
    if drivetrain.axis:
        modes += f", at {drivetrain.sliding:.4g} Hz while sliding"
    return Picture(
        "resonance", "Response that the loop closes over", modes, "frequency (Hz)",
        "acceleration per torque (dB of Hz² rad/(N·m))", tuple(traces), "log",
    )  # fmt: skip


def coordinates(axis: TwoMassAxis, drivetrain: FittedDrivetrain) -> Array:
    """Return a drivetrain in the coordinates of `modelled`."""
    return np.array([
        math.log(axis.load / axis.motor), math.log(drivetrain.sticking), math.log(axis.damping),
        drivetrain.delay,
    ])  # fmt: skip
