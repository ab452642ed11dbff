"""The thesis's statements on the step (3.2.3.1.3, 3.2.3.2.3, 3.2.3.3.3).

At steady state the reference is at rest: more than 2 reversals of the velocity per second in the second half
are an oscillation, and fewer are none.
"""

from __future__ import annotations

from stickslip.thesis.checks import (
    Check,
    Claim,
    above,
    all_of,
    beats,
    below,
    cases,
    close,
    compared,
    rises,
    within_cycle,
)

STEP = 0.01  # rad
OSCILLATES = 2.0  # reversals/s at steady state
AT_REST = 1e-6  # rad peak to peak
NO_ERROR = 0.01 * STEP  # rad
VANISHES = 1e-5  # rad, of the claim's text

FED = (
    "After a fast reversal the literal rule lets friction push with the motion for about 12 ms; the energy so "
    "fed in makes feedback by Coulomb, Stribeck and LuGre oscillate. The signed rule is passive."
)
LUGRE = (
    "LuGre's pre-sliding stiffness (Table 4) is above that of the contact, so that its feedback makes the stuck "
    "equilibrium unstable, under both rules."
)

PLACES = {
    "N": ("nominal", "3.2.3.1.3", "3.25", "3.26"),
    "P": ("plus10", "3.2.3.2.3", "3.31", "3.32"),
    "M": ("minus10", "3.2.3.3.3", "3.37", "3.38"),
}
N, P, M = (f"step/{PLACES[letter][0]}" for letter in "NPM")


def _ff(id: str, text: str, check: Check, why: str = "") -> Claim:
    """A claim on feedforward; its id says the friction."""
    _, section, ff, _ = PLACES[id[0]]
    return Claim(id, section, (ff,), text, check, why)


def _fb(id: str, text: str, check: Check, why: str = "") -> Claim:
    """A claim on feedback; its id says the friction."""
    _, section, _, fb = PLACES[id[0]]
    return Claim(id, section, (fb,), text, check, why)


def _for_each_friction(letter: str) -> list[Claim]:
    """What the thesis says of the step under every friction."""
    group = f"step/{PLACES[letter][0]}"
    gms_smooth = (
        "GMS underestimates the friction here and chatters at microscopic amplitude (61 µrad peak to peak)."
    )
    return [
        _ff(
            f"{letter}-step-improve-FF",
            "step: PD alone fails, any FF compensator improves (smoothed step; with an ideal step FF == PD exactly)",
            all_of(
                above("steady", [f"{group}/PD"], 0.5 * STEP), beats("rms", cases(group, "FF"), [f"{group}/PD"])
            ),
        ),
        _ff(
            f"{letter}-step-PIDhunts",
            "step: the PID hunts (stick-slip limit cycle) at steady state, PD+FF is at rest",
            all_of(
                above("late reversals", [f"{group}/PID"], OSCILLATES),
                above("late span", [f"{group}/PID"], NO_ERROR),
                below("late span", cases(group, "FF"), AT_REST),
            ),
        ),
        _fb(
            f"{letter}-step-FB-static-osc",
            "FB: both static models oscillate at steady state",
            above("late reversals", cases(group, "FB", "coulomb stribeck"), OSCILLATES),
        ),
        _fb(
            f"{letter}-step-FB-chatter",
            "FB: Coulomb chatters with smaller amplitude and higher frequency than Stribeck",
            all_of(
                rises("late span", cases(group, "FB", "coulomb stribeck")),
                rises("late reversals", cases(group, "FB", "stribeck coulomb")),
            ),
        ),
        _fb(
            f"{letter}-step-FB-gms-smooth",
            "FB: GMS non-oscillatory at steady state",
            below("late reversals", cases(group, "FB", "gms"), OSCILLATES),
            gms_smooth if letter == "P" else "",
        ),
        _fb(
            f"{letter}-step-FB-lugre-smooth",
            "FB: LuGre non-oscillatory at steady state",
            below("late reversals", cases(group, "FB", "lugre"), OSCILLATES),
            LUGRE,
        ),
        _fb(
            f"{letter}-step-FB-gms<lugre",
            "FB: GMS better than LuGre",
            rises("rms", cases(group, "FB", "gms lugre")),
            "" if letter == "N" else "Under the signed rule the oscillation with LuGre is "
            "smaller than the offset that GMS leaves; the literal rule makes it large.",
        ),
    ]  # fmt: skip


