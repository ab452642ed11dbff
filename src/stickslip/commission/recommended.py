"""What to switch on: bandwidth, law, structure and gain for a commissioned machine, and what they do on it.

The bandwidth comes from the measured response: `MARGIN` below that from which a PD rings, sliding or sticking. The rest
is simulated, not on the machine but on what is known of it (`stickslip.commission.candidates`). Then the machine itself
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
from stickslip.commission.candidates import (
    DAMPING,
    LEVELS,
    MARGIN,
    Candidate,
    Following,
    Known,
    candidates_of,
    chosen_of,
    controller_of,
    laws_to_try,
    simulated,
    with_lead,
)
from stickslip.control.controller import Controller
from stickslip.control.recommended import Recommended as Setting
from stickslip.identify.estimate import Identification, Picture, Trace
from stickslip.identify.model_file import write_model
from stickslip.machines.angle import AngleMap
from stickslip.model import Model
from stickslip.record import Record
from stickslip.rigs.procedures.base import Performed
from stickslip.rigs.rig import Rig
from stickslip.simulation.recorded_input.simulation import Mechanics

SLOWER = (0.75, 0.5)
"""Of the bandwidth: where the gain over the linear controller alone is measured too."""


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
class Recommended:
    """What is recommended, why, and what it did.

    Attributes
    ----------
    known : Known
    candidates : tuple of Candidate
    chosen : Candidate or None
        None: none is calm and better than the PD alone.
    model : Model or None
        The law to run, without the ripple (that is `Known.angle`).
    alone : float
        RMS error of the PD alone on the identified machine, rad.
    tracked : tuple of Tracked
        On the machine itself, from the recommended bandwidth down.
    runs : mapping of str to Record
        Those at the recommended bandwidth: ``alone``, ``mean``, ``helped``.
    machine, sample_time : str, float
        On which it was tried, and the rig's sample time, s.
    """

    known: Known
    candidates: tuple[Candidate, ...]
    chosen: Candidate | None
    model: Model | None
    alone: float
    tracked: tuple[Tracked, ...] = ()
    runs: Mapping[str, Record] = field(default_factory=dict[str, Record])
    machine: str = ""
    sample_time: float = 0.0

    def controllers(self, rig: Rig, bandwidth: float) -> dict[str, tuple[Controller, AngleMap]]:
        """Controller and map by name: the PD alone, with the law's mean, with all that was found."""
        assert self.chosen is not None
        assert self.model is not None
        k, c = self.known, self.chosen
        flat = dataclasses.replace(k, angle=AngleMap())
        return {
            "alone": (controller_of(k, rig, bandwidth), AngleMap()),
            "mean": (controller_of(flat, rig, bandwidth, c.compensation(self.model)), AngleMap()),
            "helped": (controller_of(k, rig, bandwidth, c.compensation(self.model)), k.angle),
        }

    def lines(self) -> Iterator[str]:
        """What people read."""
        k = self.known
        below = f", a factor of {MARGIN:g} below" if k.fastest.name else ""
        yield f"{k.fastest.sentence} (measured response); recommended: {k.bandwidth:.3g} Hz{below}."
        if self.chosen is None:
            yield "No compensator is recommended: none is calm on the identified machine and better than the PD alone."
            return
        c = self.chosen
        yield (
            f"Recommended compensator: {c.kind} of law {c.law!r}, gain {c.gain:g}, lead {1e3 * c.lead:g} ms, "
            "with ripple and torque offset over the angle; "
            f"simulated with friction {', '.join(f'{100 * x:g}' for x in LEVELS)} % of that "
            f"identified: error {', '.join(f'{self.alone / e:.3g}' for e in c.errors)} times smaller than with the "
            f"PD alone ({1e3 * self.alone:.3g} mrad RMS)."
        )
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

    def table(self) -> dict[str, Any]:
        """``[recommended]`` of a recommended.toml."""
        assert self.chosen is not None
        return Setting(
            self.chosen.kind, self.chosen.gain, self.known.bandwidth, DAMPING, self.known.inertia, self.chosen.lead,
            sample_time=self.sample_time, machine=self.machine,
        ).table()  # fmt: skip


def write_recommended(path: Path, found: Recommended) -> Path:
    """A model.toml of the law to run, with ``[angle]`` and ``[recommended]``: what `stickslip rig run track` takes."""
    assert found.model is not None
    result = Identification("commission", found.model, (), np.eye(0), {}, tuple(found.lines()), details={
        "mechanics": Mechanics(found.known.inertia), "angle": found.known.angle,
    })  # fmt: skip
    return write_model(path, result, more={"recommended": found.table()})


# ---- on the machine ---------------------------------------------------------------------------------------------


def recommend_on(
    known: Known, rig: Rig, lugre: Model | None, follow: Callable[[Following, str], Performed]
) -> Recommended:
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
    tried = candidates_of(known, rig, laws)
    alone, _ = simulated(known.machine(rig), controller_of(known, rig, known.bandwidth), known.angle)
    chosen = chosen_of(tried, alone)
    if chosen is None:
        return Recommended(known, tuple(tried), None, None, alone)
    chosen = with_lead(known, rig, laws[chosen.law], chosen)
    found = Recommended(
        known, tuple(tried), chosen, laws[chosen.law], alone, machine=rig.name, sample_time=rig.sample_time
    )
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


def picture_of_tracking(found: Recommended) -> Picture:
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


def picture_of_candidates(found: Recommended) -> Picture:
    """How many times smaller than with the PD alone each candidate's error is, over the friction there is."""
    traces: list[Trace] = []
    order = np.argsort(LEVELS)
    for c in found.candidates:
        if len(c.errors) == len(LEVELS) and c.gain == 1.0:
            traces.append(Trace(
                f"{c.law}, {c.kind}" + (" (restless)" if c.restless else ""), 100.0 * np.array(LEVELS)[order],
                found.alone / np.array(c.errors)[order],
            ))  # fmt: skip
    return Picture(
        "recommended", "Candidates at gain 1 on the identified machine",
        f"PD of {found.known.bandwidth:.3g} Hz; the error with it alone is {1e3 * found.alone:.3g} mrad RMS",
        "friction there is over that identified (%)", "times smaller error", tuple(traces),
    )  # fmt: skip
