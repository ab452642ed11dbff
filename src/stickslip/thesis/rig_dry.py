"""The thesis's statements on its experiments with dry friction (4.3.1.2), as predicates on runs of the virtual machine.

Thresholds were set before the first run. "Oscillates" is what a picture of the response shows: more than 0.1 mrad RMS
above 5 Hz where it travels 20 mrad, 1 mrad where it travels 1 rad. "Unstable": five times as much as the linear
controller alone. "Close" is within 20 %.
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
    compared,
    rises,
)

VISIBLE = {"low": 1e-4, "step": 1e-4, "high": 1e-3}  # rad
CLOSE, UNSTABLE, CALM = 0.2, 5.0, 0.2
STATIC, DYNAMIC, OTHERS = "coulomb stribeck", "lugre gms", "coulomb stribeck lugre"
LOW, HIGH, HIGH_PID = "dry-low-PD36", "dry-high-PD10", "dry-high-PID10"
STEP, STEP_PID = "dry-step-PD35", "dry-step-PID10"


def oscillates(group: str, names: list[str], quantity: str = "shake") -> Check:
    """All of these runs oscillate visibly."""
    return above(quantity, names, VISIBLE[group.split("-")[1]])


def linear_of(group: str) -> str:
    """The linear controller alone of a group."""
    return f"{group}/{group.rpartition('-')[2].rstrip('0123456789')}"


def unstable(group: str) -> Check:
    """Feedback of GMS oscillates visibly, and much more than the linear controller alone."""
    run, quantity = f"{group}/FB-gms", "late shake" if "step" in group else "shake"
    return all_of(oscillates(group, [run], quantity), beats(quantity, [linear_of(group)], [run], UNSTABLE))


def calmed(group: str) -> Check:
    """The filter leaves a fifth of the oscillation of GMS feedback at most."""
    quantity = "late shake" if "step" in group else "shake"
    return beats(quantity, [f"{group}/FB-gms10"], [f"{group}/FB-gms"], 1.0 / CALM)


def _low() -> list[Claim]:
    pd, pid = f"{LOW}/PD", f"{LOW}/PID"
    ff, fb = cases(LOW, "FF"), cases(LOW, "FB")
    place, figures = "4.3.1.2.1", ("4.15", "4.16")

    def claim(id: str, text: str, check: Check) -> Claim:
        return Claim(f"dry-low-{id}", place, figures, text, check)

    return [
        claim("deformed", "PD alone follows deformed and with a smaller amplitude (error above 1 mrad)",
              above("smooth", [pd], 1e-3)),
        claim("chatter", "FF: all responses with and without compensation chatter (PD 36 Hz)",
              oscillates(LOW, [pd, *ff])),
        claim("alike", "FF: LuGre and GMS are alike, Coulomb and Stribeck are alike",
              all_of(close("rms", cases(LOW, "FF", DYNAMIC), CLOSE), close("rms", cases(LOW, "FF", STATIC), CLOSE))),
        claim("dynamic", "FF: dynamic laws beat static ones near zero velocity",
              beats("near", cases(LOW, "FF", DYNAMIC), cases(LOW, "FF", STATIC))),
        claim("closer", "FF: dynamic laws are closer to the reference than static ones",
              beats("rms", cases(LOW, "FF", DYNAMIC), cases(LOW, "FF", STATIC))),
        claim("FB-oscillates", "FB: extremely high oscillations (Coulomb, Stribeck, LuGre)",
              oscillates(LOW, cases(LOW, "FB", OTHERS))),
        claim("FB-alike", "FB: Coulomb and Stribeck are closer to each other than to the rest",
              close("rms", cases(LOW, "FB", STATIC), CLOSE)),
        claim("FB-lugre", "FB: LuGre oscillates less than the static laws",
              beats("shake", cases(LOW, "FB", "lugre"), cases(LOW, "FB", STATIC))),
        claim("FB-gms", "FB: GMS makes the system unstable", unstable(LOW)),
        claim("FB-gms-worst", "FB: of all laws only GMS does (it oscillates most)",
              beats("shake", cases(LOW, "FB", OTHERS), cases(LOW, "FB", "gms"))),
        claim("FB-gms10", "FB: GMS with the 10 Hz filter is calm", calmed(LOW)),
        claim("FB-gms10-tracking", "FB: with the filter tracking becomes worse (than with LuGre)",
              beats("smooth", cases(LOW, "FB", "lugre"), [f"{LOW}/FB-gms10"])),
        claim("PID", "PID of 36 Hz oscillates", oscillates(LOW, [pid])),
        claim("PID-more", "PID of 36 Hz oscillates more than PD with feedforward", beats("shake", ff, [pid])),
        claim("PID-trend", "PID follows the trend of the reference (below 5 Hz better than PD alone)",
              beats("smooth", [pid], [pd])),
        claim("FB-more", "responses oscillate more with FB than with FF (Coulomb, Stribeck, LuGre)",
              compared("shake", zip(ff[:3], fb[:3]))),
    ]  # fmt: skip


def _high() -> list[Claim]:
    pd, pid = f"{HIGH}/PD", f"{HIGH}/PID"
    ff = cases(HIGH, "FF")
    helped = [*ff, *cases(HIGH, "FB", OTHERS), f"{HIGH}/FB-gms10"]
    alone = f"{HIGH_PID}/PID"

    claim = claims_of("dry-high", "4.3.1.2.2")

    return [
        claim("sticks", ("4.17",), "PD alone shows stick-slip", above("sticking", [pd], 0.0)),
        claim("improve", ("4.17", "4.18"), "any compensation increases the accuracy of PD",
              beats("rms", helped, [pd])),
        claim("close", ("4.17",), "FF: all laws are close to each other", close("rms", ff, CLOSE)),
        claim("dynamic", ("4.17",), "FF: dynamic laws beat static ones near zero velocity",
              beats("near", cases(HIGH, "FF", DYNAMIC), cases(HIGH, "FF", STATIC))),
        claim("FB-smoother", ("4.18",), "FB: dynamic laws (GMS filtered) oscillate less than static ones",
              beats("shake", [f"{HIGH}/FB-lugre", f"{HIGH}/FB-gms10"], cases(HIGH, "FB", STATIC))),
        claim("PID", ("4.17",), "PID is similar to PD with compensation (within a factor of 2)",
              close("rms", [pid, *ff], 1.0)),
        claim("FF-nonzero", ("4.17",), "FF: stick-slip also at non-zero velocity, with every law",
              above("sticking", ff, 0.0)),
        claim("FB-nonzero", ("4.18",), "FB: stick-slip also at non-zero velocity, with every law (GMS filtered)",
              above("sticking", [*cases(HIGH, "FB", OTHERS), f"{HIGH}/FB-gms10"], 0.0)),
        claim("PID-nonzero", ("4.17",), "PID: stick-slip also at non-zero velocity", above("sticking", [pid], 0.0)),
        claim("PID10-dynamic", ("4.19", "4.20"), "PID 10 Hz, FF: dynamic laws smoothen it near zero velocity",
              beats("near", cases(HIGH_PID, "FF", DYNAMIC), [alone])),
        claim("PID10-FB-lugre", ("4.21", "4.22"), "PID 10 Hz, FB: LuGre is better near zero velocity and calm",
              all_of(beats("near", [f"{HIGH_PID}/FB-lugre"], [alone]), below("shake", [f"{HIGH_PID}/FB-lugre"], 1e-3))),
        claim("PID10-FB-static", ("4.21",), "PID 10 Hz, FB: static laws add chatter",
              beats("shake", [alone], cases(HIGH_PID, "FB", STATIC), 2.0)),
        claim("PID10-FB-gms10", ("4.21",), "PID 10 Hz, FB: GMS with filter oscillates most",
              beats("shake", cases(HIGH_PID, "FB", OTHERS), [f"{HIGH_PID}/FB-gms10"])),
        claim("PID10-FB-gms", ("4.21",), "PID 10 Hz, FB: GMS makes the system unstable", unstable(HIGH_PID)),
    ]  # fmt: skip


def _step() -> list[Claim]:
    pd, pid, alone = f"{STEP}/PD", f"{STEP}/PID", f"{STEP_PID}/PID"

    claim = claims_of("dry-step", "4.3.1.2.3")

    return [
        claim("PD", ("4.23",), "PD ends with a steady-state error and chatters a little (more than a count)",
              all_of(above("steady", [pd], 1e-4), above("late shake", [pd], 6.3e-6))),
        claim("order", ("4.23",), "FF: order Stribeck, GMS, LuGre, Coulomb by steady-state error",
              rises("steady", cases(STEP, "FF", "stribeck gms lugre coulomb"))),
        claim("FB-static", ("4.24",), "FB: the static laws oscillate",
              oscillates(STEP, cases(STEP, "FB", STATIC), "late shake")),
        claim("FB-lugre", ("4.24",), "FB: LuGre oscillates less than the static laws",
              beats("late shake", cases(STEP, "FB", "lugre"), cases(STEP, "FB", STATIC))),
        claim("FB-gms", ("4.24",), "FB: GMS makes the system unstable", unstable(STEP)),
        claim("FB-gms10", ("4.24",), "FB: GMS oscillates with the filter too",
              oscillates(STEP, [f"{STEP}/FB-gms10"], "late shake")),
        claim("PID", ("4.23",), "PID of 35 Hz oscillates extremely", oscillates(STEP, [pid], "late shake")),
        claim("PID10-response", ("4.25",), "PID 10 Hz, FF: the response is quicker",
              at_least(3, "response", cases(STEP_PID, "FF"), alone)),
        claim("PID10-FB-static", ("4.26",), "PID 10 Hz, FB: static laws add oscillations",
              beats("late shake", [alone], cases(STEP_PID, "FB", STATIC), 2.0)),
        claim("PID10-FB-lugre", ("4.26",), "PID 10 Hz, FB: LuGre is the best (least oscillation)",
              beats("late shake", [f"{STEP_PID}/FB-lugre"],
                    [*cases(STEP_PID, "FB", "coulomb stribeck gms"), f"{STEP_PID}/FB-gms10"])),
        claim("PID10-FB-gms", ("4.26",), "PID 10 Hz, FB: GMS makes the system unstable", unstable(STEP_PID)),
    ]  # fmt: skip


CLAIMS: list[Claim] = [*_low(), *_high(), *_step()]
