"""Position P around velocity PI: what it is on paper, against its limit, and in a study's file."""

from __future__ import annotations

import math
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import stickslip as ss
from stickslip.control.controller import Controller
from stickslip.control.linear import Cascade, Gains
from stickslip.core.errors import ConfigError, ParameterError
from stickslip.core.spec import Surroundings
from stickslip.studies.study import load_run
from support.sampled_text import Memory, sample, settings

LOOP = Cascade(kv=60.0, kvp=0.05, kvi=1.0)
T = 1e-3


def torques(controller: Controller, position: np.ndarray, wanted: np.ndarray, rate: np.ndarray) -> np.ndarray:
    """What the drive gives at every sample of a motion that it does not move itself."""
    n, m = settings(controller), SimpleNamespace(**dict.fromkeys(Memory._fields, 0.0))
    empty = SimpleNamespace()
    return np.array([
        sample(float(y), float(r), float(v), 0.0, n, m, empty, empty, SimpleNamespace(**Surroundings()._asdict()))
        for y, r, v in zip(position, wanted, rate, strict=True)
    ])  # fmt: skip


def test_the_torque_of_a_cascade_is_that_of_its_equations() -> None:
    """Written out once more in arrays: filtered differences, P, then PI."""
    t = T * np.arange(200)
    position, wanted, rate = 0.1 * np.sin(9.0 * t), 0.2 * np.sin(8.0 * t), 1.6 * np.cos(8.0 * t)
    loop = LOOP._replace(feed=0.7)
    found = torques(Controller(loop, sample_time=T, velocity_filter=80.0), position, wanted, rate)
    speed = np.concatenate([[0.0], np.diff(position) / T])
    keep = math.exp(-2.0 * math.pi * 80.0 * T)
    for k in range(1, t.size):
        speed[k] = (1.0 - keep) * speed[k] + keep * speed[k - 1]
    error = loop.kv * (wanted - position) + loop.feed * rate - speed
    np.testing.assert_allclose(found, loop.kvp * error + loop.kvi * T * np.cumsum(error), atol=1e-12)


def test_a_cascade_is_its_pid_where_nothing_limits_it() -> None:
    friction = ss.Model("coulomb", fc=0.2, sigma2=0.02)
    axis = ss.RigidAxis(inertia=4e-4, friction=friction)
    move = ss.Reference("scurve", distance=1.0, velocity=2.0, acceleration=20.0, jerk=400.0)
    ran = [
        ss.simulate(axis, Controller(gains, sample_time=T), move, 1.0)
        for gains in (LOOP, LOOP.pid, LOOP._replace(feed=0.0))
    ]
    one, other, lags = (run.meta["metrics"]["position_rms_rad"] for run in ran)
    assert one == pytest.approx(other, rel=0.03)
    assert lags > 1.5 * one


def test_the_integral_rests_at_the_limit() -> None:
    """A second against the stop, then the wish turns: the torque turns with it."""
    t = T * np.arange(1200)
    wanted = np.where(t < 1.0, 0.5, -0.05)
    limited = [
        torques(Controller(gains, None, 0.4, T), 0.0 * t, wanted, 0.0 * t) for gains in (LOOP, LOOP.pid)
    ]
    assert [turned[1050] for turned in limited] == [pytest.approx(-0.3, abs=0.1)] * 2
    assert [turned[990] for turned in limited] == [0.4] * 2


def test_a_cascade_needs_samples_which_a_machine_has() -> None:
    axis, slow = (
        ss.RigidAxis(1e-3, ss.Model("coulomb", fc=0.1)),
        ss.Reference("sine", amplitude=0.1, frequency=1.0),
    )
    for name, unsampled in (
        ("a cascade", Controller(LOOP)),
        ("a velocity_filter", Controller(Gains(1.0), velocity_filter=50.0)),
    ):
        said = f"{name} needs a sampled controller; give a sample_time greater than 0, or run it on a machine"
        with pytest.raises(ParameterError, match=said):
            ss.simulate(axis, unsampled, slow, 0.1)
    machine = ss.load_machine("thesis-dry")
    one, other = (
        ss.simulate(machine, Controller(LOOP, sample_time=time), slow, 0.2)["position"]
        for time in (0.0, machine.sample_time)
    )
    assert np.array_equal(one, other)
    with pytest.raises(ParameterError, match=r"velocity_filter = -1 Hz"):
        Controller(Gains(1.0), sample_time=T, velocity_filter=-1.0)


def test_a_study_reads_a_cascade(tmp_path: Path) -> None:
    text = (Path(__file__).parents[1] / "data" / "one_run.toml").read_text(encoding="utf-8")
    head, _, rest = text.partition("[controller]")
    tail = rest.partition("\n[")
    own = (
        "\ncascade = {kv = 60, kvp = 0.05, kvi = 1, feed = 0.5}\nsample_time = 1e-3\nvelocity_filter = 300\n"
    )
    path = tmp_path / "run.toml"
    path.write_text(f"{head}[controller]{own}\n[{tail[2]}" if tail[2] else f"{head}[controller]{own}")
    control = load_run(path).control
    assert control.gains == LOOP._replace(feed=0.5)
    assert control.velocity_filter == 300.0
    path.write_text(path.read_text().replace("sample_time", 'linear = "PD"\nsample_time'))
    with pytest.raises(ConfigError, match="cascade and linear exclude each other"):
        load_run(path)
