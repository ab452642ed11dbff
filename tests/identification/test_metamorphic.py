"""What must not change a result: other units, sign and zero of the position, more rows, and true prior knowledge."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
import pytest

from stickslip.identification.experiment import Experiment
from stickslip.identification.search import Asked
from stickslip.identification.sliding import Number, SlidingPosterior, estimate_sliding
from stickslip.machines.servo import ServoAxis

AXIS = ServoAxis(drive_side="load")
LINEAR = ServoAxis(motion="linear")
NUMBERS = ("inertia", "fc", "sigma2", "offset")
WIDENED, MOVED, DROPPED = 1.1, 0.5, 1.0 / 3.0
"""Factor on a half-width, and parts of it by which a value may move: as the issue of this estimator demands."""

LOGS: Mapping[str, tuple[Any, ...]] = {
    "production": (4, "held", 1000, "p-pi", "production", "clean"),
    "staircase": (1811, "commanded", 1000, "p-pi", "staircase", "clean"),
    "cogging": (97, "held", 1000, "p-pi", "staircase", "cogging"),
    "backlash": (410422, "actual", 500, "p-pi", "production", "backlash"),
}


class Case(NamedTuple):
    """A log, its truth and what is found on it as it is."""

    experiment: Experiment
    truth: Mapping[str, float]
    found: SlidingPosterior


@pytest.fixture(scope="session", params=LOGS)
def case(request: pytest.FixtureRequest, logs: Any) -> Case:
    log = logs.draw(*LOGS[request.param])
    experiment = Experiment("log", log.time, log.position, log.torque)
    return Case(experiment, log.truth, estimate_sliding([experiment], AXIS))


def is_identified(name: str, number: Number, level: float) -> bool:
    """Whether upper and lower end differ by a factor of 2 at most; of the constant torque, by a third of the level."""
    return number.half < (level if name == "offset" else number.value) / 3.0


def compare(
    before: SlidingPosterior, after: SlidingPosterior, factors: Mapping[str, float]
) -> dict[str, tuple[float, float]]:
    """Return by how much each identified interval is wider, and each value moved in half-widths."""
    level = before.numbers["fc"].value
    out = dict[str, tuple[float, float]]()
    for name in NUMBERS:
        if is_identified(name, old := before.numbers[name], level):
            new, factor = after.numbers[name], factors.get(name, 1.0)
            out[name] = (
                new.half / (abs(factor) * old.half),
                abs(new.value / factor - old.value) / old.half,
            )
    assert out, "nothing identified to compare"
    return out


def assert_alike(
    before: SlidingPosterior, after: SlidingPosterior, factors: Mapping[str, float] | None = None
) -> None:
    """No identified interval is wider by more than a tenth, no value moved by more than half its half-width."""
    changes = compare(before, after, factors or {})
    assert {n: c for n, c in changes.items() if c[0] > WIDENED or c[1] > MOVED} == {}


def changed(experiment: Experiment, position: Any = None, torque: Any = None, time: Any = None) -> Experiment:
    """Return the record with other columns."""
    return replace(
        experiment,
        time=experiment.time if time is None else time,
        position=experiment.position if position is None else position,
        drive=experiment.signal() if torque is None else torque,
    )


KNOWN = {
    ("test_the_same_record_twice_gives_the_same_axis", "production"),
    ("test_the_same_record_twice_gives_the_same_axis", "backlash"),
    ("test_a_second_record_that_overlaps_the_first_widens_nothing", "production"),
    ("test_a_second_record_that_overlaps_the_first_widens_nothing", "staircase"),
    ("test_ten_seconds_of_rest_at_the_end_change_nothing", "production"),
    ("test_a_hundredth_of_the_rows_missing_moves_no_value_by_a_third_of_its_half_width", "production-0"),
    ("test_another_description_of_a_record_gives_the_same_axis", "backlash-another time origin"),
}
"""Tests and logs that fail today: the search ends elsewhere, an interval is wider or a value moves too far."""


@pytest.fixture(autouse=True)
def known_failure(request: pytest.FixtureRequest) -> None:
    """Expect the failures of `KNOWN`."""
    name, _, of = request.node.name.partition("[")
    if (name, of.rstrip("]")) in KNOWN:
        request.applymarker(pytest.mark.xfail(strict=True, raises=AssertionError, reason="listed in KNOWN"))


def test_the_truth_is_in_the_identified_intervals(case: Case) -> None:
    level = case.found.numbers["fc"].value
    known = [n for n in NUMBERS if is_identified(n, case.found.numbers[n], level)]
    assert known
    for name in known:
        low, high = case.found.interval(name)
        assert low <= case.truth[name] <= high, name


SAME: Mapping[str, tuple[Callable[[Experiment], Experiment], Mapping[str, float]]] = {
    "torque in mN·m": (
        lambda e: changed(e, torque=1e3 * e.signal()), dict.fromkeys(NUMBERS, 1e3)
    ),
    "inverted signs": (
        lambda e: changed(e, position=-e.position, torque=-e.signal()), {"offset": -1.0}
    ),
    "another time origin": (lambda e: changed(e, time=e.time + 4096.0), {}),
    "whole turns added": (lambda e: changed(e, position=e.position + 10.0 * math.pi), {}),
}  # fmt: skip


@pytest.mark.parametrize("change", SAME)
def test_another_description_of_a_record_gives_the_same_axis(case: Case, change: str) -> None:
    describe, factors = SAME[change]
    assert_alike(case.found, estimate_sliding([describe(case.experiment)], AXIS), factors)


def test_a_linear_axis_has_the_same_numbers_in_metres_as_in_millimetres(case: Case) -> None:
    metres, thousand = case.experiment, 1e3
    found = [
        estimate_sliding([changed(metres, position=scale * metres.position)], LINEAR) for scale in (1.0, thousand)
    ]  # fmt: skip
    assert_alike(found[0], found[1], {"inertia": 1.0 / thousand, "sigma2": 1.0 / thousand})


def test_the_same_record_twice_gives_the_same_axis(case: Case) -> None:
    assert_alike(case.found, estimate_sliding([case.experiment, case.experiment], AXIS))


def test_a_second_record_that_overlaps_the_first_widens_nothing(case: Case) -> None:
    rows = case.experiment.time.size
    parts = [case.experiment.until(round(0.6 * rows)), case.experiment.since(round(0.4 * rows))]
    changes = compare(estimate_sliding(parts[:1], AXIS), estimate_sliding(parts, AXIS), {})
    assert {n: c[0] for n, c in changes.items() if c[0] > WIDENED} == {}


def test_ten_seconds_of_rest_at_the_end_change_nothing(case: Case) -> None:
    e = case.experiment
    more = round(10.0 / e.period)
    rest = Experiment(
        "rest",
        np.concatenate([e.time, e.time[-1] + e.period * np.arange(1, more + 1)]),
        np.concatenate([e.position, np.full(more, e.position[-1])]),
        np.concatenate([e.signal(), np.full(more, e.signal()[-1])]),
    )
    assert_alike(case.found, estimate_sliding([rest], AXIS))


STATED: Mapping[str, Callable[[Mapping[str, float]], Asked]] = {
    "timing": lambda truth: Asked(skew=truth["skew"]),
    "inertia": lambda truth: Asked(known={"inertia": truth["inertia"]}),
    "constant torque": lambda truth: Asked(known={"offset": truth["offset"]}),
}


@pytest.mark.parametrize("what", STATED)
def test_a_true_statement_widens_and_moves_nothing(case: Case, what: str) -> None:
    found = estimate_sliding([case.experiment], AXIS, STATED[what](case.truth))
    assert_alike(case.found, found)


@pytest.mark.parametrize("seed", [0, 1])
def test_a_hundredth_of_the_rows_missing_moves_no_value_by_a_third_of_its_half_width(
    case: Case, seed: int
) -> None:
    e = case.experiment
    kept = np.random.default_rng(seed).random(e.time.size) >= 0.01
    less = Experiment("fewer", e.time[kept], e.position[kept], e.signal()[kept])
    changes = compare(case.found, estimate_sliding([less], AXIS), {})
    assert {n: c[1] for n, c in changes.items() if c[1] > DROPPED} == {}


def test_a_second_record_of_the_same_axis_helps(logs: Any) -> None:
    """Each has its own load torque; inertia and friction are shared."""
    log = logs.draw(*LOGS["production"], duration=24.0)
    whole = Experiment("log", log.time, log.position, log.torque)
    half = whole.time.size // 2
    parts: Sequence[Experiment] = [whole.until(half), whole.since(half)]
    first, both = estimate_sliding(parts[:1], AXIS), estimate_sliding(parts, AXIS)
    for name in ("inertia", "fc"):
        assert both.numbers[name].half <= WIDENED * first.numbers[name].half
        low, high = both.interval(name)
        assert low <= log.truth[name] <= high
