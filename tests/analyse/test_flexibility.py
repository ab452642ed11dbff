"""Twist and modes against the thesis's numbers and known answers."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from stickslip.analyse.flexibility import (
    far_inertia,
    flexibility,
    lowest_first_mode,
    shaft_stiffness,
    twist,
)
from stickslip.core.errors import ParameterError
from stickslip.machines.drivetrain import Chain
from stickslip.report.analysis_pictures import picture_of_flexibility

TOTAL, SPRINGS = 4.2757e-4, (17800.0, 396.0)
sizes = st.floats(1e-3, 1.0)


@pytest.mark.parametrize(
    ("torque", "stiffness", "printed", "room"),
    [
        # 396 is rounded to 3 digits, so 7.46e-4 is met to 0.13 %.
        (0.2951, 396.0, 7.46e-4, 1.3e-3),
        (80.7454 - 80.4742, 396.0, 6.85e-4, 1e-3),
        (0.2951, 17800.0, 1.7e-5, 0.03),
        (80.7454 - 80.4742, 17800.0, 1.5e-5, 0.03),
    ],
)
def test_twists_of_the_thesis(torque, stiffness, printed, room):
    assert twist(torque, stiffness) == pytest.approx(printed, rel=room)


def test_the_stiffness_of_a_round_shaft():
    """The thesis's 396 N·m/rad (4.5) are those of 396 mm of its shaft of 12 mm, in stainless steel."""
    assert shaft_stiffness(0.012, 0.396, 77e9) == pytest.approx(396.0, rel=2e-3)
    assert shaft_stiffness(0.02, 1.0, 80e9, bore=0.01) == pytest.approx(
        80e9 * math.pi / 32 * (0.02**4 - 0.01**4)
    )
    for wrong in ((0.0, 1.0, 1e9), (0.01, 1.0, -1e9), (0.01, 1.0, 1e9, 0.01)):
        with pytest.raises(ParameterError):
            shaft_stiffness(*wrong)


def test_two_inertias_have_the_textbook_mode():
    found = Chain((2.0, 3.0), (50.0,)).modes()
    assert found.frequencies == pytest.approx([0.0, math.sqrt(50.0 * (1 / 2 + 1 / 3)) / (2 * math.pi)])
    assert found.shapes[:, 0] == pytest.approx([1.0, 1.0])
    assert found.shapes[:, 1] == pytest.approx([1.0, -2.0 / 3.0])


@given(st.tuples(sizes, sizes, sizes), st.tuples(st.floats(1.0, 1e5), st.floats(1.0, 1e5)))
def test_no_inertias_go_below_the_bound(parts, springs):
    chain = Chain(tuple(TOTAL * p / sum(parts) for p in parts), springs)
    frequencies = 2.0 * math.pi * chain.modes().frequencies[1:]
    floor = 2.0 * math.pi * lowest_first_mode(springs, TOTAL) * (1.0 - 1e-9)
    assert frequencies[0] >= floor
    assert frequencies[1] >= math.sqrt(2.0) * floor


def test_the_bound_is_reached_and_excludes_270_hz():
    floor = lowest_first_mode(SPRINGS, TOTAL)
    assert floor == pytest.approx(303.0, abs=0.1)
    halves = Chain((0.5 * TOTAL, 1e-9 * TOTAL, 0.5 * TOTAL), SPRINGS)
    assert halves.modes().frequencies[1] == pytest.approx(floor, rel=1e-6)
    found = flexibility(SPRINGS, TOTAL, claimed=(270.0, 2750.0))
    assert "a first mode at 270 Hz is impossible" in found.lines()[-2]
    assert found.lines()[-1] == "a second mode at 2750 Hz is possible"
    assert "a first mode at 330 Hz is possible" in flexibility(SPRINGS, TOTAL, claimed=(330.0,)).lines()
    second = flexibility(SPRINGS, TOTAL, claimed=(310.0, 420.0)).lines()[-1]
    assert second == "a second mode at 420 Hz is impossible: it is at least 428.5 Hz"
    # Read as the frequency of the far inertia with the rest held, 270 Hz is near what was measured.
    assert far_inertia(396.0, 270.0) == pytest.approx(1.376e-4, rel=1e-3)
    assert found.true_first is not None
    assert 320.0 < found.true_first < 340.0


def test_printed_270_and_2750_agree_as_frequencies_of_parts():
    """With 270 Hz the far inertia's own, 2750 Hz is the mode of what is left on the coupling."""
    rest = TOTAL - far_inertia(396.0, 270.0)
    product = 17800.0 * rest / (2.0 * math.pi * 2750.0) ** 2
    root = math.sqrt(rest**2 / 4.0 - product)
    parts = (rest / 2.0 + root, rest / 2.0 - root)
    assert Chain(parts, (17800.0,)).modes().frequencies[1] == pytest.approx(2750.0)
    assert min(parts) > 0.0


@pytest.mark.parametrize(
    ("springs", "whole", "more"),
    [
        ((0.0,), 1.0, {}),
        ((1.0,), -1.0, {}),
        ((1.0,), 1.0, {"inertias": (0.5, 0.2)}),
        ((1.0, 1.0), 1.0, {"inertias": (0.5, 0.5)}),
        ((1.0,), 1.0, {"claimed": (0.0,)}),
        ((1.0,), 1.0, {"claimed": (1.0, 2.0)}),
        ((1.0, 1.0), 1.0, {"claimed": (2.0, 1.0)}),
    ],
)
def test_bad_input(springs, whole, more):
    with pytest.raises(ParameterError):
        flexibility(springs, whole, **more)


def test_the_picture_shows_the_modes_of_the_given_inertias():
    """Figure 4.57: those of the thesis's machine are 0, 308 and 2749 Hz; the thesis prints 0, 270 and 2750."""
    parts = (1.2e-4, 1.2e-4, 1.8757e-4)
    *_, panels, _ = picture_of_flexibility(flexibility(SPRINGS, TOTAL, inertias=parts))
    point = next(c for c in panels[0].curves if c.label.startswith("these inertias"))
    assert point.y == pytest.approx([307.8], abs=0.1)
    assert point.x == pytest.approx([100.0 * parts[-1] / TOTAL])
    shapes = {c.label: c.x for c in panels[1].curves}
    assert list(shapes) == ["mode at 0 Hz", "mode at 308 Hz", "mode at 2749 Hz"]
    assert sum(np.diff(np.sign(shapes["mode at 2749 Hz"])) != 0) == 2
    assert len(picture_of_flexibility(flexibility(SPRINGS, TOTAL))[2]) == 1