NOMINAL = [
    _ff(
        "N-step-FF-coulombbest",
        "FF: Coulomb has the least steady-state error",
        beats("steady", cases(N, "FF", "coulomb"), cases(N, "FF", "stribeck lugre gms")),
    ),
    _ff(
        "N-step-FF-3similar",
        "FF: Stribeck, LuGre, GMS have about the same steady-state error (20 %)",
        close("steady", cases(N, "FF", "stribeck lugre gms"), 0.2),
    ),
    _fb(
        "N-step-FB-dyn-nosse",
        "FB: dynamic models without steady-state error",
        below("steady", cases(N, "FB", "lugre gms"), NO_ERROR),
        "Under the literal rule the oscillation with LuGre feedback is large and lopsided; its mean is an offset.",
    ),
]

PLUS = [
    _ff(
        "P-step-FF-order",
        "FF: GMS lowest steady-state error, Stribeck ~ LuGre slightly larger, Coulomb the largest but better than PD",
        all_of(
            beats("steady", cases(P, "FF", "gms"), cases(P, "FF", "stribeck lugre")),
            close("steady", cases(P, "FF", "stribeck lugre gms"), 0.2),
            beats("steady", cases(P, "FF", "stribeck lugre gms"), cases(P, "FF", "coulomb")),
            rises("steady", [*cases(P, "FF", "coulomb"), f"{P}/PD"]),
        ),
    ),
    _fb(
        "P-step-FB-coulombbest",
        "FB: Coulomb best (no) steady-state error: |mean e| < 1e-5 rad and below LuGre/GMS or equal to them",
        all_of(
            below("steady", cases(P, "FB", "coulomb"), VANISHES),
            # "Equal" where both vanish: the margin is the claim's own 1e-5 rad.
            lambda e: (
                all(
                    e("steady", cases(P, "FB", "coulomb")[0]) < max(VANISHES, e("steady", case))
                    for case in cases(P, "FB", "lugre gms")
                ),
                below("steady", cases(P, "FB", "lugre gms"), 1.0)(e)[1],
            ),
        ),
        "Under the literal rule the oscillation with Coulomb feedback is large and lopsided.",
    ),
    _fb(
        "P-step-FBcoulomb-insidePID",
        "FB: the Coulomb chatter lies within the PID limit cycle",
        all_of(
            compared("late high", [(f"{P}/FB-coulomb", f"{P}/PID")]),
            compared("late low", [(f"{P}/PID", f"{P}/FB-coulomb")]),
        ),
        FED,
    ),
    _ff(
        "P-step-FFgms-insidePID",
        "FF GMS steady-state error lies inside the PID limit cycle",
        within_cycle(cases(P, "FF", "gms"), f"{P}/PID", inside=True),
        "The size of the feedforward error depends on the step's shape, which the thesis gives only as a picture.",
    ),
    _fb(
        "P-step-FBdyn-outsidePID",
        "FB: steady-state errors of the dynamic models lie outside the PID limit cycle",
        within_cycle(cases(P, "FB", "lugre gms"), f"{P}/PID", inside=False),
        "The offset that GMS feedback leaves is inside the PID's limit cycle under both rules.",
    ),
]  # fmt: skip

MINUS = [
    _ff(
        "M-step-FF-coulombbest",
        "FF: Coulomb best, the others higher",
        beats("steady", cases(M, "FF", "coulomb"), cases(M, "FF", "stribeck lugre gms")),
    ),
    _fb(
        "M-step-FBdyn<FF",
        "FB: steady-state errors of the dynamic models smaller than in FF",
        compared("steady", [(f"{M}/FB-{law}", f"{M}/FF-{law}") for law in ("lugre", "gms")]),
    ),
    _fb(
        "M-step-FBdyn-beyondPID",
        "FB: steady-state errors of the dynamic models lie beyond the PID limit cycle",
        within_cycle(cases(M, "FB", "lugre gms"), f"{M}/PID", inside=False),
        "LuGre feedback oscillates about an offset that is inside the PID's limit cycle; GMS's is beyond it.",
    ),
]

CLAIMS: list[Claim] = [
    *(claim for letter in PLACES for claim in _for_each_friction(letter)), *NOMINAL, *PLUS, *MINUS,
]  # fmt: skip
