"""The thesis's statements over the variants of the rig study: as it is, without one imperfection, over seeds."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from stickslip.thesis.rig_claims import CLAIMS, MAIN, WHY, Claim, View, judge


@dataclass(frozen=True)
class Judged:
    """One statement.

    Attributes
    ----------
    claim : Claim
    holds : bool or None
        On the machines as they are; None where runs are missing.
    numbers : str
    seeds, held : int
        Further starts that were run, and how many of them it holds on.
    turned : tuple of str
        Imperfections without which the verdict is the other one.
    main : bool
    """

    claim: Claim
    holds: bool | None
    numbers: str
    seeds: int
    held: int
    turned: tuple[str, ...]
    main: bool

    @property
    def reason(self) -> str:
        """Why it does not hold."""
        if self.holds is not False:
            return ""
        why = WHY.get(self.claim.id, "")
        if not self.turned:
            return why or "No single imperfection decides it."
        return f"{why} It holds without {', or without '.join(self.turned)}.".strip()


def judged_over(view: View, variants: Sequence[str]) -> list[Judged]:
    """Judge every statement on every variant.

    Parameters
    ----------
    view : View
    variants : sequence of str
        "as it is" first; "without NAME" and "seed N" among the others.
    """
    verdicts = {name: judge(view, name, CLAIMS) for name in variants}
    first, seeds = variants[0], [n for n in variants if n.startswith("seed ")]
    ablated = [n for n in variants if n.startswith("without ")]
    mains = {id for ids in MAIN.values() for id in ids}
    out: list[Judged] = []
    for claim in CLAIMS:
        now = verdicts[first][claim.id]
        held = sum(verdicts[n][claim.id].holds is True for n in seeds)
        turned = tuple(
            n.removeprefix("without ")
            for n in ablated
            if now.holds is not None and verdicts[n][claim.id].holds is (not now.holds)
        )
        ran = sum(verdicts[n][claim.id].holds is not None for n in seeds)
        out.append(Judged(claim, now.holds, now.numbers, ran, held, turned, claim.id in mains))
    return out


def main_share(judged: Sequence[Judged]) -> dict[str, tuple[int, int]]:
    """For every main statement of which something was run: how many of its parts hold, of how many that were run."""
    by_id = {j.claim.id: j.holds for j in judged}
    ran = {text: [by_id[i] for i in ids if by_id[i] is not None] for text, ids in MAIN.items()}
    return {text: (sum(holds is True for holds in found), len(found)) for text, found in ran.items() if found}
