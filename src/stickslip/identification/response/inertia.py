"""Inertia from the frequency response of the open loop (thesis 4.2).

The axis is modelled as inertia with effective viscous friction, V(s)/T(s) = 1 / (J s + b). Responses are averaged over
Hann windows: H1 = S_xy / S_xx (noise on the position), H2 = S_yy / S_yx (noise on the torque), coherence their ratio
(Bendat and Piersol 2010). The impedance j omega / (motion per torque) = b + j omega J is linear in both unknowns; it is
fitted on a stated band, weighted by the coherence. If friction matters, the response depends on the amplitude, so
records of several amplitudes are compared: b decreases with the amplitude, J is constant. The torque is assumed
constant from sample to sample; without that, half a sample of delay would add b dt/2 to the inertia.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from stickslip.core.errors import InputError
from stickslip.identification.estimate import Estimate, Identification, Picture, Trace
from stickslip.identification.experiment import Experiment, insist_on_motion
from stickslip.identification.fit.filters import cross_spectrum, spectrum
from stickslip.identification.regression.inverse import uniform
from stickslip.machines.servo import ServoAxis

Array = np.ndarray[Any, np.dtype[np.float64]]
Complex = np.ndarray[Any, np.dtype[np.complex128]]

BAND = (0.4, 25.0)  # Hz, of the fit in the thesis
COHERENT = 0.5
NEAR = 1.15
"""Ratio within which peaks of several records are one mode."""
PEAK = 1.4
"""Factor of a resonance over the rigid axis's response and over the adjacent valleys."""
APART = 3.0
"""Difference between the responses to two torques above which the axis is not linear, dB: a factor of 1.4."""
CHANCE = 0.01
"""Probability that some frequency of a record counts as coherent by chance."""
MODE_BAND, FEWEST = 6.0, 16.0
"""Windows of the search for resonances: four periods of the band's end divided by this; fewest in a record."""


@dataclass(frozen=True, eq=False)
class Response:
    """Frequency response of one record: position over torque.

    Attributes
    ----------
    name : str
    amplitude : float
        Standard deviation of the torque, N·m.
    frequency : array, shape (n,)
        Hz, without 0.
    h1, h2 : array of complex, shape (n,)
        rad/(N·m).
    coherence : array, shape (n,)
    windows : int
        Number of windows without overlap, on which the averages are based.
    """

    name: str
    amplitude: float
    frequency: Array
    h1: Complex
    h2: Complex
    coherence: Array
    windows: int


def frequency_response(experiment: Experiment, axis: ServoAxis, *, lowest: float = BAND[0]) -> Response:
    """Estimate position over torque of one record, with windows of 4 periods of the lowest frequency.

    Raises
    ------
    InputError
        If the record has fewer than two such windows, no torque or no motion.
    """
    t, q, u, rate = uniform(experiment)
    length = math.ceil(4.0 * rate / lowest)
    if 2 * length - 2 <= q.size < 2 * length:  # two windows to the row, of which rounding took one
        length = q.size // 2
    if q.size < 2 * length:
        raise InputError(
            f"{experiment.name}: {q.size / rate:.3g} s hold fewer than two windows of {length / rate:.3g} s; give a "
            "longer record or a higher lowest frequency"
        )
    gain, _ = axis.drive_gains(experiment.quantity)
    supply = 1.0 if experiment.supply is None else np.interp(t, experiment.time, experiment.supply)
    torque = gain * supply * u
    if not np.std(torque) > 0.0:
        raise InputError(f"{experiment.name}: the torque never changes; excite the axis")
    insist_on_motion([experiment])
    # The position drifts; its difference does not, and leaks less. Central, to keep its phase.
    speed = np.gradient(q, 1.0 / rate)
    f, sxx = spectrum(torque, rate, length)
    _, syy = spectrum(speed, rate, length)
    sxy = cross_spectrum(torque, speed, rate, length)
    keep = (f > 0.0) & (f < 0.4 * rate)
    # The central difference replaces s: sin(omega dt) / dt instead of omega.
    s = 1j * np.sin(2.0 * math.pi * f[keep] / rate) * rate
    turn = 1j * 2.0 * math.pi * f[keep] / rate
    held = (1.0 - np.exp(-turn)) / turn
    h1 = sxy[keep] / sxx[keep] / s / held
    h2 = syy[keep] / np.conj(sxy[keep]) / s / held
    coherence = np.abs(sxy[keep]) ** 2 / (sxx[keep] * syy[keep])
    return Response(
        experiment.name, float(np.std(torque)), f[keep], h1.astype(np.complex128), h2.astype(np.complex128), coherence,
        q.size // length,
    )  # fmt: skip


