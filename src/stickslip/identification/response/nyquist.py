"""How fast a PD a measured response bears: Nyquist's criterion on the frequencies that were seen.

The axis itself is stable, but for the two poles of its free motion. The loop is then stable if the locus of its sampled
response, from low to high frequencies, crosses the real axis left of -1 as often downwards as upwards. Three things
are not seen and are assumed: below the lowest frequency the axis is an inertia or a spring, beyond the highest the loop
is weaker than 1, and no mode is damped less than `LIGHT` (ratio). A gap between the frequencies seen is passed over
only where such a mode inside it would leave the loop weaker than 1 (`weak`): what happens in any other gap is not
known (`Count.unseen`). A single line that is missing is no gap (`NARROW`).
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
"""Loop gain at the ends of a gap that is passed over, at most; and the least damping of a mode that may lie in it."""

NARROW = 2.5
"""Lines apart, up to which neighbours see what is between: a Hann window takes in one line more on either side."""


@dataclass(frozen=True)
class Count:
    """Encirclements of -1 as far as they were seen.

    Attributes
    ----------
    turns : int
        Clockwise, over positive frequencies; half the unstable poles of the closed loop. One alone on the negative real
        axis is not among them: it oscillates at half the sample rate, above every frequency of a response.
    frequency : float
        Of the crossing that encircles, Hz; not a number where none does.
    unseen : tuple of float
        Ends of the first gap at which the loop is not `weak`, Hz; empty where there is none.
    """

    turns: int
    frequency: float
    unseen: tuple[float, ...]

    @property
    def calm(self) -> bool:
        """Whether the loop is seen to be stable: no encirclement, and no gap in which a mode may make one."""
        return self.turns == 0 and not self.unseen


def pd_response(inertia: float, bandwidth: float, damping: float, f: Array, dt: float) -> Complex:
    """A PD as it is sampled: kp + kd (1 - z^-1) / dt; thesis eq. 3.10."""
    w = 2.0 * math.pi * bandwidth
    difference = (1.0 - np.exp(-2j * math.pi * f * dt)) / dt
    return (inertia * w * w + 2.0 * inertia * damping * w * difference).astype(np.complex128)


def encirclements(found: LoopResponse, inertia: float, bandwidth: float, damping: float = 1.0) -> Count:
    """How the loop under a PD of that bandwidth (Hz) goes around -1."""
    f = found.frequency
    locus = pd_response(inertia, bandwidth, damping, f, found.sample_time) * found.response
    # An inertia under a PD comes from below the real axis, a spring from its right: the lowest frequency seen may
    # already lie above it.
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
    """Loop gain at the ends of a gap (Hz), below which a mode inside it would stay below 1.

    A mode at f0 is c / (f0² - f²) beside its peak and c / (2 LIGHT f0²) on it: it rises most from two ends alike.
    """
    return min(WEAK, 2.0 * LIGHT * (high**2 + low**2) / (high**2 - low**2))


@dataclass(frozen=True)
class Fastest:
    """How fast a PD may be.

    Attributes
    ----------
    bandwidth : float
        From which on it rings, or is not seen to be calm, Hz; the highest tried where neither happens.
    frequency : float
        At which it rings, Hz; not a number where it does not, or is not seen to.
    name : str
        Of the response in which it does; empty where in none.
    unseen : tuple of float
        Ends of the gap that hides whether it rings, Hz; empty where it is seen.
    """

    bandwidth: float
    frequency: float = math.nan
    name: str = ""
    unseen: tuple[float, ...] = ()

    @property
    def sentence(self) -> str:
        """What people read, without a full stop."""
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
    """The bandwidth from which on a PD rings in some response, or is not seen to be calm.

    Parameters
    ----------
    responses : sequence of LoopResponse
    inertia : float
        That places the PD, kg·m², critically damped.

    Raises
    ------
    InputError
        If that holds for every bandwidth tried.
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
