"""The fastest PD that a measured response tolerates: Nyquist's criterion on the measured frequencies.

The axis itself is stable, except for the two poles of its free motion. The loop is then stable if the locus of its
sampled response, from low to high frequencies, crosses the real axis left of -1 as often downwards as upwards. Three
unmeasured properties are assumed: below the lowest frequency the axis is an inertia or a spring, above the highest the
loop gain is below 1, and no mode is damped less than `LIGHT` (ratio). A gap between the measured frequencies is
acceptable only if such a mode inside it would keep the loop gain below 1 (`weak`): other gaps leave stability unknown
(`Count.unseen`). A single missing line is not a gap (`NARROW`).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from stickslip.core.errors import InputError
from stickslip.identification.response.drivetrain import LoopResponse

Array = np.ndarray[Any, np.dtype[np.float64]]
Complex = np.ndarray[Any, np.dtype[np.complex128]]

WEAK, LIGHT = 0.5, 0.02
"""Greatest loop gain at the ends of an acceptable gap; least damping of a mode that may be inside it."""

NARROW = 2.5
"""Greatest distance of neighbours, lines, that cover the lines between: a Hann window includes one line on either
side."""


@dataclass(frozen=True)
class Count:
    """Encirclements of -1 in the measured frequencies.

    Attributes
    ----------
    turns : int
        Clockwise, over positive frequencies; half the unstable poles of the closed loop. A single pole on the negative
        real axis is not included: it oscillates at half the sample rate, above every frequency of a response.
    frequency : float
        Frequency of the crossing that encircles, Hz; NaN if there is none.
    unseen : tuple of float
        Ends of the first gap at which the loop is not `weak`, Hz; empty if there is none.
    """

    turns: int
    frequency: float
    unseen: tuple[float, ...]

    @property
    def calm(self) -> bool:
        """Whether the loop is stable: no encirclement, and no gap in which a mode may cause one."""
        return self.turns == 0 and not self.unseen


def pd_response(inertia: float, bandwidth: float, damping: float, f: Array, dt: float) -> Complex:
    """Return the response of a sampled PD: kp + kd (1 - z^-1) / dt; thesis eq. 3.10."""
    w = 2.0 * math.pi * bandwidth
    difference = (1.0 - np.exp(-2j * math.pi * f * dt)) / dt
    return (inertia * w * w + 2.0 * inertia * damping * w * difference).astype(np.complex128)


def encirclements(found: LoopResponse, inertia: float, bandwidth: float, damping: float = 1.0) -> Count:
    """Count the encirclements of -1 by the loop with a PD of that bandwidth (Hz)."""
    f = found.frequency
    locus = pd_response(inertia, bandwidth, damping, f, found.sample_time) * found.response
    # The locus of an inertia with a PD comes from below the real axis, that of a spring from the right: the lowest
    # measured frequency may already be above it.
    below = np.concatenate([[True], locus.imag < 0.0])
    before = np.concatenate([[locus[0].real - 1j], locus])
    size = np.abs(locus)
    gaps = [(a, b) for a, b in found.gaps if b - a > NARROW * float(np.min(np.diff(f)))]
    hiding = [(a, b) for a, b in gaps if np.max(size[(f == a) | (f == b)]) >= weak(a, b)]
    unseen: tuple[float, ...] = hiding[0] if hiding else ()
    ends = {b for _, b in gaps}
    turns, frequency = 0, math.nan
    for i in np.flatnonzero(below[:-1] != below[1:]):
        one, other = before[i], before[i + 1]
        if float(f[i]) in ends:
            continue
        share = one.imag / (one.imag - other.imag)
        if one.real + share * (other.real - one.real) >= -1.0:
            continue
        turns += 1 if below[i] else -1
        last = max(i - 1, 0)
        there = float(f[last] + share * (f[i] - f[last]))
        frequency = (there if math.isnan(frequency) else frequency) if turns > 0 else math.nan
    return Count(turns, frequency, unseen)


def weak(low: float, high: float) -> float:
    """Return the loop gain at the ends of a gap (Hz) below which a mode inside it would stay below 1.

    A mode at f0 is c / (f0² - f²) off its peak and c / (2 LIGHT f0²) on it: it rises most from two equal ends.
    """
    return min(WEAK, 2.0 * LIGHT * (high**2 + low**2) / (high**2 - low**2))


@dataclass(frozen=True)
class Fastest:
    """The fastest PD in a set of responses.

    Attributes
    ----------
    bandwidth : float
        Bandwidth from which on it oscillates, or is not certainly stable, Hz; the highest tried if neither happens.
    frequency : float
        Frequency at which it oscillates, Hz; NaN if it does not, or that is unknown.
    name : str
        Name of the response in which it does; empty if none.
    unseen : tuple of float
        Ends of the gap that hides whether it oscillates, Hz; empty without one.
    """

    bandwidth: float
    frequency: float = math.nan
    name: str = ""
    unseen: tuple[float, ...] = ()

    @property
    def sentence(self) -> str:
        """The result as a sentence without a full stop."""
        if not self.name:
            return f"No PD up to {self.bandwidth:.3g} Hz oscillates"
        if self.unseen:
            return (
                f"Whether a PD from {self.bandwidth:.3g} Hz on oscillates while {self.name} is not known: the "
                "response is "
                f"not seen between {self.unseen[0]:.4g} and {self.unseen[1]:.4g} Hz"
            )
        return (
            f"A PD oscillates from {self.bandwidth:.3g} Hz on, at {self.frequency:.3g} Hz while {self.name}"
        )


def fastest_pd(responses: Sequence[LoopResponse], inertia: float) -> Fastest:
    """Find the bandwidth from which on a PD oscillates in some response, or is not certainly stable.

    Parameters
    ----------
    responses : sequence of LoopResponse
    inertia : float
        Inertia that sets the critically damped PD, kg·m².

    Raises
    ------
    InputError
        If that is the case for every bandwidth tried.
    """
    tried = np.geomspace(0.5, 0.1 / responses[0].sample_time, 400)
    for place, bandwidth in enumerate(tried):
        for r in responses:
            count = encirclements(r, inertia, float(bandwidth), 1.0)
            if count.calm:
                continue
            found = Fastest(
                float(bandwidth), count.frequency, r.name, () if count.turns > 0 else count.unseen
            )
            if not place:
                raise InputError(
                    f"{found.sentence}: no PD can be recommended; look at the response, or excite the axis more"
                )
            return found
    return Fastest(float(tried[-1]))
