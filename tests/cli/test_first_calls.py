"""First calls: compiling is said, once, and can be done beforehand; a long sweep says so before it starts."""

from __future__ import annotations

import io
from dataclasses import make_dataclass
from types import SimpleNamespace

import numpy as np
import pytest

import stickslip
from stickslip import jit
from stickslip.cli import main, parser_of, sweep, warm_up
from stickslip.control.controller import Controller
from stickslip.core import compile_notice
from stickslip.sweeps import forecast
from stickslip.verbs.recommend import loop_of


class Clock:
    """A timer that a test lets ring."""

    def __init__(self, delay, ring):
        self.ring, self.cancelled = ring, False
        Clock.last = self

    def start(self):
        pass

    def cancel(self):
        self.cancelled = True


class Terminal(io.StringIO):
    def isatty(self):
        return True


@pytest.fixture
def told(monkeypatch):
    """A notice that hears what is compiled."""
    monkeypatch.setattr(compile_notice, "_listeners", [])
    notice = compile_notice.Notice(io.StringIO(), Clock)
    compile_notice.listen(notice)
    return notice


def test_a_long_compilation_is_said_once_and_a_short_one_not(told):
    compile_notice.started()
    short = Clock.last
    compile_notice.ended()
    assert short.cancelled
    assert told.stream.getvalue() == ""
    for _ in range(2):
        compile_notice.started()
        compile_notice.started()
        Clock.last.ring()
        compile_notice.ended()
        compile_notice.ended()
    said = told.stream.getvalue()
    assert said.count("\n") == 1
    assert "20 s" in said
    assert "stickslip warm-up" in said


def test_a_terminal_sees_how_far_it_is():
    notice = compile_notice.Notice(Terminal(), Clock)
    notice.started()
    Clock.last.ring()
    notice.ended()
    notice.close()
    assert notice.stream.getvalue().endswith("\rstickslip: 1 functions compiled \n")


def test_what_is_compiled_is_told_and_what_is_kept_is_not(told):
    @jit.compile_inlined
    def twice(x):
        return 2.0 * x

    assert twice(1.5) == 3.0
    assert told.count == 1
    assert twice(2.5) == 5.0
    assert told.count == 1
    assert told.depth == 0


def test_warm_up_runs_small_pieces_of_the_verbs(monkeypatch, capsys, tmp_path):
    monkeypatch.chdir(tmp_path)
    for words in warm_up.STEPS.values():
        parser_of(words[:1]).parse_args(list(words))  # complains of what it does not know
    monkeypatch.setattr(warm_up, "STEPS", {"laws": ("laws",), "nothing": ("law", "no-such-law")})
    assert main(["warm-up"]) == 1
    said = capsys.readouterr().out.splitlines()
    assert said[0].startswith("1/2 laws ... ")
    assert "failed: stickslip: unknown law" in said[1]
    assert list(tmp_path.iterdir()) == []


def test_the_library_warms_up_as_the_command_does(monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    told: list[str] = []
    monkeypatch.setattr(warm_up, "STEPS", {"laws": ("laws",), "version": ("version",)})
    stickslip.warm_up(told.append)
    assert [line.partition(" ... ")[0] for line in told] == ["1/2 laws", "2/2 version"]
    monkeypatch.setattr(warm_up, "STEPS", {"nothing": ("law", "no-such-law")})
    with pytest.raises(stickslip.StickslipError, match="nothing: stickslip: unknown law 'no-such-law'"):
        stickslip.warm_up(told.append)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("loop", ["kp=8,kd=0.1", "kp=8,ki=60,kd=0.1", "kv=40,kvp=0.1,kvi=1,feed=1"])
@pytest.mark.parametrize("more", ["", ",filter=200,limit=3"])
def test_warm_up_compiles_the_loops_that_drives_have(loop, more):
    """A PID with a filter was compiled at its first recommendation."""

    def laws(text):
        gains, own, _ = loop_of(text)
        return Controller(gains, velocity_filter=own.get("filter", 0.0), sample_time=1e-3).laws

    warmed = [laws("kp=1,kd=1"), *map(laws, warm_up.LOOPS.values())]  # the demonstration's, and its own
    assert laws(f"{loop}{more}") in warmed


def test_a_long_sweep_says_how_long_before_it_starts(monkeypatch, capsys):
    monkeypatch.setattr("stickslip.sweeps.forecast.paces_of", lambda big: (1.0,))
    monkeypatch.setattr("stickslip.sweeps.forecast.seconds_of", lambda big, paces: 36_000.0)
    many, few = (make_dataclass("Cases", [("cases", int), ("sizes", tuple)])(n, ()) for n in (20_000, 10))
    assert sweep.announced(many, 2).sizes == (4,)
    assert "20000 closed loops, about 5.0 h on 2 cores; --cases reduces the number" in capsys.readouterr().err
    assert sweep.announced(few, 2) == few
    assert capsys.readouterr().err == ""


def test_its_time_is_that_of_cases_drawn_and_of_their_checks_not_of_the_nominal_ones(monkeypatch):
    """A processor whose clock counts closed loops: of 1,000 cases every tenth is checked at a tighter tolerance."""
    clock, cases = 0.0, []

    def ran(big, run, start, numbers):
        nonlocal clock
        cases.extend(numbers[:, 0])
        clock += sum(30.0 if case >= 900 else 3.0 for case in numbers[:, 0]) * (1 if run == 0 else 2)
        clock += 1e6 if len(numbers) == 1 else 0.0  # the first compiles

    drawn = SimpleNamespace(cases=1000, block=lambda start, stop: np.arange(start, stop)[:, None])
    monkeypatch.setattr(forecast, "compute_cases", ran)
    monkeypatch.setattr(forecast, "PATIENCE", 1e9)
    monkeypatch.setattr(forecast.time, "process_time", lambda: clock)
    big = SimpleNamespace(runs=[1, 2], drawn=drawn)
    told = forecast.seconds_of(big, forecast.paces_of(big))
    assert told == pytest.approx(1000 * (0.9 * 3.0 + 0.1 * 30.0) * 3, rel=0.3)
    assert len(cases) == 2 * (1 + forecast.MOST_TIMED)


def test_the_log_that_ships_can_be_had_alone(tmp_path, capsys):
    assert main(["demo", "--log", str(tmp_path / "log.csv")]) == 0
    assert main(["doctor", str(tmp_path / "log.csv")]) == 0


def test_what_warm_up_does_not_know_is_said_to_be_compiled_once(told):
    """It was "`stickslip warm-up` does it beforehand", after a warm-up."""
    told.started(compile_notice.OWN_WORDS)
    told.started()
    Clock.last.ring()
    said = told.stream.getvalue()
    assert "this controller or law" in said
    assert "warm-up" not in said


def test_the_texts_of_laws_are_told_from_the_kernels():
    from stickslip.jit.kept import TRANSLATED, loaded
    from stickslip.simulation.compiled_controller import measured_position

    text = "from stickslip.jit import compile_inner\n\n\n@compile_inner\ndef once(x):\n    return x\n"
    assert loaded("told_from_kernels", text).once.py_func.__module__.startswith(TRANSLATED)
    assert not measured_position.py_func.__module__.startswith(TRANSLATED)
