"""How files are read is kept in a profile, and what it says is told whenever it is used."""

from __future__ import annotations

from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest

from stickslip.cli import main


def test_a_saved_profile_is_never_used_in_silence(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("STICKSLIP_CONFIG", str(tmp_path / "config"))
    t = np.arange(1500) * 1e-3
    degrees = 0.3 * np.sin(2.0 * np.pi * t) * 180.0 / np.pi
    torque = 0.285 * np.sign(np.cos(2.0 * np.pi * t))
    np.savetxt(
        "log.csv",
        np.column_stack((t, degrees, torque)),
        "%.9g",
        ",",
        header="time [s],q,tau [N·m]",
        comments="",
    )
    calls = ["identify", "log.csv", "--inverse", "--out", "."]
    assert main([*calls, "--map", "position=q:deg", "--map", "torque=tau [N·m]:-N·m"]) == 2
    assert "friction would drive the axis" in capsys.readouterr().err
    assert not list((tmp_path / "config").rglob("*.toml"))  # what reads it wrongly is not kept
    assert main([*calls, "--map", "position=q:deg"]) == 0
    kept = next((tmp_path / "config" / "profiles").glob("*.toml"))
    first = capsys.readouterr()
    assert (
        f"how to read files with these columns is kept in the profile {kept}; delete that file" in first.err
    )
    assert main(calls) == 0
    second = capsys.readouterr()
    line = f"read by the saved profile {kept}, which says position=q:deg; delete that file to forget it"
    assert f"stickslip: log.csv: {line}" in second.err  # before the result, which may come of it
    assert line in (tmp_path / "report.html").read_text(encoding="utf-8")
    assert second.out == f"{first.out}profile: {kept}\n"
    assert main([*calls, "--map", "position=q:deg"]) == 0  # all that the profile says
    third = capsys.readouterr()
    assert "profile" not in third.err
    assert third.out == first.out
    assert main(["doctor", "log.csv"]) == 0
    assert line in capsys.readouterr().out
    kept.unlink()
    assert main(calls) == 0
    third = capsys.readouterr()
    assert "saved profile" not in third.err
    assert third.out != first.out


def test_the_numbers_of_a_saved_profile_are_shown_before_the_result_and_asked_about(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("STICKSLIP_CONFIG", str(tmp_path / "config"))
    t = np.arange(1500) * 1e-3
    q, current = 0.3 * np.sin(2.0 * np.pi * t), 2.0 * np.sign(np.cos(2.0 * np.pi * t))
    for name, size in (("small.csv", 1.0), ("large.csv", 9.0)):
        table, head = np.column_stack((t, q, size * current)), "time [s],q [rad],i [A]"
        np.savetxt(name, table, "%.9g", ",", header=head, comments="")
    calls = ["--inverse", "--no-report", "--force", "--out", "model.toml"]
    assert main(["identify", "small.csv", *calls, "--torque-constant", "0.05"]) == 0
    capsys.readouterr()
    assert main(["identify", "small.csv", *calls]) == 0
    streams = capsys.readouterr()
    assert "which says torque_constant = 0.05; delete that file to forget it" in streams.err
    assert "hold for this machine" not in streams.err
    assert main(["identify", "large.csv", *calls]) == 0
    streams = capsys.readouterr()
    asked = "a record of 0.1 N·m of torque, this one has 0.9: does torque_constant = 0.05 hold"
    assert asked in streams.err
    assert main(["identify", "large.csv", *calls, "--torque-constant", "0.2"]) == 0
    assert "hold for this machine" not in capsys.readouterr().err
    assert main(["identify", "small.csv", *calls]) == 0  # each file has what was said for it
    streams = capsys.readouterr()
    assert "which says torque_constant = 0.05; delete that file to forget it" in streams.err
    assert "not said for this file" not in streams.err + streams.out


@pytest.fixture
def two_axes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Files a.csv and b.csv of axes with the same columns: a position in mm, a torque in % of the rated one."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("STICKSLIP_CONFIG", str(tmp_path / "config"))
    t = np.arange(3000) * 1e-3
    way = 40.0 * np.sin(2.0 * np.pi * t)
    share = 20.0 * np.sign(np.cos(2.0 * np.pi * t))
    for name, size in (("a.csv", 1.0), ("b.csv", 1.1)):
        table = np.column_stack((t, size * way, share))
        np.savetxt(name, table, "%.9g", ",", header="time [s],ActPos [mm],ActTrq [%]", comments="")


@pytest.mark.usefixtures("two_axes")
def test_numbers_of_another_axis_are_a_warning_and_part_of_the_verdict(
    capsys: pytest.CaptureFixture[str],
) -> None:
    """A second file with the same columns took rated torque and lead of the first and was said to be identified."""
    calls = ["--inverse", "--no-report", "--force", "--out", "model.toml"]
    assert main(["identify", "a.csv", *calls, "--rated-torque", "2.39", "--lead", "10"]) == 0
    assert "2.39" not in capsys.readouterr().out
    assert main(["identify", "b.csv", *calls]) == 0
    streams = capsys.readouterr()
    told = f"rated_torque = 2.39 N·m, lead = 10 mm: not said for this file, but for a.csv on {datetime.now(UTC):%Y-}"
    trust = next(line for line in streams.out.splitlines() if line.startswith("trust: "))
    assert trust.startswith("trust: With care:")
    assert told in trust
    assert told in streams.err
    assert (
        "give this axis's own with --rated-torque NM --lead MM, or --rated-torque 2.39 --lead 10"
        in streams.err
    )
    assert main(["doctor", "b.csv"]) == 0
    assert "warning saved-numbers" in capsys.readouterr().out
    assert main(["doctor", "b.csv", "--rated-torque", "5", "--lead", "20"]) == 0
    assert "saved-numbers" not in capsys.readouterr().out
    assert main(["doctor", "b.csv"]) == 0  # it was said for this very file
    out = capsys.readouterr().out
    assert "saved-numbers" not in out
    assert "rated torque 5" in out


@pytest.mark.usefixtures("two_axes")
def test_a_gear_ratio_that_the_columns_do_not_need_is_never_taken_over(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    for name in ("c.csv", "d.csv"):
        text = (
            (tmp_path / "a.csv").read_text().replace("ActPos [mm],ActTrq [%]", "Position [rad],Torque [Nm]")
        )
        (tmp_path / name).write_text(text + ("2.999,0,0\n" if name == "d.csv" else ""))
    main(["doctor", "c.csv", "--gear-ratio", "20", "--side", "load"])
    assert "gear ratio 20" in capsys.readouterr().out
    main(["doctor", "d.csv"])
    out = capsys.readouterr().out
    assert "gear ratio 20" not in out
    assert "gear_ratio = 20, side = load (for c.csv on " in out
    assert "is kept and not used" in out
    main(["doctor", "d.csv", "--map", "position=Position [rad]:rad@load"])  # without it this cannot be read
    out = capsys.readouterr().out
    assert "warning saved-numbers" in out
    assert "gear_ratio = 20" in out


@pytest.mark.usefixtures("two_axes")
def test_counts_that_a_number_of_the_drive_told_are_what_the_column_means(
    capsys: pytest.CaptureFixture[str],
) -> None:
    t = np.arange(3000) * 1e-3
    counts = np.round(9000.0 * np.sin(2.0 * np.pi * t))
    for name, sign in (("e.csv", 1.0), ("f.csv", -1.0)):
        table = np.column_stack((t, sign * counts, np.sign(np.cos(2.0 * np.pi * t))))
        np.savetxt(name, table, "%.9g", ",", header="time [s],pos,torque [Nm]", comments="")
    main(["doctor", "e.csv", "--counts-per-rev", "4096"])
    capsys.readouterr()
    main(["doctor", "f.csv"])
    out = capsys.readouterr().out
    assert "counts_per_rev = 4096: not said for this file, but for e.csv on" in out
    assert "position=pos:counts" in out


@pytest.fixture
def two_drives(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Files turned.csv and right.csv with the same columns, in turns; the first has the torque's sign turned. And
    radians.csv, whose angles are in rad."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("STICKSLIP_CONFIG", str(tmp_path / "config"))
    t = np.arange(1500) * 1e-3
    turns, torque = 20.0 * np.sin(2.0 * np.pi * t), 0.285 * np.sign(np.cos(2.0 * np.pi * t))
    for name, sign, size in (("turned", -1.0, 1.0), ("right", 1.0, 1.0), ("radians", -1.0, 2.0 * np.pi)):
        table = np.column_stack((t, size * turns, sign * torque))
        np.savetxt(f"{name}.csv", table, "%.9g", ",", header="time [s],q,torque [Nm]", comments="")


IDENTIFY = ("--inverse", "--no-report", "--force", "--out", "model.toml")


@pytest.mark.usefixtures("two_drives")
def test_identify_tells_a_saved_profile_before_the_error_that_comes_of_it(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    """The log of another drive was read with the sign of the first: the error alone was said, and a remedy of two
    minus signs."""
    turned = ["--map", "torque=torque [Nm]:-Nm"]
    assert main(["identify", "turned.csv", *IDENTIFY, *turned, "--map", "position=q:rev"]) == 0
    capsys.readouterr()
    assert main(["identify", "right.csv", *IDENTIFY]) == 2
    first, second = capsys.readouterr().err.splitlines()
    kept = next((tmp_path / "config" / "profiles").glob("*.toml"))
    assert first.startswith(f"stickslip: right.csv: read by the saved profile {kept}, which says ")
    assert "motor_torque=torque [Nm]:-Nm (the sign turned)" in first
    assert "a saved profile, found by the names of the columns, says motor_torque in -Nm" in second
    undo = "delete that file, if this log's own sign is right; else"
    assert f"the profile {kept} turned the sign of motor_torque: {undo}" in second
    assert f"{undo} say --map 'motor_torque=torque [Nm]:Nm', if positive torque drives backwards" in second
    assert "or --map 'motor_torque=torque [Nm]' --map position=q to leave that out" in second
    assert "; --profile NEW.toml leaves out all that it says" in second
    # What is said now, and read wrongly by the rest of the profile, is told of that, too.
    assert main(["identify", "right.csv", *IDENTIFY, "--map", "position=q:deg"]) == 2
    assert "motor_torque=torque [Nm]:-Nm (the sign turned)" in capsys.readouterr().err.splitlines()[0]
    assert main(["identify", "right.csv", *IDENTIFY, "--map", "motor_torque=torque [Nm]:Nm"]) == 0
    capsys.readouterr()
    assert main(["identify", "turned.csv", *IDENTIFY, "--profile", "own.toml", *turned]) == 0
    assert "saved profile" not in capsys.readouterr().err


@pytest.mark.usefixtures("two_drives")
def test_two_minus_signs_are_refused_and_the_profile_that_has_them_is_named(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    assert main(["doctor", "turned.csv", "--map", "torque=torque [Nm]:--Nm"]) == 2
    assert "'--Nm' is not a unit that is known" in capsys.readouterr().err
    assert not list((tmp_path / "config").rglob("*.toml"))
    assert main(["doctor", "turned.csv", "--map", "torque=torque [Nm]:-Nm"]) == 0
    kept = next((tmp_path / "config" / "profiles").glob("*.toml"))
    kept.write_text(kept.read_text().replace(":-Nm", ":--Nm"))  # as earlier versions kept it
    capsys.readouterr()
    assert main(["identify", "turned.csv", *IDENTIFY]) == 2
    (error,) = capsys.readouterr().err.splitlines()
    assert f"the file was read by the saved profile {kept}, which says motor_torque=torque [Nm]:--Nm" in error
    assert error.endswith("delete that file to forget it")


@pytest.mark.usefixtures("two_drives")
def test_a_unit_of_a_saved_profile_that_cannot_be_is_said_to_be_the_profiles(
    capsys: pytest.CaptureFixture[str],
) -> None:
    """Radians of a file with the same names were read as turns, and nothing said whose the unit was."""
    right = ["--map", "torque=torque [Nm]:-Nm", "--map", "position=q:rev"]
    assert main(["doctor", "turned.csv", *right]) == 0
    assert "profile, found" not in capsys.readouterr().out
    main(["doctor", "radians.csv"])
    (line,) = [x for x in capsys.readouterr().out.splitlines() if "the axis would move at" in x]
    assert "a saved profile, found by the names of the columns, says position in rev; say" in line
    assert "or --map position=q to leave that out" in line
    main(["doctor", "radians.csv", "--map", "position=q"])
    assert "the axis would move at" not in capsys.readouterr().out
