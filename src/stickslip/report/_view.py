"""Access to a study's runs for the report and the claims."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from stickslip.core.record import Record
from stickslip.studies.result import Run, StudyResult
from stickslip.thesis.edition import EDITIONS, PLAIN


class StudyView:
    """Runs by key, names in the study's order, and the configuration of a controller."""

    def __init__(self, result: StudyResult) -> None:
        self.result = result
        self.edition = EDITIONS.get(str(result.manifest.get("study", "")), PLAIN)
        self.runs: dict[str, Run] = {run.key: run for run in (*result.runs, *result.extras)}
        self.rules = list(dict.fromkeys(run.slip_rule for run in result.runs))
        self.references = list(dict.fromkeys(run.reference for run in result.runs))
        self.frictions = list(dict.fromkeys(run.friction for run in result.runs))
        self.controllers = list(dict.fromkeys(run.controller for run in result.runs))
        self._compensations = {run.controller: run.compensation for run in self.runs.values()}

    def metric(self, rule: str, case: str, name: str) -> float:
        """Return one metric of a run; KeyError if it is missing or failed."""
        run = self.runs[f"{rule}/{case}"]
        if run.failure or name not in run.metrics:
            raise KeyError(f"{run.key} ({run.failure or 'no ' + name})")
        return run.metrics[name]

    def record(self, rule: str, case: str) -> Record:
        """Return the record of a run; KeyError if it is missing or failed."""
        run = self.runs[f"{rule}/{case}"]
        if run.failure:
            raise KeyError(f"{run.key} ({run.failure})")
        return run.record()

    def group(self, rule: str, reference: str, friction: str) -> list[Run]:
        """Return the runs of one reference and friction, in the study's order."""
        keys = (f"{rule}/{reference}/{friction}/{c}" for c in self.controllers)
        return [self.runs[key] for key in keys if key in self.runs]

    def compensation(self, controller: str) -> str:
        """Return `feedforward`, `feedback`, or the empty string for a linear controller alone."""
        return self._compensations.get(controller, "")

    def reference_kind(self, reference: str) -> str:
        """Return the kind of a reference, such as `sine`; the empty string if unknown."""
        return str(self._setting("references", reference).get("kind", ""))

    def _setting(self, family: str, name: str) -> Mapping[str, Any]:
        return self.result.config.get(family, {}).get(name, {})

    def kinds(self) -> Sequence[str]:
        """Return the structures of compensation in the study, feedforward first."""
        found = {self.compensation(c) for c in self.controllers}
        return [kind for kind in ("feedforward", "feedback") if kind in found]
