"""From an identified model to a setting that is safe to switch on: the verb `recommend`."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from html import escape
from pathlib import Path
from typing import Any, Literal, cast

from stickslip.approval import allow_code
from stickslip.config import Table, named_numbers
from stickslip.control.controller import Controller
from stickslip.control.files import read_controller
from stickslip.control.linear import Cascade, Gains
from stickslip.control.recommended import recommended_in
from stickslip.control.sampled_controller import SampledController
from stickslip.errors import InputError, UnknownName
from stickslip.identify import recommend as setting
from stickslip.identify.identified_file import Identified
from stickslip.identify.motion import Motion, motion_of
from stickslip.identify.recommend import Candidate, Recommendation
from stickslip.identify.setting_file import setting_table, write_setting
from stickslip.identify.setting_trial import Drive
from stickslip.model import Model
from stickslip.readers.reading import read
from stickslip.report.recommendation_text import recommendation_lines, reduction, safety
from stickslip.study.files import prepared_folder
from stickslip.verbs.compare import IdentifiedModel, identified_of
from stickslip.verbs.reading import Log, open_log

__all__ = ["RecommendationResult", "recommend"]


@dataclass(frozen=True, eq=False, repr=False)
class RecommendationResult:
    """What to switch on, and what to expect; printed, it is what `stickslip recommend` prints.

    Attributes
    ----------
    recommendation : stickslip.identify.recommend.Recommendation
    identified : stickslip.identify.identified_file.Identified
        What it was made for.
    """

    recommendation: Recommendation
    identified: Identified

    @property
    def chosen(self) -> Candidate | None:
        """The setting and its errors; None: switch no compensator on."""
        return self.recommendation.chosen

    @property
    def model(self) -> Model:
        """The law to run.

        Raises
        ------
        InputError
            Where no compensator is recommended.
        """
        if self.recommendation.model is None:
            raise InputError(f"no compensator is recommended: {'; '.join(self.notes)}")
        return self.recommendation.model

    @property
    def controller(self) -> Controller | SampledController:
        """The loop that it was tried in with the compensator, for `simulate` and `export`.

        Raises
        ------
        InputError
            Where no compensator is recommended.
        """
        loop, model = self.loop, self.model
        assert self.chosen is not None
        if isinstance(loop, SampledController):
            return self.chosen.setting.beside(loop, model)
        return replace(loop, compensator=recommended_in(self.table()).on(model))

    @property
    def loop(self) -> Controller | SampledController:
        """The loop alone."""
        return self.recommendation.drive.loop(self.recommendation.inertia)

    @property
    def reduction(self) -> tuple[float, float]:
        """Least and greatest part of the error that is taken away, with the probability `confidence`."""
        return self.recommendation.reduction

    @property
    def confidence(self) -> float:
        """Probability that `reduction` holds the axis, if the model's intervals do."""
        return self.recommendation.confidence

    @property
    def candidates(self) -> tuple[Candidate, ...]:
        """All that was tried."""
        return self.recommendation.candidates

    @property
    def notes(self) -> tuple[str, ...]:
        """What the user must know, one sentence each."""
        return self.recommendation.notes

    def save(self, path: str | os.PathLike[str] = "recommended.toml") -> Path:
        """Write the law and the setting, as `export` and `stickslip rig run track` take them.

        Parameters
        ----------
        path : path
            Of the TOML file.

        Raises
        ------
        InputError
            If nothing is recommended, or the file cannot be written.
        """
        prepared_folder(Path(path).parent)
        return write_setting(path, self.identified, self.recommendation)

    def table(self) -> Table:
        """The content of the file that `save` writes."""
        return setting_table(self.identified, self.recommendation)

    def as_dict(self) -> dict[str, Any]:
        """Plain data, all candidates too."""
        return self.recommendation.as_dict()

    def __str__(self) -> str:
        return "\n".join(recommendation_lines(self.recommendation, self.identified.unit))

    def __repr__(self) -> str:
        if self.chosen is None:
            return "<RecommendationResult: no compensator>"
        x = self.chosen.setting
        return f"<RecommendationResult: {x.kind} of law {x.law!r}, gain {x.gain:g}>"

    def _repr_html_(self) -> str:
        """A table of the candidates in a notebook, and what is recommended."""
        names = ("law", "structure", "gain", "error left", "worst", "safe")
        head = "".join(f"<th>{h}</th>" for h in names)
        rows = "".join(_row(c) for c in self.candidates)
        said = (
            f"Error reduction: {reduction(self.recommendation)}"
            if self.chosen
            else "No compensator is recommended."
        )
        notes = "".join(f"<li>{escape(n)}</li>" for n in self.notes)
        return (
            f"<div><b>{escape(repr(self).strip('<>'))}</b><p>{escape(said)}</p>"
            f"<table><thead><tr>{head}</tr></thead><tbody>{rows}</tbody></table><ul>{notes}</ul></div>"
        )


