"""Notes on gross sliding besides the numbers: timing, drift, torque over position, alternatives."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

from stickslip.core.messages import Note, name_option
from stickslip.identification.sliding import PRESENT, SlidingPosterior

KNOWN_DELAY = 0.25
"""Greatest half-width of a delay that is reported, rows."""
SAME_DELAY = 0.1
"""Tolerance for recognising a kind of timing, rows."""
KINDS = (
    (0.5, "a command held from row to row"),
    (0.0, "a value sampled at the row"),
    (-0.5, "a mean over the row before"),
)
ALLOWED = ("elasticity", "elasticity of higher order", "play", "inertia by frequency", "no single inertia")
CONTRADICTED = f"record contradicts the timing given ({name_option('torque_is')}, {name_option('delay')})"
TIMING_CONTRADICTED = "timing-contradicted"
"""Code of the note that reports a contradicted timing."""


class Drift(NamedTuple):
    """Growth of friction at the usual speed over a record, as a part of its value at the first row, with its bounds."""

    share: float
    low: float
    high: float

    def __str__(self) -> str:
        way, ends = (
            ("falls", (-self.high, -self.low)) if self.share < 0.0 else ("rises", (self.low, self.high))
        )
        low, high = (100.0 * x for x in ends)
        return f"{way} by {100.0 * abs(self.share):.2g} % (95 % interval {low:.2g} to {high:.2g} %)"


def drift_of(found: SlidingPosterior) -> Drift | None:
    """Return the drift of friction over a record; None if its interval contains 0."""
    drift, level = found.numbers["drift"], found.friction
    if drift.lower <= 0.0 <= drift.upper or level <= 0.0:
        return None

    def share(grown: float) -> float:
        first = level - 0.5 * grown
        return grown / first if first > 0.0 else math.inf

    return Drift(share(drift.value), share(drift.lower), share(drift.upper))


def on_timing(found: SlidingPosterior) -> list[str]:
    """Report when the torque acted, in a sentence; none if the record does not determine it."""
    skew, row = found.numbers["skew"], found.period
    if skew.half > KNOWN_DELAY * row or found.numbers["inertia"].lower <= 0.0:
        return []
    share, unsure = -skew.value / row, max(SAME_DELAY, skew.half / row)
    kind = next((words for at, words in KINDS if abs(share - at) <= unsure), "a hold and a delay together")
    where = "after" if skew.value < 0.0 else "before"
    return [
        f"The torque acted {1e3 * abs(skew.value):.3g} ms (±{1e3 * skew.half:.2g}) {where} its row on average, "
        f"{abs(share):.2g} of a row: {kind}. This is allowed for."
    ]


def on_drift(found: SlidingPosterior) -> list[str]:
    """Report a drift of friction over the record, in a sentence; none without a drift."""
    drift = drift_of(found)
    if drift is None:
        return []
    return [
        f"Friction {drift} from the first row to the last. This is allowed for; values are those of the middle."
    ]


def on_alternatives(found: SlidingPosterior) -> list[str]:
    """Report what the record shows besides a rigid axis with friction, in one sentence."""
    shown = [(a, found.presence(n)) for n, a in found.alternatives.items() if found.presence(n) > PRESENT]
    shown = [
        (a, p) for a, p in shown if a.cause and a.name not in ("late torque", "drift") and not a.wave_number
    ]
    if not shown:
        return []
    parts = [f"{a.cause} ({100.0 * p:.0f} %)" for a, p in sorted(shown, key=lambda x: -x[1])]
    return [
        f"Beside a rigid axis with friction the record shows: {'; '.join(parts)}. Intervals allow for it."
    ]


MOSTLY = 1.0 / 3.0
"""Part of a number's variance from which on an alternative is named as its cause."""


def cause_of(found: SlidingPosterior, number: str) -> tuple[str, float]:
    """Return the alternative that widens a number most, and its part of the variance; none below a third of it."""
    name, share = found.explains(number)
    return (name, share) if share >= MOSTLY else ("", 0.0)


def reason_for(found: SlidingPosterior, cause: str, share: float) -> str:
    """Explain why an interval is wide and what to record to narrow it, for a verdict; "" without a cause."""
    if not cause:
        return ""
    a = found.alternatives[cause]
    return f"; {a.cause} explains {100.0 * share:.0f} % of the variance: {a.remedy}"


def against_given(found: SlidingPosterior, given: float) -> list[str]:
    """Report that the record contradicts the given delay, s; none if it does not."""
    skew = found.numbers["skew"]
    if skew.lower <= given <= skew.upper or found.numbers["inertia"].lower <= 0.0:
        return []
    acted = f"the torque acted {_when(skew.value)} (±{1e3 * skew.half:.2g} ms) its row on average"
    said = f"The {CONTRADICTED}: {acted}, not {_when(given)} it. Leave both out, or correct them."
    return [Note(said, TIMING_CONTRADICTED)]


def _when(skew: float) -> str:
    return f"{1e3 * abs(skew):.3g} ms {'after' if skew < 0.0 else 'before'}"


def on_exponents(exponents: Mapping[float, float]) -> list[str]:
    """Report the probability of the exponent of friction's fall; none if only one is possible."""
    if not exponents:
        return []
    likeliest = max(exponents, key=lambda e: exponents[e])
    probability = f"{exponents[likeliest]:.0%}"
    if probability == "100%":
        return []
    return [
        f"Friction falls with the exponent delta_s = {likeliest:g} with a probability of {probability}; the intervals "
        "of fs and vs include the other exponent."
    ]
