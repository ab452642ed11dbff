"""Files that Python wrote are the command line's own, as its own are."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import stickslip as ss
from stickslip.cli import main
from stickslip.core.errors import InputError
from stickslip.verbs.own_files import ours

LAW = ss.Model("coulomb", fc=0.3, sigma2=0.01)


def test_the_command_line_writes_over_what_python_exported_and_not_over_what_was_edited(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The README's example in Python and its command, one after the other in one folder, ended in "was not written by
    stickslip"."""
    made = ss.export(LAW, to="c99", folder=tmp_path / "c")
    assert made.paths
    assert all(ours(path) for path in made.paths)
    (tmp_path / "law.toml").write_text('law = "coulomb"\n[parameters]\nfc = 0.4\nsigma2 = 0.01\n')
    command = ["export", str(tmp_path / "law.toml"), "--to", "c99", "--out", str(tmp_path / "c")]
    names = [path.name for path in made.paths]
    if "law.h" not in names:
        command += ["--name", next(n for n in names if n.endswith(".h")).removesuffix(".h")]
    assert main(command) == 0
    made.paths[0].write_text("edited")
    capsys.readouterr()
    assert main(command) == 2
    assert "or was edited since; use --force" in capsys.readouterr().err


def test_a_record_that_cannot_be_written_is_told_in_a_line(tmp_path: Path) -> None:
    record = ss.Record(np.arange(3.0), {"position": np.zeros(3)}, {"position": "rad"})
    with pytest.raises(InputError, match=r"cannot write .*; choose another place"):
        record.save(tmp_path / "nowhere" / "x.npz")


def test_times_as_dates_are_seconds_and_complex_numbers_are_none() -> None:
    """Dates in microseconds were taken for as many seconds."""
    t = np.arange(400) * 1e-3
    dates = np.datetime64("2026-11-26T05:00:00", "us") + np.round(1e6 * t).astype("timedelta64[us]")
    read = ss.read(t=dates, position=np.sin(9.0 * t), torque=np.cos(9.0 * t))
    assert read.time == pytest.approx(t, abs=1e-9)
    with pytest.raises(InputError, match="position is no array of numbers"):
        ss.read(t=t, position=np.sin(9.0 * t) + 1j, torque=t)
