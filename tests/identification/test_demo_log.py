"""The log that ships with the package, of which everything is known."""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path

import pytest

import stickslip as ss
from stickslip.identification.estimate import Identification

TRUTH = {"inertia": 4e-4, "fs": 0.335, "fc": 0.285, "vs": 0.1, "sigma2": 0.018, "offset": 0.03}


@pytest.fixture(scope="module")
def found() -> Identification:
    return ss.identify(Path(str(files("stickslip") / "demo.csv")), law=["coulomb", "stribeck"])


def test_the_law_that_made_the_demo_log_is_chosen(found: Identification) -> None:
    assert found.model is not None
    assert found.model.law.name == "stribeck"


def test_the_inertia_of_the_demo_log_is_right_within_2_percent(found: Identification) -> None:
    assert found["inertia"].value == pytest.approx(TRUTH["inertia"], rel=0.02)


@pytest.mark.parametrize("name", TRUTH)
def test_every_number_of_the_demo_log_is_identified_and_right(found: Identification, name: str) -> None:
    e = found[name]
    assert e.identified
    assert e.lower <= TRUTH[name] <= e.upper
