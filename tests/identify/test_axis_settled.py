"""The values that a model takes: identified ones stand, the rest explains the record within the bounds of physics."""

from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from stickslip.binding import NEGATIVE
from stickslip.identify.axis import identify
from stickslip.identify.axis.agreed import held_against
from stickslip.identify.axis.choice import Candidate, chosen_of, sentence_on
from stickslip.identify.axis.identify import leaves_more, nothing_more, worth_comparing
from stickslip.identify.axis.search import Asked
from stickslip.identify.axis.settled import settled
from stickslip.identify.estimate import Estimate, Identification, silent
from stickslip.identify.experiment import Experiment
from stickslip.identify.regression.force_error import force_error, force_error_on, plain_error_on
from stickslip.identify.regression.inverse import inverse_dynamics
from stickslip.machines.servo import ServoAxis
from stickslip.model import Model
from stickslip.plugins import law

AXIS = ServoAxis(drive_side="load")
TRUE = {"inertia": 4e-3, "offset": 0.05, "fc": 0.3, "sigma2": 0.02}
COULOMB = Model("coulomb", fc=0.3, sigma2=0.02)


def moving(gravity: float = 0.0, angle: float = 0.0) -> Experiment:
    """An axis that moves both ways at many speeds, its torque known to 0.01 N·m."""
    t = np.arange(0.0, 20.0, 2e-3)
    rates = (1.3, 3.1, 5.7)
    q = sum(a * np.sin(w * t) for a, w in zip((1.0, 0.5, 0.2), rates, strict=True))
    v = sum(a * w * np.cos(w * t) for a, w in zip((1.0, 0.5, 0.2), rates, strict=True))
    acceleration = -sum(a * w * w * np.sin(w * t) for a, w in zip((1.0, 0.5, 0.2), rates, strict=True))
    torque = TRUE["inertia"] * acceleration + TRUE["sigma2"] * v + TRUE["fc"] * np.sign(v) + TRUE["offset"]
    noise = 0.01 * np.random.default_rng(1).standard_normal(t.size)
    return Experiment("made", t, q, torque + gravity * np.sin(q - angle) + noise)


def estimate(name: str, value: float, half: float = 0.0, told: bool = True) -> Estimate:
    return Estimate(
        name, "N·m", "x", value, half / 1.96, value - half, value + half, told, "" if told else "why"
    )


def test_what_is_not_identified_goes_with_what_is() -> None:
    inverse = inverse_dynamics([moving()], AXIS)
    given = [estimate(n, 3.0 * x, told=n == "inertia") for n, x in TRUE.items()]
    given[0] = replace(given[0], value=4.02e-3, lower=4.0e-3, upper=4.04e-3)
    found, _ = settled(given, COULOMB, inverse)
    values = {e.name: e.value for e in found}
    assert 4.0e-3 <= values["inertia"] <= 4.02e-3
    assert values["fc"] == pytest.approx(0.3, rel=0.03)
    assert values["offset"] == pytest.approx(0.05, abs=0.003)
    assert all(e.lower <= e.value <= e.upper for e in found)


def test_identified_values_are_those_of_sliding_and_of_the_whole_record_by_precision() -> None:
    inverse = inverse_dynamics([moving()], AXIS)
    off = {"inertia": 5.5e-3, "offset": 0.05, "fc": 0.36, "sigma2": 0.02}
    given = [estimate(n, x, 0.4 * x) for n, x in off.items()]
    found, said = settled(given, COULOMB, inverse)
    values = {e.name: e.value for e in found}
    assert force_error(inverse, COULOMB, off) > 1.5 * inverse.relative_error
    model = Model("coulomb", fc=values["fc"], sigma2=values["sigma2"])
    assert force_error(inverse, model, values) == pytest.approx(inverse.relative_error, rel=0.02)
    assert [(e.lower, e.upper, e.identified) for e in found] == [(e.lower, e.upper, True) for e in given]
    assert not said


