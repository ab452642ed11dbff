"""The motion that is given is read as identify reads a log, and no unit is guessed in silence."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import stickslip as ss
from stickslip.cli import main
from stickslip.core.errors import InputError
from stickslip.identification.motion import Motion
from stickslip.readers import profiles
from stickslip.readers.convert import Drive
from stickslip.readers.reading import open_table
from stickslip.verbs.motion_given import Given, motion_in
from support.identified_files import written

TIME = np.arange(0.0, 2.0, 1e-3)
ANGLE = 0.3 - 0.3 * np.cos(np.pi * TIME)
SLOPE = np.sin(np.pi * TIME)
COUNTS = 65536.0


def log(path: Path, head: str, *columns: np.ndarray) -> Path:
    """A log of the motion."""
    np.savetxt(path, np.stack(columns, axis=1), "%.9g", ",", header=head, comments="")
    return path


def in_counts() -> np.ndarray:
    """The angle as an encoder counts it."""
    return np.round(ANGLE * COUNTS / (2.0 * np.pi))


def same(motion: Motion) -> bool:
    """Whether it is the motion that was logged."""
    return motion.amplitude == pytest.approx(0.3, rel=1e-3) and motion.duration == pytest.approx(
        2.0, rel=1e-2
    )


def test_a_unit_that_nobody_states_is_a_note(tmp_path: Path) -> None:
    file = log(tmp_path / "log.csv", "t,q,torque_Nm", TIME, ANGLE, SLOPE)
    motion, (note,) = motion_in(file)
    assert same(motion)
    assert "no unit that is known; taken were 't' as time in s, 'q' as position in rad" in note
    assert "motion_map=" in note
    _, stated = motion_in(file, Given({"time": "t:s", "position": "q:rad"}))
    assert stated == ()


def test_a_unit_that_is_certainly_wrong_is_refused(tmp_path: Path) -> None:
    file = log(tmp_path / "log.csv", "Time,ActPos,ActTorque", 1e3 * TIME, np.degrees(ANGLE), SLOPE)
    with pytest.raises(InputError, match=r"1 apart .* ms rather than s; say motion_map=..time.: .Time:ms"):
        motion_in(file)
    motion, notes = motion_in(file, Given(["time=Time:ms", "position=ActPos:deg"]))
    assert same(motion)
    assert notes == ()


def test_few_points_may_be_seconds_apart(tmp_path: Path) -> None:
    time = np.arange(0.0, 40.0, 1.0)
    motion, notes = motion_in(log(tmp_path / "points.csv", "t,q", time, np.sin(time)))
    assert motion.source.startswith("points of points.csv")
    assert any("taken were 't' as time in s" in n for n in notes)


def test_counts_are_read_by_the_encoders(tmp_path: Path) -> None:
    # A torque in percent needs a rated torque, which no motion does.
    file = log(tmp_path / "log.csv", "time_s,position_counts,torque_percent", TIME, in_counts(), 50 * SLOPE)
    with pytest.raises(InputError, match=r"in counts; give counts_per_rev, or motion_map=..position"):
        motion_in(file)
    motion, notes = motion_in(file, Given(counts_per_rev=COUNTS))
    assert same(motion)
    assert motion.source.startswith("position of")
    assert notes == ()
    quiet = log(tmp_path / "quiet.csv", "time_s,q,torque_Nm", TIME, in_counts(), SLOPE)
    motion, (note,) = motion_in(quiet, Given(counts_per_rev=COUNTS))
    assert same(motion)
    assert "'q' states no unit; it was read as counts, 65536 a revolution" in note


def test_an_angle_whose_unit_is_stated_is_no_count(tmp_path: Path) -> None:
    file = log(tmp_path / "log.csv", "time_s,position_rad,torque_Nm", TIME, ANGLE, SLOPE)
    assert same(motion_in(file, Given(counts_per_rev=COUNTS))[0])
    with pytest.raises(InputError, match=r"is in rad, and the axis moves in m; say motion_map"):
        motion_in(file, Given(unit="m"))


def test_the_saved_profile_is_used_and_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("STICKSLIP_CONFIG", str(tmp_path / "config"))
    file = log(tmp_path / "log.csv", "t,where,torque_Nm", 1e3 * TIME, in_counts(), SLOPE)
    kept = profiles.Profile({"time": "t:ms", "position": f"where:{360.0 / COUNTS}deg"}, Drive())
    saved = profiles.save(kept, open_table(file))
    before = saved.read_bytes()
    motion, notes = motion_in(file, Given(remember=True))
    assert same(motion)
    assert any(str(saved) in n for n in notes)
    assert saved.read_bytes() == before
    with pytest.raises(InputError):
        motion_in(file)


def test_the_verb_and_the_command_read_alike(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("stickslip.recommendation.recommend.GAINS", (0.8,))
    monkeypatch.setenv("STICKSLIP_CONFIG", str(tmp_path / "config"))
    file = log(tmp_path / "log.csv", "t,q,torque_percent", TIME, in_counts(), 50 * SLOPE)
    model = written(tmp_path / "model.toml")
    options = [
        "--counts-per-rev",
        str(COUNTS),
        "--motion-map",
        "position=q:counts",
        "--axes=1",
        "--confirm=0",
    ]
    assert main(["recommend", str(model), "--motion", str(file), *options, "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["drive"]["motion"]["amplitude"] == pytest.approx(0.3, rel=1e-3)
    assert any("taken were 't' as time in s" in n for n in told["notes"])
    result = ss.recommend(
        model, motion=file, motion_map={"position": "q:counts"}, counts_per_rev=COUNTS, axes=1, confirm=0
    )
    assert any("motion_map={" in n for n in result.notes)
    assert not (tmp_path / "config").exists()
    with pytest.raises(InputError, match="motion_map says how"):
        ss.recommend(model, motion_map={"position": "q:counts"})
