"""A long run says how far it is, and Ctrl-C ends it."""

from __future__ import annotations

import os
import signal
import threading
import time
import weakref

import pytest

import stickslip as ss
from stickslip.core import progress
from stickslip.core.progress import Reached, Watch, watched
from stickslip.simulation.adaptive import engine as adaptive
from stickslip.simulation.case_arrays import DONE, TOO_STIFF
from stickslip.simulation.closed_loop import prepare
from stickslip.simulation.exact import engine as exact
from stickslip.simulation.fixed import engine as fixed

LUGRE = {"sigma0": 3.5e4, "sigma1": 0.1, "sigma2": 0.018, "fs": 0.335, "fc": 0.285, "vs": 0.01}


@pytest.fixture
def said(monkeypatch):
    lines: list[str] = []
    monkeypatch.setattr(progress, "_listeners", [])
    progress.listen(lines.append)
    return lines


def case():
    axis = ss.RigidAxis(4e-4, ss.Model("lugre", **LUGRE))
    controller = ss.Controller(ss.place("PD", 4e-4, 10.0, 1.0))
    return prepare(axis, controller, ss.Reference("sine", amplitude=0.1, frequency=1.0), 2.0)


def looks(*reached: tuple[float, float, float]) -> list[str]:
    """Lines of a watch that is looked at, each entry at its own second: second, time and steps of a motion of 100 s."""
    seconds = iter([0.0, *(row[0] for row in reached)])
    rows = iter(Reached(row[1], 100.0, row[2]) for row in reached)
    watch = Watch(lambda: next(rows), lambda: next(seconds))
    return [watch.look() for _ in reached]


def test_a_line_says_what_was_done_and_at_the_pace_of_late_what_is_left():
    first, second = looks((2.0, 10.0, 1e6), (6.0, 20.0, 3e6))
    assert first == "simulated 10 of 100 s in 2 s (1,000,000 steps), about 18 s more; Ctrl-C ends it"
    assert second == "simulated 20 of 100 s in 6 s (3,000,000 steps), about 32 s more; Ctrl-C ends it"


def test_what_is_compiled_first_does_not_count():
    assert looks((2.0, 0.0, 0.0), (20.0, 0.0, 0.0), (22.0, 50.0, 1e6))[:2] == ["", ""]
    assert "50 of 100 s in 2 s" in looks((2.0, 0.0, 0.0), (20.0, 0.0, 0.0), (22.0, 50.0, 1e6))[2]


def test_a_run_that_stands_has_no_end_in_sight():
    assert "no end in sight" in looks((2.0, 10.0, 1e6), (6.0, 10.0, 3e6))[1]


def test_it_is_looked_at_ever_more_seldom():
    seconds = iter(range(10))
    watch = Watch(lambda: Reached(1.0, 2.0, 1.0), lambda: float(next(seconds)))
    waits = [watch.wait]
    for _ in range(3):
        watch.look()
        waits.append(watch.wait)
    assert waits == [2.0, 4.0, 8.0, 16.0]


def impatient(reached):
    watch = Watch(reached)
    watch.wait = 1e-3
    return watch


def test_listeners_hear_it_while_the_work_goes_on(said):
    def work():
        while not said:
            pass
        return "done"

    assert watched(work, lambda: Reached(1.0, 2.0, 5.0), lambda: None, impatient) == "done"
    assert said[0].startswith("simulated 1 of 2 s")


def test_what_the_work_raises_is_raised(said):
    with pytest.raises(ZeroDivisionError):
        watched(lambda: 1 // 0, lambda: Reached(0.0, 1.0, 0.0), lambda: None)


def run(work):
    return watched(work, lambda: Reached(0.0, 1.0, 0.0), lambda: None)


def test_one_thread_beside_this_one_does_work_after_work():
    threads = {run(threading.get_ident) for _ in range(3)}
    assert len(threads) == 1
    assert threading.get_ident() not in threads


def test_work_within_a_signals_handler_has_a_thread_of_its_own():
    """The main thread waits for a run when the handler comes, and its thread is busy until the handler is through."""
    inner, through = [], threading.Event()

    def handler(*_):
        inner.append(run(threading.get_ident))
        through.set()

    def work():
        os.kill(os.getpid(), signal.SIGUSR1)
        assert through.wait(60.0)
        return threading.get_ident()

    before = signal.signal(signal.SIGUSR1, handler)
    try:
        assert run(work) not in (inner[0], threading.get_ident())
    finally:
        signal.signal(signal.SIGUSR1, before)


@pytest.mark.skipif(not hasattr(os, "fork"), reason="no fork here")
def test_a_forked_process_has_a_thread_of_its_own():
    run(threading.get_ident)
    child = os.fork()
    if child == 0:
        signal.alarm(60)
        os._exit(run(lambda: 7))
    assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 7


def test_no_work_is_kept_after_it():
    """Its arrays may be large."""

    class Rows:
        def of(self):
            return 1

    rows = Rows()
    gone = weakref.ref(rows)
    run(rows.of)
    del rows
    until = time.monotonic() + 60.0
    while gone() is not None:  # its thread may still be on the way back
        assert time.monotonic() < until
        time.sleep(1e-3)


def test_ctrl_c_ends_the_work():
    ending = threading.Event()

    def work():
        os.kill(os.getpid(), signal.SIGINT)
        assert ending.wait(60.0)

    with pytest.raises(KeyboardInterrupt):
        watched(work, lambda: Reached(0.0, 1.0, 0.0), ending.set)
    assert run(lambda: "the next") == "the next"


@pytest.mark.parametrize("module", [exact, adaptive, fixed])
def test_every_integrator_tells_how_far_it_is_and_ends_when_asked(module, monkeypatch):
    """What it tells after the run is what the run counted; asked beforehand, it ends at its first steps."""
    told = []

    def asked(work, reached, stop):
        if told:  # the second run
            stop()
        found = work()
        told.append(reached())
        return found

    monkeypatch.setattr(module, "watched", asked)
    steps = []
    for code in (DONE, TOO_STIFF):
        outcome = module.run(case(), 1e-4) if module is fixed else module.run(case())
        assert outcome.code == code
        assert told[-1].time == outcome.time
        assert told[-1].of == 2.0
        assert told[-1].steps == outcome.counts["steps"] + outcome.counts["rejected"] * (module is adaptive)
        steps.append(outcome.counts["steps"])
    assert told[0].time == 2.0
    assert steps[1] < 0.01 * steps[0]