def inertia(
    experiments: Sequence[Experiment],
    axis: ServoAxis,
    *,
    band: tuple[float, float] = BAND,
    estimator: str = "h1",
) -> Identification:
    """Identify inertia and effective viscous friction from open-loop records of one or several amplitudes.

    Parameters
    ----------
    experiments : sequence of Experiment
        With the torque that excited them (random, or a sweep).
    axis : ServoAxis
    band : (float, float)
        Band in which the rigid axis is fitted, Hz.
    estimator : {"h1", "h2"}

    Returns
    -------
    Identification
        ``inertia``, and ``viscous[i]`` per record. ``details`` contains ``responses`` and ``resonances`` (Hz).

    Raises
    ------
    InputError
        If there is no coherent response in the band.
    """
    if not experiments:
        raise InputError("no record; give at least one")
    if estimator not in ("h1", "h2"):
        raise InputError(f"estimator = {estimator!r} must be 'h1' or 'h2'")
    if not 0.0 < band[0] < band[1]:
        raise InputError(f"band = {band} must be two ascending frequencies in Hz")
    responses = [frequency_response(t, axis, lowest=band[0]) for t in experiments]
    rows: list[Array] = []
    sides: list[Array] = []
    weights: list[Array] = []
    for place, r in enumerate(responses):
        inside = (r.frequency >= band[0]) & (r.frequency <= band[1]) & (r.coherence >= COHERENT)
        if inside.sum() < 3:
            raise InputError(
                f"{r.name}: the coherence exceeds {COHERENT} at fewer than 3 frequencies in {band[0]:g} to "
                f"{band[1]:g} Hz; excite the axis more there"
            )
        omega = 2.0 * math.pi * r.frequency[inside]
        h = (r.h1 if estimator == "h1" else r.h2)[inside]
        g = r.coherence[inside]
        impedance = 1.0 / (1j * omega * h)
        # Standard deviation of a response from its coherence: Bendat and Piersol 2010, eq. 9.90.
        spread = np.abs(impedance) * np.sqrt(np.maximum(1.0 - g, 1e-6) / (2.0 * g * r.windows))
        real, imaginary = (
            np.zeros((omega.size, 1 + len(experiments))),
            np.zeros((omega.size, 1 + len(experiments))),
        )
        real[:, 1 + place], imaginary[:, 0] = 1.0, omega
        rows += [real, imaginary]
        sides += [impedance.real, impedance.imag]
        weights += [1.0 / spread, 1.0 / spread]
    w = np.concatenate(weights)
    a, y = np.concatenate(rows) * w[:, None], np.concatenate(sides) * w
    solution: Array = np.linalg.lstsq(a, y, rcond=None)[0].astype(np.float64)
    residual = y - a @ solution
    # A Hann window spreads each line over its neighbours: half of them count as independent.
    level = max(1.0, float(residual @ residual) / max(y.size - solution.size, 1))
    covariance: Array = (2.0 * level * np.linalg.inv(a.T @ a)).astype(np.float64)
    resonances = modes_of(experiments, axis, float(solution[0]), band[1])
    return _result(responses, solution, covariance, axis, band, estimator, resonances)


def _result(
    responses: Sequence[Response], solution: Array, covariance: Array, axis: ServoAxis, band: tuple[float, float],
    estimator: str, resonances: Sequence[float],
) -> Identification:  # fmt: skip
    std = np.sqrt(np.diag(covariance))
    names = [("inertia", axis.unit("kg·m²"), "J")]
    names += [(f"viscous[{i}]", axis.unit("N·m·s/rad"), "b") for i in range(len(responses))]
    estimates: list[Estimate] = []
    for (name, unit, symbol), value, s in zip(names, solution, std, strict=True):
        low, high = float(value - 1.96 * s), float(value + 1.96 * s)
        good = low > 0.0 and high <= 2.0 * low
        why = "" if good else verdict_on(low, high)
        estimates.append(Estimate(name, unit, symbol, float(value), float(s), low, high, good, why))
    notes = [f"Rigid axis fitted from {band[0]:g} to {band[1]:g} Hz with {estimator.upper()}."]
    if resonances:
        notes.append(f"Resonances at {', '.join(f'{f:g}' for f in resonances)} Hz.")
    if len(responses) == 1:
        notes.append("One amplitude only: effective viscous friction depends on it; record another.")
    return Identification(
        "inertia", None, tuple(estimates), covariance / np.outer(std, std),
        {"lowest_coherence": float(min(r.coherence.min() for r in responses))}, tuple(notes),
        pictures=(_picture(responses, solution, axis, band),),
        details={"responses": tuple(responses), "resonances": tuple(resonances), "axis": axis, "band": band},
    )  # fmt: skip


def verdict_on(low: float, high: float) -> str:
    """Return the reason why a positive value is not identified."""
    if high < 0.0:
        return "it lies below 0, which no axis has: torque and motion are not of one time, or one has the wrong sign"
    return "cannot be distinguished from 0" if low <= 0.0 else "its interval is too wide"


def modes_of(experiments: Sequence[Experiment], axis: ServoAxis, inertia: float, above: float) -> list[float]:
    """Return the resonances of the records' responses, Hz; similar ones of several records are one."""
    found: list[float] = []
    for experiment in experiments:
        # Shorter windows than the fit's: many averages, which distinguish a mode from chance.
        span = float(experiment.time[-1] - experiment.time[0])
        try:
            response = frequency_response(
                experiment, axis, lowest=max(above / MODE_BAND, 4.0 * FEWEST / span)
            )
        except InputError:
            continue  # The record is too short for them.
        found += resonances_of(response, inertia, above)
    return merged(found)


