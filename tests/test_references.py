"""Every registered kind of reference: derivatives, breaks, limits; the compiled profile equals plain Python."""

from __future__ import annotations

import ctypes
import math
from itertools import pairwise
from pathlib import Path
from time import perf_counter

import numpy as np
import pandas
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stickslip.core.errors import ParameterError, UnknownName
from stickslip.jit import compiled_profile, flat
from stickslip.models import plugins
from stickslip.models.model import Reference
from stickslip.subset import Layout

EXAMPLES = {
    "sine": Reference("sine", amplitude=0.01, frequency=0.4),
    "plain_sine": Reference("plain_sine", amplitude=0.01, frequency=0.4),
    "harmonic": Reference("harmonic", amplitude=0.01, frequency=0.4, phase=-1.5, velocity=0.01),
    "step": Reference("step", amplitude=0.01, tau=0.02),
    "ramp": Reference("ramp", velocity=0.3, end=1.2),
    "staircase": Reference("staircase", height=0.1, dwell=0.5, steps=4, tau=0.02),
    "scurve": Reference("scurve", distance=1.0, velocity=0.5, acceleration=2.0, jerk=40.0),
    "table": Reference.table([0.0, 1.0, 2.0, 3.0], [0.0, 1.0, 0.0, 0.5]),
}


def test_every_kind_has_an_example():
    assert set(EXAMPLES) >= set(plugins.reference_names())


def test_the_sine_starts_from_rest_and_the_plain_one_does_not():
    """A (1 - cos 2 pi f t) spans twice the amplitude that its name lets one expect: a kind of its own is A sin."""
    quarter = [0.0, 0.625, 1.25]  # s, of 2.5 s
    assert EXAMPLES["sine"].sample(quarter)[:, 0] == pytest.approx([0.0, 0.01, 0.02], abs=1e-15)
    plain = EXAMPLES["plain_sine"].sample(quarter)
    assert plain[:, 0] == pytest.approx([0.0, 0.01, 0.0], abs=1e-15)
    assert plain[0, 1] == pytest.approx(2.0 * np.pi * 0.4 * 0.01)
    assert EXAMPLES["plain_sine"].breaks(3.0) == pytest.approx([0.625, 1.875])


@pytest.mark.parametrize("file", ["README.md", "docs/tutorial.md", "src/stickslip/cli/simulate.py"])
def test_it_is_said_where_a_sine_is_first_used(file):
    text = (Path(__file__).parents[1] / file).read_text()
    first = min(i for written in ('"sine"', 'kind = "sine"') if (i := text.find(written)) >= 0)
    assert "(1 - cos" in text[first : first + 400]


@pytest.mark.parametrize("name", EXAMPLES)
def test_derivatives_are_consistent_between_breaks(name):
    reference, duration, h = EXAMPLES[name], 3.0, 1e-6
    edges = [0.0, *reference.breaks(duration), duration]
    for start, end in pairwise(edges):
        t = np.linspace(start + 1e-3 * (end - start), end - 1e-3 * (end - start), 11)
        now, before, after = (reference.sample(t + d) for d in (0.0, -h, h))
        velocity = (after[:, 0] - before[:, 0]) / (2 * h)
        acceleration = (after[:, 1] - before[:, 1]) / (2 * h)
        assert np.abs(velocity - now[:, 1]).max() <= 1e-6 * (1 + np.abs(now[:, 1]).max() * 1e2)
        assert np.abs(acceleration - now[:, 2]).max() <= 1e-5 * (1 + np.abs(now[:, 2]).max() * 1e2)


@pytest.mark.parametrize("name", EXAMPLES)
def test_velocity_keeps_its_sign_between_breaks(name):
    """Integrators rely on it: a feedforward's sign changes only at breaks."""
    reference, duration = EXAMPLES[name], 3.0
    edges = [0.0, *reference.breaks(duration), duration]
    for start, end in pairwise(edges):
        t = np.linspace(start, end, 102)[1:-1]
        assert len(set(np.sign(reference.sample(t)[:, 1])) - {0.0}) <= 1


