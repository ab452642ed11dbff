"""The thesis's statements on its experiments with grease (4.3.2.2), on all of them (5.1) and on the spectra (4.5).

Words as in `stickslip.thesis.rig_dry`.
"""

from __future__ import annotations

from stickslip.thesis.checks import (
    Check,
    Claim,
    above,
    all_of,
    at_least,
    beats,
    below,
    cases,
    claims_of,
    close,
    rises,
)
from stickslip.thesis.evidence import Evidence
from stickslip.thesis.rig_dry import (
    CLOSE,
    DYNAMIC,
    OTHERS,
    STATIC,
    VISIBLE,
    calmed,
    linear_of,
    oscillates,
    unstable,
)

LOW, LOW36, LOW_PID = "grease-low-PD25", "grease-low-PD36", "grease-low-PID10"
HIGH, HIGH_PID = "grease-high-PD10", "grease-high-PID10"
STEP, STEP35, STEP_PID = "grease-step-PD25", "grease-step-PD35", "grease-step-PID10"
GROUPS = (
    "dry-low-PD36", "dry-high-PD10", "dry-high-PID10", "dry-step-PD35", "dry-step-PID10", LOW, LOW_PID, HIGH, HIGH_PID,
    STEP, STEP_PID,
)  # fmt: skip
MOST = 0.75


def _low() -> list[Claim]:
    pd, pid, alone = f"{LOW}/PD", f"{LOW}/PID", f"{LOW_PID}/PID"
    best = f"{LOW}/FF-lugre"

    claim = claims_of("grease-low", "4.3.2.2.1")

    return [
        claim("PD36", ("7.2", "7.3"), "PD of 36 Hz oscillates without compensation already",
              oscillates(LOW36, [f"{LOW36}/PD"])),
        claim("PD25", ("4.39",), "PD of 25 Hz cannot follow alone (error above 1 mrad)", above("smooth", [pd], 1e-3)),
        claim("dynamic", ("4.39",), "FF: dynamic laws track better than static ones",
              beats("rms", cases(LOW, "FF", DYNAMIC), cases(LOW, "FF", STATIC))),
        claim("near", ("4.39",), "FF: dynamic laws beat static ones near zero velocity",
              beats("near", cases(LOW, "FF", DYNAMIC), cases(LOW, "FF", STATIC))),
        claim("stribeck", ("4.39",), "FF: Stribeck is better than Coulomb",
              rises("rms", cases(LOW, "FF", "stribeck coulomb"))),
        claim("lugre", ("4.39",), "FF: LuGre is the best near zero velocity (5.1: definitely)",
              beats("near", [best], cases(LOW, "FF", "coulomb stribeck gms"))),
        claim("order", ("4.39",), "FF: order LuGre, GMS, Stribeck, Coulomb (5.1)",
              rises("rms", cases(LOW, "FF", "lugre gms stribeck coulomb"))),
        claim("FB-oscillates", ("4.40",), "FB: high oscillations (Coulomb, Stribeck, LuGre)",
              oscillates(LOW, cases(LOW, "FB", OTHERS))),
        claim("FB-lugre", ("4.40",), "FB: the static laws oscillate less than LuGre",
              beats("shake", cases(LOW, "FB", STATIC), cases(LOW, "FB", "lugre"))),
        claim("FB-gms", ("4.40",), "FB: GMS makes the system unstable", unstable(LOW)),
        claim("FB-gms10", ("4.40",), "FB: GMS with the 10 Hz filter is calm",
              all_of(calmed(LOW), below("shake", [f"{LOW}/FB-gms10"], VISIBLE["low"]))),
        claim("FB-gms10-tracking", ("4.40",), "FB: with the filter it has a tracking error (more than FF by LuGre)",
              beats("smooth", [best], [f"{LOW}/FB-gms10"])),
        claim("PID", ("4.39",), "PID of 25 Hz oscillates, more than PD with feedforward",
              all_of(oscillates(LOW, [pid]), beats("shake", cases(LOW, "FF"), [pid]))),
        claim("PID10-improve", ("4.41",), "PID 10 Hz, FF: all laws but Stribeck improve it",
              beats("rms", cases(LOW_PID, "FF", "coulomb lugre gms"), [alone])),
        claim("PID10-lugre", ("4.41",), "PID 10 Hz, FF: LuGre is much the closest",
              beats("rms", [f"{LOW_PID}/FF-lugre"], [alone, *cases(LOW_PID, "FF", "coulomb stribeck gms")])),
        claim("PID10-FB", ("4.42",), "PID 10 Hz, FB: highly oscillatory with every law",
              oscillates(LOW_PID, cases(LOW_PID, "FB"))),
    ]  # fmt: skip


