"""A recorded run played back."""

from __future__ import annotations

import numpy as np
import pytest
from test_loop import PD, sine

from stickslip.core.errors import ConfigError, InputError, LimitCrossed, RigError
from stickslip.core.record import Record
from stickslip.rigs.files import read_rig
from stickslip.rigs.kinds import rig_kind, rig_kind_names
from stickslip.rigs.loop import Loop
from stickslip.rigs.replay import Replay
from stickslip.rigs.rig import Limits, Rig, setpoints
from support.axis_rig import LIMITS, AxisRig


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    path = tmp_path_factory.mktemp("replay") / "run.stream"
    with Loop(AxisRig(), path=path) as loop:
        loop.run(sine(800), PD)
        loop.pause(5.0)
        loop.run(setpoints(100))
    return path


def test_the_same_controller_commands_the_same_torques_again(recorded):
    run = Record.load(recorded)
    with Loop(Replay(run, limits=LIMITS)) as loop:
        loop.run(sine(800), PD)
        loop.pause(5.0)
        loop.run(setpoints(99))
        again = loop.record()
    for name in ("position", "motor_torque", "torque_command", "sensor_torque", "temperature"):
        assert np.array_equal(again[name], run[name][: len(again)]), name
    assert np.array_equal(again.time, run.time[: len(again)])


def test_it_asks_whether_narrower_limits_would_have_held(recorded):
    speed = float(np.abs(Record.load(recorded)["velocity"]).max())
    with (
        pytest.raises(LimitCrossed, match="speed"),
        Loop(Replay(Record.load(recorded), limits=Limits(torque=1.0, speed=0.9 * speed))) as loop,
    ):
        loop.run(sine(800), PD)


def test_the_end_of_the_record_ends_the_run(recorded):
    with pytest.raises(RigError, match="the record has ended"), Loop(Replay(Record.load(recorded))) as loop:
        loop.run(sine(2000), PD)


def test_uneven_times_are_resampled():
    t = np.cumsum(np.random.default_rng(1).uniform(0.5e-3, 1.5e-3, 1000))
    record = Record(t, {"position": 2.0 * t}, {"position": "rad"})
    with Loop(Replay(record, sample_time=1e-3)) as loop:
        rows = loop.run(setpoints(900))
    assert np.allclose(np.diff(rows[:, 0]), 1e-3)
    assert np.allclose(rows[5:, 2], 2.0)


def test_from_a_file(recorded, tmp_path):
    path = tmp_path / "rig.toml"
    path.write_text(
        f'[rig]\nkind = "replay"\nfile = "{recorded}"\n[rig.limits]\ntorque = 1.0\nspeed = 60.0\n'
    )
    rig = read_rig(path)
    assert isinstance(rig, Rig)
    assert (rig.limits.torque, rig.limits.speed) == (LIMITS.torque, LIMITS.speed)
    assert rig.open().position == Record.load(recorded)["position"][0]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('[rig]\nkind = "repaly"', "did you mean 'replay'"),
        ('[rig]\nkind = "replay"', "file"),
        ('[rig]\nkind = "replay"\nfile = "none.stream"', "no file .*none.stream"),
        ("[rg]\n", "rig"),
    ],
)
def test_bad_files_are_refused_in_one_line(tmp_path, text, message):
    path = tmp_path / "rig.toml"
    path.write_text(text)
    with pytest.raises(InputError, match=message):
        read_rig(path)


@pytest.mark.parametrize("line", ["torque = -1.0", "speed = 0", "lowest_position = 1e9", "colour = 3"])
def test_bad_limits_are_refused(recorded, tmp_path, line):
    path = tmp_path / "rig.toml"
    path.write_text(
        f'[rig]\nkind = "replay"\nfile = "{recorded}"\n[rig.limits]\nhighest_position = 1.0\n{line}\n'
    )
    with pytest.raises(ConfigError, match="limits"):
        read_rig(path)


def test_every_registered_kind_is_there():
    for name in rig_kind_names():
        kind = rig_kind(name)
        assert kind.name == name
        assert kind.title
    with pytest.raises(InputError, match="unknown rig 'nothing'"):
        rig_kind("nothing")