def test_identified_values_that_the_whole_record_contradicts_move_within_their_intervals() -> None:
    inverse = inverse_dynamics([moving()], AXIS)
    off = {"inertia": 4e-3, "offset": 0.05, "fc": 0.33, "sigma2": 0.02}
    given = [estimate(n, x, 0.0292 if n == "fc" else 0.4 * x) for n, x in off.items()]
    found, said = settled(given, COULOMB, inverse)
    values = {e.name: e.value for e in found}
    model = Model("coulomb", fc=values["fc"], sigma2=values["sigma2"])
    assert force_error(inverse, Model("coulomb", fc=0.33, sigma2=0.02), off) > 1.05 * inverse.relative_error
    assert force_error(inverse, model, values) <= 1.03 * inverse.relative_error
    assert all(e.lower <= values[e.name] <= e.upper for e in given)
    assert "within their intervals" in said[0]


def test_values_leave_intervals_that_cannot_explain_the_record_and_are_not_identified_then() -> None:
    inverse = inverse_dynamics([moving()], AXIS)
    off = {"inertia": 4e-3, "offset": 0.05, "fc": 0.5, "sigma2": 0.02}
    given = [estimate(n, x, 0.01 * x) for n, x in off.items()]
    found, said = settled(given, COULOMB, inverse)
    values = {e.name: e.value for e in found}
    model = Model("coulomb", fc=values["fc"], sigma2=values["sigma2"])
    assert force_error(inverse, model, values) <= 1.0201 * inverse.relative_error
    (level,) = (e for e in found if e.name == "fc")
    assert not level.identified
    assert "whole record" in level.verdict
    assert level.lower <= level.value <= level.upper
    assert level.upper == 0.505
    assert "next to their intervals" in said[0]


def test_a_plain_inverse_dynamics_that_certain_sliding_refutes_moves_nothing_out_of_its_interval() -> None:
    inverse = inverse_dynamics([moving()], AXIS)
    given = [estimate(n, x, 0.01 * x) for n, x in (TRUE | {"fc": 0.5}).items()]
    found, said = settled(given, COULOMB, inverse, refuted_by={})
    assert [e.value for e in found] == [e.value for e in given]
    assert all(e.identified for e in found)
    assert "leave more of the torque in sliding" in said[0]


def test_a_refuted_plain_inverse_dynamics_moves_nothing_out_of_what_certain_sliding_says() -> None:
    """However wide the interval given is, so as to hold both."""
    inverse = inverse_dynamics([moving()], AXIS)
    given = [estimate(n, x, 0.4 * x if n == "fc" else 0.01 * x) for n, x in (TRUE | {"fc": 0.36}).items()]
    free, told = (
        {e.name: e.value for e in settled(given, COULOMB, inverse, refuted_by=own)[0]}
        for own in ({}, {"fc": (0.35, 0.37)})
    )
    assert free["fc"] < 0.33
    assert 0.35 <= told["fc"] <= 0.37


def test_numbers_refuted_by_little_are_followed_farther_and_the_level_is_not_identified_then() -> None:
    """A joint that ends in a reversal of which it only winds up: the force error was a quarter above plain's."""
    inverse = inverse_dynamics([moving()], AXIS)
    given = [estimate(n, x, 0.2 * x if n == "fc" else 0.01 * x) for n, x in (TRUE | {"fc": 0.36}).items()]
    own, both = {"fc": (0.35, 0.37)}, {"fc": (0.288, 0.432)}
    (kept,) = (e for e in settled(given, COULOMB, inverse, own)[0] if e.name == "fc")
    found, said = settled(given, COULOMB, inverse, own, both)
    values = {e.name: e.value for e in found}
    model = Model("coulomb", fc=values["fc"], sigma2=values["sigma2"])
    assert kept.value == 0.36
    assert values["fc"] < 0.33
    assert force_error(inverse, model, values) <= 1.03 * inverse.relative_error
    (level,) = (e for e in found if e.name == "fc")
    assert not level.identified
    assert "two methods" in level.verdict
    assert "within their intervals" in said[0]


