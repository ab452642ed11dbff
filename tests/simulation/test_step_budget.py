"""No integrator takes far more steps than its motion is long: it ends in one line with the remedy."""

from __future__ import annotations

import numpy as np
import pytest

import stickslip as ss
from stickslip.core.errors import InputError, ModelRemark, StepFailure
from stickslip.simulation.adaptive import engine as adaptive
from stickslip.simulation.case_arrays import COLUMNS, NO_STEP, TOO_STIFF, Case, Outcome, StepBudget
from stickslip.simulation.closed_loop import prepare
from stickslip.simulation.exact import engine as exact
from stickslip.simulation.sampled import engine as sampled
from stickslip.studies.build import Numerics
from stickslip.studies.planned_run import PlannedRun
from stickslip.sweeps.measured import measured
from stickslip.sweeps.metric_check import checked

LUGRE = {"sigma0": 3.5e4, "sigma1": 0.1, "sigma2": 0.018, "fs": 0.335, "fc": 0.285, "vs": 0.01}
PD = ss.Controller(ss.place("PD", 4e-4, 10.0, 1.0))


def loop(inertia: float, frequency: float):
    return (
        ss.RigidAxis(inertia, ss.Model("lugre", **LUGRE)),
        PD,
        ss.Reference("sine", amplitude=0.1, frequency=frequency),
    )


@pytest.mark.parametrize(
    ("module", "name", "inertia", "frequency"),
    [(exact, "exact", 1e-12, 1.0), (adaptive, "adaptive", 4e-4, 1e3)],
)
def test_too_many_steps_end_the_run_with_the_remedy(module, name, inertia, frequency, monkeypatch):
    monkeypatch.setattr(module, "STEPS", StepBudget(2000.0, 0.0, 0.0))
    with pytest.raises(StepFailure) as caught:
        ss.simulate(*loop(inertia, frequency), 0.5, integrator=name)
    said, counts = str(caught.value), caught.value.record.meta["counts"]
    taken = counts["steps"]
    assert 2000 < taken + counts["rejected"] * (module is adaptive) <= 2010
    whole = taken * 0.5 / caught.value.time
    assert f"{taken:,} so far; at this pace 0.5 s take some {whole:.2g}" in said
    assert "use the fixed integrator" in said
    assert "try a tolerance above 1e-09 rad" in said
    assert ('integrator="adaptive"' in said) == (name == "exact")
    assert "\n" not in said


@pytest.mark.parametrize(
    ("module", "inertia", "frequency"),
    [(exact, 1e-12, 1.0), (adaptive, 4e-4, 1e3)],
    ids=["exact", "adaptive"],
)
def test_a_run_without_end_is_found_out_at_its_start(module, inertia, frequency, monkeypatch):
    """The budget of 60 s is not there for the first of them."""
    monkeypatch.setattr(module, "STEPS", StepBudget(10_000, 50_000, 0))
    outcome = module.run(prepare(*loop(inertia, frequency), 60.0))
    assert outcome.code == TOO_STIFF
    assert outcome.time < 1.0
    assert outcome.counts["steps"] <= 10_000 + 50_000 * outcome.time + 10


def test_the_budget_grows_with_the_motion_and_holds_what_the_thesis_takes():
    """Of its runs, the step with LuGre feedback takes most: 265,000 steps of the exact integrator in 3 s."""
    short, long = (prepare(*loop(4e-4, 4.0), duration) for duration in (3.0, 60.0))
    assert exact.STEPS.of(short) > 4 * 265_000
    for module in (exact, adaptive):
        assert module.STEPS.of(long) > 10 * module.STEPS.of(short) - 10 * module.STEPS.base
        assert module.STEPS.of(long) <= 50_000_000
        first, rate = module.STEPS.pace(long)
        assert first + rate * 60.0 == pytest.approx(module.STEPS.of(long))
        assert first == module.STEPS.base


def test_a_step_whose_metrics_would_take_hours_ends_the_run():
    """Of a loop of 1 GHz a single step has half a million e-folds; nothing hears Ctrl-C inside it."""
    axis = ss.RigidAxis(4e-4, ss.Model("lugre", **LUGRE))
    fast = ss.Controller(ss.place("PD", 4e-4, 1e9, 1.0))
    with pytest.raises(StepFailure, match=r"so fast that its metrics .* lower the controller's gains"):
        ss.simulate(axis, fast, ss.Reference("sine", amplitude=0.01, frequency=0.4), 1.0, integrator="exact")


