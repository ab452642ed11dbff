"""The thesis's statements on all simulations together (3.2.4, 5.1), by RMS position error.

A group is a reference, a friction and a way to compensate (feedforward or feedback): 18 of four runs each.
"""

from __future__ import annotations

from stickslip.thesis.checks import Check, Claim, cases
from stickslip.thesis.evidence import Evidence

LAWS = ("coulomb", "stribeck", "lugre", "gms")
GROUPS = [
    (f"{reference}/{friction}", kind)
    for reference in ("low", "high", "step")
    for friction in ("nominal", "plus10", "minus10")
    for kind in ("FF", "FB")
]
FIGURES = tuple(f"3.{n}" for n in range(21, 39))
FED = (
    "The literal rule feeds energy in after fast reversals and spoils Coulomb, Stribeck and LuGre; under the "
    "passive signed rule Coulomb wins most groups."
)


def _errors(evidence: Evidence, group: str, kind: str) -> dict[str, float]:
    return {law: evidence("rms", case) for law, case in zip(LAWS, cases(group, kind), strict=True)}


def _ranks(evidence: Evidence) -> dict[str, list[int]]:
    """Rank of every law in every group, 1 the best."""
    ranks: dict[str, list[int]] = {law: [] for law in LAWS}
    for group, kind in GROUPS:
        errors = _errors(evidence, group, kind)
        for rank, law in enumerate(sorted(LAWS, key=errors.__getitem__), start=1):
            ranks[law].append(rank)
    return ranks


def _most_wins(evidence: Evidence) -> tuple[bool, str]:
    wins = {law: sum(r == 1 for r in ranks) for law, ranks in _ranks(evidence).items()}
    text = ", ".join(f"{law} {n}" for law, n in wins.items())
    return all(wins["gms"] > n for law, n in wins.items() if law != "gms"), f"groups won: {text}"


def _better(law: str, rivals: tuple[str, ...]) -> Check:
    """The law has a smaller error than all the rivals in more than half of the groups."""

    def check(evidence: Evidence) -> tuple[bool, str]:
        found = [_errors(evidence, group, kind) for group, kind in GROUPS]
        count = sum(all(errors[law] < errors[rival] for rival in rivals) for errors in found)
        return 2 * count > len(
            GROUPS
        ), f"{law} ahead of {' and '.join(rivals)} in {count} of {len(GROUPS)} groups"

    return check


def _mean_ranks(evidence: Evidence) -> tuple[bool, str]:
    mean = {law: sum(r) / len(r) for law, r in _ranks(evidence).items()}
    # "Both of these dynamic models usually give better results than the static models."
    ahead = max(mean["lugre"], mean["gms"]) < min(mean["coulomb"], mean["stribeck"])
    return ahead, "mean rank: " + ", ".join(f"{law} {r:.2f}" for law, r in mean.items())


def _stribeck_feedforward(evidence: Evidence) -> tuple[bool, str]:
    ratios: dict[str, float] = {}
    for group, kind in GROUPS:
        if kind == "FF" and not group.startswith("step"):
            errors = _errors(evidence, group, kind)
            ratios[group] = errors["stribeck"] / errors["coulomb"]
    text = ", ".join(f"{group} {ratio:.2f}" for group, ratio in ratios.items())
    return all(ratio <= 1.2 for ratio in ratios.values()), f"RMS error over Coulomb's: {text}"


CLAIMS: list[Claim] = [
    Claim(
        "324-gms-best", "3.2.4", FIGURES,
        "3.2.4: GMS gives the best result overall (most wins in the 18 groups)",
        _most_wins, FED,
    ),
    Claim(
        "324-lugre-follows", "3.2.4", FIGURES,
        "3.2.4: LuGre follows GMS in most cases (better than both static models)",
        _better("lugre", ("coulomb", "stribeck")), FED,
    ),
    Claim(
        "324-dyn>static", "3.2.4", FIGURES,
        "3.2.4: dynamic models usually better than static ones (mean rank)",
        _mean_ranks, FED,
    ),
    Claim(
        "324-coulomb>stribeck", "3.2.4", FIGURES,
        "3.2.4: Coulomb generally better than Stribeck",
        _better("coulomb", ("stribeck",)),
    ),
    Claim(
        "51-FF-static", "5.1", FIGURES[0::2],
        "5.1: FF sines: Stribeck similar (20 %) or better than Coulomb",
        _stribeck_feedforward,
        "Under the signed rule feedforward by Coulomb tracks the low-velocity sinusoid better than by Stribeck.",
    ),
]  # fmt: skip
