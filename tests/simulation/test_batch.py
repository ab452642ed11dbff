"""Batches: laid out as one loop at a time, bit for bit, and running as it does."""

import numpy as np
import pytest

from stickslip.control.compensator import Feedback, Feedforward
from stickslip.control.controller import Controller
from stickslip.control.linear import Gains, place
from stickslip.core.errors import InputError, UnknownName
from stickslip.machines.rigid import RigidAxis
from stickslip.models.model import Model, Reference
from stickslip.simulation.case_arrays import COMPENSATOR_SCALE, PLANT_SCALE, STIFFNESS
from stickslip.simulation.closed_loop import prepare
from stickslip.simulation.exact import engine as exact
from stickslip.simulation.exact.state import AT_SIDES
from stickslip.simulation.many import batch
from stickslip.simulation.metrics import COARSE, metrics

CURVE = {"fs": 0.335, "fc": 0.285, "vs": 0.01, "sigma2": 0.018}
LAWS = {
    "gms": Model("gms", k=[1e4, 7e3, 5e3, 3e3], alpha=[0.25] * 4, c=24.0, **CURVE),
    "lugre": Model("lugre", sigma0=3.5e4, sigma1=0.1, **CURVE),
    "stribeck": Model("stribeck", k=3.5e4, **CURVE),
    "coulomb": Model("coulomb", fc=0.285, sigma2=0.018),
    "maxwell_slip": Model("maxwell_slip", k=[1e4, 7e3], w=[0.15, 0.15], sigma2=0.018),
    "table": Model(
        "gms", {"curve": "double_exponential"}, k=[1e4, 5e3], alpha=[0.5, 0.5], c=24.0, sigma2=0.018,
        alpha0=0.1, alpha1=0.235, alpha2=0.185, v1=0.01, v2=0.015,
    ),
}  # fmt: skip
INERTIA = 3.8623e-4
PD = place("PD", INERTIA, 36.0, 1.0)
SINE = Reference("sine", amplitude=0.01, frequency=2.0)


def varied(model: Model, n: int, rng: np.random.Generator) -> dict[str, np.ndarray]:
    """Every parameter of a law within 20 % of its value; shares as they are."""
    columns = {}
    for name, value in model.parameters._asdict().items():
        if name not in ("alpha", "delta_s"):
            base = np.asarray(value, dtype=float)
            columns[name] = base * rng.uniform(0.8, 1.2, (n, *base.shape))
    return columns


def one_of(model: Model, columns: dict[str, np.ndarray], i: int) -> Model:
    given = model.parameters._asdict() | {k: v[i].tolist() for k, v in columns.items()}
    return Model(model.law, **given)


@pytest.mark.parametrize("plant", ["gms", "lugre", "coulomb", "maxwell_slip", "table"])
@pytest.mark.parametrize("helper", [None, "FF-lugre", "FB-gms", "FB-lugre", "FB-stribeck", "FB-coulomb"])
def test_each_loop_is_laid_out_and_runs_as_one_alone(plant, helper):
    n, rng = 3, np.random.default_rng(7)
    friction, inertia = varied(LAWS[plant], n, rng), INERTIA * rng.uniform(0.7, 1.3, n)
    columns = {f"friction.{k}": v for k, v in friction.items()} | {
        "inertia": inertia, "kd": PD.kd * rng.uniform(0.8, 1.2, n), "ki": rng.uniform(0.0, 5.0, n),
    }  # fmt: skip
    law = {}
    compensator = None
    if helper:
        kind, name = helper.split("-")
        compensator = (Feedforward if kind == "FF" else Feedback)(LAWS[name])
        columns["gain"] = rng.uniform(0.5, 1.0, n)
        if kind == "FB":
            law = varied(LAWS[name], n, rng)
            columns |= {f"law.{k}": v for k, v in law.items()}
    axis = RigidAxis(INERTIA, LAWS[plant])
    case = prepare(axis, Controller(PD, compensator), SINE, 0.6, tolerance=1e-7, output=0.6)
    many = batch.prepare(case, columns)
    found = many.run()
    for i in range(n):
        gains = Gains(PD.kp, columns["ki"][i], columns["kd"][i], PD.kr)
        assist = compensator and type(compensator)(one_of(compensator.model, law, i), columns["gain"][i])
        one = prepare(
            RigidAxis(inertia[i], one_of(LAWS[plant], friction, i)), Controller(gains, assist), SINE, 0.6,
            tolerance=1e-7, output=0.6,
        )  # fmt: skip
        alone = exact.prepare(one)
        assert np.array_equal(many.plans[i], alone.plan)
        assert np.array_equal(many.starts[i], alone.work[AT_SIDES:], equal_nan=True)
        unread = (COMPENSATOR_SCALE, PLANT_SCALE, STIFFNESS)
        assert np.array_equal(np.delete(many.parameters[i], unread), np.delete(alone.parameters, unread))
        outcome = alone.record()
        assert found.codes[i] == outcome.code == 0
        for name, value in metrics(outcome.meter, outcome.turns).items():
            # The compiler may round the same kernel differently in another loop, and events magnify that.
            assert found.metrics[name][i] == pytest.approx(value, rel=1e-6, abs=1e-9, nan_ok=True), name


