"""How files are read is kept in a profile, and what it says is told whenever it is used."""

from __future__ import annotations

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
    assert "profile" not in second.err  # at length it is said once, when it was written
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
    assert (
        "a record of 0.1 N·m of torque, this one has 0.9: does torque_constant = 0.05 hold"
        in capsys.readouterr().err
    )
    assert main(["identify", "large.csv", *calls, "--torque-constant", "0.2"]) == 0
    assert "hold for this machine" not in capsys.readouterr().err
