"""A mixture whose alternatives are known: nothing else is weighed, and its intervals are narrower."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from stickslip.core.errors import InputError, UnknownName
from stickslip.identification.experiment import Experiment
from stickslip.identification.search import Asked
from stickslip.identification.sliding import estimate_sliding
from stickslip.machines.servo import ServoAxis

AXIS = ServoAxis(drive_side="load")


@pytest.fixture(scope="module")
def cogging(logs: Any) -> Any:
    """An axis with three orders of cogging on production moves."""
    return logs.draw(4711, imperfection="cogging", duration=6.0)


def record(log: Any) -> Experiment:
    return Experiment("log", log.time, log.position, log.torque)


def test_only_the_named_alternatives_are_present(cogging: Any) -> None:
    levels = {f"cogging {order:.4g}": 1 for order in cogging.machine.orders}
    known = estimate_sliding([record(cogging)], AXIS, Asked(levels=levels))
    assert all(m.on == frozenset(levels) for m in known.members)
    assert sorted(w for w, _ in known.waves) == pytest.approx(np.sort(cogging.machine.orders))
    inferred = estimate_sliding([record(cogging)], AXIS)
    assert known.numbers["fc"].half < inferred.numbers["fc"].half


def test_an_unknown_alternative_or_level_is_refused(cogging: Any) -> None:
    with pytest.raises(UnknownName, match="did you mean 'play'"):
        estimate_sliding([record(cogging)], AXIS, Asked(levels={"plya": 1}))
    with pytest.raises(InputError, match="play: level 2; it has 0 to 1"):
        estimate_sliding([record(cogging)], AXIS, Asked(levels={"play": 2}))
