"""What would run without an end, or beyond memory, is refused before it starts, with its number."""

from __future__ import annotations

import dataclasses
import math
import os
import time

import pytest

import stickslip as ss
from stickslip import cli
from stickslip.control.controller import Controller
from stickslip.control.linear import place
from stickslip.core import resources
from stickslip.core.errors import InputError, SimulationError
from stickslip.machines.rigid import RigidAxis
from stickslip.simulation.closed_loop import simulate
from stickslip.studies import study as studies
from stickslip.sweeps import execute
from stickslip.sweeps.plan import load

FRICTION = ss.Model("coulomb", fc=0.3)
AXIS = RigidAxis(4e-4, FRICTION)


def loop(bandwidth: float = 36.0, **more: float) -> Controller:
    return Controller(place("PD", AXIS.inertia, bandwidth, 1.0), **more)


@pytest.mark.parametrize("frequency", [1e9, 1e16, 1e300])
@pytest.mark.parametrize("kind", ["sine", "harmonic"])
def test_a_reference_that_turns_too_often(kind, frequency):
    with pytest.raises(InputError, match=r"turns .* times within 0.5 s, 200,000 at most"):
        simulate(AXIS, loop(), ss.Reference(kind, amplitude=0.01, frequency=frequency), 0.5)


def test_a_phase_or_a_staircase_of_any_size_takes_no_time():
    begin = time.process_time()
    shifted = ss.Reference("harmonic", amplitude=0.01, frequency=1.0, phase=2e9)
    assert len(shifted.breaks(2.0)) == 4
    stairs = ss.Reference("staircase", height=0.1, dwell=0.1, steps=1e15)
    assert len(stairs.breaks(1.0)) in (9, 10)
    assert time.process_time() - begin < 5.0


@pytest.mark.parametrize("step", [1e-300, 1e-12, 5e-324])
def test_steps_without_number(step):
    reference = ss.Reference("sine", amplitude=0.01, frequency=1.0)
    with pytest.raises(InputError, match=r"time_step = .* 1e\+09 at most"):
        simulate(AXIS, loop(), reference, 0.5, integrator="fixed", time_step=step)
    with pytest.raises(InputError, match=r"sample_time = .* 1e\+09 at most"):
        simulate(AXIS, loop(sample_time=step), reference, 0.5)
    with pytest.raises(InputError, match=r"output = .* rows"):
        simulate(AXIS, loop(), reference, 0.5, output=step)


@pytest.mark.parametrize("integrator", ["exact", "adaptive", "fixed"])
@pytest.mark.parametrize(
    ("duration", "bandwidth", "limit"),
    [(1e-9, 36.0, math.inf), (1e-7, 36.0, 1.0), (0.05, 1e-300, math.inf), (0.05, 36.0, 1e-320)],
)
def test_tiny_numbers_come_to_an_end(integrator, duration, bandwidth, limit):
    if integrator == "exact":
        limit = math.inf
    reference = ss.Reference("sine", amplitude=0.01, frequency=1.0)
    controller = loop(bandwidth, torque_limit=limit)
    try:
        record = simulate(AXIS, controller, reference, duration, integrator=integrator, check=True)
    except SimulationError as error:
        record = error.record
    assert 0 < len(record) < 1000


@pytest.mark.parametrize("duration", [1e-300, 1e-12, 5e-324])
def test_a_run_in_which_nothing_can_move_is_refused(duration):
    reference = ss.Reference("sine", amplitude=0.01, frequency=1.0)
    with pytest.raises(InputError, match=r"duration = .* s is shorter than 1e-09 s"):
        simulate(AXIS, loop(), reference, duration)


@pytest.mark.parametrize("jobs", ["100000", 18 * "9"])
@pytest.mark.parametrize("call", [["sweep", "thesis-robustness"], ["study", "thesis"]])
def test_numbers_of_workers(call, jobs, tmp_path, capsys):
    assert cli.main([*call, f"--jobs={jobs}", "--out", str(tmp_path / "out")]) == 2
    assert f"--jobs {jobs} must be 1 to {32 * (os.cpu_count() or 1)}" in capsys.readouterr().err


@pytest.mark.parametrize("cases", ["1" + 17 * "0", "0", "-1"])
def test_numbers_of_cases(cases, tmp_path, capsys):
    assert cli.main(["sweep", "thesis-robustness", f"--cases={cases}", "--out", str(tmp_path / "out")]) == 2
    assert f"--cases {cases}" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_a_sweep_beyond_memory_or_disk(tmp_path, monkeypatch):
    whole = load("thesis-robustness")
    sweep = dataclasses.replace(whole, drawn=dataclasses.replace(whole.drawn, cases=10**9))
    with pytest.raises(InputError, match=r"closed loops in blocks .* memory|GB free"):
        execute.run(sweep, tmp_path / "out")
    monkeypatch.setattr(resources, "free_memory", lambda: 1e6)
    with pytest.raises(InputError, match=r"closed loops in blocks of 256 need .* of memory, 1 MB are free"):
        execute.run(sweep, tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_a_seed_that_no_file_holds(tmp_path, capsys):
    text = load("thesis-robustness").source.read_text(encoding="utf-8")
    file = tmp_path / "a.toml"
    file.write_text(text.replace("seed = 1\n", f"seed = {26 * '7'}\n"), encoding="utf-8")
    assert cli.main(["sweep", str(file), "--out", str(tmp_path / "out")]) == 2
    assert "more than 63 bits" in capsys.readouterr().err


def test_jobs_of_a_study_from_python(tmp_path):
    with pytest.raises(InputError, match="jobs = 0"):
        studies.run(studies.load("thesis"), tmp_path, jobs=0)
