"""Two identified models: by how much, on which side of the gear, and what could not have been seen."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from stickslip.core.errors import InputError
from stickslip.identification.compare.change import compare_models
from stickslip.identification.compare.motor_or_load import on_one_side
from stickslip.identification.estimate import Estimate
from stickslip.identification.identified_file import Identified
from stickslip.models.model import Model

UNITS = {"fs": "N·m", "fc": "N·m", "vs": "rad/s", "sigma2": "N·m·s/rad", "k": "N·m·s/rad", "inertia": "kg·m²"}
TRUE = {"k": 50.0, "fs": 0.335, "fc": 0.285, "vs": 0.1, "sigma2": 0.018, "inertia": 4e-4}
SPEEDS = {"positive": np.linspace(0.05, 5.0, 11), "negative": np.linspace(0.05, 4.0, 11)}


def found(name: str, law: str = "stribeck", spread: float = 0.01, **other: float) -> Identified:
    values = {**TRUE, **other}
    own = {f.name for f in Model(law, **{k: v for k, v in values.items() if k in PARAMETERS[law]}).law.fields}
    values = {k: v for k, v in values.items() if k in own or k == "inertia"}
    estimates = tuple(
        Estimate(n, UNITS[n], n, v, spread * v, v * math.exp(-1.96 * spread), v * math.exp(1.96 * spread), True)
        for n, v in values.items()
    )  # fmt: skip
    model = Model(law, **{k: v for k, v in values.items() if k in own})
    axis = {"inertia": values["inertia"], "offset": 0.0}
    return Identified(Path(name), model, estimates, np.eye(len(estimates)), axis, speeds=SPEEDS)


PARAMETERS = {"stribeck": ("k", "fs", "fc", "vs", "sigma2"), "coulomb": ("fc", "sigma2")}


def test_it_says_by_how_much() -> None:
    result = compare_models(found("a"), found("b", fc=0.82 * 0.285, fs=0.82 * 0.335))
    assert result.changed
    fc = next(c for c in result.changes if c.name == "fc")
    assert fc.words() == "fc -18 % [-20, -16]"
    assert "fc -18 % [-20, -16]" in result.summary
    assert fc.percent_span == pytest.approx((-20.2, -15.7), abs=0.1)
    slow = next(c for c in result.levels if c.name == "friction at 0.05 rad/s")
    assert slow.told
    assert -22.0 < slow.percent_span[0] < -18.0 < slow.percent_span[1] < -14.0


OPEN = {
    "k": (26e3, 1e-12, 6e20), "fs": (59.0, 0.039, 730.0), "fc": (53.6, 53.13, 54.08), "vs": (0.0156, 8.7e-4, 0.0196),
    "sigma2": (67.0, 63.4, 70.5), "inertia": (30.3, 29.2, 31.3),
}  # fmt: skip
"""Of a belt drive's one record: what slow motion would tell is open, by orders of magnitude."""


def belt(name: str, factor: float = 1.0) -> Identified:
    """With that much more friction."""
    levels = ("fs", "fc", "sigma2")
    estimates = tuple(
        Estimate(n, UNITS[n], n, *(f * x for x in (value, (high - low) / 3.92, low, high)), n in IDENTIFIED)
        for n, (value, low, high) in OPEN.items() for f in [factor if n in levels else 1.0]
    )  # fmt: skip
    model = Model("stribeck", **{e.name: e.value for e in estimates if e.name in PARAMETERS["stribeck"]})
    speeds = {side: np.linspace(5e-4, 0.175, 11) for side in ("positive", "negative")}
    return Identified(Path(name), model, estimates, np.eye(len(estimates)), speeds=speeds)


IDENTIFIED = ("fc", "sigma2", "inertia")


def test_what_is_identified_has_changed_although_the_rest_is_open() -> None:
    """A rise of 20 %, in parameters and at a recorded speed, was denied since k, fs and vs are not identified."""
    result = compare_models(belt("a"), belt("b", 1.2))
    assert result.changed
    every = (*result.changes, *result.levels)
    assert {c.name for c in every if c.changed} == {"fc", "sigma2", "friction at 0.175 rad/s"}
    assert result.summary.startswith("The friction has changed: fc +20 % [+19, +22], sigma2 +20 % ")
    assert result.summary.endswith("Not identified in both, so nothing is said of k, fs, vs.")
    assert sum(line.endswith("changed") for line in str(result).splitlines()) == 3
    same = compare_models(belt("a"), belt("b", 1.003))
    assert not same.changed
    assert same.summary.startswith(
        "No change of the friction that the intervals do not explain. Not identified"
    )


def test_a_narrow_interval_that_was_refused_is_not_believed() -> None:
    """A friction at rest that was extrapolated: its interval does not hold what speaks against it."""

    def with_rest(name: str, fs: float) -> Identified:
        m = found(name, fs=fs)
        return replace(
            m, estimates=tuple(replace(e, identified=e.name != "fs", verdict="no") for e in m.estimates)
        )

    assert compare_models(found("a", fs=0.3), found("b", fs=0.38)).changed
    result = compare_models(with_rest("a", 0.3), with_rest("b", 0.38))
    assert not result.changed
    assert result.summary.endswith("nothing is said of fs.")


