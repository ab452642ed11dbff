"""What `identify` hands back: parameters with intervals and verdicts, the model, the report; a table in a notebook."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from html import escape
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np

from stickslip.core.arguments import arguments_checked, constructor_checked
from stickslip.core.code_approval import allow_code
from stickslip.core.config import Table
from stickslip.core.errors import InputError
from stickslip.core.extras import needed
from stickslip.core.finding import Finding
from stickslip.core.whole_files import prepared_folder
from stickslip.identification.doctor.steady_table import is_steady_table
from stickslip.identification.estimate import Estimate, Held, Identification, Picture
from stickslip.identification.identified_file import Identified, identified_in
from stickslip.identification.model_file import in_memory, model_content, versions, write_model
from stickslip.identification.motion import motion_of, speeds_in, speeds_of
from stickslip.machines.identified import identified_machine
from stickslip.machines.machine import Machine
from stickslip.machines.position_map import PositionMap
from stickslip.machines.rigid import RigidAxis
from stickslip.models.model import Model
from stickslip.report.answers import Answers, answers_of
from stickslip.report.identified import Source, files_of, write_identification
from stickslip.report.result_text import interval_text, result_lines_in_python
from stickslip.verbs import own_files

if TYPE_CHECKING:
    import pandas


@constructor_checked
@dataclass(frozen=True, eq=False, repr=False)
class IdentificationResult:
    """Numbers with intervals, a verdict on each, a model; printed, it is what `stickslip identify` prints.

    Attributes
    ----------
    identification : stickslip.identification.estimate.Identification
        The result of the method, with its correlation, pictures and details.
    sources : tuple of Source
        The records as they were used, with what the doctor found.
    law_file : str
        Path of the law's file; empty where it is registered.
    """

    identification: Identification
    sources: tuple[Source, ...]
    law_file: str = ""

    @property
    def method(self) -> str:
        """The method that was taken."""
        return self.identification.method

    @property
    def parameters(self) -> Mapping[str, Estimate]:
        """Every fitted number by name: ``value``, ``unit``, ``interval`` (95 %), ``identified``, ``verdict``.

        ``verdict`` says why a number is not identified, and is empty where it is. `given` has the other numbers.
        """
        return MappingProxyType({e.name: e for e in self.identification.estimates})

    @property
    def given(self) -> Mapping[str, float]:
        """What was held at a value that you gave (`inertia`, `frozen`), by name."""
        return MappingProxyType({h.name: h.value for h in self.identification.held})

    @property
    def model(self) -> Model:
        """The law with its parameters, for `simulate`, compensators and `export`.

        Raises
        ------
        InputError
            Where the method yields no whole law.
        """
        if self.identification.model is None:
            raise InputError(
                f"{self.method} gives no complete law and so no model; use method sliding or axis"
            )
        return self.identification.model

    @property
    def axis(self) -> RigidAxis:
        """The axis to simulate: inertia (kg·m², kg) and friction, without offset and without a pendulum's gravity.

        `machine` has a pendulum's gravity; a constant offset has no place in either.

        Raises
        ------
        InputError
            Where no inertia was identified or no law.
        """
        mechanics: Any = self.identification.details.get("mechanics")
        if mechanics is None:
            raise InputError(f"{self.method} gives no inertia; use method axis, or RigidAxis(inertia, model)")
        return RigidAxis(inertia=float(mechanics.inertia), friction=self.model)

    @property
    def machine(self) -> Machine:
        """The axis as a machine, with a pendulum's gravity (cogging of order 1), and with motor and load behind a
        spring where the record told them (damped by 0.03 of critical, which it does not tell; friction at the load).

        As `load_machine` reads the saved model. Its sample time is 1 ms, its amplifier and encoder are ideal:
        ``dataclasses.replace`` changes what is known. A constant offset has no place in it.
        ``machine.write("machine.toml")`` makes a file of it.

        Raises
        ------
        InputError
            Where no inertia was identified or no law.
        """
        return identified_machine(self.table(), "identified")

    @property
    def position_map(self) -> PositionMap | None:
        """The torque over the angle, for `export` and `position_feedforward`: from method cogging, or from method axis
        with ``position_map=True``."""
        found: Any = self.identification.details.get("map")
        return found if isinstance(found, PositionMap) else None

    @property
    def verdict(self) -> str:
        """Whether the numbers can be trusted, in a line."""
        return self.answers.trust

    @property
    def evidence(self) -> tuple[str, ...]:
        """Why, a sentence each."""
        return self.answers.evidence

    @property
    def misfit(self) -> Mapping[str, float]:
        """How well it fits, by name."""
        return self.identification.misfit

    @property
    def notes(self) -> tuple[str, ...]:
        """What the user must know, one sentence each."""
        return self.identification.notes

    @property
    def findings(self) -> tuple[Finding, ...]:
        """What the doctor found in the logs."""
        return tuple(f for s in self.sources for f in s.findings)

    @cached_property
    def answers(self) -> Answers:
        """What the friction is, whether it can be trusted, what to do now."""
        return self.answers_with("model.toml")

    @cached_property
    def pictures(self) -> tuple[Picture, ...]:
        """The report's pictures as plain numbers: the sliding curve with its band, the torque, the residuals."""
        from stickslip.report.answers import speeds_in
        from stickslip.report.axis_pictures import pictures_of

        return pictures_of(self.identification, speeds_in([s.record for s in self.sources if not s.held_out]))

    @arguments_checked
    def answers_with(self, model_file: str | os.PathLike[str]) -> Answers:
        """The same, its commands for a model that lies in `model_file`."""
        fitted = [s for s in self.sources if not s.held_out]
        return answers_of(self.identification, [s.record for s in fitted], Path(model_file), files_of(fitted))

    def __getitem__(self, name: str) -> Estimate:
        return self.identification[name]

    # ---- files ----------------------------------------------------------------------------------------------------

    @arguments_checked
    def save(self, path: str | os.PathLike[str] = "model.toml") -> Path:
        """Write the model with axis, intervals, correlation and data, as `recommend`, `export` and `compare` take it.

        Parameters
        ----------
        path : path
            Of a file that ends in .toml, or a folder, which then holds model.toml.

        Raises
        ------
        InputError
            If there is neither a whole law nor a map over the angle, or the file cannot be written.
        """
        target = Path(path)
        target = target if target.suffix == ".toml" else target / "model.toml"
        prepared_folder(target.parent)
        made = write_model(
            target, self.identification, data=self._data, law=self.law_file, more=self._recorded()
        )
        own_files.written([made])
        return made

    @arguments_checked
    def report(
        self, path: str | os.PathLike[str] = "report.html", model_file: str | os.PathLike[str] | None = None
    ) -> Path:
        """Write the report, one HTML file: what the friction is, whether it can be trusted, pictures, what to do.

        Parameters
        ----------
        path : path
        model_file : path, optional
            As its commands name the model; model.toml beside the report unless given.

        Raises
        ------
        InputError
            If it cannot be written.
        """
        prepared_folder(Path(path).parent)
        made = write_identification(
            path, self.identification, self.sources, versions=versions(), model_file=model_file
        )
        own_files.written([made])
        return made

    def identified(self) -> Identified:
        """What reading the saved model gives, without a file.

        Raises
        ------
        InputError
            If there is no whole law.
        """
        with allow_code(bool(self.law_file)):  # it was named, and has run
            return identified_in(self.table())

    def table(self) -> Table:
        """The content of the model's file."""
        law = os.path.realpath(self.law_file) if self.law_file else ""
        return in_memory(model_content(self.identification, self._data, law, self._recorded()))

    @property
    def _data(self) -> list[Mapping[str, Any]]:
        return [s.about for s in self.sources]

    def _recorded(self) -> dict[str, Any]:
        """How far the numbers can be trusted; and what the records hold besides friction: the first motion, the speeds,
        the side of the gear."""
        fitted = [s for s in self.sources if not s.held_out and "position" in s.record.channels]
        out: dict[str, Any] = self.answers.as_dict()
        if fitted and (speeds := speeds_of([s.record for s in fitted])):
            out["speeds"] = speeds
        tables = [s.record["velocity"] for s in self.sources if is_steady_table(s.record)]
        if tables and (speeds := speeds_in(np.concatenate(tables))):
            out["speeds"] = speeds
        for source in fitted:
            try:
                out["trajectory"] = motion_of(source.record, source.name).table()
                break
            except InputError:
                continue
        drive: dict[str, Any] = fitted[0].record.meta.get("reading", {}).get("drive", {}) if fitted else {}
        if "gear_ratio" in drive:
            out["axis"] = {"seen_from": drive.get("side", "motor"), "gear_ratio": float(drive["gear_ratio"])}
        return out

    # ---- words ----------------------------------------------------------------------------------------------------

    def as_dict(self) -> dict[str, Any]:
        """Law, estimates, correlation, misfit and sentences as plain data; ``trust`` is `verdict`, ``doubts`` what it
        names against the numbers (empty where nothing speaks against them), ``evidence`` why."""
        return {**self.identification.as_dict(), **self.answers.as_dict()}

    def to_pandas(self) -> pandas.DataFrame:
        """The parameters as a data frame: value, lower, upper, std, unit, identified, verdict.

        What the table calls not determined has no value (NaN) and no limits (0 and infinity).

        Raises
        ------
        InputError
            Without pandas, which `pip install 'stickslip[pandas]'` brings.
        """
        pandas = needed("pandas", "pandas", "to_pandas() needs")
        columns = ("value", "lower", "upper", "std", "unit", "identified", "verdict")
        told = (_limitless(e) if e.undetermined else e for e in self.identification.estimates)
        rows = {e.name: [getattr(e, c) for c in columns] for e in told}
        return pandas.DataFrame.from_dict(rows, orient="index", columns=list(columns))

    def summary(self) -> str:
        """Estimates with 95 % intervals, what is not identified and why, how far the torque is off, what to do now."""
        return "\n".join(result_lines_in_python(self.identification, self.answers))

    def __str__(self) -> str:
        return self.summary()

    def __repr__(self) -> str:
        law = f", law {self.identification.model.law.name!r}" if self.identification.model else ""
        good = sum(e.identified for e in self.identification.estimates)
        return f"<IdentificationResult: method {self.method!r}{law}, {good} of {len(self.parameters)} identified>"

    def _repr_html_(self) -> str:
        """A table in a notebook, and what it is worth."""
        cells = [*map(_cells, self.identification.estimates), *map(_given, self.identification.held)]
        rows = "".join(f"<tr>{''.join(f'<td>{escape(c)}</td>' for c in row)}</tr>" for row in cells)
        law = f": law {self.identification.model.law.name}" if self.identification.model else ""
        head = "".join(f"<th>{h}</th>" for h in ("parameter", "value", "95 % interval", "unit", "verdict"))
        more = "".join(f"<li>{escape(s)}</li>" for s in (*self.evidence, *self.answers.friction))
        return (
            f"<div><b>{escape(self.method.replace('_', ' ') + law)}</b>"
            f"<table><thead><tr>{head}</tr></thead><tbody>{rows}</tbody></table>"
            f"<p>Trust: {escape(self.verdict)}</p><ul>{more}</ul></div>"
        )


def _limitless(e: Estimate) -> Estimate:
    return replace(e, value=math.nan, std=math.nan, lower=0.0, upper=math.inf)


def _given(h: Held) -> tuple[str, ...]:
    return h.name, f"{h.value:.5g}", "", h.unit, "given"


def _cells(e: Estimate) -> tuple[str, ...]:
    value = "not determined" if e.undetermined or math.isnan(e.value) else f"{e.value:.5g}"
    verdict = "identified" if e.identified else f"not identified: {e.verdict or 'not determined by the data'}"
    return e.name, value, interval_text(e), e.unit, verdict
