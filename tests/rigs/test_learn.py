"""The procedure learn: its repetitions become better, and what it saves runs as a controller."""

from __future__ import annotations

import math
import tomllib
from dataclasses import replace

import numpy as np
import pytest
import tomli_w

from stickslip.core.errors import InputError
from stickslip.machines.files import machine
from stickslip.machines.motor import Harmonics
from stickslip.machines.position_map import PositionMap, Waves
from stickslip.rigs.procedures import procedure
from stickslip.rigs.procedures.base import perform, planned
from stickslip.rigs.procedures.learn import errors
from stickslip.rigs.virtual import VirtualRig, virtual_rig


def learn(**options):
    return procedure("learn").with_options({k: str(v) for k, v in options.items()})


def test_repetitions_become_better_and_the_best_table_is_saved(tmp_path):
    saved = tmp_path / "learned.toml"
    result = perform(learn(times=5, save=saved), virtual_rig("thesis-dry"))
    assert result.passed
    assert [label for label, _, _ in result.segments] == [f"repetition {i}" for i in range(1, 6)]
    each = errors(result.record, 10_000)
    assert each[-1] < 0.7 * each[0]
    track = procedure("track").with_options({"controller": str(saved), "reference": "high", "duration": "10"})
    record = perform(track, virtual_rig("thesis-dry")).record
    error = record["position_reference"] - record["position"]
    assert math.sqrt(float(np.mean(error**2))) < 0.8 * each[0]


def test_what_was_saved_is_replaced_by_the_same_learning_only(tmp_path):
    saved = tmp_path / "learned.toml"
    perform(learn(times=2, duration=10, save=saved), virtual_rig("thesis-dry"))
    kept = tomllib.loads(saved.read_text())
    assert 0.0 < kept["uncertainty"]["table"] < 0.1
    planned(learn(save=saved), virtual_rig("thesis-dry"))
    for options, rig, said in (
        ({"reference": "low", "duration": 5}, "thesis-dry", "with other reference"),
        ({}, "thesis-grease", "with other machine"),
    ):
        with pytest.raises(InputError, match=said):
            planned(learn(save=saved, **options), virtual_rig(rig))
    saved.write_text("[controller]\n")
    with pytest.raises(InputError, match="holds nothing that was learned, and is not overwritten"):
        planned(learn(save=saved), virtual_rig("thesis-dry"))


def cogging_of(own, folder):
    """A model.toml with the map of the machine's own cogging, as `identify --method cogging` writes one."""
    order, size, phase = (np.array(getattr(own.cogging, k)) for k in ("order", "amplitude", "phase"))
    size = -size  # what the drive must give against it
    waves = Waves(tuple(order), tuple(size * np.cos(phase)), tuple(-size * np.sin(phase)))
    path = folder / "model.toml"
    path.write_text(tomli_w.dumps({"position_map": PositionMap(even=waves).as_dict()}))
    return path


def test_over_the_angle_it_starts_from_an_identified_map_and_learns_what_that_leaves(tmp_path):
    strong = Harmonics((12.0, 24.0), (0.08, 0.03), (0.0, 0.7))
    own = replace(machine("thesis-dry"), cogging=strong)
    given, saved = cogging_of(own, tmp_path), tmp_path / "learned.toml"
    bare = errors(perform(learn(times=2, over="angle"), VirtualRig(own)).record, 10_000)
    result = perform(learn(times=5, over="angle", bins=48, map=given, save=saved), VirtualRig(own))
    each = errors(result.record, 10_000)
    assert result.passed
    assert each[0] < 0.95 * bare[0]
    assert each[-1] < 0.6 * each[0]
    kept = tomllib.loads(saved.read_text())
    laws = [b["law"] for b in kept["controller"]["feedforward"]]
    assert laws == ["position_feedforward", "table_feedforward"]
    for duration in ("10", "20"):  # over the angle it holds for another motion in its range as well
        track = procedure("track").with_options(
            {"controller": str(saved), "reference": "high", "duration": duration}
        )
        record = perform(track, VirtualRig(own)).record
        error = record["position_reference"] - record["position"]
        assert math.sqrt(float(np.mean(error**2))) < 0.7 * bare[0]


def test_learning_that_makes_it_worse_ends():
    result = perform(learn(times=6, corner=400, rate=1.9), virtual_rig("thesis-dry"))
    each = errors(result.record, 10_000)
    assert len(each) < 6
    assert each[-1] > 1.5 * min(each)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"reference": "step", "duration": 0}, "does not end where it starts"),
        ({"duration": 7.5}, "a duration of whole periods"),
        ({"times": 1}, "times = 1 must be at least 2"),
        ({"rate": 2}, "rate = 2 between 0 and 2"),
        ({"over": "angel"}, "unknown domain of learning 'angel'; did you mean 'angle'"),
        ({"over": "angle", "corner": 5}, "corner and advance belong to learning over time"),
        ({"over": "angle", "bins": 1}, "bins = 1 must be at least 2"),
        ({"map": "nowhere.toml"}, "nowhere.toml"),
    ],
)
def test_what_cannot_be_learned_is_refused(options, said):
    with pytest.raises(InputError, match=said):
        planned(learn(**options), virtual_rig("thesis-dry"))