def _row(c: Candidate) -> str:
    x = c.setting
    cells = (x.law, x.kind, f"{x.gain:g}", f"{100 * c.errors[0]:.1f} %", f"{100 * c.worst:.1f} %", safety(c))
    return "<tr>" + "".join(f"<td>{escape(cell)}</td>" for cell in cells) + "</tr>"


def recommend(
    model: IdentifiedModel,
    *,
    bandwidth: float = 10.0,
    damping: float = 1.0,
    linear: Literal["PD", "PID", "PR"] = "PD",
    loop: str | Mapping[str, float] | None = None,
    controller: SampledController | str | os.PathLike[str] | None = None,
    sample_time: float = 1e-3,
    counts_per_rev: float = 0.0,
    torque_limit: float = math.inf,
    motion: Log | None = None,
    amplitude: float | None = None,
    frequency: float | None = None,
    inertia: float | None = None,
    feed_inertia: bool = True,
    axes: int = 6,
    confirm: int = 39,
    progress: Callable[[int, int], None] = lambda done, of: None,
) -> RecommendationResult:
    """Choose law, structure, gain, lead and deadband of a compensator, and say what to expect.

    Candidates are simulated on the best estimate and on axes drawn from the model's intervals, along the motion of the
    log and at rest behind it, sampled as in the drive. Recommended is what limit-cycles on none of them and leaves the
    least error on the worst; then it is simulated on other axes drawn from the intervals.

    Parameters
    ----------
    model : IdentificationResult or path
        What `identify` gave, or the model.toml that it saved.
    bandwidth, damping : float
        Of the position loop's poles, Hz and -.
    linear : {"PD", "PID", "PR"}
        What they place.
    loop : str or mapping, optional
        The drive's own loop instead: kp (N·m/rad), ki, kd, kr of a PID, or kv (1/s), kvp (N·m·s/rad), kvi (N·m/rad),
        feed (part of the reference velocity fed forward) of position P around velocity PI; with filter (Hz, low-pass
        on its velocity) and limit (N·m).
    controller : SampledController or path, optional
        The drive's own loop made of control laws instead, observers and all, but without friction laws; a path is that
        of a file with a table [controller].
    sample_time : float
        Of the drive, s.
    counts_per_rev : float
        Of the encoder; 0: exact.
    torque_limit : float
        N·m
    motion : log, optional
        Time and position of the motion that matters; that of the identification's log unless given.
    amplitude, frequency : float, optional
        Of a slow sinusoid as the motion instead, rad (m) and Hz (0.5).
    inertia : float, optional
        kg·m², where the model has none, or another one.
    feed_inertia : bool
        Whether the inertia times the reference's acceleration is fed forward, too.
    axes : int
        Drawn from the intervals for all candidates.
    confirm : int
        Drawn for the recommended one; what it does on them holds with (confirm - 1)/(confirm + 1).
    progress : callable, optional
        ``progress(finished, all)``

    Returns
    -------
    RecommendationResult

    Raises
    ------
    InputError
        One line that names the thing, its value and the remedy.
    """
    if axes < 1:
        raise InputError(
            f"--axes {axes} must be at least 1: what is safe on the best estimate alone need not be on the machine"
        )
    if confirm < 0:
        raise InputError(
            f"--confirm {confirm} must be at least 0, which confirms nothing; leave it out for 39"
        )
    if motion is not None and amplitude is not None:
        raise InputError("--motion and --amplitude are two motions; give one of them")
    if frequency is not None and amplitude is None:
        raise InputError(f"--frequency {frequency:g} belongs to a sinusoid; give its --amplitude too")
    if loop and linear != "PD":
        raise InputError(f"--linear {linear} beside --loop, which gives the gains themselves; leave it out")
    found = identified_of(model)
    path = None if motion is None else motion_in(motion)
    if controller is not None:
        for option, value, usual in (
            ("loop", loop, None), ("linear", linear, "PD"), ("bandwidth", bandwidth, 10.0), ("damping", damping, 1.0),
            ("sample-time", sample_time, 1e-3),
        ):  # fmt: skip
            if value != usual:
                raise InputError(f"--{option} beside --controller {controller}, which says it; leave it out")
        drive = drive_with(
            controller,
            inertia or found.axis.get("inertia"),
            counts_per_rev,
            torque_limit,
            amplitude,
            frequency,
            path,
        )
    else:
        gains, own = loop_of(loop) if loop else (None, dict[str, float]())
        if "limit" in own and math.isfinite(torque_limit):
            raise InputError(f"--torque-limit {torque_limit:g} beside --loop's limit; give one of them")
        drive = Drive(
            bandwidth, damping, sample_time, counts_per_rev, own.get("limit", torque_limit), amplitude,
            frequency or 0.5, linear, gains, own.get("filter", 0.0), path,
        )  # fmt: skip
    with allow_code(bool(found.law_file)):  # its model has been read: whoever must approve it has
        result = setting.recommend(
            found, drive, inertia=inertia, axes=axes, confirm=confirm, progress=progress, feed_inertia=feed_inertia
        )  # fmt: skip
    return RecommendationResult(result, found)


