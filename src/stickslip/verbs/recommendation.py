"""What the verb `recommend` gives: the recommendation with what it was made for, to print, save and run."""

from __future__ import annotations

import os
from dataclasses import dataclass
from functools import cached_property
from html import escape
from pathlib import Path
from typing import Any

from stickslip.analyse.controller_margins import ControllerStability, controller_stability
from stickslip.analyse.machine_axis import axis_of
from stickslip.control.controller import Controller
from stickslip.core.arguments import arguments_checked, constructor_checked
from stickslip.core.config import Table
from stickslip.core.errors import InputError
from stickslip.core.whole_files import prepared_folder
from stickslip.identification.identified_file import Identified
from stickslip.identification.model_file import versions
from stickslip.models.model import Model
from stickslip.recommendation.axes import plants_of
from stickslip.recommendation.file import setting_table, write_setting
from stickslip.recommendation.recommend import Candidate, Recommendation
from stickslip.report.recommendation_text import (
    instead_lines,
    recommendation_lines,
    reduction,
    safety,
    summary_lines,
    without_friction,
    worst_left,
)
from stickslip.verbs import own_files
from stickslip.verbs.identification import IdentificationResult


@constructor_checked
@dataclass(frozen=True, eq=False, repr=False)
class RecommendationResult:
    """What to switch on, and what to expect; printed, it is what `stickslip recommend` prints.

    `details` has all candidates and notes, `plot` the error before and after, `report` the page.

    Attributes
    ----------
    recommendation : stickslip.recommendation.recommendation.Recommendation
    identified : stickslip.identification.identified_file.Identified
        What it was made for.
    """

    recommendation: Recommendation
    identified: Identified

    @property
    def chosen(self) -> Candidate | None:
        """The setting to switch on, and its errors; None: none, or a compensator of the catalogue (`controller`)."""
        return self.recommendation.switched_on

    @property
    def model(self) -> Model:
        """The law to run.

        Raises
        ------
        InputError
            Where no compensator is recommended, or a whole controller.
        """
        if self.recommendation.instead is not None:
            raise InputError(
                f"{self.recommendation.instead.label} is recommended, which is a whole controller; take controller"
            )
        if self.recommendation.model is None:
            raise InputError(f"no compensator is recommended: {self.recommendation.why_none}")
        return self.recommendation.model

    @property
    def controller(self) -> Controller:
        """The loop that it was tried in with the compensator, for `simulate` and `export`.

        Raises
        ------
        InputError
            Where no compensator is recommended.
        """
        if self.recommendation.instead is not None:
            assert self.recommendation.instead.controller is not None
            return self.recommendation.instead.controller
        model = self.model
        assert self.chosen is not None
        return self.chosen.setting.on(self.loop, model)

    @property
    def loop(self) -> Controller:
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
        """All that was tried; those that were beaten early are not finished (`Candidate.finished`)."""
        return self.recommendation.candidates

    @property
    def notes(self) -> tuple[str, ...]:
        """What the user must know, one sentence each."""
        return self.recommendation.notes

    @cached_property
    def stability(self) -> ControllerStability | None:
        """Poles and margins of the loop with what is recommended, about rest on the best estimate (`stability`).

        None if a law of the loop is not smooth about rest.
        """
        drive = self.recommendation.drive
        recommended = self.chosen is not None or self.recommendation.instead is not None
        inertia = self.recommendation.inertia
        plant = next(plants_of(self.identified, inertia, 0, 0, machine=drive.machine, delay=drive.delay))
        try:
            axis = axis_of(plant.built(drive.sample_time, drive.encoder_counts), 0.0)
            return controller_stability(axis, self.controller if recommended else self.loop, drive.latest)
        except InputError:
            return None

    @arguments_checked
    def plot(self, found: IdentificationResult | None = None) -> Any:
        """Draw the position error without and with what is recommended, on the best estimate and on the worst axis.

        Parameters
        ----------
        found : IdentificationResult, optional
            The identification: its measured torque and friction curve are drawn in place of the reference.

        Returns
        -------
        matplotlib.figure.Figure
            A notebook shows it; its ``savefig("advice.png")`` writes it.
        """
        from stickslip.report.plots import house_style
        from stickslip.report.recommended import recommendation_figure

        curve = next((p for p in found.pictures if p.name == "sliding-curve"), None) if found else None
        with house_style():
            return recommendation_figure(self.recommendation, self.identified.unit, curve)

    @arguments_checked
    def report(
        self,
        path: str | os.PathLike[str] = "recommendation.html",
        setting_file: str | os.PathLike[str] = "recommended.toml",
    ) -> Path:
        """Write the report, one HTML file: verdict, error before and after, what to set, margins, limits.

        Parameters
        ----------
        path : path
        setting_file : path
            The file that `save` writes, as the page's commands name it.

        Raises
        ------
        InputError
            If it cannot be written.
        """
        from stickslip.report.recommended import write_recommendation

        prepared_folder(Path(path).parent)
        made = write_recommendation(
            path, self.identified, self.recommendation, self.stability, notes=self.recommendation.notes,
            setting_file=str(setting_file), versions=versions(),
        )  # fmt: skip
        own_files.written([made])
        return made

    @property
    def details(self) -> str:
        """All candidates, the parameters and all notes, as `stickslip recommend --all` prints them."""
        return "\n".join(recommendation_lines(self.recommendation, self.identified.unit))

    @arguments_checked
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
        made = write_setting(path, self.identified, self.recommendation)
        own_files.written([made])
        return made

    def table(self) -> Table:
        """The content of the file that `save` writes."""
        return setting_table(self.identified, self.recommendation)

    def as_dict(self) -> dict[str, Any]:
        """Plain data, all candidates too."""
        return self.recommendation.as_dict()

    def __str__(self) -> str:
        return "\n".join(summary_lines(self.recommendation, self.identified, self.stability))

    def __repr__(self) -> str:
        if self.recommendation.instead is not None:
            return f"<RecommendationResult: {self.recommendation.instead.label}>"
        if self.chosen is None:
            return "<RecommendationResult: no compensator>"
        return f"<RecommendationResult: {self.chosen.setting.words}>"

    def _repr_html_(self) -> str:
        """A table of the candidates in a notebook, and what is recommended."""
        names = ("law", "structure", "gain", "error left", "worst", "safe")
        head = "".join(f"<th>{h}</th>" for h in names)
        rows = "".join(_row(c) for c in self.candidates)
        said = (
            instead_lines(self.recommendation, instead)[0].partition(":")[2].strip()
            if (instead := self.recommendation.instead)
            else "; of this, ".join(
                [f"Error reduction: {reduction(self.recommendation)}", *without_friction(self.recommendation)]
            )
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
    cells = (
        x.label,
        x.kind,
        f"{x.gain:g}",
        f"{100 * c.errors[0]:.1f} %",
        worst_left(c),
        safety(c),
    )
    return "<tr>" + "".join(f"<td>{escape(cell)}</td>" for cell in cells) + "</tr>"