def test_more_samples_than_memory_holds_are_refused_before_the_run(monkeypatch):
    monkeypatch.setattr("stickslip.core.resources.free_memory", lambda: 1e9)
    axis, _, reference = loop(4e-4, 1.0)
    sampled = ss.Controller(ss.place("PD", 4e-4, 10.0, 1.0), sample_time=1e-8)
    with pytest.raises(
        InputError, match=r"1e\+08 steps of sample_time = 1e-08 s need 10 GB .* use a longer one"
    ):
        prepare(axis, sampled, reference, 1.0)


def test_auto_goes_on_with_the_next_integrator_where_one_finds_no_step(monkeypatch):
    """And says so; left with fixed steps, which keep no tolerance, it warns."""
    axis, controller, reference = loop(4e-4, 1.0)
    known = ss.simulate(axis, controller, reference, 0.2, integrator="adaptive")["position"][-1]
    monkeypatch.setattr(exact, "STEPS", StepBudget(50.0, 0.0, 0.0))
    ran = ss.simulate(axis, controller, reference, 0.2)
    assert ran.meta["integrator"] == "adaptive"
    assert ran.meta["refused"]["exact"].startswith("ended at 0.")
    assert ran["position"][-1] == pytest.approx(known, abs=1e-7)
    monkeypatch.setattr(adaptive, "STEPS", StepBudget(50.0, 0.0, 0.0))
    with pytest.warns(
        ModelRemark, match="the fixed integrator ran this, whose steps of 0.0001 s keep no tolerance"
    ):
        ran = ss.simulate(axis, controller, reference, 0.2)
    assert ran.meta["integrator"] == "fixed"
    assert set(ran.meta["refused"]) == {"exact", "adaptive", "sampled"}
    assert ran["position"][-1] == pytest.approx(known, abs=1e-4)


def test_fixed_steps_that_were_asked_for_are_no_surprise(recwarn):
    steep = ss.RigidAxis(4e-4, ss.Model("stribeck", k=3.5e4, fs=0.335, fc=0.285, vs=0.01, sigma2=0.018))
    motion = ss.Reference("sine", amplitude=0.1, frequency=1.0)
    ss.simulate(steep, PD, motion, 0.05, integrator="fixed")
    assert not recwarn
    with pytest.warns(
        ModelRemark, match=r"slows the axis down at 9e\+07 /s\); compare with a tenth of the time_step"
    ):
        ss.simulate(steep, PD, motion, 0.05)


def no_step(case: Case, *step: float) -> Outcome:
    """An integrator that finds none."""
    rows = np.zeros((1, len(COLUMNS)))
    return Outcome(rows=rows, code=NO_STEP, time=0.01, meter=None, turns=None, counts={"steps": 1})


def planned(axis, controller, reference, **numerics: float) -> PlannedRun:
    return PlannedRun("own", "sine", "lugre", "PD", axis, controller, reference, 0.2, Numerics(**numerics))


def test_a_sampled_run_without_a_step_keeps_its_record(monkeypatch):
    """It was "no integrator can run this", which ended a whole study."""
    axis, _, reference = loop(4e-4, 1.0)
    controller = ss.Controller(ss.place("PD", 4e-4, 10.0, 1.0), sample_time=1e-3)
    monkeypatch.setattr(sampled, "run", no_step)
    with pytest.raises(
        StepFailure, match=r"ended at 0.01 s: no step .* try a tolerance above 1e-09 rad$"
    ) as caught:
        ss.simulate(axis, controller, reference, 0.2)
    assert len(caught.value.record) == 1
    assert "the controller is sampled" in caught.value.record.meta["refused"]["fixed"]
    assert "no step" in planned(axis, controller, reference).execute().failure


def test_a_time_step_of_no_use_loses_no_record_and_what_ran_is_not_advised(monkeypatch):
    for module in (exact, adaptive):
        monkeypatch.setattr(module, "run", no_step)
    with pytest.raises(StepFailure, match=r"1e-09 rad, or a longer time_step, with which fixed steps end$"):
        ss.simulate(*loop(4e-4, 1.0), 0.2, time_step=1e-12)
    assert "no step" in planned(*loop(4e-4, 1.0), time_step=1e-12).execute().failure


@pytest.mark.parametrize("together", [True, False])
def test_a_sweep_goes_on_with_the_next_integrator_too(together, monkeypatch):
    """Whose error is that of its own worse run."""
    monkeypatch.setattr(exact, "STEPS", StepBudget(10.0, 0.0, 0.0))
    run = planned(*loop(4e-4, 1.0))
    values = {"friction.fs": np.array([0.335])} if together else {}
    metrics = ["position_rms_rad"]
    found = measured(run, values, metrics, 1)
    assert found.integrators == ["adaptive"]
    best, flagged = checked(run, values, metrics, found)
    assert best.integrators == ["adaptive"]
    assert np.isfinite(best.metrics).all()
    assert not flagged.any()