def resonances_of(response: Response, inertia: float, above: float) -> list[float]:
    """Return the frequencies above the band at which the response certainly peaks over the rigid axis's, Hz.

    A peak counts if the coherence exceeds chance at all frequencies, and if the peak rises above the lowest response to
    either side, before a higher peak, by more than the uncertainty of both: their standard deviations are those of a
    response with that coherence (Bendat and Piersol 2010, eq. 9.90), times the range of the logarithms of as many
    responses by chance.
    """
    place = np.flatnonzero(response.frequency > above)
    n, windows = place.size, response.windows
    # For an inertia below 0, which the verdict reports, there is no rigid axis to compare to.
    if n < 3 or windows < 2 or not inertia > 0.0:
        return []
    f, g = response.frequency[place], response.coherence[place]
    # Without any relation the coherence exceeds c with the chance (1 - c)^(windows - 1).
    sure = max(COHERENT, 1.0 - (CHANCE / n) ** (1.0 / (windows - 1)))
    level = np.log(np.abs(response.h1[place]) * inertia * (2.0 * math.pi * f) ** 2)
    spread = np.sqrt(np.maximum(1.0 - g, 1e-9) / (2.0 * np.maximum(g, 1e-9) * windows))
    factor = 2.0 * math.sqrt(math.log(n))
    out: list[float] = []
    for i in range(1, n - 1):
        if not (level[i] > math.log(PEAK) and g[i] >= sure and level[i - 1] < level[i] >= level[i + 1]):
            continue
        rises = [rise(level[i::-1], spread[i::-1], factor), rise(level[i:], spread[i:], factor)]
        if min(rises) > math.log(PEAK):
            out.append(float(f[i]))
    return out


def merged(found: Sequence[float]) -> list[float]:
    """Return the mean of peaks of several records that are one resonance, ascending, Hz."""
    groups: list[list[float]] = []
    for f in sorted(found):
        if groups and f < NEAR * groups[-1][0]:
            groups[-1].append(f)
        else:
            groups.append([f])
    return [round(math.fsum(g) / len(g), 1) for g in groups]


def rise(level: Array, spread: Array, factor: float) -> float:
    """Return how far the first level is certainly above the lowest level before a higher one."""
    higher = np.flatnonzero(level > level[0])
    end = int(higher[0]) if higher.size else level.size
    if end < 2:
        return 0.0
    sure = level[0] - level[1:end] - factor * np.hypot(spread[0], spread[1:end])
    return float(np.max(sure))


def _picture(
    responses: Sequence[Response], solution: Array, axis: ServoAxis, band: tuple[float, float]
) -> Picture:
    decibel = [
        Trace(
            f"{r.amplitude:.3g} {axis.unit('N·m')} RMS", r.frequency,
            np.where(r.coherence >= COHERENT, 20.0 * np.log10(np.abs(r.h1)), np.nan),
        )
        for r in responses
    ]  # fmt: skip
    f = responses[0].frequency
    s = 2j * math.pi * f
    rigid = 1.0 / (solution[0] * s**2 + solution[1] * s)
    return Picture(
        "inertia", "Frequency response", _compared(responses, band),
        "frequency (Hz)", f"position over torque (dB of 1 {axis.unit('rad')}/({axis.unit('N·m')}))",
        (*decibel, Trace("rigid axis", f, 20.0 * np.log10(np.abs(rigid)), "dashes")), "log",
    )  # fmt: skip


def _compared(responses: Sequence[Response], band: tuple[float, float]) -> str:
    """Report whether the responses to the least and the greatest torque differ at the band start (thesis 4.2)."""
    least, most = (pick(responses, key=lambda r: r.amplitude) for pick in (min, max))
    slow, fast = (_gap(least, most, *span) for span in ((band[0], 2.0 * band[0]), (band[1], math.inf)))
    if not slow >= APART:  # True as well if nothing can be compared.
        return "The rigid axis explains the response below its resonances"
    above = f" and by {fast:.2g} dB above {band[1]:g} Hz" if math.isfinite(fast) else ""
    return f"The responses differ by {slow:.2g} dB from {band[0]:g} to {2.0 * band[0]:g} Hz{above}: friction acts"


def _gap(one: Response, other: Response, low: float, high: float) -> float:
    """Return the median difference of two responses between two frequencies, dB; NaN if none is coherent in both."""
    f = one.frequency
    level = np.interp(f, other.frequency, 20.0 * np.log10(np.abs(other.h1)))
    coherent = np.interp(f, other.frequency, other.coherence) >= COHERENT
    shown = (f >= low) & (f <= high) & (one.coherence >= COHERENT) & coherent
    if not np.any(shown):
        return math.nan
    return float(np.median(np.abs(20.0 * np.log10(np.abs(one.h1)) - level)[shown]))