def loops(n, compensator=None, **more):
    rng = np.random.default_rng(3)
    axis = RigidAxis(INERTIA, LAWS["gms"])
    case = prepare(axis, Controller(PD, compensator), SINE, 1.0, tolerance=1e-7, output=1.0)
    columns = {
        "friction.fs": 0.335 * rng.uniform(0.7, 1.3, n),
        "friction.fc": 0.285 * rng.uniform(0.7, 1.3, n),
    }
    return batch.prepare(case, columns | more)


@pytest.mark.parametrize("compensator", [None, Feedback(LAWS["gms"]), Feedforward(LAWS["lugre"])])
def test_long_windows_give_the_same_metrics(compensator):
    many = loops(20, compensator)
    fine, coarse = many.run(), many.run(COARSE)
    for name in COARSE:
        scale = np.max(np.abs(fine.metrics[name]))
        assert np.max(np.abs(coarse.metrics[name] - fine.metrics[name])) < 1e-3 * scale, name


@pytest.mark.parametrize("compensator", [None, Feedback(LAWS["gms"])])
def test_metrics_leave_every_bit_of_the_motion(compensator):
    many = loops(9, compensator)
    bare = many.run(())
    for metered in (many.run(COARSE), many.run()):
        assert np.array_equal(metered.position, bare.position)
        assert np.array_equal(metered.velocity, bare.velocity)


def test_a_batch_gives_the_same_again_in_any_cut_and_in_threads():
    many, name = loops(9), "position_rms_rad"
    whole = many.run([name]).metrics[name]
    assert np.array_equal(whole, many.run([name]).metrics[name])
    assert np.array_equal(whole[4:], many[4:].run([name]).metrics[name])
    one, threads = many.run([name]), many.run([name], jobs=4)
    assert np.array_equal(whole, threads.metrics[name])
    for part in ("codes", "time", "position", "velocity"):
        assert np.array_equal(getattr(one, part), getattr(threads, part))
    assert np.unique(whole).size == 9


def test_what_a_batch_refuses():
    with pytest.raises(UnknownName, match="metric"):
        loops(2).run(["position_rms"])
    with pytest.raises(InputError, match="fs = -1 N·m must be greater than 0"):
        loops(2, **{"friction.fs": np.array([0.3, -1.0])})
    with pytest.raises(UnknownName, match="parameter of law 'gms'"):
        loops(2, **{"friction.f": np.ones(2)})
    with pytest.raises(InputError, match="no compensator"):
        loops(2, gain=np.ones(2))
    with pytest.raises(InputError, match="tabulated once"):
        loops(2, Feedforward(LAWS["lugre"]), **{"law.fs": np.ones(2)})
    with pytest.raises(InputError, match="alpha adds up to"):
        loops(2, **{"friction.alpha": np.full((2, 4), 0.3)})
    with pytest.raises(InputError, match="inertia from -1"):
        loops(2, inertia=np.array([-1.0, 1.0]))