def test_values_follow_refuted_plain_numbers_no_farther_than_they_must_and_the_level_last() -> None:
    """Not to the least force error: with play F_C then was up to 12 % off, where certain sliding had it within 4 %."""
    inverse = inverse_dynamics([moving()], AXIS)
    off = {"inertia": 4e-3, "offset": 0.05, "fc": 0.309, "sigma2": 0.0215}
    given = [estimate(n, x, (0.1 if n == "fc" else 0.2) * x) for n, x in off.items()]
    found, said = settled(given, COULOMB, inverse, refuted_by={})
    values = {e.name: e.value for e in found}
    model = Model("coulomb", fc=values["fc"], sigma2=values["sigma2"])
    assert 1.015 < force_error(inverse, model, values) / inverse.relative_error <= 1.0201
    moved = {n: abs(values[n] - x) / x for n, x in off.items()}
    assert 0.0 < moved["fc"] < 0.25 * moved["sigma2"]
    assert all(e.identified for e in found)
    assert "within their intervals" in said[0]


@pytest.mark.parametrize(
    ("level", "half", "why"),
    [(0.33, 0.04, "two methods are"), (0.3, 0.08, "interval is too wide"), (0.3, 0.06, "")],
)
def test_a_level_that_certain_sliding_alone_tells_is_identified_where_that_is_sure(
    level: float, half: float, why: str
) -> None:
    """A level known to 29 %, and one moved by 7 % to go with numbers that are refuted, were called identified."""
    inverse = inverse_dynamics([moving()], AXIS)
    off = {"inertia": inverse["inertia"], "offset": inverse["offset"], "fc": level, "sigma2": inverse["fv"]}
    given = [estimate(n, x, half if n == "fc" else 1e-3 * x) for n, x in off.items()]
    (found,) = (e for e in settled(given, COULOMB, inverse, refuted_by={})[0] if e.name == "fc")
    assert found.identified == (not why)
    assert why in found.verdict
    (both,) = (e for e in settled(given, COULOMB, inverse)[0] if e.name == "fc")
    assert both.identified


def test_identified_values_that_explain_the_record_stay() -> None:
    inverse = inverse_dynamics([moving()], AXIS)
    given = [
        estimate(e, inverse[n], 0.01)
        for e, n in (("inertia", "inertia"), ("offset", "offset"), ("fc", "fc"), ("sigma2", "fv"))
    ]
    found, said = settled(given, COULOMB, inverse)
    assert [e.value for e in found] == [e.value for e in given]
    assert not said


def test_values_keep_the_bounds_of_physics() -> None:
    experiment = moving()
    assert experiment.drive is not None
    speed = np.gradient(experiment.position, experiment.time)
    inverse = inverse_dynamics([replace(experiment, drive=experiment.drive - 0.1 * speed)], AXIS)
    assert inverse["fv"] < 0.0
    found, _ = settled([estimate(n, x, told=False) for n, x in TRUE.items()], COULOMB, inverse)
    assert all(e.value >= 0.0 for e in found if e.name != "offset")


def test_a_fall_of_friction_that_is_not_identified_is_left_out_where_it_explains_nothing() -> None:
    inverse = inverse_dynamics([moving()], AXIS)
    model = Model("stribeck", k=1e4, fs=5.0, fc=0.3, vs=300.0, delta_s=2.0, sigma2=0.02)
    given = [*(estimate(n, x) for n, x in TRUE.items()), estimate("fs", 5.0, told=False)]
    values = {e.name: e.value for e in settled(given, model, inverse)[0]}
    assert values["fs"] == values["fc"]


