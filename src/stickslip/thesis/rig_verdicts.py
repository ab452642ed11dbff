"""The thesis's statements over the variants of the rig study: as it is, without one imperfection, over seeds."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from stickslip.thesis.evidence import Evidence
from stickslip.thesis.rig_claims import CLAIMS, MAIN, Claim, View, judge
from stickslip.thesis.rig_reasons import WHY


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
    ablated : int
        Imperfections without which it was judged, one at a time.
    turned : tuple of str
        Those without which the verdict is the other one.
    main : bool
    why : str
        What the runs show of a statement that does not hold; "" if nothing.
    """

    claim: Claim
    holds: bool | None
    numbers: str
    seeds: int
    held: int
    ablated: int
    turned: tuple[str, ...]
    main: bool
    why: str = ""

    @property
    def reason(self) -> str:
        """Why it does not hold, and which imperfections decide that."""
        if self.holds is not False:
            return ""
        if self.turned:
            decides = f"It holds without {', or without '.join(self.turned)}."
        elif self.ablated:
            decides = "No single imperfection decides it."
        else:
            decides = "Not tried without single imperfections."
        return f"{self.why} {decides}".strip()


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
    evidence = Evidence(view, first)
    out: list[Judged] = []
    for claim in CLAIMS:
        now = verdicts[first][claim.id]
        over_seeds = [v for n in seeds if (v := verdicts[n][claim.id].holds) is not None]
        over_ablated = {n: v for n in ablated if (v := verdicts[n][claim.id].holds) is not None}
        turned = [n.removeprefix("without ") for n, holds in over_ablated.items() if holds is (not now.holds)]
        why = WHY[claim.id](evidence) if now.holds is False and claim.id in WHY else ""
        out.append(
            Judged(claim, now.holds, now.numbers, len(over_seeds), sum(over_seeds), len(over_ablated),
                   tuple(turned) if now.holds is not None else (), claim.id in mains, why)
        )  # fmt: skip
    return out


def main_share(judged: Sequence[Judged]) -> dict[str, tuple[int, int]]:
    """For every main statement of which something was run: how many of its parts hold, of how many that were run."""
    by_id = {j.claim.id: j.holds for j in judged}
    ran = {text: [by_id[i] for i in ids if by_id[i] is not None] for text, ids in MAIN.items()}
    return {text: (sum(holds is True for holds in found), len(found)) for text, found in ran.items() if found}


GROUPS = {
    "dry-low": "dry, slow sine", "dry-high": "dry, fast sine", "dry-step": "dry, step",
    "grease-low": "grease, slow sine", "grease-high": "grease, fast sine", "grease-step": "grease, step",
    "51": "5.1, overall", "45": "4.5, resonances", "": "all",
}  # fmt: skip
"""Statements by the start of their id."""


@dataclass(frozen=True)
class Tally:
    """Statements of one group over several starts.

    Attributes
    ----------
    words : str
    statements, hold : int
        Judged, and those that hold from the first start.
    always, never : int
        Those that hold from all further starts, and from none.
    share : float
        Of all statements and further starts, those that hold.
    """

    words: str
    statements: int
    hold: int
    always: int
    never: int
    share: float


def tally_starts(judged: Sequence[Judged]) -> list[Tally]:
    """Count the statements that hold from several starts, by group; empty without further starts."""
    out: list[Tally] = []
    for prefix, words in GROUPS.items():
        own = [j for j in judged if j.claim.id.startswith(prefix) and j.holds is not None and j.seeds]
        if own:
            share = sum(j.held for j in own) / sum(j.seeds for j in own)
            always, never = sum(j.held == j.seeds for j in own), sum(j.held == 0 for j in own)
            out.append(Tally(words, len(own), sum(j.holds is True for j in own), always, never, share))
    return out


def tally_imperfections(judged: Sequence[Judged]) -> dict[str, tuple[int, int]]:
    """Count, by imperfection, the statements that hold only without it, and those that hold only with it."""
    names = dict.fromkeys(name for j in judged for name in j.turned)
    counted = {
        name: (
            sum(name in j.turned for j in judged if j.holds is False),
            sum(name in j.turned for j in judged if j.holds is True),
        )
        for name in names
    }
    return dict(sorted(counted.items(), key=lambda item: -sum(item[1])))
