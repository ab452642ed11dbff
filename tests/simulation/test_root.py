"""The root finder of the implicit steps: the nearest root, sharp powers, jumps; one text, the same numbers."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stickslip.simulation import root
from stickslip.simulation.recorded_input.segments import root_finder
from stickslip.simulation.root import MOST, ROOT

ENOUGH, ROUNDING, LEAST = 1e-11, 1e-11, 1e-2


def search(**kept: float) -> Any:
    """What a search begins with."""
    start = {"inverse": 1.0, "enough": ENOUGH, "rounding": ROUNDING, "least": LEAST, "sharp": 1.0}
    return SimpleNamespace(**dict.fromkeys(ROOT.scalars, 0.0) | start | kept)


def solved(f: Callable[[float], float], guess: float, r: Any) -> tuple[float, int]:
    """The root, and how often f was evaluated."""
    root.begin(r, guess)
    for count in range(1, MOST + 1):
        if root.improve(r, f(r.x)) == 0.0:
            return r.x, count
    raise AssertionError("no root within the evaluations that a step gives it")


def friction(v: float, size: float, power: float) -> float:
    """A torque like a power of the velocity."""
    return math.copysign(size * abs(v) ** power, v)


@settings(max_examples=300)
@given(
    power=st.sampled_from([0.2, 0.3768, 0.5, 1.0, 1.7, 2.0]),
    inertia=st.floats(1e-4, 1.0), size=st.floats(1e-4, 1.0), driven=st.floats(-1.0, 1.0),
    scale=st.floats(-6.0, 0.0), guess=st.sampled_from([0.0, 1e-6, -1e-3, 0.1, -2.0]),
)  # fmt: skip
def test_powers_of_the_velocity_are_solved(
    power: float, inertia: float, size: float, driven: float, scale: float, guess: float
) -> None:
    free = driven * 10.0**scale
    r = search(inverse=1.0 / inertia, enough=inertia * ENOUGH)

    def f(v: float) -> float:
        return inertia * v + friction(v, size, power) - free

    v, count = solved(f, guess, r)
    near = 1.01 * ROUNDING * max(abs(v), LEAST)
    assert f(v - near) <= 0.0 <= f(v + near)
    assert count <= 30


def lacking(v: float, free: float) -> float:
    """The momentum that an end velocity lacks, with the viscous friction of thesis Table 10."""
    return 1e-3 * v + friction(v, 1e-2, 0.3768) - free


def test_a_power_that_was_met_before_takes_three_evaluations() -> None:
    r, v, total = search(enough=1e-3 * 1e-8, least=0.1), 0.0, 0
    for k in range(2000):
        free = 1e-3 * (v + math.sin(0.01 * k))
        v, count = solved(partial(lacking, free=free), v, r)
        total += count
    assert total / 2000 < 3.5


def test_a_line_takes_one_evaluation_where_its_slope_is_known() -> None:
    r = search()
    assert solved(lambda x: 40.0 * (x - 0.3), 0.0, r)[0] == pytest.approx(0.3, abs=1e-12)
    v, count = solved(lambda x: 40.0 * (x + 0.2), 0.3, r)
    assert v == pytest.approx(-0.2, abs=1e-12)
    assert count == 2


def test_of_several_roots_the_next_one_is_taken() -> None:
    # Friction that falls with the velocity between 0.1 and 0.2: three roots.
    def f(v: float) -> float:
        return (v - 0.05) * (v - 0.15) * (v - 0.3) * 1e3

    for guess, found in ((0.0, 0.05), (0.1, 0.05), (0.16, 0.3), (0.4, 0.3)):
        assert solved(f, guess, search(inverse=1e-2))[0] == pytest.approx(found, abs=1e-9)


def test_a_jump_is_closed_in_on() -> None:
    v, _ = solved(lambda x: x - 0.2 + (1.0 if x > 0.1 else -1.0), 0.0, search())
    assert v == pytest.approx(0.1, abs=1e-12)


def test_what_is_no_number_ends_the_search() -> None:
    for wrong in (math.nan, math.inf, -math.inf):
        r = search()
        root.begin(r, 1.0)
        assert root.improve(r, wrong) == 0.0


def selected(test: bool, a: float, b: float) -> float:
    """What vectors have in place of a branch."""
    return a if test else b


@given(
    numbers=st.lists(st.floats(-1.0, 1.0), min_size=5, max_size=5), phase=st.sampled_from([0.0, 1.0, 2.0, 3.0]),
    inverse=st.floats(0.1, 10.0),
)  # fmt: skip
def test_compiled_and_branchless_texts_say_the_same(
    numbers: list[float], phase: float, inverse: float
) -> None:
    x, last, f_last, other, f = numbers
    kept = {
        "x": x,
        "last": last,
        "f_last": f_last,
        "other": other,
        "phase": phase,
        "inverse": inverse,
        "sharp": 0.0,
    }
    plain = search(**kept)
    goes_on = root.improve(plain, f)

    flat = np.array([getattr(search(**kept), name) for name in ROOT.scalars])
    assert root.compiled.improve(flat, f) == goes_on
    assert flat.tolist() == [getattr(plain, name) for name in ROOT.scalars]

    names = ("x", "last", "f_last", "other", "phase", "rise")
    w = SimpleNamespace(**dict(zip(names, np.array([x, last, f_last, other, phase, inverse]))))
    scope: dict[str, Any] = {"math": math, "select": selected}
    with np.errstate(all="ignore"):
        exec("\n".join(root_finder()[1:]), scope)
        assert scope["searched"](w, np.float64(f), ENOUGH, ROUNDING) == goes_on
    ends = [getattr(plain, name) for name in ("x", "last", "f_last", "other", "phase", "inverse")]
    assert [getattr(w, name) for name in names] == pytest.approx(ends, rel=1e-15, nan_ok=True)
