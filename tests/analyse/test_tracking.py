"""Metrics of tracking on motions whose answers are known, and the statements' own consistency."""

from __future__ import annotations

import math

import numpy as np
import pytest

from stickslip.analyse.tracking import METRICS, tracking_metrics
from stickslip.core.record import Record
from stickslip.thesis.rig_claims import CLAIMS, MAIN, judge

TIME = np.arange(5000) / 1000.0
WANTED = 0.01 * (1.0 - np.cos(2.0 * math.pi * 0.4 * TIME))
SPEED = 0.01 * 0.8 * math.pi * np.sin(2.0 * math.pi * 0.4 * TIME)


def metrics(position, torque=0.0, limit=math.inf, wanted=WANTED, speed=SPEED):
    channels = {
        "position": position, "position_reference": wanted, "velocity_reference": speed,
        "torque_command": torque + 0.0 * TIME,
    }  # fmt: skip
    return tracking_metrics(Record(TIME, channels, dict.fromkeys(channels, "-")), limit)


def test_a_perfect_run_has_no_error():
    found = metrics(WANTED)
    assert set(found) == set(METRICS)
    assert found["position_rms_rad"] == 0.0
    assert found["sticking_share"] == 0.0
    assert found["ended_s"] == pytest.approx(4.999)


def test_oscillation_is_told_from_error():
    found = metrics(
        WANTED - 2e-3 * np.cos(2.0 * math.pi * 0.4 * TIME) + 3e-4 * np.sin(2.0 * math.pi * 246.0 * TIME)
    )
    assert found["position_above_5Hz_rms_rad"] == pytest.approx(3e-4 / math.sqrt(2.0), rel=0.02)
    assert found["smooth_error_rms_rad"] == pytest.approx(2e-3 / math.sqrt(2.0), rel=0.02)
    assert found["strongest_Hz"] == pytest.approx(246.0, abs=2.0)


def test_an_axis_that_stands_sticks():
    assert metrics(0.0 * TIME)["sticking_share"] == 1.0
    half = np.where(TIME < 2.5, WANTED, 0.0)
    assert metrics(half)["sticking_share"] == pytest.approx(0.5, abs=0.05)


def test_saturation_and_response():
    wanted = 0.01 * (1.0 - np.exp(-TIME / 0.02))
    slow = 0.01 * (1.0 - np.exp(-TIME / 0.5))
    found = metrics(slow, torque=1.0, limit=1.0, wanted=wanted, speed=np.gradient(wanted, TIME))
    assert found["saturated_share"] == 1.0
    assert found["response_time_s"] == pytest.approx(0.5 * math.log(10.0), abs=2e-3)
    assert metrics(0.0 * TIME, wanted=wanted, speed=0.0 * TIME)["response_time_s"] == math.inf


def test_every_statement_is_judged_and_every_main_one_exists():
    ids = [claim.id for claim in CLAIMS]
    assert len(set(ids)) == len(ids)
    assert {id for parts in MAIN.values() for id in parts} <= set(ids)

    class Nothing:
        def metric(self, rule, case, name):
            raise KeyError(case)

        def record(self, rule, case):
            raise KeyError(case)

    assert all(v.holds is None for v in judge(Nothing(), "as it is", CLAIMS).values())


@pytest.mark.parametrize("claim", CLAIMS, ids=lambda c: c.id)
def test_every_statement_can_hold_and_can_fail(claim):
    """Random numbers in place of runs: a predicate that always says the same would judge nothing."""
    rng = np.random.default_rng(7)
    seen = set()
    for experiment in range(3000):
        spread = (0.05, 1.0, 3.0)[experiment % 3]  # close cases, mixed ones, far ones
        base = 10.0 ** rng.uniform(-6.0, 0.5)
        numbers: dict[tuple[str, str], float] = {}

        class Drawn:
            def metric(self, rule, case, name, numbers=numbers, base=base, spread=spread):
                if name == "strongest_Hz":
                    return numbers.setdefault((case, name), float(rng.uniform(0.0, 500.0)))
                drawn = base * 10.0 ** float(rng.normal(0.0, spread)) if rng.random() < 0.95 else 0.0
                return numbers.setdefault((case, name), drawn)

        holds = judge(Drawn(), "as it is", [claim])[claim.id].holds
        seen.add(holds)
        if seen >= {True, False}:
            return
    assert seen >= {True, False}
