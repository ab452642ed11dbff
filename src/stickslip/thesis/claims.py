"""The thesis's 89 statements on its simulations (3.2.3, 3.2.4, 5.1), judged on the runs of a study."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from stickslip.thesis import overall as _thesis_overall
from stickslip.thesis import sines as _thesis_sines
from stickslip.thesis import step as _thesis_step
from stickslip.thesis.checks import Claim
from stickslip.thesis.evidence import Evidence, View

CLAIMS: tuple[Claim, ...] = (*_thesis_sines.CLAIMS, *_thesis_step.CLAIMS, *_thesis_overall.CLAIMS)


@dataclass(frozen=True)
class Verdict:
    """How a claim fared under one slip rule.

    Attributes
    ----------
    holds : bool or None
        None where runs that it needs are missing.
    numbers : str
        The compared quantities, with units.
    """

    holds: bool | None
    numbers: str


def judge(view: View, rule: str, claims: Sequence[Claim] = CLAIMS) -> dict[str, Verdict]:
    """Judge the claims on the runs of one slip rule; by the claim's id."""
    evidence = Evidence(view, rule)
    verdicts: dict[str, Verdict] = {}
    for claim in claims:
        try:
            holds, numbers = claim.check(evidence)
            verdicts[claim.id] = Verdict(bool(holds), numbers)
        except KeyError as missing:
            verdicts[claim.id] = Verdict(None, f"no run {missing.args[0]}")
    return verdicts
