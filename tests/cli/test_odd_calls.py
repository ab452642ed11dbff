"""Odd names and numbers: one line, exit code 2, and nothing is written."""

from __future__ import annotations

from pathlib import Path

import pytest

import stickslip as ss
from stickslip.cli import main

DATA = Path(__file__).parents[1] / "data"
DEMO = str(Path(ss.__file__).with_name("demo.csv"))
RUN = str(DATA / "one_run.toml")
LONG, DIGITS = "x" * 300, "9" * 400
SAMPLED = """
[axis]
inertia = 4e-4
[friction]
law = "coulomb"
fc = 0.285
sigma2 = 0.018
[reference]
kind = "sine"
amplitude = 0.01
frequency = 2.0
duration = 0.5
[controller]
linear = "PD"
placement = {bandwidth_hz = 20.0, damping = 1.0}
sample_time = 1e-3
"""
CALLS = [
    *(([verb, f"{LONG}{suffix}"], LONG[:30]) for verb in ("identify", "doctor", "simulate", "learn", "study", "sweep",
       "tune", "machine", "rerun", "cite", "law") for suffix in (".toml", ".csv", "")),
    (["identify", DEMO, "--law", f"{LONG}.py"], LONG[:30]),
    (["identify", DEMO, "--law", "coulomb", "--out", LONG], "File name too long"),
    (["simulate", RUN, "--out", f"{LONG}.npz"], "File name too long"),
    (["demo", "--out", LONG], "File name too long"),
    (["law", "coulomb", "--plot", f"{LONG}.svg"], "File name too long"),
    (["export", "m.toml", "--to", "c99", "--out", LONG], "File name too long"),
    (["rig", "run", "breakaway", "--rig", f"{LONG}.toml"], "File name too long"),
    (["identify", "a\0b"], "NUL"),
    (["export", "m.toml", "--to", "c99", "--out", "a\0b"], "NUL"),
    (["export", "m.toml", "--to", "c99", "--out", "/dev/null"], "/dev/null"),
    (["simulate", RUN, "--out", "/dev/null"], "is not a regular file"),
    (["learn", "sampled.toml", "--out", "folder"], "is a folder"),
    (["identify", DEMO, "--law", "coulomb", "--out", "a\udcffb"], "is not Unicode"),
    (["rig", "run", "breakaway", "--rig", "ideal", "--stream", "loop"], "loop"),
    (["export", "m.toml", "--to", "urdf", "--top-speed", "0"], "the top speed is 0 rad/s"),
    (["identify", DEMO, "--law", "coulomb", "--inverse", "--drive-gain", "1e308"], "times 1e+308"),
    (["identify", DEMO, DEMO, "--law", "coulomb", "--inverse"], "are the same record"),
    (["identify", DEMO, "--hold-out", DEMO, "--law", "coulomb", "--inverse"], "are the same record"),
    (["doctor", DEMO, "--rows", "1:99999"], "--rows ends at row 99999, but the record has 6000 rows"),
    (["doctor", DEMO, "--leave-out", "5900:6001"], "--leave-out ends at row 6001, but the record has 6000 rows"),
    (["recommend", "m.toml", "--inertia=4e-4", "--amplitude=0.1", "--frequency=0"], "--frequency 0 must be greater"),
    (["recommend", "m.toml", "--compensators="], "unknown compensator ''"),
    (["sweep", "thesis-robustness", "--cases=--"], "--cases=--: -- is not a value"),
    (["study", "thesis", "--jobs=--"], "--jobs=--: -- is not a value"),
    (["recommend", "m.toml", f"--confirm={DIGITS}"], "--confirm: 99999999999999999999... is too large"),
    (["recommend", "m.toml", "--bandwidth=nan"], "nan is not a number"),
    (["recommend", "m.toml", "--bandwidth=1e400"], "1e400 is too large"),
    (["learn", "sampled.toml", "--corner=-1"], "--corner -1 Hz must lie between 2 Hz"),
    (["learn", "sampled.toml", "--corner=1e-400"], "1e-400 is too small"),
    (["learn", "sampled.toml", "--corner=1e-300"], "--corner 1e-300 Hz must lie between"),
    (["learn", "sampled.toml", "--advance=100000000000"], "--advance 100000000000 must be below 500"),
]  # fmt: skip


@pytest.mark.parametrize(
    ("words", "said"), CALLS, ids=[" ".join(w)[:50].replace("\0", "?") for w, _ in CALLS]
)
def test_an_odd_call_is_one_line(tmp_path, monkeypatch, capsys, words: list[str], said: str) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "m.toml").write_text('law = "coulomb"\n[parameters]\nfc = 0.3\nsigma2 = 0.01\n')
    (tmp_path / "sampled.toml").write_text(SAMPLED)
    (tmp_path / "folder").mkdir()
    (tmp_path / "loop").symlink_to("loop")
    assert main(words) == 2
    complaint = capsys.readouterr().err.splitlines()[-1]
    assert said in complaint
    assert len(complaint) < 1200
    assert sorted(p.name for p in tmp_path.iterdir()) == ["folder", "loop", "m.toml", "sampled.toml"]


def nested(depth: int) -> list[object]:
    """A list in a list in a list ..."""
    out: list[object] = []
    for _ in range(depth):
        out = [out]
    return out


def endless() -> dict[str, object]:
    """A mapping that contains itself."""
    out: dict[str, object] = {}
    out["a"] = out
    return out


class Unprintable:
    """An object whose repr fails."""

    def __repr__(self) -> str:
        raise RuntimeError


def test_a_key_of_many_parts_is_refused_at_once(tmp_path, capsys) -> None:
    """The parser of Python takes a minute for this one."""
    file = tmp_path / "deep.toml"
    file.write_text(f"a{'.a' * 50_000} = 1\n")
    assert main(["machine", str(file)]) == 2
    assert "nested too deeply" in capsys.readouterr().err


@pytest.mark.parametrize(
    "odd", [10**400, -(10**400), endless(), nested(10_000), Unprintable(), "a\0b", "x" * 5000]
)
def test_an_odd_value_is_an_input_error_in_python(tmp_path, monkeypatch, odd: object) -> None:
    monkeypatch.chdir(tmp_path)
    calls = (
        lambda: ss.Model("coulomb", fc=odd, sigma2=0.01),
        lambda: ss.identify(odd),
        lambda: ss.read(DEMO, map=odd),
        lambda: ss.study({"a": odd}, tmp_path / "out"),
        lambda: ss.export(ss.Model("coulomb", fc=0.3, sigma2=0.01), "c99", odd),
        lambda: ss.doctor(DEMO, sample_time=odd),
    )
    for call in calls:
        with pytest.raises(ss.InputError) as refused:
            call()
        assert "\n" not in str(refused.value)
        assert len(str(refused.value)) < 1500
    assert not list(tmp_path.iterdir())
