"""What to switch on: bandwidth, law, structure and gain for a commissioned machine, and what they do on it.

The bandwidth comes from the measured response: `MARGIN` below that from which a PD rings, sliding or sticking. The rest
is chosen as for any model (`stickslip.recommendation`), on the machine as it was identified. Then the machine itself
follows the slow sinusoid with the PD alone and with the compensator, at this bandwidth and at lower ones.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from stickslip.analyse.tracking import tracking_metrics
from stickslip.commission.known import LEVELS, MARGIN, Known, laws_to_try
from stickslip.control.controller import Controller
from stickslip.core.record import Record
from stickslip.identification.estimate import Identification, Picture, Trace
from stickslip.identification.model_file import write_model
from stickslip.machines.angle import AngleMap
from stickslip.models.model import Model
from stickslip.recommendation.file import recommended_table
from stickslip.recommendation.recommendation import Recommendation
from stickslip.rigs.procedures.base import Performed, Plan
from stickslip.rigs.procedures.track import REFERENCES, Track
from stickslip.rigs.rig import Rig
from stickslip.simulation.recorded_input.simulation import Mechanics

NOTHING = AngleMap()
SLOWER = (0.75, 0.5)
"""Of the bandwidth: where the gain over the linear controller alone is measured too."""
STILL = 0.9
"""Of the motion's RMS about where it begins, an error with which the axis hardly moves."""
NONE_SAFE = "none is safe on the identified machine and better than the PD alone"


@dataclass(frozen=True)
class Following(Track):
    """`Track` with a controller and a map that are at hand."""

    using: Controller | None = None
    over: AngleMap = NOTHING

    def made(self, rig: Rig) -> Controller:
        """The one that was given."""
        assert self.using is not None
        return self.using

    def angle(self) -> AngleMap:
        """The one that was given."""
        return self.over

    def plan(self, rig: Rig) -> Plan:
        """As `Track`, with what the controller has."""
        assert self.using is not None
        compensator, whole = self.using.compensator, super().plan(rig)
        what = f"{compensator.name} of law {compensator.model.law.name!r}" if compensator else "the PD alone"
        return dataclasses.replace(whole, text=(f"follow {self.reference}, {what}",))

    def options(self) -> dict[str, Any]:
        """Plain data."""
        assert self.using is not None
        used = self.using.compensator
        return {
            "reference": self.reference, "gains": self.using.numbers(),
            "compensator": used
            and {
                "kind": used.name, "gain": used.gain, "lead": used.lead, "deadband": used.deadband,
                "inertia_feedforward": used.inertia_feedforward, **used.model.as_dict(),
            },
            "angle": self.over.as_dict(),
        }  # fmt: skip


@dataclass(frozen=True)
class Tracked:
    """RMS errors on the machine itself at one bandwidth, rad: with the PD alone, with the law's mean over the angle
    alone, and with all that was found."""

    bandwidth: float
    alone: float
    mean: float
    helped: float

    @property
    def ratio(self) -> float:
        """How many times smaller the error is with the compensator."""
        return self.alone / self.helped


@dataclass(frozen=True, eq=False)
class TrackedRecommendation:
    """What is recommended, and what it did on the machine itself.

    Attributes
    ----------
    known : Known
    advice : Recommendation
        On the machine as it was identified.
    model : Model or None
        The law to run, without the ripple (that is `Known.angle`).
    tracked : tuple of Tracked
        On the machine itself, from the recommended bandwidth down.
    runs : mapping of str to Record
        Those at the recommended bandwidth: ``alone``, ``mean``, ``helped``.
    machine : str
        On which it was tried.
    """

    known: Known
    advice: Recommendation
    model: Model | None = None
    tracked: tuple[Tracked, ...] = ()
    runs: Mapping[str, Record] = field(default_factory=dict[str, Record])
    machine: str = ""

    def controllers(self, rig: Rig, bandwidth: float) -> dict[str, tuple[Controller, AngleMap]]:
        """Controller and map by name: the PD alone, with the law's mean, with all that was found."""
        assert self.advice.chosen is not None
        assert self.model is not None
        angle, setting = self.known.angle, self.advice.chosen.setting
        # The rig measures by its own encoder.
        alone = dataclasses.replace(
            self.known.drive(rig, bandwidth).loop(self.known.inertia), encoder_counts=0.0
        )
        return {
            "alone": (alone, NOTHING),
            "mean": (setting.on(alone, self.model), NOTHING),
            "helped": (setting.on(alone, angle.on(self.model)), angle),
        }

    def lines(self) -> Iterator[str]:
        """What people read."""
        k, chosen = self.known, self.advice.chosen
        below = f", a factor of {MARGIN:g} below" if k.fastest.name else ""
        yield f"{k.fastest.sentence} (measured response); recommended: {k.bandwidth:.3g} Hz{below}."
        if self.advice.rings:
            yield f"The PD alone oscillates {self.advice.rings}."
        if chosen is None:
            yield f"No compensator is recommended: {NONE_SAFE}."
            return
        c, times = chosen.setting, [1.0 / e for e in chosen.errors]
        yield (
            f"Recommended compensator: {c.kind} of law {c.law!r}, gain {c.gain:g}, lead {1e3 * c.lead:g} ms, "
            "with ripple and torque offset over the angle; "
            f"simulated with friction {', '.join(f'{100 * x:g}' for x in LEVELS)} % of that "
            f"identified: error {', '.join(f'{x:.3g}' for x in times)} times smaller than with the "
            f"PD alone ({1e3 * self.advice.linear_error:.3g} mrad RMS)."
        )
        if math.isfinite(self.advice.unsafe_gain):
            yield f"With a gain of {self.advice.unsafe_gain:g} it is not safe there."
        if self.tracked and self.tracked[0].alone > STILL * slow_rms():
            yield "The PD alone hardly moves the axis on this slow motion: it is compared with an axis that stands."
        for t in self.tracked:
            yield (
                f"Measured on the slow sinusoid{self.place}, PD of {t.bandwidth:.3g} Hz: {1e3 * t.alone:.3g} mrad RMS "
                f"alone, {1e3 * t.helped:.3g} with the compensator: {t.ratio:.3g} times smaller "
                f"({t.alone / t.mean:.3g} times without what it knows of the angle)."
            )

    @property
    def place(self) -> str:
        """Where the runs began, in words."""
        if not self.runs:
            return ""
        start = math.degrees(float(self.runs["alone"]["position"][0])) % 360.0
        return f" from one start angle ({start:.0f} degrees; elsewhere it may be more or less)"


