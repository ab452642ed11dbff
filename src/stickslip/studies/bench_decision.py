"""Which compensator for which machine, with what is known of it: decided from the runs of a bench.

Compensators are compared by the error RMS over that of the bare PD on the same machine, change and reference, as a
geometric mean. One that fails, chatters, hunts at rest, or is worse than the bare PD somewhere is left out; of the
rest the best is chosen, or what needs to know least of those within a tenth of it.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from stickslip.control.catalogue import CATALOGUE, INERTIA, LEVELS, NOTHING
from stickslip.recommendation.swings import between_counts
from stickslip.studies.bench import BenchRun

KNOWLEDGE = ("nothing", "its inertia", "levels of friction", "a friction law")
"""What may be known of an axis, each with those before it."""
CHATTER = 0.05
"""Torque's change from sample to sample at rest over the torque's RMS in motion: what is beyond it chatters.

On the four machines the bare PD, which differentiates noise and counts, reaches 0.046; explicit super-twisting begins
at 0.075 and a square wave at 0.6.
"""
HUNTING = 2e-4
"""rad peak to peak at rest: what is beyond it, and beyond what an encoder lets a loop see, hunts.

What measurement noise moves at 20 bits stays below 150 µrad. What resets or slips for ever makes more, most of it 0.4
to 15 mrad.
"""
NEAR = 1.1
"""Of the best mean: as good as the best."""
CONDITIONS: Mapping[str, Sequence[str]] = {
    "friction as believed": ("believed",),
    "friction off, and changing": ("believed", "weaker", "stronger", "drop", "warm-up"),
    "an encoder of 16 bits": ("coarse",),
    "a sample of delay more": ("late",),
}
"""What is decided for, each from the runs with those changes."""
USUAL = ("believed", "weaker", "stronger", "drop", "warm-up", "coarse")
LATE = CONDITIONS["a sample of delay more"]
"""What a machine's picture shows, and what has a column of its own: with one more sample of delay even the PD rings on
a contact whose springs hardly damp."""


def knowledge_of(name: str) -> int:
    """What a compensator needs, as a place in `KNOWLEDGE`."""
    return {NOTHING: 0, INERTIA: 1, LEVELS: 2}.get(
        CATALOGUE[name].needs, 2 if "levels" in CATALOGUE[name].needs else 3
    )


@dataclass(frozen=True)
class Standing:
    """A compensator in a loop on one machine.

    Attributes
    ----------
    mean : float
        Geometric mean of its error RMS over the bare PD's; infinite where a run failed.
    worst : float
        The largest of these.
    chatter, hunting : float
        Largest torque change over torque RMS (RMS, at rest), and largest peak to peak of a limit cycle at rest, rad.
    recovery : float
        After a drop of friction, s; NaN where none was tried.
    effort : float
        Geometric mean of its torque RMS over the bare PD's.
    why_not : str
        Why it is not chosen, or "".
    """

    machine: str
    loop: str
    compensator: str
    mean: float
    worst: float
    chatter: float
    hunting: float
    recovery: float
    effort: float
    why_not: str

    @property
    def label(self) -> str:
        """``PD + dob``"""
        if self.loop == "-":
            return self.compensator
        return self.loop if self.compensator == "none" else f"{self.loop} + {self.compensator}"


def standings(runs: Sequence[BenchRun], changes: Iterable[str] = ()) -> list[Standing]:
    """How every compensator did on every machine, over the runs with `changes` (all, where none are given)."""
    wanted = set(changes)
    kept = [r for r in runs if not wanted or r.change in wanted]
    bare = {r.key: r for r in kept if r.key == r.bare}
    groups: dict[tuple[str, str, str], list[BenchRun]] = {}
    for run in kept:
        groups.setdefault((run.machine, run.loop, run.compensator), []).append(run)
    return [_standing(key, group, bare) for key, group in groups.items()]


def _standing(key: tuple[str, str, str], group: Sequence[BenchRun], bare: Mapping[str, BenchRun]) -> Standing:
    failed = next((r for r in group if r.failure), None)
    pairs = [(r, bare[r.bare]) for r in group if not r.failure]
    errors = [ratio(r, b, "rms_rad") for r, b in pairs]
    chatter = largest(number(r, "chatter_Nm") / max(number(r, "effort_Nm"), 1e-9) for r, _ in pairs)
    hunting = largest(number(r, "hunting_rad") for r, _ in pairs)
    cycle = largest(number(r, "hunting_rad") for r, _ in pairs if hunts(r))
    mean, worst = (math.inf, math.inf) if failed or not errors else (geometric(errors), max(errors))
    why = ""
    if failed:
        why = f"{failed.change}, {failed.reference}: {failed.failure}"
    elif chatter > CHATTER:
        why = f"chatters: its torque changes by {100.0 * chatter:.0f} % of its size from sample to sample at rest"
    elif cycle:
        why = f"hunts: {1e6 * cycle:.0f} µrad peak to peak at rest"
    elif worst > 1.05:
        why = f"somewhere worse than the PD alone, {worst:.2f} times its error"
    elif CATALOGUE[key[2]].against:
        why = CATALOGUE[key[2]].against
    recoveries = [number(r, "recovery_s") for r in group if r.metrics.get("recovery_s") is not None]
    effort = geometric([ratio(r, b, "effort_Nm") for r, b in pairs]) if pairs else math.nan
    return Standing(*key, mean, worst, chatter, hunting, max(recoveries, default=math.nan), effort, why)


def number(run: BenchRun, metric: str) -> float:
    """A metric; 0 where the run has none."""
    return run.metrics.get(metric) or 0.0


def hunts(run: BenchRun) -> bool:
    """Whether it goes to and fro at rest by more than its encoder lets it see."""
    return number(run, "hunting_rad") > max(HUNTING, between_counts(run.counts))


def ratio(run: BenchRun, bare: BenchRun, metric: str) -> float:
    """A metric over that of the bare loop."""
    return max(number(run, metric), 1e-12) / max(number(bare, metric), 1e-12)


def largest(values: Iterable[float]) -> float:
    """The largest; 0 of none."""
    return max(values, default=0.0)


def geometric(values: Sequence[float]) -> float:
    """The geometric mean."""
    return math.exp(math.fsum(map(math.log, values)) / len(values))


@dataclass(frozen=True)
class Choice:
    """A line of the decision table."""

    machine: str
    knowledge: str
    condition: str
    """One of `CONDITIONS`."""
    chosen: Standing | None

    def as_dict(self) -> dict[str, Any]:
        """Plain data."""
        s = self.chosen
        return {
            "machine": self.machine, "known": self.knowledge, "condition": self.condition,
            "compensator": s.label if s else None, "error_over_PD": s.mean if s else None,
            "worst_over_PD": s.worst if s else None,
        }  # fmt: skip


def choices(runs: Sequence[BenchRun]) -> list[Choice]:
    """The decision table: for every machine, for all that may be known of it, under every condition that it ran in.

    Runs with friction as believed alone do not say what is best where friction is off.
    """
    out: list[Choice] = []
    believed = set(CONDITIONS["friction as believed"])
    for condition, changes in CONDITIONS.items():
        found = standings(runs, changes)
        beyond = set(changes) - believed or believed
        for machine in dict.fromkeys(r.machine for r in runs if r.change in beyond):
            for k, known in enumerate(KNOWLEDGE):
                fit = [
                    s
                    for s in found
                    if s.machine == machine and not s.why_not and knowledge_of(s.compensator) <= k
                ]
                out.append(Choice(machine, known, condition, best_of(fit)))
    return out


def best_of(fit: Sequence[Standing]) -> Standing | None:
    """The one that needs to know least of those as good as the best."""
    if not fit:
        return None
    limit = NEAR * min(s.mean for s in fit)
    near = [s for s in fit if s.mean <= limit]
    return min(near, key=lambda s: (knowledge_of(s.compensator), s.mean))