def drive_with(
    controller: SampledController | str | os.PathLike[str], inertia: float | None, counts: float, limit: float,
    amplitude: float | None, frequency: float | None, motion: Motion | None,
) -> Drive:  # fmt: skip
    """The drive whose loop is made of control laws; sample time, limit and counts are the controller's.

    Raises
    ------
    InputError
    """
    made = (
        controller
        if isinstance(controller, SampledController)
        else read_controller(Path(controller), inertia)
    )
    return Drive(
        sample_time=made.sample_time, encoder_counts=counts or made.encoder_counts, torque_limit=limit,
        amplitude=amplitude, frequency=frequency or 0.5, motion=motion, controller=made,
    )  # fmt: skip


def loop_of(given: str | Mapping[str, float]) -> tuple[Gains | Cascade, dict[str, float]]:
    """Gains of a loop as the drive has it, and its filter and limit.

    Raises
    ------
    InputError
        If a name is unknown, both kinds of loop are mixed, or a number is out of bounds.
    """
    numbers = named_numbers(given.split(",")) if isinstance(given, str) else dict(given)
    kind = Cascade if "kv" in numbers else Gains
    names = (*kind._fields, "filter", "limit")
    for name, value in numbers.items():
        if name not in names:
            raise UnknownName(f"number of --loop of a {'cascade' if kind is Cascade else 'PID'}", name, names)
        above = value > 0.0 if name == "limit" else value >= 0.0 and math.isfinite(value)
        if not above:
            raise InputError(
                f"--loop: {name} = {value:g} must be a number of 0 or more, a limit greater than 0"
            )
    for name in ("kv", "kvp") if kind is Cascade else ("kp",):
        if not numbers.get(name, 0.0) > 0.0:
            raise InputError(f"--loop {given}: give {name}, greater than 0")
    own = {name: numbers.pop(name) for name in ("filter", "limit") if name in numbers}
    return kind(**numbers), own


def motion_in(log: Log) -> Motion:
    """The motion of a log or of a table of points."""
    if isinstance(log, (str, os.PathLike)):
        path = Path(cast("str", log))
        return motion_of(read(path), path.name)
    return motion_of(open_log(log, {}).record, "the motion given")
