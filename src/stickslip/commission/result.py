"""All that commissioning found: estimates of every stage under one law, notes, pictures."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from stickslip.commission.recommended import TrackedRecommendation, picture_of_candidates, picture_of_tracking
from stickslip.identification.estimate import Estimate, Identification, Picture
from stickslip.machines.angle import AngleMap
from stickslip.machines.position_map import PositionMap
from stickslip.models.model import Model
from stickslip.rigs.procedures.base import Performed
from stickslip.simulation.recorded_input.simulation import Mechanics

Array = np.ndarray[Any, np.dtype[np.float64]]


@dataclass(frozen=True, eq=False)
class Stage:
    """One procedure with what was identified from its record; `found` is None where that was impossible, and `note`
    says why."""

    name: str
    performed: Performed
    found: Identification | None
    note: str = ""


def result_of(
    stages: Sequence[Stage], model: Model, j: float, stiffness: float, said: tuple[str, ...], angle: AngleMap,
    recommended: TrackedRecommendation | None, the_map: PositionMap | None = None,
) -> Identification:  # fmt: skip
    """All that the stages found, as one identification of the joined law."""
    estimates: list[Estimate] = []
    pictures: list[Picture] = []
    notes: list[str] = [
        f"Total pre-sliding stiffness at the encoder: {stiffness:.4g} N·m/rad{doubt(stages)}. It is that of the "
        "contact in series with all that twists between it and the encoder; the springs of the model are this.",
        "The sliding curve is the mean of both directions.",
        *said,
        *(recommended.lines() if recommended else ()),
    ]
    misfit: dict[str, float] = {}
    for i, stage in enumerate(stages):
        again = any(s.performed is stage.performed for s in stages[:i])
        failed = [c for c in stage.performed.checks if not c.passed and not again]
        notes += [f"{stage.name}: {c.name}: {c.text}" for c in failed]
        if stage.found is None:
            notes.append(f"{stage.name}: {stage.note}.")
            continue
        estimates += [owned(stage, e, model) for e in stage.found.estimates]
        pictures += stage.found.pictures
        if stage.name != "resonance":  # `TrackedRecommendation.lines` says it
            notes += [f"{stage.name}: {n}" for n in stage.found.notes]
        misfit |= {f"{stage.name}_{k}": float(v) for k, v in stage.found.misfit.items()}
    if recommended and recommended.advice.chosen:
        pictures += [picture_of_candidates(recommended), picture_of_tracking(recommended)]
    correlation = blocks([s.found for s in stages if s.found])
    return Identification(
        "commission", model, tuple(estimates), correlation, misfit, tuple(notes), (), tuple(pictures),
        {"mechanics": Mechanics(j), "stiffness": stiffness, "angle": angle, **({"map": the_map} if the_map else {})},
    )  # fmt: skip


def doubt(stages: Sequence[Stage]) -> str:
    """Why the stiffness is not identified; empty where it is."""
    found = [s.found["stiffness"] for s in stages if s.name == "presliding" and s.found is not None]
    return "".join(f" (not identified: {e.verdict})" for e in found if not e.identified)


OF_THE_LAW = ("sliding", "presliding", "attraction")
"""Stages whose estimates are parameters of the law, so that sweeps, recommendations and comparisons know them."""


def owned(stage: Stage, e: Estimate, model: Model) -> Estimate:
    """Under the law's own name where it is its parameter; else with that of the stage before its own."""
    own = stage.name in OF_THE_LAW and e.name.partition("[")[0] in {f.name for f in model.law.fields}
    if own and e.name == "c":
        # Within the range that the record allows a rule may have chosen another than the least misfit does.
        return dataclasses.replace(e, value=float(model.parameters.c))
    # The rotations' own inertia is what they need of it, not the machine's.
    whole = e.name == "inertia" and stage.name != "cogging"
    return e if own or whole else dataclasses.replace(e, name=f"{stage.name}.{e.name}")


def blocks(found: Sequence[Identification]) -> Array:
    """Correlation of all estimates: the stages' own, and none between stages, whose records are others."""
    sizes = [len(f.estimates) for f in found]
    whole, begin = np.eye(sum(sizes)), 0
    for f, size in zip(found, sizes, strict=True):
        if f.correlation.shape == (size, size):
            whole[begin : begin + size, begin : begin + size] = f.correlation
        begin += size
    return whole
