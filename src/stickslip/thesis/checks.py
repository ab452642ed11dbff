"""The comparisons that statements about runs are made of; each gives whether it holds, and the numbers."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise

from stickslip.analyse.wording import quantity
from stickslip.thesis.evidence import QUANTITIES, Evidence

Check = Callable[[Evidence], tuple[bool, str]]


def cases(group: str, kind: str, laws: str = "coulomb stribeck lugre gms") -> list[str]:
    """Compensated cases of a group, ``cases("low/nominal", "FF", "lugre gms")``."""
    return [f"{group}/{kind}-{law}" for law in laws.split()]


def _numbers(name: str, values: dict[str, float]) -> str:
    """``RMS error: FF-gms 0.983 mrad, FF-lugre 0.968 mrad``; groups are named where there are several."""
    known = QUANTITIES[name]
    groups = {case.rpartition("/")[0] for case in values}
    short = {c: c.rpartition("/")[2] if len(groups) == 1 else c for c in values}
    return f"{known.label}: " + ", ".join(f"{short[c]} {quantity(v, known.unit)}" for c, v in values.items())


def _over(name: str, names: Sequence[str], judge: Callable[[list[float]], bool]) -> Check:
    def check(evidence: Evidence) -> tuple[bool, str]:
        values = {case: evidence(name, case) for case in names}
        return judge(list(values.values())), _numbers(name, values)

    return check


def below(name: str, names: Sequence[str], limit: float) -> Check:
    """Every case's quantity is below the limit."""
    return _over(name, names, lambda values: max(values) < limit)


def above(name: str, names: Sequence[str], limit: float) -> Check:
    """Every case's quantity is above the limit."""
    return _over(name, names, lambda values: min(values) > limit)


def rises(name: str, names: Sequence[str]) -> Check:
    """The quantity grows from each case to the next: best first."""
    return _over(name, names, lambda values: all(a < b for a, b in pairwise(values)))


def close(name: str, names: Sequence[str], share: float) -> Check:
    """The largest exceeds the smallest by at most that share."""
    return _over(name, names, lambda values: max(values) <= (1.0 + share) * min(values))


def beats(name: str, winners: Sequence[str], losers: Sequence[str], factor: float = 1.0) -> Check:
    """Every winner's quantity is smaller than every loser's, by the factor."""
    return _over(
        name,
        [*winners, *losers],
        lambda values: factor * max(values[: len(winners)]) < min(values[len(winners) :]),
    )


def compared(name: str, pairs: Iterable[tuple[str, str]], factor: float = 1.0) -> Check:
    """In each pair the first quantity is below the second times the factor."""
    both = [tuple(p) for p in pairs]

    def judge(values: list[float]) -> bool:
        return all(a < factor * b for a, b in zip(values[::2], values[1::2], strict=True))

    return _over(name, [case for pair in both for case in pair], judge)


def at_least(count: int, name: str, names: Sequence[str], rival: str) -> Check:
    """At least `count` of the cases have a smaller quantity than the rival."""
    return _over(name, [*names, rival], lambda values: sum(v < values[-1] for v in values[:-1]) >= count)


def within_cycle(names: Sequence[str], pid: str, inside: bool) -> Check:
    """The mean errors at steady state lie all inside, or all outside, the range of the PID's error there."""

    def check(evidence: Evidence) -> tuple[bool, str]:
        low, high = evidence("late low", pid), evidence("late high", pid)
        values = {case: evidence("offset", case) for case in names}
        found = all((low <= v <= high) == inside for v in values.values())
        return found, f"{_numbers('offset', values)}; PID {quantity(low, 'rad')} to {quantity(high, 'rad')}"

    return check


def _said_once(texts: Iterable[str]) -> list[str]:
    """The texts without those whose numbers another one has as well."""
    parts = {text: set(text.partition(": ")[2].split(", ")) for text in texts}
    label = {text: text.partition(": ")[0] for text in parts}
    return [a for a in parts if not any(label[a] == label[b] and parts[a] < parts[b] for b in parts)]


def all_of(*checks: Check) -> Check:
    """All of the comparisons hold."""

    def check(evidence: Evidence) -> tuple[bool, str]:
        found = [one(evidence) for one in checks]
        return all(holds for holds, _ in found), "; ".join(_said_once(text for _, text in found))

    return check


@dataclass(frozen=True)
class Claim:
    """A statement of the thesis as a predicate on runs.

    Attributes
    ----------
    id : str
    section : str
        Where the thesis says it.
    figures : tuple of str
        The thesis's figures that show it.
    text : str
    check : callable
        Given the runs of one slip rule: whether it holds, and the numbers.
    why : str
        The reason where it does not hold, or holds under one rule only.
    """

    id: str
    section: str
    figures: tuple[str, ...]
    text: str
    check: Check
    why: str = ""


def claims_of(prefix: str, section: str) -> Callable[[str, tuple[str, ...], str, Check], Claim]:
    """What makes the statements of a section: their ids begin alike."""

    def claim(id: str, figures: tuple[str, ...], text: str, check: Check) -> Claim:
        return Claim(f"{prefix}-{id}", section, figures, text, check)

    return claim
