"""Every alternative obeys the contract of the registry, does no harm on clean records, and is found where it is."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from stickslip.identification.alternatives import usual_alternatives
from stickslip.identification.alternatives.alternative import Alternative
from stickslip.identification.alternatives.cogging import order_of
from stickslip.identification.alternatives.load import registry_for
from stickslip.identification.experiment import Experiment
from stickslip.identification.rows import SlidingRows, sliding_rows
from stickslip.identification.sliding import SlidingPosterior, estimate_sliding
from stickslip.machines.servo import ServoAxis
from support import analytic_records as analytic

AXIS = ServoAxis(drive_side="load")
MODEL = np.array([analytic.TRUTH[n] for n in ("inertia", "fc", "sigma2", "offset")])


def all_alternatives(rows: SlidingRows) -> dict[str, Alternative]:
    """Return every alternative that a record can have, by name."""
    every = (*usual_alternatives(rows), *registry_for(MODEL, (0.0, 0.0)), order_of(4.0))
    return {a.name: a for a in every}


def rows_of(experiments: list[Experiment]) -> SlidingRows:
    return sliding_rows(experiments, AXIS)


@pytest.fixture(scope="module")
def rows() -> SlidingRows:
    """Rows of two records: some alternatives are there only then."""
    return rows_of([analytic.record(seconds=6.0), analytic.record(seconds=6.0, seed=4)])


NAMES = sorted(
    all_alternatives(rows_of([analytic.record(seconds=6.0), analytic.record(seconds=6.0, seed=4)]))
)


def test_names_are_unique(rows: SlidingRows) -> None:
    every = (*usual_alternatives(rows), *registry_for(MODEL, (0.0, 0.0)))
    assert len({a.name for a in every}) == len(every)


@pytest.mark.parametrize("name", NAMES)
def test_an_alternative_is_described(rows: SlidingRows, name: str) -> None:
    a = all_alternatives(rows)[name]
    assert a.cause
    assert a.remedy
    assert 0.0 < a.odds < 1.0


@pytest.mark.parametrize("name", NAMES)
def test_columns_are_finite_and_as_many_as_rows(rows: SlidingRows, name: str) -> None:
    a = all_alternatives(rows)[name]
    columns = a.columns(rows)
    assert columns.ndim == 2
    assert columns.shape[0] == rows.sign.size
    assert np.all(np.isfinite(columns))
    assert np.any(columns != 0.0)
    if a.curve is not None:
        steady = a.curve(np.geomspace(0.01, 5.0, 4), rows)
        assert steady.shape == (4, columns.shape[1])
    if a.lags:
        assert a.columns(rows.rates).shape == columns.shape


@pytest.mark.parametrize("name", NAMES)
def test_levels_increase_from_absence_on(rows: SlidingRows, name: str) -> None:
    a = all_alternatives(rows)[name]
    count = a.columns(rows).shape[1]
    sizes = np.array([np.linalg.norm(a.std(k, count)) for k in range(len(a.levels))])
    assert sizes[0] > 0.0
    assert np.all(sizes[1:] > sizes[0])
    assert np.all(np.diff(sizes) >= -1e-3 * sizes[1:])
    probability = np.exp([a.log_odds(k) for k in range(len(a.levels))])
    assert np.sum(probability) == pytest.approx(1.0)


@pytest.mark.parametrize("name", NAMES)
def test_columns_do_not_depend_on_the_measured_torque(name: str) -> None:
    """A column of the measured torque would explain that torque's own noise."""
    plain = analytic.record(seconds=6.0)
    other = replace(plain, drive=plain.signal() + np.random.default_rng(9).normal(0.0, 0.1, plain.time.size))
    pairs = [rows_of([x, replace(x, name="second")]) for x in (plain, other)]
    first, second = (all_alternatives(r)[name].columns(r) for r in pairs)
    assert np.array_equal(first, second)


# ---- clean records ----------------------------------------------------------------------------------------------

CLEAN: Mapping[str, tuple[Any, ...]] = {
    "production": (4, "held", 1000, "p-pi", "production", "clean"),
    "staircase": (1811, "commanded", 1000, "p-pi", "staircase", "clean"),
}


@pytest.fixture(scope="module", params=CLEAN)
def clean(request: pytest.FixtureRequest, logs: Any) -> SlidingPosterior:
    log = logs.draw(*CLEAN[request.param])
    return estimate_sliding([Experiment("log", log.time, log.position, log.torque)], AXIS)


def test_no_alternative_moves_the_inertia_of_a_clean_record(clean: SlidingPosterior) -> None:
    fit = clean.fits[0]
    posterior = fit.posterior(fit.noise.weight)
    k = posterior.core.names.index("inertia")
    number = clean.numbers["inertia"]
    none = (0,) * len(fit.alternatives)

    def inertia(on: tuple[int, ...]) -> float:
        family = posterior.family(on)
        share = np.exp(family.log_evidence - np.max(family.log_evidence))
        return float(share @ np.array([m[k] for m in family.mean]) / share.sum())

    plain = inertia(none)
    for place, a in enumerate(fit.alternatives):
        for level in range(1, len(a.levels)):
            moved = inertia((*none[:place], level, *none[place + 1 :]))
            assert abs(moved - plain) <= number.half, (a.name, a.levels[level])


# ---- each is found where it is ----------------------------------------------------------------------------------

FC = analytic.TRUTH["fc"]
SPEED = 7.3
"""rad/s, about the highest of the analytic record."""
SHOWN: Mapping[str, tuple[str, Any]] = {
    "large drift": ("drift", lambda t, q, v, a: 0.3 * FC * np.sign(v) * (t / t[-1] - 0.5)),
    "drift": ("drift", lambda t, q, v, a: 0.15 * FC * np.sign(v) * (t / t[-1] - 0.5)),
    "cogging": ("cogging 4", lambda t, q, v, a: 0.1 * FC * np.sin(4.0 * q + 0.3)),
    "viscous by direction": ("viscous friction by direction", lambda t, q, v, a: 0.2 * FC * np.abs(v) / SPEED),
    "torque over position": ("torque over position", lambda t, q, v, a: 0.1 * FC * (q + 0.3 * q**2 / 3.0)),
}  # fmt: skip


@pytest.mark.parametrize(
    "case",
    [
        pytest.param(
            c, marks=pytest.mark.xfail(strict=True, reason="the noise model absorbs a drift of 15 %")
        )
        if c == "drift"
        else c
        for c in SHOWN
    ],
)
def test_an_effect_is_found_where_it_is(case: str) -> None:
    name, effect = SHOWN[case]
    found = estimate_sliding([analytic.record(effect)], AXIS)
    assert found.presence(name) > 0.5
    for number, truth in analytic.TRUTH.items():
        low, high = found.interval(number)
        # The constant torque and the mean of another torque over the position are the same.
        if number != "offset" or case in ("drift", "large drift", "cogging"):
            assert low <= truth <= high, number


def test_a_torque_column_late_by_several_rows_is_found() -> None:
    found = estimate_sliding([analytic.record(delay=4e-3)], AXIS)
    assert found.numbers["skew"].value == pytest.approx(4e-3, abs=0.2e-3)
    low, high = found.interval("inertia")
    assert low <= analytic.TRUTH["inertia"] <= high


@pytest.mark.parametrize("name", ["drift", "torque over position", "viscous friction by direction", "play"])
def test_a_record_of_the_plain_axis_shows_no_effect(name: str) -> None:
    assert estimate_sliding([analytic.record()], AXIS).presence(name) < 0.5