def _high() -> list[Claim]:
    pd, pid, alone = f"{HIGH}/PD", f"{HIGH}/PID", f"{HIGH_PID}/PID"

    claim = claims_of("grease-high", "4.3.2.2.2")

    return [
        claim("sticks", ("4.43",), "PD alone shows stick-slip", above("sticking", [pd], 0.0)),
        claim("close", ("4.43",), "FF: all laws but Coulomb are as accurate away from zero velocity",
              close("away", cases(HIGH, "FF", "stribeck lugre gms"), CLOSE)),
        claim("dynamic", ("4.43",), "FF: dynamic laws beat static ones near zero velocity",
              beats("near", cases(HIGH, "FF", DYNAMIC), cases(HIGH, "FF", STATIC))),
        claim("lugre", ("4.43",), "FF: LuGre is the best (5.1)",
              beats("rms", [f"{HIGH}/FF-lugre"], cases(HIGH, "FF", "coulomb stribeck gms"))),
        claim("FF-nonzero", ("4.43",), "FF: stick-slip also at non-zero velocity, with every law",
              above("sticking", cases(HIGH, "FF"), 0.0)),
        claim("FB-oscillates", ("4.44",), "FB: all responses oscillate", oscillates(HIGH, cases(HIGH, "FB", OTHERS))),
        claim("FB-gms", ("4.44",), "FB: GMS makes the system unstable", unstable(HIGH)),
        claim("FB-gms10", ("4.44",), "FB: GMS with filter gives the least oscillation",
              beats("shake", [f"{HIGH}/FB-gms10"], cases(HIGH, "FB", OTHERS))),
        claim("PID", ("4.43",), "PID is similar to PD with compensation (within a factor of 2)",
              close("rms", [pid, *cases(HIGH, "FF", "stribeck lugre gms")], 1.0)),
        claim("PID10-near", ("4.45", "4.46"), "PID 10 Hz, FF: all laws but Stribeck improve it near zero velocity",
              beats("near", cases(HIGH_PID, "FF", "coulomb lugre gms"), [alone])),
        claim("PID10-lugre", ("4.45", "4.46"), "PID 10 Hz, FF: LuGre is much the closest near zero velocity",
              beats("near", [f"{HIGH_PID}/FF-lugre"], [alone, *cases(HIGH_PID, "FF", "coulomb stribeck gms")])),
        claim("PID10-FB", ("4.47",), "PID 10 Hz, FB: all oscillate, Coulomb least",
              all_of(oscillates(HIGH_PID, cases(HIGH_PID, "FB")),
                     beats("shake", [f"{HIGH_PID}/FB-coulomb"], cases(HIGH_PID, "FB", "stribeck lugre gms")))),
    ]  # fmt: skip


