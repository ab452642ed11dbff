"""The sliding curve: the thesis's experiments on its own friction, segments of records, choice of a curve."""

import functools
import json
import math
from pathlib import Path

import numpy as np
import pytest

from stickslip import Controller, Gains, Model, Record, Reference, RigidAxis, simulate
from stickslip.cli import main
from stickslip.core.errors import InputError
from stickslip.identification.estimate import Identification
from stickslip.identification.steady_friction.choice import candidates, choose_sliding
from stickslip.identification.steady_friction.curve import identify_sliding
from stickslip.identification.steady_friction.points import SlidingPoints
from stickslip.identification.steady_friction.segments import constant_velocity_segments, sliding_points
from stickslip.report.identification import draw_picture_to
from support.places import REFERENCE, needs_reference

TABLE_1 = {"fs": 0.335, "fc": 0.285, "vs": 0.01, "delta_s": 2.0, "sigma2": 0.018}
VELOCITIES = np.array([0.001, 0.025, 0.03, 0.04, 0.05, 0.1, 0.2, 0.3, 0.4, 0.5, 0.7, 1.0])  # (3.18)
PLANT = Model("gms", k=[1e4, 7e3, 5e3, 3e3], alpha=[0.25] * 4, c=24.0, **TABLE_1)
GUESS = Model("lugre", sigma0=1e4, sigma2=0.005, fs=0.5, fc=0.1, vs=0.05, delta_s=1.0)


def friction(velocity: np.ndarray, model: Model = PLANT) -> np.ndarray:
    return np.array([model.law.steady(v, model.parameters) for v in velocity])


def without_second_point() -> SlidingPoints:
    kept = np.arange(VELOCITIES.size) != 1
    return SlidingPoints(VELOCITIES[kept], friction(VELOCITIES[kept]))


@functools.cache
def left_open() -> Identification:
    """Of the points that leave three parameters open: for all tests that look at it."""
    return identify_sliding(without_second_point(), GUESS, noise=1e-6)


def test_table_1_to_six_digits() -> None:
    result = identify_sliding(SlidingPoints(VELOCITIES, friction(VELOCITIES)), GUESS)
    assert {n: result[n].value for n in TABLE_1} == pytest.approx(TABLE_1, rel=1e-7)
    # The residual of a perfect fit says nothing about the noise.
    assert set(result.not_identified) == set(TABLE_1)
    assert "noise" in result["fs"].verdict


