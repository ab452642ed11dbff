"""An integral that hunts within seconds at rest, which the short rest behind a motion does not show."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from test_recommend_axes import estimate

from stickslip.control.controller import Controller
from stickslip.control.linear import pid
from stickslip.identification.identified_file import Identified
from stickslip.machines.rigid import RigidAxis
from stickslip.models.model import Model, Reference
from stickslip.recommendation import long_rest
from stickslip.recommendation import recommend as recommending
from stickslip.recommendation.long_rest import HUNTS, hunts_with, integrates, unsure_at_rest
from stickslip.recommendation.recommend import Drive, recommend
from stickslip.simulation.closed_loop import simulate

INERTIA, COUNTS = 4e-3, 2.0**20
LAW = Model("stribeck_plain", fc=0.3, fs=0.5, vs=0.02, sigma2=0.02)
GAINS = pid(10.0, 40.0, 0.3)


@pytest.fixture
def few(monkeypatch):
    monkeypatch.setattr(recommending, "GAINS", (1.0,))
    monkeypatch.setattr(recommending, "LEADS", (0.0,))
    monkeypatch.setattr(recommending, "BEYOND", ())


def known(*told: str) -> Identified:
    sizes = {"fs": 0.01, "fc": 0.01, "sigma2": 0.05}
    own = [estimate(n, "N·m", getattr(LAW.parameters, n), s) for n, s in sizes.items()]
    own = [replace(e, identified=e.name in told or not told) for e in own]
    return Identified(Path("m.toml"), LAW, tuple(own), np.eye(len(own)), {"inertia": INERTIA})


@pytest.mark.usefixtures("few")
def test_an_integral_that_hunts_by_itself_is_told_with_its_swing():
    drive = Drive(gains=GAINS, amplitude=0.3, torque_limit=5.0, encoder_counts=COUNTS)
    advice = recommend(known(), drive, axes=1, confirm=2)
    assert advice.rings.startswith("at rest on 3 of 3 axes within 20 s (by up to ")
    assert "lower ki (40)" in advice.rings
    told = float(advice.rings.partition("by up to ")[2].split(" ", 1)[0])
    loop = Controller(GAINS, sample_time=1e-3, encoder_counts=COUNTS, torque_limit=5.0)
    run = simulate(RigidAxis(INERTIA, LAW), loop, Reference.table([0.0, 0.5, 60.0], [0.0, 0.1, 0.1]), 60.0)
    assert told == pytest.approx(np.ptp(run["position"][run.time > 30.0]), rel=0.15)


@pytest.mark.usefixtures("few")
def test_a_loop_without_an_integral_is_not_asked():
    drive = Drive(gains=replace_ki(0.0), amplitude=0.3, torque_limit=5.0, encoder_counts=COUNTS)
    advice = recommend(known(), drive, axes=1, confirm=2)
    assert advice.rings == ""
    assert not any("integral" in note for note in advice.notes)


def test_hunting_is_unsure_where_friction_at_rest_is_not_identified():
    loop = Controller(GAINS, sample_time=1e-3)
    assert integrates(loop)
    assert not unsure_at_rest(known(), loop)
    (said,) = unsure_at_rest(known("fc", "sigma2"), loop)
    assert "friction at rest (fs) is not identified" in said
    assert not unsure_at_rest(known("fc", "sigma2"), Controller(replace_ki(0.0), sample_time=1e-3))


def replace_ki(ki: float):
    """The same gains with another integral."""
    return GAINS._replace(ki=ki)


def test_a_compensator_that_wakes_an_integral_is_refused(monkeypatch):
    """What swings by half as much again as alone, or where nothing does alone, is the compensator's."""
    bench = SimpleNamespace(rested=[0.0, 0.01], linear=Controller(GAINS, sample_time=1e-3))
    for widest, said in ((0.014, ""), (0.016, HUNTS)):
        monkeypatch.setattr(long_rest, "swings_for_long", lambda *_, widest=widest: [0.0, widest])
        assert hunts_with(bench.linear, bench) == said
    bench.rested = []  # it has no integral part
    assert hunts_with(bench.linear, bench) == ""