@pytest.mark.parametrize("name", EXAMPLES)
def test_compiled_profile_equals_plain_python(name):
    reference = EXAMPLES[name]
    kind = reference.kind
    address = compiled_profile(kind.name, kind.profile, Layout.of(kind.fields, counted=True))
    pointer = ctypes.POINTER(ctypes.c_double)
    call = ctypes.CFUNCTYPE(None, ctypes.c_double, pointer, pointer)(address)
    p, out = flat(kind.pack(reference.parameters)), np.zeros(3)
    for t in np.linspace(0.0, 4.0, 97):
        call(t, p.ctypes.data_as(pointer), out.ctypes.data_as(pointer))
        assert tuple(out) == tuple(reference.sample([t])[0])


@given(
    distance=st.floats(1e-4, 10),
    velocity=st.floats(1e-2, 20),
    acceleration=st.floats(1e-1, 200),
    jerk=st.floats(1, 2e4),
)
@settings(max_examples=150)
def test_scurve_keeps_its_limits_and_arrives(distance, velocity, acceleration, jerk):
    reference = Reference(
        "scurve", distance=distance, velocity=velocity, acceleration=acceleration, jerk=jerk
    )
    end = max(reference.breaks(1e6))
    rows = reference.sample(np.linspace(0.0, end, 501))
    assert rows[-1, 0] == pytest.approx(distance, rel=1e-9)
    assert np.abs(rows[:, 1]).max() <= velocity * (1 + 1e-9)
    assert np.abs(rows[:, 2]).max() <= acceleration * (1 + 1e-9)
    assert np.all(np.diff(rows[:, 0]) >= -1e-12)
    change = np.abs(np.diff(rows[:, 2])).max() / (end / 500)
    assert change <= jerk * (1 + 1e-6)


def test_table_passes_through_its_points():
    t, x = [0.0, 0.5, 1.5, 2.0], [0.0, 1.0, -1.0, 0.25]
    assert Reference.table(t, x).sample(t)[:, 0] == pytest.approx(x)


def test_a_table_breaks_at_its_points_and_where_it_turns():
    """Beside the points: where a cubic's velocity passes through zero, twice, once at a bend, or never."""
    t, x, v = [0.0, 1.0, 2.0, 3.0, 4.0], [0.0, 0.0, 0.0, 1.0, 1.0], [1.0, 1.0, -1.0, 1.0, 0.0]
    found = Reference.table(t, x, v).breaks(4.0)
    third = 0.5 - np.sqrt(1.0 / 12.0)
    turns = [third, 1.0 - third, 1.5, 2.0 + (4.0 - np.sqrt(10.0)) / 6.0, 3.0 + 1.0 / 3.0]
    assert found == pytest.approx(sorted([1.0, 2.0, 3.0, *turns]))


def test_a_table_of_many_points_is_laid_out_at_once():
    time = np.linspace(0.0, 20.0, 2001)
    reference = Reference.table(time, np.sin(time))
    begun = perf_counter()
    assert len(reference.breaks(20.0)) >= 1999
    assert perf_counter() - begun < 0.05  # it was 0.2 s, for every case of a sweep


def test_table_without_velocities_does_not_overshoot():
    """Dwells stay dwells, and the motion starts and ends at rest."""
    t, x = [0.0, 0.5, 1.5, 2.0, 3.0, 3.5], [0.0, 0.0, 1.0, 1.0, 0.0, 0.0]
    reference = Reference.table(t, x)
    rows = reference.sample(np.linspace(0.0, 3.5, 701))
    assert rows[:, 0].min() >= -1e-15
    assert rows[:, 0].max() <= 1.0 + 1e-15
    assert np.abs(rows[300:401, 0] - 1.0).max() < 1e-14
    assert rows[0, 1] == rows[-1, 1] == 0.0


@pytest.mark.parametrize(
    ("step", "uneven", "order"),
    [
        (1e-3, 0.0, 1e-5),
        (4e-3, 0.0, 2e-4),
        (1e-2, 0.0, 1e-3),
        (5e-2, 0.0, 0.03),
        (1e-3, 0.3, 3e-5),
        (1e-2, 0.3, 3e-3),
    ],
)
def test_points_of_a_smooth_motion_give_its_acceleration(step, uneven, order):
    """Also where it turns: there it was 1.5 times the largest wrong, however dense the points."""
    w, times = 3.0 * np.pi, np.arange(0.0, 2.0 + 0.5 * step, step)
    times[1:-1] += uneven * step * np.random.default_rng(3).uniform(-1.0, 1.0, times.size - 2)
    at = np.linspace(0.1, 1.9, 20001)
    rows = Reference.table(times, 0.05 * (1.0 - np.cos(w * times))).sample(at)
    largest = 0.05 * w * w
    assert np.abs(rows[:, 1] - 0.05 * w * np.sin(w * at)).max() < 0.5 * order * largest / w
    assert np.abs(rows[:, 2] - largest * np.cos(w * at)).max() < order * largest


