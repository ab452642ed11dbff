"""What is recommended for an identified model: the setting, what to expect of it, and what was tried besides."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from statistics import median
from typing import Any

from stickslip.core.messages import render, rendered
from stickslip.models.model import Model
from stickslip.recommendation.beside import Beside
from stickslip.recommendation.candidate_run import Drive, Trial
from stickslip.recommendation.candidates import NEAR, Candidate

ALLOWANCE, BETTER = 1.4, 2.0
"""Factors on the error left, upwards and downwards, for resonances, backlash, cogging and the like, which a machine has
or has not: so the promise held in `benchmarks/promise.py`."""


@dataclass(frozen=True, eq=False)
class Comparison:
    """One axis under the linear controller alone, and with what is recommended.

    Attributes
    ----------
    axis : str
        For people: "best estimate", or which sampled axis.
    before : Trial
        The linear controller alone.
    after : Trial or None
        With what is recommended; None if nothing is.
    """

    axis: str
    before: Trial
    after: Trial | None = None

    @property
    def errors(self) -> tuple[float, float]:
        """RMS position errors before and after, rad (m); NaN for the latter if nothing is recommended."""
        before, after = self.before.moving, self.after.moving if self.after else {}
        return before["position_rms_rad"], after.get("position_rms_rad", math.nan)


@dataclass(frozen=True, eq=False)
class Recommendation:
    """What to switch on.

    Attributes
    ----------
    chosen : Candidate or None
        The best setting of a law; None: none is safe and worth it. Its errors are those on the axes that it was not
        picked on. Another compensator may be better (`instead`): `switched_on` is the setting where it is not.
    model : Model or None
        The law to run, with its parameters.
    gains : mapping
        Of the linear controller; of a loop made of control laws the parameters of all of them.
    linear_error : float
        RMS error of the linear controller alone on the best estimate, rad.
    margin : float
        Highest gain tried, over the chosen one, up to which it is safe on all axes.
    unsafe_gain : float
        Lowest gain tried above the chosen one at which it is not safe on some axis; infinite where there is none.
    candidates : tuple of Candidate
    axes : int
        On how many the candidates were simulated, the best estimate among them.
    notes : tuple of str
    rings : str
        Where the linear controller rings alone, why, and what to change; empty where it does not.
    inertia : float
        kg·m², that the PD is placed with.
    beside : tuple of Beside
        Compensators of the catalogue that were tried besides, best first.
    hunts : str
        What the chosen setting does at rest for long, where compensators were tried besides and it goes to and fro.
    better : float
        Times as small as simulated, that the error left may be.
    inertia_alone : Candidate or None
        The inertia feedforward without friction compensation on the axes that the chosen setting was not picked on, up
        to the first on which it is not safe; None where no inertia is fed forward, or nothing is recommended.
    friction : Candidate or None
        The best setting that compensates friction, on the same axes; it is not the chosen one where it adds nothing to
        the inertia feedforward alone. None where there is none.
    why_none : str
        The one reason why no compensator is recommended, and what to do; empty where one is.
    warnings : tuple of str
        Those of the notes that limit the answer or ask for an action.
    comparisons : tuple of Comparison
        The best estimate and, if something is recommended, the sampled axis on which the most of the error is left.
    hunting : str
        Whether the linear controller alone hunts at rest, and how long that was simulated.
    """

    chosen: Candidate | None
    model: Model | None
    gains: dict[str, float]
    linear_error: float
    margin: float
    unsafe_gain: float
    candidates: tuple[Candidate, ...]
    axes: int
    notes: tuple[str, ...] = ()
    drive: Drive = field(default_factory=Drive)
    rings: str = ""
    inertia: float = math.nan
    beside: tuple[Beside, ...] = ()
    hunts: str = ""
    better: float = BETTER
    inertia_alone: Candidate | None = None
    friction: Candidate | None = None
    why_none: str = ""
    warnings: tuple[str, ...] = ()
    comparisons: tuple[Comparison, ...] = ()
    hunting: str = ""

    def __post_init__(self) -> None:
        object.__setattr__(self, "notes", rendered(self.notes))
        for name in ("rings", "hunts", "why_none"):
            object.__setattr__(self, name, render(getattr(self, name)))

    @property
    def instead(self) -> Beside | None:
        """The compensator of the catalogue to be switched on instead of the chosen setting; None: none is better."""
        best = next((b for b in self.beside if not b.why_not), None)
        if best is None or best.name == "none" or ALLOWANCE * best.at_most > 1.0:
            return None
        return best if self.chosen is None or self.hunts or NEAR * best.at_most < self.chosen.worst else None

    @property
    def switched_on(self) -> Candidate | None:
        """The setting to switch on; None if none is, or a compensator of the catalogue is (`instead`)."""
        return self.chosen if self.instead is None else None

    @property
    def errors(self) -> tuple[float, ...]:
        """Errors left by what is recommended: the best estimate, and the axes that it was not picked on."""
        if self.instead is not None:
            return self.instead.confirmed or self.instead.errors
        return self.chosen.errors if self.chosen else ()

    @property
    def reduction(self) -> tuple[float, float]:
        """Least and greatest part of the error that is taken away, over the axes that the setting was not picked on
        and the best estimate.

        Of n drawn axes they hold the reduction on another one with a probability of (n - 1)/(n + 1), 95 % for 39, or a
        little more: the best estimate may widen them. They are moved apart by `ALLOWANCE` and `better`,
        for what machines have and the simulation has not.
        """
        if not self.errors:
            return 0.0, 0.0
        return 1.0 - ALLOWANCE * max(self.errors), 1.0 - min(self.errors) / self.better

    @property
    def usual_reduction(self) -> float:
        """The part of the error that is taken away at least on half of the axes that the setting was not picked on; NaN
        where it was confirmed on none."""
        return 1.0 - median(self.errors[1:]) if self.confirmed_on > 0 else math.nan

    @property
    def confirmed_on(self) -> int:
        """Number of drawn axes on which the recommendation was confirmed."""
        return max(len(self.errors) - 1, 0)

    @property
    def confidence(self) -> float:
        """Probability that `reduction` holds another axis from the model's intervals."""
        n = self.confirmed_on
        return max(0.0, (n - 1) / (n + 1))

    def as_dict(self) -> dict[str, Any]:
        """Plain data."""
        return {
            "chosen": self.switched_on.as_dict() if self.switched_on else None,
            "model": self.model.as_dict() if self.model and self.switched_on else None, "gains": self.gains,
            "linear_error_rms": self.linear_error, "margin": self.margin, "unsafe_gain": self.unsafe_gain,
            "reduction": list(self.reduction) if self.errors else None, "reduction_confidence": self.confidence,
            "usual_reduction": self.usual_reduction if self.confirmed_on else None,
            "inertia_alone": self.inertia_alone.as_dict() if self.inertia_alone else None,
            "axes": self.axes, "axes_confirmed": self.confirmed_on, "notes": list(self.notes),
            "warnings": list(self.warnings), "errors_rms": {c.axis: list(c.errors) for c in self.comparisons},
            "linear_alone_rings": self.rings, "hunting": self.hunting, "drive": self.drive.as_dict(),
            "candidates": [c.as_dict() for c in self.candidates],
            "compensators": [b.as_dict() for b in self.beside],
            "instead": self.instead.label if self.instead else None, "why_none": self.why_none,
        }  # fmt: skip
