"""stickslip identify: which signal is the drive's, what else is known of it, and where it is recorded."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from stickslip.cli import main
from stickslip.identification.experiment import Experiment
from stickslip.simulation.recorded_input.simulation import Drive, Loop, Mechanics, drive_axis
from support import axis_cases as cases

TIME = np.arange(0.0, 4.0, 1e-3)
FAST = ["--no-report", "--force", "--json"]


@pytest.fixture(autouse=True)
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("STICKSLIP_CONFIG", str(tmp_path / "config"))


def written(name: str, **columns: np.ndarray) -> str:
    head = ",".join(columns)
    np.savetxt(name, np.stack(list(columns.values()), axis=1), "%.9g", ",", header=head, comments="")
    return name


def run(loop: Loop, supply: np.ndarray | None = None, gain: float = 1.0, seed: int = 0) -> np.ndarray:
    """Position of an axis under a loop whose output times the supply times a gain is the torque."""
    drive = Drive(TIME, cases.wanted(TIME, seed), "feedback", loop, supply, max_step=2e-4)
    mechanics = Mechanics(cases.INERTIA, drive_gain=gain, back_emf=gain * 0.05 if gain != 1.0 else 0.0)
    return drive_axis(mechanics, cases.model("coulomb"), drive)[:, 0]


def found(capsys: pytest.CaptureFixture[str]) -> dict[str, float]:
    return {e["name"]: e["value"] for e in json.loads(capsys.readouterr().out)["estimates"]}


@pytest.fixture(scope="module")
def duty() -> tuple[np.ndarray, np.ndarray]:
    """Position and supply voltage of a loop that commands a duty cycle: kt / R = 0.05 / 0.1."""
    supply = 7.4 - 0.2 * np.abs(np.sin(TIME))
    return run(Loop(kp=1.5, kd=0.02, kr=0.02, limit=1.0), supply, 0.5), supply


def servo(duty: tuple[np.ndarray, np.ndarray]) -> str:
    position, supply = duty
    reference = cases.wanted(TIME, 0)
    return written(
        "servo.csv", timestamp=TIME, position=position, goal_position=reference, input_volts=supply
    )


def test_the_supply_is_no_drive_signal(duty, capsys):
    assert main(["doctor", servo(duty)]) == 0
    assert "supply" in capsys.readouterr().out
    assert main(["identify", servo(duty), *FAST, "--inverse"]) == 2
    assert "neither the drive's signal" in capsys.readouterr().err


def test_a_duty_cycle_times_the_supply_over_the_resistance(duty, capsys):
    motor = ["--torque-constant", "0.05", "--resistance", "0.1"]
    loop = ["--loop", "kp=1.5,kd=0.02,kr=0.02,limit=1"]
    assert main(["identify", servo(duty), *FAST, "--inverse", *motor, *loop]) == 0
    values = found(capsys)
    assert values["fc"] == pytest.approx(cases.FC, rel=0.05)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--torque-constant", "0.05"], "--torque-constant 0.05 would not be used: the drive's signal is a torque"),
        (["--loop-output", "current"], "needs torque_constant; give --torque-constant, or --drive-gain"),
        (["--torque-constant", "0.05", "--loop-output", "voltage"], "needs resistance; give --resistance"),
        (["--drive-gain", "2", "--resistance", "3"], "--resistance 3 would not be used"),
    ],
)  # fmt: skip
def test_a_motors_constant_is_used_or_refused(duty, capsys, options, said):
    loop = ["--map", "supply=none", "--loop", "kp=1.5,kd=0.02,kr=0.02,limit=1"]
    assert main(["identify", servo(duty), *FAST, "--inverse", *loop, *options]) == 2
    assert said in capsys.readouterr().err


def linear(position: np.ndarray, **columns: np.ndarray) -> str:
    return written("linear.csv", **{"time [s]": TIME, "position [m]": position, **columns})


def test_the_force_constant_drives_a_linear_axis_by_its_voltage(duty, capsys):
    """It was read and nothing else, so that a voltage asked for a torque constant, which a linear motor has not."""
    position, supply = duty
    loop = ["--loop", "kp=1.5,kd=0.02,kr=0.02,limit=1", "--resistance", "0.1"]
    reference = cases.wanted(TIME, 0)
    log = linear(position, **{"position_reference [m]": reference, "supply [V]": supply})
    assert main(["identify", log, *FAST, "--inverse", *loop]) == 2
    assert "of a linear motor --force-constant" in capsys.readouterr().err
    for force in (["--force-constant", "0.05"], []):  # the second time it is the saved profile's
        assert main(["identify", log, *FAST, "--inverse", *loop, *force]) == 0
        assert found(capsys)["fc"] == pytest.approx(cases.FC, rel=0.05)


def test_what_a_profile_kept_of_a_motor_that_turns_is_neither_used_nor_told(duty, capsys):
    log = linear(duty[0], **{"current [A]": np.sign(np.gradient(duty[0]))})
    main(["doctor", log, "--torque-constant", "0.1", "--lead", "5"])
    capsys.readouterr()
    main(["doctor", log, "--force-constant", "3"])
    said = capsys.readouterr().out
    assert "current x force constant 3 N/A" in said
    assert "lead = " not in said


def test_a_force_constant_that_is_not_used_is_refused(duty, capsys):
    position = duty[0]
    log = linear(position, **{"motor_torque [N]": np.sign(np.gradient(position))})
    assert main(["identify", log, *FAST, "--inverse", "--force-constant", "3"]) == 2
    assert "--force-constant 3 would not be used: the drive's signal is a torque" in capsys.readouterr().err
    assert main(["identify", servo(duty), *FAST, "--inverse", "--force-constant", "3", "--loop", "kp=1"]) == 2
    assert (
        "--force-constant 3 is a linear motor's, and the record's positions are angles"
        in capsys.readouterr().err
    )


def test_a_current_of_a_linear_axis_asks_for_its_force_constant(duty, capsys):
    log = linear(duty[0], **{"current [A]": np.sign(np.gradient(duty[0]))})
    for verb in (["doctor"], ["identify", "--method", "sliding"]):
        assert main([*verb, log]) == 2
        streams = capsys.readouterr()
        assert "--force-constant" in streams.out + streams.err


def test_a_constant_voltage_is_taken_for_the_supply(duty, capsys):
    assert main(["doctor", servo(duty), "--map", "voltage=input_volts", "--map", "supply=none"]) == 0
    assert "say --map supply=input_volts --map voltage=none" in capsys.readouterr().out


def test_records_of_several_loops_in_one_fit(capsys):
    loops = (Loop(kp=8.0, kd=0.08, kr=0.08), Loop(kp=3.0, kd=0.05, kr=0.05))
    for number, loop in enumerate(loops):
        position, reference = run(loop, seed=number), cases.wanted(TIME, number)
        written(f"{number}.csv", time=TIME, position=position, reference=reference)
    texts = [f"kp={loop.kp},kd={loop.kd},kr={loop.kr}" for loop in loops]
    fit = ["identify", "0.csv", "1.csv", *FAST, "--inverse"]
    assert main([*fit, "--loop", texts[0], "--loop", texts[1]]) == 0
    values = found(capsys)
    assert values["fc"] == pytest.approx(cases.FC, rel=0.03)
    assert main([*fit, "--loop", texts[0]]) == 0
    assert abs(found(capsys)["fc"] / cases.FC - 1.0) > 0.1
    assert main(["identify", "0.csv", "1.csv", "0.csv", *FAST, "--loop", texts[0], "--loop", texts[1]]) == 2
    assert "--loop is given 2 times for 3 LOGs" in capsys.readouterr().err


@pytest.fixture(scope="module")
def axis() -> Experiment:
    return cases.experiment("coulomb", noise=2e-3, seconds=4.0)


def test_a_known_torque_beside_the_recorded_one(axis, capsys):
    known = 0.1 * np.sin(3.0 * axis.time)
    table = {"time [s]": axis.time, "position [rad]": axis.position, "torque [Nm]": axis.drive - known}
    written("log.csv", **table, **{"compensation_torque [Nm]": known})
    fit = ["identify", "log.csv", *FAST, "--inverse"]
    off = []
    for options in ([], ["--extra-torque", "compensation_torque"]):
        assert main([*fit, *options]) == 0
        off.append(abs(found(capsys)["fc"] / cases.FC - 1.0))
    assert off[1] < 0.02 < off[0]
    assert main([*fit, "--extra-torque", "compensation"]) == 2
    assert "compensation_torque" in capsys.readouterr().err


def test_position_and_torque_in_two_files(axis, capsys):
    written("position.csv", **{"time [s]": axis.time, "position [rad]": axis.position})
    written("drive.csv", **{"t [ms]": 1e3 * axis.time[30:-20], "torque [Nm]": axis.drive[30:-20]})
    table = {"time [s]": axis.time, "position [rad]": axis.position, "torque [Nm]": axis.drive}
    written("one.csv", **{name: values[30:-20] for name, values in table.items()})
    assert main(["doctor", "position.csv", "--with", "drive.csv"]) == 0
    assert "motor_torque" in capsys.readouterr().out
    assert main(["identify", "position.csv", "--with", "drive.csv", *FAST, "--inverse"]) == 0
    two = found(capsys)
    assert main(["identify", "one.csv", *FAST, "--inverse"]) == 0
    assert two == pytest.approx(found(capsys), rel=1e-6)
    assert two["fc"] == pytest.approx(cases.FC, rel=0.03)
    assert main(["identify", "position.csv", "--with", "drive.csv", "--with", "drive.csv", *FAST]) == 2
    assert "--with is given 2 times for 1 LOGs" in capsys.readouterr().err
    assert main(["identify", "position.csv", "--with", "none.csv", *FAST]) == 2
    assert "none.csv" in capsys.readouterr().err