@given(st.lists(st.floats(-2.0, 2.0), min_size=2, max_size=8), st.integers(2, 4), st.floats(0.1, 10.0))
def test_a_staircase_of_any_points_has_no_overshoot(levels, repeated, step):
    """Nor do its dwells move; a few points that bend like a parabola are taken for one."""
    positions = np.repeat(levels, repeated + 1)
    reference = Reference.table(step * np.arange(positions.size), positions)
    rows = reference.sample(np.linspace(0.0, step * (positions.size - 1), 8 * positions.size))
    assert rows[:, 0].min() >= min(levels) - 1e-12
    assert rows[:, 0].max() <= max(levels) + 1e-12
    for k in np.flatnonzero(np.diff(positions) == 0.0).tolist():
        between = reference.sample(step * np.linspace(k, k + 1, 5))[:, 0]
        assert np.abs(between - positions[k]).max() < 1e-12


def test_bad_references_are_refused():
    with pytest.raises(UnknownName, match="did you mean 'sine'"):
        Reference("sin", amplitude=1.0)
    with pytest.raises(ParameterError, match="frequency = 0"):
        Reference("sine", amplitude=1.0, frequency=0.0)
    with pytest.raises(ParameterError, match=r"time\[1\]"):
        Reference("table", time=[0.0, 0.0], position=[0.0, 1.0], velocity=[0.0, 0.0])
    with pytest.raises(ParameterError, match=r"time\[2\] = 1 s must come after time\[1\] = 1 s"):
        Reference.table([0.0, 1.0, 1.0], [0.0, 1.0, 2.0])
    with pytest.raises(ParameterError, match="whole number"):
        Reference("staircase", height=0.1, dwell=1.0, steps=2.5)


@pytest.mark.parametrize(
    ("points", "said"),
    [
        (
            ([0.0, 2.0, 1.0], [0.0] * 3),
            r"time\[2\] = 1 s must come after time\[1\] = 2 s; sort the rows by time",
        ),
        (([0.0, 1.0, 1.0], [0.0] * 3), r"time\[2\] = 1 s must come after .*; leave one of both rows out"),
        (([0.0, math.nan, 1.0], [0.0] * 3), r"time\[1\] = nan s must be a finite number"),
        (([0.0, 1.0], [0.0, -math.inf]), r"position\[1\] = -inf rad must be a finite number"),
        (([0.0, 1.0], [0.0, 1.0], [0.0, math.nan]), r"velocity\[1\] = nan rad/s must be a finite number"),
        ((np.zeros((2, 2)), np.zeros((2, 2))), r"time has the shape \(2, 2\); give one number a point"),
        ((np.arange(4.0), np.zeros((4, 1))), r"position has the shape \(4, 1\)"),
        (([0.0, 1.0], [0.0, 1.0, 2.0]), "time has 2 values and position 3; give as many of each"),
        (([0.0], [0.0]), "at least two points"),
        (([0.0, 1.0], [0.0, 1.0], [0.0]), "time has 2 values and velocity 1"),
        ((["0", 1.0], [0.0, 1.0]), r"time\[0\] = '0' must be a number"),
        ((np.array([None, 1.0]), [0.0, 1.0]), r"time\[0\] = nan|holds what is no number"),
    ],
)
def test_a_table_that_cannot_be_names_the_row(points, said):
    """One line for all of them named neither row nor value."""
    with pytest.raises(ParameterError, match=said):
        Reference.table(*points)


def test_a_table_takes_arrays_of_any_kind():
    lists = Reference.table([0, 1, 2], [0.0, 0.1, 0.3])
    assert Reference.table(np.arange(3), np.array([0.0, 0.1, 0.3])) == lists
    assert Reference.table(pandas.Series([0, 1, 2]), (0.0, 0.1, 0.3)) == lists


def test_a_table_of_times_is_refused():
    """Its rows were taken one after another without a word."""
    sine = Reference("sine", amplitude=0.1, frequency=1.0)
    assert sine.sample([0.1]).shape == (1, 3)
    with pytest.raises(
        ParameterError, match=r"time has the shape \(2, 3\); give the times one after another"
    ):
        sine.sample(np.zeros((2, 3)))
