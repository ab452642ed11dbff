"""A feedback that rests by itself, and swings on once it is pushed."""

from __future__ import annotations

import numpy as np
import pytest

from stickslip.control.linear import Cascade
from stickslip.core.record import Record
from stickslip.identification.motion import motion_of
from stickslip.models.model import Model
from stickslip.recommendation.candidate_run import Drive
from stickslip.recommendation.candidates import AFTER_A_PUSH, Bench, Candidate, Setting
from stickslip.recommendation.plant import Plant
from stickslip.recommendation.pushed import PUSHED, pushes

INERTIA = 2.378e-3
LAW = Model("lugre", sigma0=1489.0, sigma1=1.385, fs=0.668, fc=0.4614, vs=0.0701, delta_s=2.0, sigma2=0.00644)
T = 1e-3


def drive() -> Drive:
    """A cascade with a filter, along two moves of a turn."""
    s = np.clip(T * np.arange(1500) / 0.5 - 0.2, 0.0, 1.0)
    one = s - np.sin(2.0 * np.pi * s) / (2.0 * np.pi)
    position = 6.0 * np.concatenate([one, one[-1] - one])
    record = Record(
        np.asarray(T * np.arange(position.size), dtype=np.float64),
        {"position": position},
        {"position": "rad"},
    )
    return Drive(
        gains=Cascade(kv=35.12, kvp=0.4131, kvi=10.88, feed=1.0), velocity_filter=500.0, sample_time=T,
        encoder_counts=262144, torque_limit=8.36, motion=motion_of(record),
    )  # fmt: skip


@pytest.fixture(scope="module")
def judged() -> dict[str, Candidate]:
    here = drive()
    plant = Plant(INERTIA, LAW, delay=0.5, bandwidth=800.0)
    bench = Bench([plant], here.loop(INERTIA), here, {"lugre": LAW})
    settings = {
        "feedback": Setting("lugre", "feedback", 0.5, deadband=0.036, inertia_feedforward=INERTIA),
        "weak": Setting("lugre", "feedback", 0.1, deadband=0.036, inertia_feedforward=INERTIA),
        "feedforward": Setting("lugre", "feedforward", 1.0, inertia_feedforward=INERTIA),
    }
    return {name: bench.judged(setting) for name, setting in settings.items()}


def test_a_feedback_that_swings_on_after_a_push_is_not_safe(judged: dict[str, Candidate]) -> None:
    """Such an axis went to and fro by 26 mrad at 1.9 Hz, with no more than noise in its current."""
    assert judged["feedback"].unsafe == (AFTER_A_PUSH,)


def test_what_a_push_does_not_keep_going_is_safe(judged: dict[str, Candidate]) -> None:
    assert judged["weak"].unsafe == ()
    assert judged["feedforward"].unsafe == ()


def test_a_push_ends_before_it_brings_an_axis_to_the_motions_own_speed() -> None:
    here = drive()
    heavy, light = (list(pushes(Plant(inertia, LAW), here)) for inertia in (INERTIA, 1e-5))
    assert [np.max(push) for push in heavy] == pytest.approx([0.5344, 0.668, 1.002, 1.336])
    assert [np.count_nonzero(push) for push in heavy] == [round(PUSHED / T)] * 4
    assert all(np.sum(push) * T <= here.path.top_speed * 1e-5 + 2.0 * 0.668 * T for push in light)
    assert list(pushes(Plant(INERTIA, Model("viscous", sigma2=0.1)), here)) == []