@needs_reference("identification.json")
def test_table_1_by_command(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Static friction, extrapolated to rest, lies above the torque at the slowest velocity."""
    points = json.loads((REFERENCE / "identification.json").read_text())["stribeck_points"]
    rows, time, angle = [], 0.0, 0.0
    for velocity, torque in zip(points["velocity"][::-1], points["torque"][::-1], strict=True):
        for _ in range(round(max(1.0, min(7.0 / velocity, 20.0)) / 0.01)):
            rows.append(f"{time!r},{angle!r},{torque!r}")
            time, angle = time + 0.01, angle + 0.01 * velocity
    log = tmp_path / "constant_velocities.csv"
    log.write_text("\n".join(["time [s],position [rad],torque [Nm]", *rows]))
    level = ["--freeze", "offset", "--set", "offset=0", "--noise", "1e-9"]
    command = ["identify", str(log), "--method", "sliding", "--law", "stribeck_plain", *level]
    assert main([*command, "--json", "--no-report", "--out", str(tmp_path / "m.toml")]) == 0
    found = {e["name"]: e for e in json.loads(capsys.readouterr().out)["estimates"]}
    assert {n: found[n]["value"] for n in TABLE_1} == pytest.approx(TABLE_1, rel=1e-4)
    assert all(found[n]["lower"] <= TABLE_1[n] <= found[n]["upper"] for n in TABLE_1)


@pytest.mark.parametrize(
    ("noise", "all_points", "undetermined"),
    [
        (1e-6, True, set()),
        (1e-6, False, {"fs", "vs", "delta_s"}),
        (1e-4, True, {"fs", "vs", "delta_s"}),
        (1e-4, False, {"fs", "vs", "delta_s"}),
    ],
)
def test_figure_3_8(noise: float, all_points: bool, undetermined: set[str]) -> None:
    points = SlidingPoints(VELOCITIES, friction(VELOCITIES)) if all_points else without_second_point()
    known = noise == 1e-6 and not all_points
    result = left_open() if known else identify_sliding(points, GUESS, noise=noise)
    assert set(result.not_identified) == undetermined
    if not undetermined:
        assert [result[n].std / result[n].value for n in ("vs", "delta_s")] == pytest.approx(
            [0.05, 0.05], abs=0.006
        )
    else:
        family = result.details["family"]
        shape = family[:, result.details["free"].index("delta_s")]
        # The reference found perfect-looking fits from 1.35 to 4.24.
        assert np.min(shape) < 1.36
        assert np.max(shape) > 4.23
        assert result.measure_next


def test_the_point_asked_for_settles_it() -> None:
    points, wanted = without_second_point(), left_open().details["next_velocity"]
    assert 0.001 < wanted < 0.03
    added = points + SlidingPoints(np.array([wanted]), friction(np.array([wanted])))
    assert identify_sliding(added, GUESS, noise=1e-6).not_identified == ()


def test_the_point_asked_for_may_lie_outside_the_range_but_not_beyond_the_axis() -> None:
    """Measured above the Stribeck velocity only: a slower point tells vs; half the lowest velocity is the limit."""
    v = np.geomspace(0.015, 1.0, 8)
    points = SlidingPoints(v, friction(v))
    wanted = identify_sliding(points, GUESS, noise=1e-4, starts=10).details["next_velocity"]
    assert 0.0075 * (1.0 - 1e-9) <= wanted < 0.015
    # Below it the viscous slope is open: a fast point tells it, unless the axis cannot.
    v = np.geomspace(0.001, 0.012, 8)
    points = SlidingPoints(v, friction(v))
    wanted = [
        identify_sliding(points, GUESS, noise=1e-4, starts=10, fastest=x).details["next_velocity"]
        for x in (np.inf, 0.015)
    ]
    assert wanted[0] > 0.015
    assert wanted[1] <= 0.015 * (1.0 + 1e-9)


def test_an_error_left_out_does_not_blow_up() -> None:
    """Of the two exponentials twelve points leave a fold's parameters open; unbounded, its error was 93 N·m."""
    v = np.array([0.002, 0.005, 0.01, 0.02, 0.04, 0.08, 0.2, 0.5, 1.0, 2.0, 4.0, 7.0])
    points = SlidingPoints(v, friction(v) + 2e-3 * np.random.default_rng(7).standard_normal(v.size))
    name = "two exponentials (eq. 4.4)"
    _, _, table = choose_sliding(points, {name: candidates(v, points.torque)[name]}, noise=2e-3, starts=10)
    assert table[name]["cross_validated_Nm"] < 0.02


def test_intervals_with_noise_hold_the_truth() -> None:
    """Both directions, break-away points at zero velocity, repeats that set the noise; 20 draws."""
    rng = np.random.default_rng(1)
    v = np.array([0.0, 0.002, 0.005, 0.01, 0.02, 0.04, 0.08, 0.2, 0.5, 1.0])
    v = np.concatenate([v, -v, v, -v])
    truth = np.where(v == 0.0, np.repeat([1.0, -1.0, 1.0, -1.0], 10) * 0.335, friction(v))
    inside = 0
    for _ in range(20):
        result = identify_sliding(SlidingPoints(v, truth + rng.normal(0.0, 1e-3, v.size)), GUESS, starts=6)
        assert result.details["noise_source"].startswith("repeats")
        inside += sum(result[n].lower <= TABLE_1[n] <= result[n].upper for n in TABLE_1)
        assert result.not_identified == ()
    assert 88 <= inside <= 100


def test_weights_let_a_bad_point_count_for_little() -> None:
    torque = friction(VELOCITIES)
    torque[5] += 0.05
    std = np.where(np.arange(12) == 5, 1.0, 1e-5)
    result = identify_sliding(SlidingPoints(VELOCITIES, torque, std), GUESS)
    assert result["fc"].value == pytest.approx(0.285, rel=1e-4)


def test_a_curve_is_chosen_by_what_it_predicts() -> None:
    """With little noise the Stribeck curve is; where friction has no Stribeck effect, Coulomb's line is."""
    rng = np.random.default_rng(2)
    v = np.array([0.002, 0.005, 0.01, 0.015, 0.02, 0.04, 0.08, 0.1, 0.2, 0.3, 0.5, 0.7, 1.0] * 2)
    templates = {"Coulomb": Model("coulomb", fc=0.2, sigma2=0.01), "Stribeck": GUESS}
    noise = rng.normal(0.0, 1e-3, v.size)
    name, result, table = choose_sliding(SlidingPoints(v, friction(v) + noise), templates)
    assert name == "Stribeck"
    assert table["Stribeck"]["cross_validated_Nm"] == pytest.approx(1e-3, rel=0.5)
    line = 0.285 + 0.018 * v + noise
    assert choose_sliding(SlidingPoints(v, line), templates)[0] == "Coulomb"
    assert set(result.details["comparison"]) == set(templates)


GREASE = Model(  # thesis Table 10, eq. 4.5
    "stribeck_plain", {"curve": "double_stribeck", "viscous": "power"}, beta0=80.7454, beta1=-80.4742, beta2=-80.5930,
    beta3=0.7884, beta4=0.7871, v1=0.1755, v2=0.1758, sigma2=-0.0054, fv2=0.0791, delta_v=0.3768,
)  # fmt: skip
GREASE_VELOCITIES = np.array([  # (4.3)
    25, 20, 15, 10, 5, 3, 2, 1.9, 1.8, 1.6, 1.4, 1.2, 1.1, 1.0, 0.95, 0.9, 0.8, 0.7, 0.6, 0.5, 0.4, 0.3, 0.2, 0.1, 0.08,
    0.06, 0.04, 0.02, 0.01, 0.005,
])  # fmt: skip


DRY = Model("stribeck_plain", fs=0.2951, fc=0.3524, vs=0.003, delta_s=1.1, sigma2=0.0263)  # thesis Table 9
DRY_VELOCITIES = np.array([1.4, 1.2, 1.0, 0.8, 0.6, 0.5, 0.4, 0.3, 0.2, 0.1, 0.08, 0.06, 0.04, 0.02])  # (4.1)


def test_table_9_from_its_curve_and_break_away_torque() -> None:
    """Thesis 4.3.1.1.2: the break-away torque is the point at zero; friction rises from it, fs < fc.

    The slowest point is at 7 vs, where the rise is over: nothing tells vs and delta_s, and the verdict must say so.
    """
    v = np.concatenate([[0.0], DRY_VELOCITIES])
    points = SlidingPoints(v, np.concatenate([[0.2951], friction(DRY_VELOCITIES, DRY)]))
    template = candidates(points.velocity, points.torque)["Stribeck (eq. 2.6)"]
    result = identify_sliding(points, template, noise=1e-4, starts=20)
    for name in ("fs", "fc", "sigma2"):
        assert result[name].identified
        assert result[name].value == pytest.approx(getattr(DRY.parameters, name), rel=1e-3)
    assert set(result.not_identified) == {"vs", "delta_s"}
    assert result.model is not None
    grid = np.geomspace(0.02, 1.4, 50)
    assert friction(grid, result.model) == pytest.approx(friction(grid, DRY), abs=1e-4)


def test_table_10_gives_its_curve_and_a_verdict_on_its_parameters() -> None:
    """Thesis 4.3.2.1.2: betas of 80 N·m for a curve of 0.28 N·m are one of many sets of equally good ones."""
    v = GREASE_VELOCITIES
    points = SlidingPoints(v, friction(v, GREASE))
    template = candidates(v, points.torque)["two Stribeck curves (eq. 4.5)"]
    result = identify_sliding(points, template, noise=1e-3, starts=10)
    assert result.model is not None
    grid = np.geomspace(0.005, 25.0, 100)
    assert friction(grid, result.model) == pytest.approx(friction(grid, GREASE), abs=1e-4)
    assert {"beta0", "beta1", "beta2"} <= set(result.not_identified)
    assert any("do not determine beta0" in note for note in result.notes)


def test_without_templates_the_grease_of_the_thesis_takes_equation_4_5() -> None:
    """Thesis 4.3.2.1.2: eqs. 2.6 and 4.4 are not flexible enough for the curve of figure 4.33."""
    v = GREASE_VELOCITIES
    torque = friction(v, GREASE) + np.random.default_rng(0).normal(0.0, 1e-3, v.size)
    name, result, table = choose_sliding(SlidingPoints(v, torque), noise=1e-3, starts=10)
    assert name == result.details["chosen"] == "two Stribeck curves (eq. 4.5)"
    assert set(table) == set(candidates(v, torque))
    assert table["Stribeck (eq. 2.6)"]["cross_validated_Nm"] > 5 * table[name]["cross_validated_Nm"]
    assert all(tried in result.notes[-1] for tried in table)


def test_of_laws_with_the_same_curve_the_one_with_nothing_beside_it_is_taken() -> None:
    v = np.geomspace(0.002, 1.0, 12)
    torque = friction(v) + np.random.default_rng(3).normal(0.0, 1e-3, v.size)
    plain = Model("stribeck_plain", fs=0.5, fc=0.1, vs=0.05, delta_s=1.0, sigma2=0.005)
    templates = {"gms": PLANT, "lugre": GUESS, "plain": plain}
    assert choose_sliding(SlidingPoints(v, torque), templates, noise=1e-3, starts=10)[0] == "plain"


def test_twins_of_a_speed_are_left_out_together() -> None:
    """A curve with a parameter per speed would else be told every point by its twin in the other direction."""
    v = np.array([0.1, -0.1001, 0.0, 0.0, 0.2, 0.1])
    labels = SlidingPoints(v, np.ones(6)).speeds().tolist()
    assert labels[0] == labels[1] == labels[5]
    assert len({labels[0], labels[2], labels[3], labels[4]}) == 4


def test_a_frozen_parameter_stays_in_every_candidate() -> None:
    v = VELOCITIES[1:]
    torque = friction(v)
    laws = {n: m for n, m in candidates(v, torque, {"sigma2": 0.05}).items() if "4." not in n}
    _, result, table = choose_sliding(SlidingPoints(v, torque), laws, noise=1e-3, frozen=["sigma2"], starts=5)
    assert result.model is not None
    assert result.model.parameters.sigma2 == 0.05
    assert table["Coulomb with viscous"]["parameters"] == 1
    assert "viscous (eq. 2.3)" not in table  # nothing of it is free
    assert "viscous (eq. 2.3)" in result.notes[-1]


@pytest.mark.parametrize(
    ("template", "untouched"), [(GUESS, ["sigma0", "sigma1"]), (PLANT, ["k", "alpha", "c"])]
)
def test_what_sliding_does_not_touch_is_never_called_found(template: Model, untouched: list[str]) -> None:
    result = identify_sliding(SlidingPoints(VELOCITIES, friction(VELOCITIES)), template, noise=1e-6, starts=5)
    assert result.details["untouched"] == untouched
    assert {e.name for e in result.estimates} == set(TABLE_1)
    assert any(all(name in note for name in untouched) for note in result.notes)
    frozen = identify_sliding(
        SlidingPoints(VELOCITIES, friction(VELOCITIES)), template, noise=1e-6, starts=2, frozen=untouched
    )
    assert frozen.details["untouched"] == []


def test_bad_points_get_one_clear_error() -> None:
    with pytest.raises(InputError, match="5 parameters need at least 5 points"):
        identify_sliding(SlidingPoints(np.ones(3), np.ones(3)), GUESS)
    with pytest.raises(InputError, match="equally long"):
        SlidingPoints(np.ones(3), np.ones(2))
    with pytest.raises(InputError, match="finite"):
        SlidingPoints(np.array([1.0, math.nan]), np.ones(2))


# ---- records -----------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def staircase() -> Record:
    """A simulated constant-velocity experiment in both directions, with a torque that varies with the position."""
    axis = RigidAxis(3.8623e-4, PLANT)
    parts = []
    for k, speed in enumerate([3.0, -3.0, 1.0, -1.0]):
        run = simulate(axis, Controller(Gains(kp=20.0, kd=0.2, kr=0.2)), Reference("ramp", velocity=speed),
                       (2.0 * math.pi * 2 + 1.0) / abs(speed), output=2e-3)  # fmt: skip
        parts.append((k, run))
    time, rows = [], {"position": [], "motor_torque": []}
    clock = 0.0
    for _, run in parts:
        time.append(run.time + clock)
        clock = time[-1][-1] + 1e-6
        rows["position"].append(run["position"])
        rows["motor_torque"].append(run["motor_torque"] + 0.03 * np.sin(3.0 * run["position"]))
    channels = {n: np.concatenate(v) for n, v in rows.items()}
    return Record(np.concatenate(time), channels, {"position": "rad", "motor_torque": "N·m"})


def test_segments_are_found_and_averaged_over_whole_revolutions(staircase: Record) -> None:
    segments = constant_velocity_segments(staircase)
    assert [s.velocity for s in segments] == pytest.approx([3.0, -3.0, 1.0, -1.0], rel=1e-3)
    assert [s.revolutions for s in segments] == [2, 2, 2, 2]
    assert [s.torque for s in segments] == pytest.approx(friction(np.array([3.0, -3.0, 1.0, -1.0])), abs=2e-4)
    points, notes = sliding_points([staircase])
    assert len(points) == 4
    assert "20 degrees" in notes[0]


def test_a_segment_shorter_than_a_revolution_is_said(staircase: Record) -> None:
    early = staircase.time < 1.5
    short = Record(
        staircase.time[early], {n: staircase[n][early] for n in staircase.channels}, staircase.units
    )
    _, notes = sliding_points(short)
    assert "less than a revolution" in notes[1]


def test_a_record_without_constant_velocity_is_one_clear_error() -> None:
    time = np.linspace(0.0, 1.0, 500)
    still = Record(
        time, {"position": 0.0 * time, "motor_torque": time}, {"position": "rad", "motor_torque": "N·m"}
    )
    with pytest.raises(InputError, match="no segment of constant velocity"):
        sliding_points(still)
    swinging = Record(time, {"position": np.sin(6.0 * time), "motor_torque": time}, still.units)
    with pytest.raises(InputError, match="no segment of constant velocity"):
        sliding_points(swinging)


def test_pictures_are_drawn(tmp_path: Path) -> None:
    result = left_open()
    assert any(t.kind == "vertical" for t in result.pictures[0].traces)
    assert sum(t.kind == "faint" for t in result.pictures[0].traces) > 10
    for picture in result.pictures:
        draw_picture_to(picture, tmp_path / "drawn.png")
        assert (tmp_path / "drawn.png").stat().st_size > 5000
