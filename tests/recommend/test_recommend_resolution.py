"""Which encoder a recommendation was simulated with, and where it is from."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from test_inertia_alone import identified

import stickslip as ss
from stickslip.control.recommended import read_recommended
from stickslip.core.errors import ParameterError
from stickslip.core.messages import render
from stickslip.core.record import Record
from stickslip.machines.contact import Contact
from stickslip.machines.encoder import Encoder
from stickslip.machines.machine import Machine
from stickslip.models.model import Model
from stickslip.recommendation import recommend as recommending
from stickslip.recommendation.recommend import Drive
from stickslip.recommendation.resolution import encoder_for
from stickslip.verbs import recommend as verb
from stickslip.verbs.identify import about

COUNT = 2.0 * math.pi / 36000


def seen(*steps: float):
    """A model of records whose positions have these steps, rad."""
    data = tuple({"file": f"log{i}.csv", "position_step": step} for i, step in enumerate(steps))
    return replace(identified(0.1, 0.02), data=data)


@pytest.fixture
def few(monkeypatch: pytest.MonkeyPatch) -> None:
    """One gain, so that a recommendation is quick."""
    monkeypatch.setattr(recommending, "GAINS", (0.8,))
    monkeypatch.setattr(recommending, "LEADS", (0.0,))
    monkeypatch.setattr(recommending, "BEYOND", ())


def test_the_step_of_the_log_is_the_encoder_unless_one_is_given() -> None:
    counts, source = encoder_for(seen(COUNT), None)
    assert counts == 36000
    assert source.startswith("the position step of the record log0.csv (0.000175 rad)")
    assert "give counts_per_rev" in render(source)
    assert encoder_for(seen(COUNT), 4096.0) == (4096.0, "as given")
    assert encoder_for(seen(COUNT), 0.0) == (0.0, "as given")
    assert encoder_for(seen(COUNT), None, None, 1e6) == (1e6, "that of the controller")
    machine = Machine("mine", 1e-3, Contact(Model("coulomb", fc=0.1)), encoder=Encoder(8192.0))
    assert encoder_for(seen(COUNT), None, machine) == (8192.0, "that of the machine mine")
    # Of several records the coarsest.
    assert encoder_for(seen(COUNT, 2.0 * math.pi / 65536), None)[0] == 36000


@pytest.mark.parametrize("step", [math.nan, 0.0, -1.0, math.inf, "0.1"])
def test_without_a_step_exact_positions_are_assumed_and_said(step) -> None:
    for found in (identified(0.1, 0.02), seen(step)):
        counts, source = encoder_for(found, None)
        assert counts == 0.0
        assert source.startswith("assumed, as the model does not contain the position step")


def test_identify_keeps_the_step_of_the_position() -> None:
    t = np.arange(0.0, 1.0, 1e-3)
    angle = np.sin(2.0 * math.pi * t)
    coarse = Record(t, {"position": COUNT * np.round(angle / COUNT)}, {"position": "rad"})
    assert about(coarse)["position_step"] == pytest.approx(COUNT)
    assert "position_step" not in about(Record(t, {"position": angle}, {"position": "rad"}))


@pytest.mark.usefixtures("few")
@pytest.mark.parametrize(
    ("given", "counts", "said"),
    [
        ({}, 36000.0, "an encoder of 36000 counts per revolution, the position step of the record log0.csv"),
        ({"counts_per_rev": 8192}, 8192.0, "an encoder of 8192 counts per revolution, as given"),
        ({"counts_per_rev": 0}, 0.0, "exact positions, as given"),
    ],
)
def test_the_result_and_its_file_state_the_encoder(
    given, counts, said, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(verb, "identified_of", lambda _: seen(COUNT))
    advice = ss.recommend(tmp_path / "model.toml", bandwidth=20.0, amplitude=0.5, axes=1, confirm=1, **given)
    (note,) = [n for n in advice.notes if n.startswith(f"Simulated with {said}")]
    assert note in advice.details
    assert advice.as_dict()["drive"]["encoder_counts"] == counts
    assert advice.loop.encoder_counts == counts
    file = advice.save(tmp_path / "recommended.toml")
    assert read_recommended(file).encoder_counts == counts
    assert f"Simulated with {said}" in file.read_text()


def test_counts_that_no_encoder_has_are_refused() -> None:
    for wrong in (math.nan, math.inf, -1.0):
        with pytest.raises(ParameterError, match="encoder_counts"):
            Drive(amplitude=1.0, encoder_counts=wrong)
