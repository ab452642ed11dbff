"""What a study returns: data only. `stickslip.report` renders it."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

from stickslip.core.extras import needed
from stickslip.core.record import Record

if TYPE_CHECKING:
    import pandas

ERROR = "position_rms_rad"
"""The metric that a printed result shows."""
SHOWN = 12
"""Runs that it shows, at most."""


def designed_for(manifest: Mapping[str, Any]) -> str:
    """For which inertias a study's controllers were designed, in a line; empty where it is one for all."""
    found = {run["run"].split("/")[2]: run.get("design_inertia_kg_m2", math.nan) for run in manifest["runs"]}
    if len(set(found.values())) < 2:
        return ""
    each = ", ".join(f"{axis} {inertia:g}" for axis, inertia in found.items())
    return f"gains that are placed, and inertias left out, are those of each axis: {each} kg·m²"


@dataclass(frozen=True)
class Run:
    """One run of a study, `slip_rule/reference/friction/controller`.

    Attributes
    ----------
    metrics : mapping of str to float
        As `stickslip.simulate` gives them, unit in the name; NaN where there is none. Empty if the run failed.
    path : Path
        The record's file.
    failure : str
        Why the run ended early, or the empty string.
    seconds : float
        CPU time of the run, s.
    depends_on_start : bool
        Whether a start 1e-9 rad beside takes another branch of the motion (`stickslip.simulation.accuracy`), so that
        its metrics are those of one branch; False where another integrator than the exact one ran it.
    compensation : str
        How the controller compensates friction, as `stickslip.studies.planned_run.PlannedRun.compensation` says.
    """

    slip_rule: str
    reference: str
    friction: str
    controller: str
    metrics: Mapping[str, float]
    path: Path
    failure: str = ""
    seconds: float = 0.0
    depends_on_start: bool = False
    compensation: str = ""

    @property
    def case(self) -> str:
        """`reference/friction/controller`, as the reference results name it."""
        return f"{self.reference}/{self.friction}/{self.controller}"

    @property
    def key(self) -> str:
        """`slip_rule/reference/friction/controller`."""
        return f"{self.slip_rule}/{self.case}"

    def record(self) -> Record:
        """The run's record."""
        return Record.load(self.path)


@dataclass(frozen=True, repr=False)
class StudyResult:
    """A finished study.

    Attributes
    ----------
    folder : Path
        Folder of metrics.csv, manifest.json and records/.
    runs : sequence of Run
        In the study's order: slip rule, reference, friction, controller.
    manifest : mapping
        Inputs with SHA-256, versions, configuration, timings.
    config : mapping
        The study's TOML as read.
    extras : sequence of Run
        Runs of the study's comparisons, which the table leaves out.
    """

    folder: Path
    runs: Sequence[Run]
    manifest: Mapping[str, Any]
    config: Mapping[str, Any]
    extras: Sequence[Run] = ()

    def __iter__(self) -> Iterator[Run]:
        return iter(self.runs)

    def find(self, key: str) -> Run:
        """The run of that key, `signed/low/nominal/PD`.

        Raises
        ------
        KeyError
        """
        for run in (*self.runs, *self.extras):
            if run.key == key:
                return run
        raise KeyError(key)

    def to_pandas(self) -> pandas.DataFrame:
        """A row a run: its names, every metric, why it failed; its comparisons' runs after the others.

        Raises
        ------
        InputError
            Without pandas, which `pip install 'stickslip[pandas]'` brings.
        """
        pandas = needed("pandas", "pandas", "to_pandas() needs")
        names = ("slip_rule", "reference", "friction", "controller")
        return pandas.DataFrame(
            [
                {**{name: getattr(run, name) for name in names}, **run.metrics, "failure": run.failure}
                for run in (*self.runs, *self.extras)
            ]
        )

    def _rows(self) -> list[tuple[str, str]]:
        """Name of each run, and its error or why it has none."""
        every = [*self.runs, *self.extras]
        return [(r.key, r.failure or f"{r.metrics.get(ERROR, math.nan):.4g}") for r in every[:SHOWN]]

    def __repr__(self) -> str:
        rows, count = self._rows(), len(self.runs) + len(self.extras)
        width = max((len(key) for key, _ in rows), default=0)
        lines = [f"{'run':<{width}}  {ERROR}", *(f"{key:<{width}}  {said}" for key, said in rows)]
        more = [f"and {count - SHOWN} more runs: to_pandas()"] if count > SHOWN else []
        return (
            "\n".join([f"<StudyResult: {count} runs in {self.folder}", *(f"  {x}" for x in lines + more)])
            + ">"
        )

    def _repr_html_(self) -> str:
        """A table in a notebook: the error of every run."""
        body = "".join(f"<tr><td>{escape(k)}</td><td>{escape(x)}</td></tr>" for k, x in self._rows())
        head = f"<tr><th>run</th><th>{ERROR}</th></tr>"
        return f"<table><thead>{head}</thead><tbody>{body}</tbody></table>"