def test_gravity_that_is_not_identified_is_found_with_the_rest() -> None:
    inverse = inverse_dynamics([moving(0.8, 0.3)], ServoAxis(gravity="pendulum", drive_side="load"))
    given = [*(estimate(n, x, told=n == "fc") for n, x in TRUE.items())]
    given += [estimate("gravity", 7.0, told=False), estimate("gravity_angle", 2.0, told=False)]
    values = {e.name: e.value for e in settled(given, COULOMB, inverse)[0]}
    assert values["gravity"] == pytest.approx(0.8, rel=0.05)
    assert values["gravity_angle"] == pytest.approx(0.3, abs=0.05)


def test_nothing_is_changed_without_the_inverse_dynamics() -> None:
    given = tuple(estimate(n, x) for n, x in TRUE.items())
    assert settled(given, COULOMB, None) == (given, [])


# ---- which law ------------------------------------------------------------------------------------------------


def scored(law: str, parameters: int, misfit: float, seed: int = 0) -> Candidate:
    """A law whose held-out misfit is so large, the same in all blocks but for a thousandth."""
    score = misfit**2 * (1.0 + 1e-3 * np.random.default_rng(seed).standard_normal(20))
    return Candidate(law, parameters, {}, score, {})


@pytest.mark.parametrize(("finer", "chosen"), [(0.9, "coulomb"), (0.77, "coulomb"), (0.7, "lugre")])
def test_a_law_of_more_parameters_must_foretell_clearly_better(finer: float, chosen: str) -> None:
    tried = [scored("coulomb", 4, 1.0), scored("lugre", 8, finer, 1)]
    assert tried[chosen_of(tried)].law == chosen
    assert f"{finer:.3g}" in sentence_on(tried, chosen)


def test_a_law_that_failed_is_not_chosen() -> None:
    failed = Candidate("coulomb", 0, {}, np.full(20, math.inf), {}, "why")
    assert chosen_of([failed, scored("lugre", 8, 1.0)]) == 1


# ---- which law is given, and in which band its error is -------------------------------------------------------------


def told(law: Model, **changes: bool) -> Identification:
    """A law of the package with its parameters as estimates, all of them identified but those that are named."""
    values: dict[str, float] = {"inertia": 4e-3, **law.parameters._asdict()}
    estimates = tuple(estimate(n, x, 0.1 * x, changes.get(n, True)) for n, x in values.items())
    return Identification("axis", law, estimates, np.eye(len(estimates)), {})


@pytest.mark.parametrize(
    ("fs", "identified", "given", "simplest"),
    [
        (0.3, (), (), True),
        (0.3, (), ("vs",), False),  # the user asked for it
        (0.3, ("k",), (), False),  # reversals tell the stiffness
        (0.4, (), (), False),  # friction falls, though by how much is not told
    ],
)
def test_a_law_of_which_nothing_but_coulombs_part_is_told_is_coulombs(
    fs: float, identified: tuple[str, ...], given: tuple[str, ...], simplest: bool
) -> None:
    """Of parts of one robot arm's record some had stribeck with every parameter of it unknown, others coulomb."""
    law = Model("stribeck", k=50.0, fs=fs, fc=0.3, vs=0.1, delta_s=2.0, sigma2=0.02)
    untold = {n: n in identified for n in ("k", "fs", "vs", "delta_s")}
    assert nothing_more(told(law, **untold), {*given}) == simplest


def test_coulombs_law_has_nothing_more_to_lose() -> None:
    assert not nothing_more(told(COULOMB, fc=False, sigma2=False), set())


def test_held_out_force_errors_of_the_same_values_are_the_same_in_the_same_band() -> None:
    """With a low-pass chosen for each record anew the same four numbers had errors of 20 and 13 %."""
    second = moving()
    assert second.drive is not None
    first = replace(
        second, time=second.time[:6000], position=second.position[:6000], drive=second.drive[:6000]
    )
    inverse = inverse_dynamics([first], AXIS, cutoff=20.0)
    model = Model("coulomb", fc=inverse.coulomb, sigma2=inverse.viscous)
    values = {"inertia": inverse["inertia"], "offset": inverse.offset}
    own = force_error_on([second], AXIS, model, values, inverse.cutoff)
    assert own == pytest.approx(plain_error_on([second], AXIS, inverse), rel=0.02)
    assert force_error_on([second], AXIS, model, values, 60.0) != pytest.approx(own, rel=0.1)


