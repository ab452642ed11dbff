"""The thesis's statements on the sinusoidal references (3.2.3.1.1, 3.2.3.1.2 and their perturbed counterparts).

"Oscillates" along a sinusoid: more than 20 mrad/s RMS of velocity above 50 Hz, twice the PID's stick-slip.
"Worst" is an RMS error at least 5 % above every other, since less is not to be told from the spread of
ill-conditioned runs.
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
    close,
    compared,
    rises,
)

OSCILLATES = 20e-3  # rad/s RMS above 50 Hz
TRAVEL = {"low": 0.02, "high": 1.0}  # rad, of the reference
CHATTER = 20.0  # reversals/s

FED = (
    "After a fast reversal the literal rule lets friction push with the motion for about 12 ms; the energy so "
    "fed in makes feedback by Coulomb, Stribeck and LuGre oscillate. The signed rule is passive."
)
FED_FF = (
    "The literal rule feeds energy in after fast reversals, here in the run with feedforward by Coulomb; under "
    "the passive signed rule that run is calm and accurate."
)
NOMINAL = {"low": ("3.2.3.1.1", "3.21", "3.22"), "high": ("3.2.3.1.2", "3.23", "3.24")}
PLUS = {"low": ("3.2.3.2.1", "3.27", "3.28"), "high": ("3.2.3.2.2", "3.29", "3.30")}
MINUS = {"low": ("3.2.3.3.1", "3.33", "3.34"), "high": ("3.2.3.3.2", "3.35", "3.36")}
PLACES = {"N": NOMINAL, "P": PLUS, "M": MINUS}
FRICTIONS = {"N": "nominal", "P": "plus10", "M": "minus10"}


def _ff(id: str, text: str, check: Check, why: str = "") -> Claim:
    """A claim on feedforward; its id says the friction and the reference."""
    section, ff, _ = PLACES[id[0]][id.split("-")[1]]
    return Claim(id, section, (ff,), text, check, why)


def _fb(id: str, text: str, check: Check, why: str = "") -> Claim:
    """A claim on feedback; its id says the friction and the reference."""
    section, _, fb = PLACES[id[0]][id.split("-")[1]]
    return Claim(id, section, (fb,), text, check, why)


def _both(id: str, text: str, check: Check, why: str = "") -> Claim:
    """A claim on both ways to compensate; its id says the friction and the reference."""
    section, ff, fb = PLACES[id[0]][id.split("-")[1]]
    return Claim(id, section, (ff, fb), text, check, why)


def _for_each_friction(letter: str) -> list[Claim]:
    """What the thesis says of the sinusoids under every friction."""
    low, high = f"low/{FRICTIONS[letter]}", f"high/{FRICTIONS[letter]}"
    others = "coulomb stribeck lugre"
    improve = "PD alone follows badly; every FF and FB compensator improves the tracking"
    claims = [
        _both(f"{letter}-{name}-improve", improve, all_of(
            beats("rms", [*cases(group, "FF"), *cases(group, "FB")], [f"{group}/PD"]),
            above("rms", [f"{group}/PD"], 0.1 * TRAVEL[name]),
        ))
        for name, group in (("low", low), ("high", high))
    ]  # fmt: skip
    low_place, high_place = PLACES[letter]["low"], PLACES[letter]["high"]
    return [
        *claims,
        _both(
            f"{letter}-low-PIDstickslip",
            "low-velocity sine: PID shows stick-slip throughout the trajectory (also away from the peaks)",
            above("standstills away", [f"{low}/PID"], 0),
        ),
        _both(
            f"{letter}-high-PIDsmooth",
            "high-velocity sine: PID is smooth at non-zero velocity and sticks near zero velocity",
            all_of(
                above("standstills", [f"{high}/PID"], 0), below("standstills off zero", [f"{high}/PID"], 1)
            ),
        ),
        Claim(
            f"{letter}-FBgms-nonosc",
            f"{low_place[0]}, {high_place[0]}",
            (low_place[2], high_place[2]),
            "sinusoidal inputs, FB: GMS is the only compensator without oscillation",
            all_of(
                below("oscillation", [*cases(low, "FB", "gms"), *cases(high, "FB", "gms")], OSCILLATES),
                above("oscillation", [*cases(low, "FB", others), *cases(high, "FB", others)], OSCILLATES),
            ),
            FED,
        ),
    ]


N_LOW, N_HIGH, P_LOW, P_HIGH, M_LOW, M_HIGH = (
    f"{reference}/{friction}" for friction in FRICTIONS.values() for reference in ("low", "high")
)

NOMINAL_LOW = [
    _ff(
        "N-low-FF-3close",
        "FF: Stribeck, LuGre, GMS close to each other (within 20 %) and at least 2x better than Coulomb",
        all_of(
            close("rms", cases(N_LOW, "FF", "stribeck lugre gms"), 0.2),
            beats("rms", cases(N_LOW, "FF", "stribeck lugre gms"), cases(N_LOW, "FF", "coulomb"), 2.0),
        ),
        FED_FF,
    ),
    _ff(
        "N-low-FF-gmsbest",
        "FF: GMS slightly better than LuGre and Stribeck (rms)",
        beats("rms", cases(N_LOW, "FF", "gms"), cases(N_LOW, "FF", "lugre stribeck")),
        "LuGre and GMS differ by 2 %, in favour of LuGre, under both rules.",
    ),
    _ff(
        "N-low-FF-peak",
        "FF: even with GMS there is stick-slip at the peak of the trajectory",
        above("longest", cases(N_LOW, "FF", "gms"), 0.0),
    ),
    _fb(
        "N-low-FB-order",
        "FB: order GMS, LuGre, Stribeck, Coulomb (3.2.3.1.1)",
        rises("rms", cases(N_LOW, "FB", "gms lugre stribeck coulomb")),
        "Coulomb beats Stribeck under both rules, as the thesis itself says in 5.1.",
    ),
    _fb(
        "N-low-FB-order5",
        "FB: order GMS, LuGre, Coulomb, Stribeck (5.1)",
        rises("rms", cases(N_LOW, "FB", "gms lugre coulomb stribeck")),
        FED,
    ),
    _fb(
        "N-low-FB-gmsperfect",
        "FB: GMS matches perfectly (rms error at least 10x below every other)",
        beats("rms", cases(N_LOW, "FB", "gms"), cases(N_LOW, "FB", "coulomb stribeck lugre"), 10.0),
        "GMS matches as well under both rules; without the energy that the literal rule feeds in, Coulomb is "
        "only 8 times worse.",
    ),
    _both(
        "N-low-FBmoreosc",
        "responses are more oscillatory in FB than in FF (Coulomb, Stribeck, LuGre)",
        compared(
            "oscillation",
            [(f"{N_LOW}/FF-{law}", f"{N_LOW}/FB-{law}") for law in ("coulomb", "stribeck", "lugre")],
        ),
        FED,
    ),
    _ff(
        "N-low-FFsmoother",
        "PD+FF is usually smoother than PID at non-zero velocity (mid-part velocity rms error, at least 3 of 4)",
        at_least(3, "midway", cases(N_LOW, "FF"), f"{N_LOW}/PID"),
    ),
    _fb(
        "N-low-FBgms-vs-PID",
        "FB: PD+GMS has better stick-slip behaviour near zero velocity than PID",
        beats("longest", cases(N_LOW, "FB", "gms"), [f"{N_LOW}/PID"]),
    ),
]

NOMINAL_HIGH = [
    _ff(
        "N-high-FF-close",
        "FF: all four close to each other (rms within 20 %)",
        close("rms", cases(N_HIGH, "FF"), 0.2),
    ),
    _fb(
        "N-high-FB-gmsperfect",
        "FB: GMS follows perfectly without oscillation",
        all_of(
            below("peak", cases(N_HIGH, "FB", "gms"), 1e-3 * TRAVEL["high"]),
            below("oscillation", cases(N_HIGH, "FB", "gms"), OSCILLATES),
        ),
    ),
    _fb(
        "N-high-FB-coulomb<lugre",
        "FB: Coulomb slightly better than LuGre",
        rises("rms", cases(N_HIGH, "FB", "coulomb lugre")),
    ),
    _fb(
        "N-high-FB-stribeckworst",
        "FB: Stribeck is the worst",
        beats("rms", cases(N_HIGH, "FB", "coulomb lugre gms"), cases(N_HIGH, "FB", "stribeck"), 1.05),
        "Stribeck and LuGre are within 1 % under the passive signed rule; the literal rule makes Stribeck "
        "feedback oscillate.",
    ),
    _both(
        "N-high-PIDsimilar",
        "PID gives a response similar to PD+FF (rms within a factor 1.5)",
        close("rms", [f"{N_HIGH}/PID", *cases(N_HIGH, "FF")], 0.5),
    ),
    _ff(
        "N-high-FFpeak",
        "FF: smooth at non-zero velocity, stick-slip near zero velocity (stuck intervals start only near zero "
        "velocity)",
        all_of(
            above("standstills", cases(N_HIGH, "FF"), 0),
            below("standstills off zero", cases(N_HIGH, "FF"), 1),
        ),
    ),
    _fb(
        "N-high-FBgms-vs-PID",
        "FB GMS better and smoother than PID at the peaks",
        all_of(
            beats("peak", cases(N_HIGH, "FB", "gms"), [f"{N_HIGH}/PID"]),
            beats("oscillation", cases(N_HIGH, "FB", "gms"), [f"{N_HIGH}/PID"]),
        ),
    ),
]

PLUS_LOW = [
    _ff(
        "P-low-FF",
        "FF: GMS, LuGre, Stribeck nearly the same and better than Coulomb",
        all_of(
            close("rms", cases(P_LOW, "FF", "gms lugre stribeck"), 0.2),
            beats("rms", cases(P_LOW, "FF", "gms lugre stribeck"), cases(P_LOW, "FF", "coulomb")),
        ),
    ),
    _fb(
        "P-low-FB-order",
        "FB: Coulomb best, then LuGre, GMS, Stribeck",
        rises("rms", cases(P_LOW, "FB", "coulomb lugre gms stribeck")),
        "Coulomb is best under both rules; GMS and Stribeck change places (signed), LuGre and GMS do (literal).",
    ),
    _fb(
        "P-low-FB-coulombbest",
        "FB: Coulomb gives the best result",
        beats("rms", cases(P_LOW, "FB", "coulomb"), cases(P_LOW, "FB", "stribeck lugre gms")),
    ),
    _fb(
        "P-low-FB-chatter",
        "FB: Coulomb and LuGre chatter (velocity reversals > 20 /s, more than GMS FF)",
        all_of(
            above("reversals", cases(P_LOW, "FB", "coulomb lugre"), CHATTER),
            beats("reversals", cases(P_LOW, "FF", "gms"), cases(P_LOW, "FB", "coulomb lugre")),
        ),
    ),
    _both(
        "P-low-lag",
        "FF and FB responses lag (under-compensation): mean error in the direction of motion > 0",
        above("lag", [*cases(P_LOW, "FF"), *cases(P_LOW, "FB")], 0.0),
        "Where the literal rule feeds energy in, the axis is thrown ahead of the reference and leads on average.",
    ),
    _fb(
        "P-low-FB-vs-PID",
        "FB: Coulomb and LuGre track better than GMS and better than PID",
        beats("rms", cases(P_LOW, "FB", "coulomb lugre"), [*cases(P_LOW, "FB", "gms"), f"{P_LOW}/PID"]),
        "Only Coulomb tracks better than the PID; LuGre feedback of 10 % too little friction leaves an error "
        "that the PID integrates away.",
    ),
]

PLUS_HIGH = [
    _ff("P-high-FF", "FF: nearly the same accuracy (10 %)", close("rms", cases(P_HIGH, "FF"), 0.1)),
    _ff("P-high-FFpeak", "FF: all stick near the peak", above("longest", cases(P_HIGH, "FF"), 0.0)),
    _fb(
        "P-high-FB-gmsbest",
        "FB: GMS best",
        beats("rms", cases(P_HIGH, "FB", "gms"), cases(P_HIGH, "FB", "coulomb stribeck lugre")),
        "All four carry the same lag of the missing 10 %; the signed rule leaves Coulomb 2 % ahead of GMS.",
    ),
    _fb(
        "P-high-FB-close",
        "FB: LuGre and Coulomb follow, close to each other (20 %), Stribeck worst",
        all_of(
            close("rms", cases(P_HIGH, "FB", "lugre coulomb"), 0.2),
            beats("rms", cases(P_HIGH, "FB", "lugre coulomb gms"), cases(P_HIGH, "FB", "stribeck"), 1.05),
        ),
        "Under the signed rule all four are within 3 %; the literal rule makes Stribeck feedback oscillate.",
    ),
    _ff(
        "P-high-lag",
        "PD+FF is delayed relative to PID",
        beats("lag", [f"{P_HIGH}/PID"], cases(P_HIGH, "FF")),
    ),
]

MINUS_LOW = [
    _ff(
        "M-low-FF-order",
        "FF: GMS ~ LuGre (20 %), better than Coulomb; Coulomb better than Stribeck",
        all_of(
            close("rms", cases(M_LOW, "FF", "gms lugre"), 0.2),
            beats("rms", cases(M_LOW, "FF", "gms lugre"), cases(M_LOW, "FF", "coulomb")),
            rises("rms", cases(M_LOW, "FF", "coulomb stribeck")),
        ),
        "Without the energy of the literal rule, Coulomb, which estimates least friction, overcompensates least "
        "and is best.",
    ),
    _ff(
        "M-low-FFstick",
        "FF: stick-slip present in all responses",
        above("standstills", cases(M_LOW, "FF"), 0),
    ),
    _fb(
        "M-low-FB-gmsbest",
        "FB: GMS most accurate and smooth",
        all_of(
            beats("rms", cases(M_LOW, "FB", "gms"), cases(M_LOW, "FB", "coulomb stribeck lugre")),
            below("oscillation", cases(M_LOW, "FB", "gms"), OSCILLATES),
        ),
        "GMS is as smooth under both rules; without the energy of the literal rule Coulomb is more accurate.",
    ),
    _fb(
        "M-low-FB-order",
        "FB: then LuGre, Coulomb, Stribeck",
        rises("rms", cases(M_LOW, "FB", "lugre coulomb stribeck")),
        FED,
    ),
    _fb(
        "M-low-FBgms-nostick",
        "FB GMS: no stick-slip near zero velocity",
        below("longest", cases(M_LOW, "FB", "gms"), 10e-3),
    ),
]

MINUS_HIGH = [
    _ff("M-high-FF", "FF: nearly the same (10 %)", close("rms", cases(M_HIGH, "FF"), 0.1)),
    _ff(
        "M-high-FF-pp",
        "FF: Coulomb has the lowest peak-to-peak error",
        beats("late span", cases(M_HIGH, "FF", "coulomb"), cases(M_HIGH, "FF", "stribeck lugre gms")),
    ),
    _fb(
        "M-high-FB-gmsbest",
        "FB: GMS best and smooth",
        all_of(
            beats("rms", cases(M_HIGH, "FB", "gms"), cases(M_HIGH, "FB", "coulomb stribeck lugre")),
            below("oscillation", cases(M_HIGH, "FB", "gms"), OSCILLATES),
        ),
        "All four carry the same lead of the excess 10 %; the signed rule leaves Coulomb 1 % ahead of GMS.",
    ),
    _fb(
        "M-high-FB-order",
        "FB: GMS, LuGre, Coulomb, Stribeck",
        rises("rms", cases(M_HIGH, "FB", "gms lugre coulomb stribeck")),
        "Coulomb is better than LuGre by about 1 % under both rules.",
    ),
    _fb(
        "M-high-FBlugre-osc",
        "FB: LuGre oscillates",
        above("oscillation", cases(M_HIGH, "FB", "lugre"), OSCILLATES),
        FED,
    ),
]

CLAIMS: list[Claim] = [
    *(claim for letter in FRICTIONS for claim in _for_each_friction(letter)),
    *NOMINAL_LOW, *NOMINAL_HIGH, *PLUS_LOW, *PLUS_HIGH, *MINUS_LOW, *MINUS_HIGH,
]  # fmt: skip
