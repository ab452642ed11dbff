"""What the report of a study says beyond its runs: numbers and names of figures, notes, statements that are judged."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from stickslip.thesis.claims import CLAIMS, Claim


@dataclass(frozen=True)
class Note:
    """A paragraph with a heading."""

    title: str
    text: str


@dataclass(frozen=True)
class Edition:
    """What one study's report says beyond its runs.

    Attributes
    ----------
    references, frictions : mapping of str to str
        What references and frictions are called in titles; others go by their own names.
    motions : mapping of str to str
        The number of a reference's figure.
    results : mapping of (str, str, str) to str
        The number of the figure of a reference, a friction and a kind of compensation.
    before, after, last : tuple of Note
        Notes before those on the runs, after them, and at the end.
    claims : tuple of Claim
        Statements that are judged on the runs.
    near_zero : bool
        Whether responses of other models than the study's frictions are drawn about zero velocity.
    """

    references: Mapping[str, str] = field(default_factory=dict[str, str])
    frictions: Mapping[str, str] = field(default_factory=dict[str, str])
    motions: Mapping[str, str] = field(default_factory=dict[str, str])
    results: Mapping[tuple[str, str, str], str] = field(default_factory=dict[tuple[str, str, str], str])
    before: tuple[Note, ...] = ()
    after: tuple[Note, ...] = ()
    last: tuple[Note, ...] = ()
    claims: tuple[Claim, ...] = ()
    near_zero: bool = False


SLIP = Note(
    "From stick to slip",
    "Eq. 2.17 lets an element slip when |F_i| > α_i s(v). Read literally, an element may slip while its force "
    "pushes with the motion: after a fast reversal s(v) falls faster than |F_i|, and friction feeds energy in "
    "for about 12 ms. The signed rule, slip when sign(v) F_i ≥ α_i s(v), is passive. Both agree in open loop and "
    "with PD, PID, and feedforward by LuGre and GMS; they differ most in feedback compensation by Coulomb, "
    "Stribeck and LuGre.",
)
STEP = Note(
    "The step",
    "The thesis gives its step only as a picture. With an ideal step the desired velocity is zero and every "
    "feedforward run is the PD run, against the text. The step here passes through a critically damped filter, "
    "θ_d = A (1 − (1 + t/τ) exp(−t/τ)) with A = 0.01 rad and τ = 0.02 s. The profile was chosen because it shows "
    "what the text says of feedforward on the step; those statements are no independent evidence.",
)
SIGN = Note(
    "Sign feedback",
    "Feedback by Coulomb and Stribeck switches with the sign of the measured velocity. The limit in continuous "
    "time is exact here, with no boundary layer and no sampling. At v = 0 the start lies on a repelling "
    "discontinuity, so that 1e-9 rad can decide the first direction: orderings within one per cent of such runs "
    "mean nothing.",
)
MISSING = Note(
    "Figures that are not here",
    "Figures 3.7 and 3.8 (curve fitting) belong to the identification. Figures 3.1 to 3.4, 3.6 and 3.9 are "
    "schematics and block diagrams.",
)
NUMERICS = Note(
    "Numerics",
    "Gains come from eqs. 3.10 and 3.15, not from the rounded tables; runs start at rest with all elements "
    "sticking; controllers act in continuous time unless a sample time is given. Metrics are accumulated inside "
    "the integrators, not from the records' grid.",
)
KINDS = ("feedforward", "feedback")
REFERENCES = {"low": "low-velocity sine", "high": "high-velocity sine", "step": "step"}
FRICTIONS = {"nominal": "nominal friction", "plus10": "friction +10 %", "minus10": "friction −10 %"}

PLAIN = Edition()
"""A study of one's own"""
THESIS = Edition(
    references=REFERENCES,
    frictions=FRICTIONS,
    motions={name: f"3.{15 + i}" for i, name in enumerate(REFERENCES)},
    results={
        (reference, friction, kind): f"3.{21 + 6 * i + 2 * j + k}"
        for i, friction in enumerate(FRICTIONS)
        for j, reference in enumerate(REFERENCES)
        for k, kind in enumerate(KINDS)
    },
    before=(SLIP, STEP, SIGN),
    after=(NUMERICS,),
    last=(MISSING,),
    claims=CLAIMS,
    near_zero=True,
)
"""Figures 3.15 to 3.17 are the references; 3.21 to 3.38 friction by friction, reference by reference, feedforward
then feedback."""
EDITIONS = {"thesis": THESIS}
