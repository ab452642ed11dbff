"""Five hundred random closed loops against their frozen motion: any engine must give it."""

import numpy as np
import pytest

from support.truth_loops import COUNT, FILE, KNOWN, draw

BLOCK = 50
TOLERANCE = 1e-9
CLOSE = 1e-8
"""rad: what a run at the default tolerance keeps unless its own estimate of its error is larger."""
TRUTH = np.load(FILE)


@pytest.mark.slow
@pytest.mark.parametrize("first", range(0, COUNT, BLOCK))
def test_random_loops_move_as_frozen(first):
    for at in range(first, first + BLOCK):
        loop = draw(int(TRUTH["number"][at]))
        apart = np.max(np.abs(loop.positions(TOLERANCE) - TRUTH["position"][at]))
        if apart > CLOSE:
            estimate = loop.run(TOLERANCE, check=True).meta["accuracy"]["error_rad"]
            assert apart < estimate + TRUTH["error"][at], (loop.number, loop.parts, apart, estimate)


def test_every_law_and_plant_is_among_the_frozen_loops():
    kinds = {draw(int(number)).parts[:2] for number in TRUTH["number"]}
    laws = {"gms", "maxwell_slip", "lugre", "elasto_plastic", "dahl", "coulomb"}
    assert len(TRUTH["number"]) == COUNT
    assert np.max(TRUTH["error"]) < KNOWN
    assert {law for law, _ in kinds} == laws
    assert {plant for _, plant in kinds} == {"rigid", "servo", "two masses"}
