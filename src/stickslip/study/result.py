"""What a study returns: data only. `stickslip.report` renders it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from stickslip.record import Record


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


@dataclass(frozen=True)
class StudyResult:
    """A finished study.

    Attributes
    ----------
    folder : Path
        Where metrics.csv, metrics.parquet, manifest.json and records/ lie.
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
