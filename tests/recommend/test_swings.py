"""Swings to and fro at rest: a sequence of jumps that decays is no limit cycle, one that repeats is."""

import numpy as np
import pytest

from stickslip.recommendation.swings import repeats, turning_points, turns

TIME = np.arange(0.0, 1.0, 1e-3)


@pytest.mark.parametrize(("decay", "goes_on"), [(0.0, True), (0.3, True), (4.0, False)])
def test_swings_that_become_smaller_are_no_limit_cycle(decay, goes_on):
    position = np.exp(-decay * TIME) * np.cos(2.0 * np.pi * 4.0 * TIME)
    assert turns(position, 0.01) == 7
    assert repeats(position, 0.01) == goes_on


def test_what_cannot_be_told_is_taken_to_go_on():
    there_and_back = np.interp(TIME, [0.0, 0.3, 0.6, 1.0], [0.0, 1.0, 0.2, 0.2])
    assert turning_points(there_and_back, 0.1).tolist() == [0.0, 1.0]
    assert turns(there_and_back, 0.1) == 1
    assert repeats(there_and_back, 0.1)


def test_less_than_a_swing_is_rest():
    assert turns(0.04 * np.sin(30.0 * TIME), 0.1) == 0
    assert turning_points(0.04 * np.sin(30.0 * TIME), 0.1).size == 0
