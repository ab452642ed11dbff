"""Options that a method does not use are refused before a log is read, from the command line and from Python."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import stickslip as ss
from stickslip.cli import main
from stickslip.core.errors import InputError
from stickslip.identification.methods import METHODS, method_named

GIVEN: dict[str, tuple[dict[str, Any], list[str]]] = {
    "laws": ({"law": "coulomb"}, ["--law", "coulomb"]),
    "values": ({"values": {"fc": 1.0}}, ["--set", "fc=1"]),
    "frozen": ({"frozen": ["fc"]}, ["--freeze", "fc"]),
    "free": ({"free": ["fc"]}, ["--free", "fc"]),
    "noise": ({"noise": 0.1}, ["--noise", "0.1"]),
    "torque": ({"torque_channel": "sensor_torque"}, ["--torque", "sensor_torque"]),
    "elements": ({"elements": 2}, ["--elements", "2"]),
    "shares": ({"shares": "equal"}, ["--shares", "equal"]),
    "threshold": ({"threshold": 0.1}, ["--threshold", "0.1"]),
    "held_out": ({"hold_out": "other.csv"}, ["--hold-out", "other.csv"]),
    "inverse": ({"inverse": True}, ["--inverse"]),
    "per_direction": ({"per_direction": True}, ["--per-direction"]),
    "pendulum": ({"pendulum": True}, ["--pendulum"]),
    "drive_gain": ({"drive_gain": 2.0}, ["--drive-gain", "2"]),
    "resistance": ({"resistance": 2.0}, ["--resistance", "2"]),
    "loop": ({"loop": {"kp": 1.0}}, ["--loop", "kp=1"]),
    "loop_output": ({"loop_output": "current"}, ["--loop-output", "current"]),
    "extra_torque": ({"extra_torque": "load"}, ["--extra-torque", "load"]),
    "torque_is": ({"torque_is": "actual"}, ["--torque-is", "actual"]),
    "delay": ({"delay": 0.01}, ["--delay", "0.01"]),
    "harmonics": ({"harmonics": 2}, ["--harmonics", "2"]),
    "load": ({"load": True}, ["--load"]),
    "intervals": ({"intervals": "covariance"}, ["--intervals", "covariance"]),
    "robust": ({"robust": True}, ["--robust"]),
    "position_map": ({"position_map": True}, ["--position"]),
    "inertia": ({"inertia": 0.1}, ["--inertia", "0.1"]),
}


@pytest.mark.parametrize("method", METHODS)
def test_python_refuses_every_option_that_a_method_does_not_use(method: str) -> None:
    uses = method_named(method).uses
    assert uses <= {*GIVEN, "model"}
    for option, (argument, _) in GIVEN.items():
        with pytest.raises(InputError) as refused:
            ss.identify("none.csv", method=method, **argument)
        unused = f'method="{method}" does not use {next(iter(argument))}' in str(refused.value)
        assert unused == (option not in uses), (option, str(refused.value))


@pytest.mark.parametrize("method", ["axis", "sliding", "breakaway", "cogging"])
def test_the_command_line_refuses_them_too(method: str, capsys: pytest.CaptureFixture[str]) -> None:
    for option, (_, words) in GIVEN.items():
        if option in method_named(method).uses:
            continue
        assert main(["identify", "none.csv", "--method", method, *words]) == 2
        assert f"--method {method} does not use {words[0]}" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("option", "said"),
    [
        (["--robust"], "--inverse does not use --robust"),
        (["--free", "vs"], "--inverse does not use --free"),
        (["--law", "stribeck"], "fits law coulomb only, not stribeck"),
        (["--set", "fc=1"], "--set fc=.. would be ignored"),
        (["--inertia", "1"], "inertia cannot be held"),
    ],
)
def test_least_squares_refuse_what_only_the_simulation_uses(
    option: list[str], said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    t = np.arange(0.0, 20.0, 0.01)
    q, v, a = np.sin(t), np.cos(t), -np.sin(t)
    log = tmp_path / "log.csv"
    table = np.column_stack([t, q, 0.1 * a + 0.3 * np.sign(v) + 0.05 * v])
    np.savetxt(log, table, delimiter=",", header="time [s],position [rad],torque [Nm]", comments="")
    assert main(["identify", str(log), "--inverse", *option, "--out", str(tmp_path / "m.toml")]) == 2
    assert said in capsys.readouterr().err


def weighed(extra: str) -> dict[str, Any]:
    """Friction of 2 N·m and a known weight of 30 N·m, at constant velocities."""
    v = np.repeat([1.0, -1.0, 2.0, -2.0, 3.0, -3.0], 200)
    noise = 1e-2 * np.random.default_rng(0).standard_normal(v.size)
    return {
        "t": 0.01 * np.arange(v.size), "position": 0.01 * np.cumsum(v),
        "torque": 2.0 * np.sign(v) + 0.1 * v + 30.0 + noise,
        "compensation_torque": np.full(v.size, -30.0), "extra_torque": extra,
    }  # fmt: skip


def test_sliding_adds_a_known_torque() -> None:
    found = ss.identify(**weighed("compensation_torque"), method="sliding", law="coulomb")
    assert found["fc"].value == pytest.approx(2.0, abs=0.02)
    assert found["offset"].lower <= 0.0 <= found["offset"].upper
    assert found["offset"].identified
    with pytest.raises(InputError, match="unknown channel of extra_torque"):
        ss.identify(**weighed("weight"), method="sliding", law="coulomb")


def test_a_constant_that_multiplies_nothing_is_refused() -> None:
    with pytest.raises(InputError, match=r"torque_constant=0\.5 would not be used"):
        ss.identify(**weighed(""), method="sliding", law="coulomb", torque_constant=0.5)