def _step() -> list[Claim]:
    pd, pid, alone = f"{STEP}/PD", f"{STEP}/PID", f"{STEP_PID}/PID"

    claim = claims_of("grease-step", "4.3.2.2.3")

    return [
        claim("PD35", ("7.4", "7.5"), "PD of 35 Hz oscillates without compensation already",
              oscillates(STEP35, [f"{STEP35}/PD"])),
        claim("PD25", ("4.48",), "PD of 25 Hz cannot follow alone (steady-state error above 1 mrad)",
              above("steady", [pd], 1e-3)),
        claim("improve", ("4.48",), "FF: dynamic laws decrease the steady-state error",
              beats("steady", cases(STEP, "FF", DYNAMIC), [pd])),
        claim("order", ("4.48",), "FF: order GMS, LuGre, Stribeck, Coulomb by steady-state error (5.1)",
              rises("steady", cases(STEP, "FF", "gms lugre stribeck coulomb"))),
        claim("FB-oscillates", ("4.49",), "FB: static laws and LuGre oscillate extremely",
              oscillates(STEP, cases(STEP, "FB", OTHERS), "late shake")),
        claim("FB-lugre", ("4.49",), "FB: the static laws oscillate less than LuGre",
              beats("late shake", cases(STEP, "FB", STATIC), cases(STEP, "FB", "lugre"))),
        claim("FB-gms", ("4.49",), "FB: GMS makes the system unstable", unstable(STEP)),
        claim("FB-gms10", ("4.49",), "FB: GMS with filter is smooth, with a steady-state error",
              all_of(below("late shake", [f"{STEP}/FB-gms10"], VISIBLE["step"]),
                     above("steady", [f"{STEP}/FB-gms10"], 1e-4))),
        claim("PID", ("4.48",), "PID of 25 Hz oscillates", oscillates(STEP, [pid], "late shake")),
        claim("PID10-steady", ("4.50",), "PID 10 Hz, FF: the steady-state error stays about the same (within 0.2 mrad)",
              below("steady", [alone, *cases(STEP_PID, "FF", "coulomb lugre gms")], 2e-4)),
        claim("PID10-response", ("4.50",), "PID 10 Hz, FF: dynamic laws make the response quicker",
              beats("response", cases(STEP_PID, "FF", DYNAMIC), [alone])),
        claim("PID10-FB", ("4.51",), "PID 10 Hz, FB: every law oscillates more than PID alone",
              beats("late shake", [alone], cases(STEP_PID, "FB"), 2.0)),
    ]  # fmt: skip


def most(found: list[bool], words: str) -> tuple[bool, str]:
    """Whether `MOST` of the runs do, and how many."""
    return sum(found) >= MOST * len(found), f"{sum(found)} of {len(found)} runs {words}"


def _most_improve(evidence: Evidence) -> tuple[bool, str]:
    """Feedforward improves on the linear controller alone in most runs."""
    found = [evidence("rms", c) < evidence("rms", linear_of(g)) for g in GROUPS for c in cases(g, "FF")]
    return most(found, "with feedforward are better than without")


def _most_oscillate(evidence: Evidence) -> tuple[bool, str]:
    """Feedback oscillates visibly in most runs."""
    found = [evidence("shake", c) > VISIBLE[g.split("-")[1]] for g in GROUPS for c in cases(g, "FB")]
    return most(found, "with feedback oscillate visibly")


def _feedforward_calmer(evidence: Evidence) -> tuple[bool, str]:
    """Feedforward oscillates less than feedback of the same law in most runs."""
    pairs = [(a, b) for g in GROUPS for a, b in zip(cases(g, "FF"), cases(g, "FB"), strict=True)]
    found = [evidence("shake", a) < evidence("shake", b) for a, b in pairs]
    return most(found, "oscillate less with feedforward")


def _resonance(case: str) -> Check:
    def check(evidence: Evidence) -> tuple[bool, str]:
        at = evidence("strongest", case)
        return 270.0 <= at <= 360.0, f"{case}: strongest oscillation at {at:.0f} Hz"

    return check


OVERALL = [
    Claim("51-feedforward", "5.1", (), "feedforward generally improves the response (3 of 4 runs)", _most_improve),
    Claim("51-feedback", "5.1", (), "feedback oscillates in almost all experiments (3 of 4 runs)", _most_oscillate),
    Claim("51-rather", "5.1", (), "feedforward is to be preferred: it oscillates less than feedback (3 of 4 runs)",
          _feedforward_calmer),
    Claim("51-low", "5.1", (), "dynamic laws are for low velocities: at least one beats PD alone in both frictions",
          all_of(at_least(1, "rms", cases("dry-low-PD36", "FF", DYNAMIC), "dry-low-PD36/PD"),
                 at_least(1, "rms", cases(LOW, "FF", DYNAMIC), f"{LOW}/PD"))),
    Claim("45-PD36", "4.5", ("4.58",), "dry, PD 36 Hz: resonance near 330 Hz (270 to 360)",
          _resonance("dry-low-PD36/PD")),
    Claim("45-PID25", "4.5", ("4.59",), "grease, PID 25 Hz: resonance near 300 Hz (270 to 360)",
          _resonance(f"{LOW}/PID")),
]  # fmt: skip

CLAIMS: list[Claim] = [*_low(), *_high(), *_step(), *OVERALL]