@pytest.mark.parametrize("name", ["inertia", "fc", "sigma2"])
def test_without_certain_sliding_no_level_is_identified_and_nothing_that_plain_least_squares_contradict(
    name: str,
) -> None:
    """Of tuning steps sigma2 was called identified at nine times the truth, which least squares had within 50 %; of
    others Fc 16 % off (990356)."""
    inverse = inverse_dynamics([moving()], AXIS)
    right = [estimate(n, x, 0.05 * x) for n, x in TRUE.items()]
    # What slides too little tells inertia and offset, but no level.
    kept = {e.name: e for e in held_against(right, inverse)}
    assert {n for n, e in kept.items() if e.identified} == kept.keys() - {"fc", "sigma2", "fs", "vs"}
    assert "too little in one direction to tell a level" in kept["fc"].verdict
    (backward,) = held_against([estimate("fc" + NEGATIVE, 0.3, 0.01)], inverse)
    assert not backward.identified
    wrong = [replace(e, value=4.0 * e.value, upper=4.1 * e.value, lower=3.9 * e.value) if e.name == name else e
             for e in right]  # fmt: skip
    found = held_against(wrong, inverse)
    assert not any(e.identified for e in found)
    assert all("too little in one direction to decide" in e.verdict for e in found)
    plain = {
        "inertia": inverse["inertia"],
        "fc": inverse.coulomb,
        "sigma2": inverse.viscous,
        "offset": inverse.offset,
    }
    for e in found:
        assert e.name not in plain or e.lower <= plain[e.name] <= e.upper
        assert e.lower <= e.value <= e.upper


@pytest.mark.parametrize(
    ("own", "identified", "given", "gives_way"),
    [
        (
            0.087,
            ("k",),
            (),
            True,
        ),  # joint 6 of another arm: friction at rest above the largest torque recorded
        (0.061, ("k",), (), False),  # as good as plain least squares
        (0.087, ("k", "fs", "vs", "delta_s"), (), False),
        (0.087, ("k",), ("fs",), False),
    ],
)
def test_a_law_that_leaves_more_than_plain_least_squares_gives_way_where_it_is_not_told(
    own: float, identified: tuple[str, ...], given: tuple[str, ...], gives_way: bool
) -> None:
    law = Model("stribeck", k=50.0, fs=0.4, fc=0.3, vs=0.1, delta_s=2.0, sigma2=0.02)
    misfit = {"force_relative": own, "inverse_dynamics_relative": 0.06}
    found = replace(told(law, **{n: n in identified for n in ("k", "fs", "vs", "delta_s")}), misfit=misfit)
    assert leaves_more(found, {*given}) == gives_way
    assert not leaves_more(replace(told(COULOMB), misfit=misfit), set())


@pytest.mark.parametrize(
    ("misfit", "compared"), [(1.2, ["stribeck", "lugre"]), (2.7, ["coulomb", "stribeck", "lugre"])]
)
def test_laws_without_a_fall_are_compared_where_no_other_predicts_what_was_held_out(
    monkeypatch: pytest.MonkeyPatch, misfit: float, compared: list[str]
) -> None:
    # Half an arm's record: its fall was another joint's load, and the law with it 1.5 times plain's error on the rest.
    def judged(evidence, laws, *_):
        return [scored(law.name, 5, misfit) for law in laws], []

    monkeypatch.setattr(identify, "judged_laws", judged)
    evidence = SimpleNamespace(sliding=SimpleNamespace(shows_a_fall=True))
    laws = [law(n) for n in ("coulomb", "stribeck", "lugre")]
    listed, candidates, more, _ = worth_comparing(evidence, laws, Asked(), "prediction", silent)
    assert [x.name for x in listed] == [c.law for c in candidates] == compared
    assert bool(more) == (len(compared) == 2)