def test_one_parameter_that_differs_is_never_denied() -> None:
    """The joint test of five parameters does not see three standard deviations of one; the last line did not either."""
    result = compare_models(found("a"), found("b", vs=0.1 * math.exp(0.0473)))
    (vs,) = [c for c in result.changes if c.p < 0.0125]
    assert result.p > 0.0125
    assert vs.changed
    assert "The friction has changed: vs" in result.summary


def test_inertia_is_told_beside_the_friction_whatever_the_laws() -> None:
    for law in ("stribeck", "coulomb"):
        result = compare_models(found("a"), found("b", law, inertia=1.6 * 4e-4, fc=0.3))
        assert "Beside it has changed: inertia +60 % [+56, +64]." in result.summary
        names = {c.name for c in result.changes}
        assert ("fc" in names) == (law == "stribeck")
        assert [c.name for c in result.levels if "friction at" in c.name]
    assert any("The laws differ (stribeck, coulomb)" in note for note in result.notes)


@pytest.mark.parametrize("turns", [-1, 0, 1, 5])
def test_a_pendulum_hangs_where_it_did_but_for_whole_turns(turns: int) -> None:
    """-0.348 and 5.935 rad were called a change of 6.28 rad."""

    def hanging(name: str, angle: float) -> Identified:
        m = found(name)
        of_it = Estimate("gravity_angle", "rad", "q_0", angle, 0.02, angle - 0.039, angle + 0.039, True)
        return replace(m, estimates=(*m.estimates, of_it), correlation=np.eye(len(m.estimates) + 1))

    off = 2.0 * math.pi * turns
    same = compare_models(hanging("a", -0.348), hanging("b", -0.345 + off))
    assert same.summary == "No change of the friction that the intervals do not explain."
    angle = next(c for c in same.changes if c.name == "gravity_angle")
    assert angle.second == pytest.approx(-0.345)
    other = compare_models(hanging("a", 3.1), hanging("b", -3.0 + off))
    assert other.summary.endswith("Beside it has changed: gravity_angle +0.183 rad [+0.128, +0.239].")
    # Of two shafts neither turn is the other's: 32 rad at a motor of 80 turns are 0.4 at the load, or 0.479, ...
    two = [replace(hanging(s, a), axis={**found(s).axis, "seen_from": s, "gear_ratio": 80.0})
           for s, a in (("load", 0.4), ("motor", 32.0))]  # fmt: skip
    assert "gravity_angle" not in [c.name for c in compare_models(*two).changes]


def test_it_says_what_it_could_not_have_seen() -> None:
    result = compare_models(found("a"), found("b"))
    assert not result.changed
    assert result.summary == "No change of the friction that the intervals do not explain."
    assert any("Smaller changes than these would not have been seen: k by 2.8 %" in n for n in result.notes)
    assert any("from 0.05 to 5 rad/s, the speeds that both records have" in note for note in result.notes)
    assert (result.velocity[-1], -result.velocity[0]) == (5.0, 5.0)
    blind = compare_models(replace(found("a"), speeds={}), found("b"))
    assert any("the files do not say" in note for note in blind.notes)


def test_the_picture_shows_the_recorded_speeds() -> None:
    traces = compare_models(found("a"), found("b", fc=0.3)).picture.traces
    points = [t for t in traces if t.kind == "points"]
    assert [t.label for t in points] == ["tenths of the speeds of a", "tenths of the speeds of b"]
    np.testing.assert_allclose(points[0].x, SPEEDS["positive"])


def test_one_axis_seen_from_both_sides_of_its_gear_has_not_changed() -> None:
    """At the motor of a gear of 50 torques are a fiftieth, speeds 50 times, inertia and viscous friction 1/2500."""
    load, n = found("load.toml"), 50.0
    power = {"fs": -1, "fc": -1, "vs": 1, "sigma2": -2, "k": -2, "inertia": -2}
    motor = found("motor.toml", **{k: v * n ** power[k] for k, v in TRUE.items()})
    sides = ("load", "motor")
    load, motor = (
        replace(m, axis={**m.axis, "seen_from": s, "gear_ratio": n})
        for m, s in zip((load, motor), sides, strict=True)
    )
    motor = replace(motor, speeds={k: n * v for k, v in SPEEDS.items()})
    for a, b in ((load, motor), (motor, load)):
        result = compare_models(a, b)
        assert not result.changed
        assert [c.percent for c in result.changes] == pytest.approx([0.0] * len(result.changes), abs=1e-9)
        assert any("side of the gear of 50" in note for note in result.notes)
        assert result.velocity[-1] == pytest.approx(float(a.speeds["positive"][-1]))
    assert compare_models(found("load.toml"), replace(motor, axis={})).changed
    other = replace(motor, axis={**motor.axis, "gear_ratio": 49.0})
    with pytest.raises(InputError, match=r"gear ratio of 50 and motor\.toml one of 49"):
        on_one_side(load, other)