def write_recommended(path: Path, found: TrackedRecommendation) -> Path:
    """A model.toml of the law to run, with ``[angle]`` and ``[recommended]``: what `stickslip rig run track` takes."""
    assert found.model is not None
    result = Identification("commission", found.model, (), np.eye(0), {}, tuple(found.lines()), details={
        "mechanics": Mechanics(found.known.inertia), "angle": found.known.angle,
    })  # fmt: skip
    return write_model(path, result, more={"recommended": recommended_table(found.advice, found.machine)})


def write_identified_machine(path: Path, found: TrackedRecommendation, rig: Rig, lugre: Model | None) -> Path:
    """The machine as it was identified on the rig, for simulations: what `stickslip.load_machine` reads.

    The laws to try on it are its models; the torque over the angle beside friction is not in it (`Known.machine`).
    """
    laws = laws_to_try(found.known.model, lugre)
    machine = dataclasses.replace(
        found.known.machine(rig), title=f"{rig.name} as it was commissioned", models=laws
    )
    return machine.write(path)


# ---- on the machine ---------------------------------------------------------------------------------------------


def recommend_and_track(
    known: Known, rig: Rig, lugre: Model | None, follow: Callable[[Following, str], Performed]
) -> TrackedRecommendation:
    """Choose on the identified machine, then track on the rig with the PD alone and with what was chosen.

    Parameters
    ----------
    known : Known
    rig : Rig
    lugre : Model or None
        LuGre's dynamics, where they were identified.
    follow : callable
        Performs a `Following` on the rig; also given a name for its record.
    """
    laws = laws_to_try(known.model, lugre)
    advice = known.recommendation(rig, laws)
    if advice.chosen is None:
        return TrackedRecommendation(known, advice)
    found = TrackedRecommendation(known, advice, laws[advice.chosen.setting.law], machine=rig.name)
    tracked: list[Tracked] = []
    runs: dict[str, Record] = {}
    for share in (1.0, *SLOWER):
        errors: list[float] = []
        for name, (controller, angle) in found.controllers(rig, share * known.bandwidth).items():
            record = follow(Following(using=controller, over=angle), f"track-{100 * share:.0f}-{name}").record
            errors.append(tracking_metrics(record)["position_rms_rad"])
            if share == 1.0:
                runs[name] = record
        tracked.append(Tracked(share * known.bandwidth, *errors))
    return dataclasses.replace(found, tracked=tuple(tracked), runs=runs)


def slow_rms() -> float:
    """RMS of the slow sinusoid about where it begins, rad."""
    reference, seconds = REFERENCES["low"]
    path = reference.sample(np.linspace(0.0, seconds, 2001))
    way: np.ndarray[Any, np.dtype[np.float64]] = path[:, 0] - path[0, 0]
    return float(np.sqrt(np.mean(way**2)))


def picture_of_tracking(found: TrackedRecommendation) -> Picture:
    """The slow sinusoid on the machine itself."""
    traces: list[Trace] = []
    for name, words in (("alone", "PD alone"), ("mean", "without the angle"), ("helped", "recommended")):
        record = found.runs[name]
        origin = record["position_reference"][0]
        if not traces:
            traces.append(
                Trace(
                    "reference", record.time - record.time[0], record["position_reference"] - origin, "faint"
                )
            )
        traces.append(Trace(words, record.time - record.time[0], record["position"] - origin))
    best = found.tracked[0]
    return Picture(
        "tracking", f"Slow sinusoid, PD of {best.bandwidth:.3g} Hz",
        f"The error is {best.ratio:.2g} times smaller than with the PD alone", "time (s)", "position (rad)",
        tuple(traces),
    )  # fmt: skip


def picture_of_candidates(found: TrackedRecommendation) -> Picture:
    """What the safe candidates leave of the error of the PD alone, over the friction there is."""
    order = np.argsort(LEVELS)
    traces = [
        Trace(
            f"{c.setting.law}, {c.setting.kind}",
            100.0 * np.array(LEVELS)[order],
            100.0 * np.array(c.errors)[order],
        )
        for c in found.advice.candidates
        if not (c.unsafe or c.setting.lead or c.setting.deadband) and c.setting.gain == 1.0
    ]
    return Picture(
        "recommended", "What candidates of gain 1 leave of the error on the identified machine",
        f"Those that are safe there; with the PD of {found.known.bandwidth:.3g} Hz alone it is "
        f"{1e3 * found.advice.linear_error:.3g} mrad RMS", "friction there is over that identified (%)",
        "error left (% of the PD's alone)", tuple(traces),
    )  # fmt: skip
