"""Lanes: the same cases as one at a time in plain Python, close to the exact integrator, in vectors of the machine."""

import math
import platform

import numpy as np
import pytest

from stickslip import jit
from stickslip.errors import InputError, UnknownName
from stickslip.jit import compiled_lanes, exponential
from stickslip.simulation.many import batch, simd_batch
from support.lane_loops import loops


def in_python(many: simd_batch.Lanes, i: int) -> np.ndarray:
    """Position and velocity of case i, by the same text in plain Python, one case at a time."""
    same = {"compile_inlined": lambda f: f, "compile_lanes": lambda f: f, "pointer": lambda a, _: a}
    same |= {"exponential": math.exp, "select": lambda c, a, b: a if c else b, "math": math, "np": np}
    text = "\n".join(line for line in many.text.splitlines() if not line.startswith(("import", "from")))
    exec(f"METERED = False\n{text.replace(f'LANES = {simd_batch.LANES}', 'LANES = 1')}", same)
    ends = np.zeros((1, 3))
    steps = np.array([0, len(many.reference)])
    same["solve_lanes"](
        many.shared, many.columns[i : i + 1], np.array([0.0, 0.0, 1.0]), many.step, many.reference, steps,
        np.zeros((1, 1, 12)), ends,
    )  # fmt: skip
    return ends[0, :2]


@pytest.mark.parametrize(("plant", "helper"), [("gms", "FB-gms"), ("lugre", "FB-stribeck")])
def test_lanes_do_what_one_case_does_in_plain_python(plant, helper):
    """To 1e-12 rad: products and sums are fused in lanes, and events magnify that."""
    _, _, many = loops(plant, helper, n=simd_batch.LANES + 3, duration=0.08)
    found = many.run(())
    for i in (0, simd_batch.LANES + 2):
        position, velocity = in_python(many, i)
        assert found.position[i] == pytest.approx(position, abs=1e-12)
        assert found.velocity[i] == pytest.approx(velocity, abs=1e-9)


def test_the_error_falls_with_the_square_of_the_step():
    case, columns, _ = loops()
    truth = batch.prepare(case, columns).run(()).position
    errors = [
        np.max(np.abs(simd_batch.prepare(case, columns, h).run(()).position - truth)) for h in (2e-4, 5e-5)
    ]
    assert errors[1] < 1e-6
    assert errors[0] > 8.0 * errors[1]


def test_a_step_with_more_switches_than_are_followed_is_told():
    """At 2e-3 s the elements that are fed back turn more than 16 times in a step; at 2e-4 s they do not."""
    assert not loops("gms", "FB-gms", duration=0.4, step=2e-4)[2].run(()).unresolved.any()
    assert loops("gms", "FB-gms", duration=0.4, step=2e-3)[2].run(()).unresolved.any()


@pytest.mark.skipif(platform.machine() not in ("x86_64", "AMD64"), reason="reads x86 code")
def test_the_step_runs_in_vectors(tmp_path, monkeypatch):
    _, _, many = loops("gms", "FB-gms", n=2, duration=0.01)
    # Code read from a kept cache has no listing: an empty cache, and a text that no other test compiled.
    monkeypatch.setattr(jit, "cache_folder", lambda: tmp_path)
    module = compiled_lanes(f"METERED = True\n{many.text}\n# {tmp_path}")
    c, h, n = many.shared, many.step, len(many.reference)
    ends = np.zeros((2, 3))
    start, cuts = np.array([0.0, 0.0, 1.0]), np.array([0, n])
    module.solve_lanes(c, many.columns, start, h, many.reference, cuts, np.zeros((2, 1, 12)), ends)
    (code,) = module.run.inspect_asm().values()
    wide = [line for line in code.splitlines() if "vdivpd" in line and ("ymm" in line or "zmm" in line)]
    assert len(wide) >= 3


def test_the_exponential_is_as_exact_as_it_says():
    x = np.concatenate([-np.geomspace(1e-9, 690.0, 2000), np.geomspace(1e-9, 690.0, 2000), [0.0]])
    found = np.array([exponential(v) for v in x])
    assert np.max(np.abs(found / np.exp(x) - 1.0)) < 1e-15


def test_what_lanes_refuse():
    with pytest.raises(InputError, match="holds at rest needs its events"):
        loops("coulomb")
    with pytest.raises(InputError, match="step = 0 s must be greater than 0"):
        loops(step=0.0)
    with pytest.raises(UnknownName, match="metric of lanes"):
        loops()[2].run(["reversals_per_s"])
