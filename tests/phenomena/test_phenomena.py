"""The phenomena of thesis 2.1 as properties, the fits of 3.1.3.1, and the command that draws them."""

from __future__ import annotations

import importlib
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from stickslip import Model, gallery, law, law_names
from stickslip.cli import main
from stickslip.gallery import FIGURES


def script(name: str) -> ModuleType:
    """A module of the gallery."""
    return importlib.import_module(f"stickslip.gallery.{name}")


def test_the_command_lists_every_figure_and_its_modules_are_all_listed(
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert main(["figure"]) == 0
    listed = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in listed] == list(FIGURES)
    modules = {p.stem for p in Path(gallery.__file__).parent.glob("[a-z]*.py")}
    assert {figure.module for figure in FIGURES.values()} == modules


def test_a_figure_that_is_not_there_is_refused_with_those_that_are(
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert main(["figure", "2.9"]) == 2
    assert "2.1, 2.2, 2.3" in capsys.readouterr().err


@pytest.mark.parametrize(
    "number",
    ["3.7", *(pytest.param(n, marks=[pytest.mark.slow, pytest.mark.long]) for n in FIGURES if n != "3.7")],
)
def test_the_command_draws_a_figure(number: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    target = tmp_path / "figure.png"
    assert main(["figure", number, "--plot", str(target)]) == 0
    assert f"picture: {target}" in capsys.readouterr().out
    assert target.stat().st_size > 10_000


# ---- fits of the sliding curve (3.1.3.1) ----------------------------------------------------------------------


def test_twelve_points_give_table_1_and_eleven_leave_three_parameters_open() -> None:
    """Figures 3.7 and 3.8: without 25 mrad/s curves differ below it by more than the bend itself is deep."""
    example = script("sliding_fit")
    found = example.fitted()
    assert {n: found[n].value for n in example.TABLE_1} == pytest.approx(example.TABLE_1, rel=1e-6)
    missing = example.without_bend()
    assert set(missing.not_identified) == {"fs", "vs", "delta_s"}
    curves = np.array([[m.sliding_torque(v) for v in (0.01, 0.1)] for m in example.equally_good(missing)])
    assert np.ptp(curves[:, 0]) > 0.04
    assert np.ptp(curves[:, 1]) < 1e-5


# ---- break-away (2.1.1) ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["LUGRE", "GMS"])
def test_breakaway_force_falls_with_the_rate_between_its_two_levels(name: str) -> None:
    """Canudas de Wit et al. 1995: from near Fs at slow rates to near Fc at fast ones."""
    example = script("breakaway")
    found = [example.breakaway(example.pulled(getattr(example, name), rate)) for rate in (1.0, 5.0, 50.0)]
    assert found == sorted(found, reverse=True)
    assert 0.95 * 1.5 < found[0] <= 1.5 * 1.002
    assert 1.0 <= found[-1] < 1.2


# ---- pre-sliding (2.1.2) --------------------------------------------------------------------------------------


def remembering() -> list[str]:
    """Laws that declare non-local memory."""
    return [name for name in law_names() if law(name).non_local_memory]


# Leuven remembers turning points of its state z, which lags behind the position: its loops close in z, and in
# position only to some per cent.
ELSEWHERE = {"leuven"}


@pytest.mark.parametrize("name", sorted(set(remembering()) - ELSEWHERE))
def test_inner_loops_close_where_a_law_declares_it(name: str) -> None:
    example = script("presliding")
    record = example.loop(Model(name, **law(name).example))
    assert abs(example.gap(record)) < 5e-3 * np.ptp(record["friction_torque"])


def test_leuven_closes_its_loop_better_than_lugre_in_position() -> None:
    example = script("presliding")
    gaps = []
    for name in ("leuven", "lugre"):
        record = example.loop(Model(name, **law(name).example))
        gaps.append(abs(example.gap(record)) / np.ptp(record["friction_torque"]))
    assert gaps[0] < 0.75 * gaps[1]


def test_lugre_does_not_close_its_inner_loop() -> None:
    example = script("presliding")
    record = example.loop(example.LUGRE)
    assert abs(example.gap(record)) > 0.05 * np.ptp(record["friction_torque"])


def test_the_outer_curve_is_resumed() -> None:
    """After the interruption GMS goes on along the curve it would have followed without it."""
    example = script("presliding")
    interrupted = example.loop(example.GMS)
    example.TURNS = [0.0, 25e-6, -25e-6, 25e-6]
    plain = example.loop(example.GMS)
    part = {}
    for key, record in (("interrupted", interrupted), ("plain", plain)):
        last = record.time > record.time[np.argmin(record["position"])]
        part[key] = record["position"][last], record["friction_torque"][last]
    grid = np.linspace(13e-6, 24e-6, 30)
    x, torque = part["interrupted"]
    back = x.size - 1 - int(np.argmax(x[::-1] < 12e-6))
    gap = np.interp(grid, x[back:], torque[back:]) - np.interp(grid, *part["plain"])
    assert np.max(np.abs(gap)) < 5e-3 * np.ptp(torque)


def test_lugre_drifts_under_pulses_below_break_away_and_gms_does_not() -> None:
    example = script("presliding")
    lugre, gms = (example.drift(example.pulsed(model)) for model in (example.LUGRE, example.GMS))
    assert lugre > 1e-6
    assert abs(gms) < 1e-3 * lugre


# ---- frictional lag (2.1.3) -----------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["LUGRE", "GMS"])
def test_the_lag_widens_with_the_frequency(name: str) -> None:
    example = script("frictional_lag")
    widths = [example.width(example.swung(getattr(example, name), f)) for f in (0.2, 1.0, 5.0)]
    assert widths == sorted(widths)
    assert widths[0] > 0.0
    assert widths[-1] > 5.0 * widths[0]


def test_a_static_law_has_no_lag() -> None:
    example = script("frictional_lag")
    stribeck = Model("stribeck", **law("stribeck").example)
    assert example.width(example.swung(stribeck, 5.0)) == pytest.approx(0.0, abs=1e-9)


# ---- stick-slip (2.1.4) ---------------------------------------------------------------------------------------


def test_the_dragged_mass_sticks_and_slips() -> None:
    example = script("stick_slip")
    record = example.dragged(40.0)
    rests = example.rests(record)
    assert len(rests) >= 5
    # It lets go where the spring, slowly loaded, reaches the break-away force.
    assert 0.97 * 1.5 < example.SPRING * example.SPEED * rests[0][1] <= 1.5 * 1.01
    periods = np.diff([end for _, end in rests[:-1]])
    assert np.ptp(periods) < 0.01 * periods.mean()


def test_it_slides_steadily_where_friction_does_not_fall_with_speed() -> None:
    example = script("stick_slip")
    flat = Model("lugre", sigma0=1e5, sigma1=1e5**0.5, sigma2=0.4, fc=1.0, fs=1.0, vs=1e-3)
    record = example.dragged(60.0, flat)
    assert record["velocity"][record.time > 40.0] == pytest.approx(example.SPEED, rel=0.05)


# ---- time (2.1.5) and position (2.1.6) ------------------------------------------------------------------------


def declared() -> list[str]:
    """Laws that have a torque while they slide at one speed."""
    return [name for name in law_names() if law(name).steady is not None]


@pytest.mark.parametrize("name", declared())
def test_the_ripple_of_any_law_is_found_in_its_torque(name: str) -> None:
    """Its harmonics, and no other; the mean over a revolution is the steady torque without it."""
    example = script("position")
    model = example.rippling(name)
    there, back = (example.turned(model, speed) for speed in (example.SPEED, -example.SPEED))
    for record, speed in ((there, example.SPEED), (back, -example.SPEED)):
        for periods in range(1, 9):
            expected = example.HARMONICS.get(periods, 0.0)
            assert example.harmonic(record, periods) == pytest.approx(expected, abs=1e-3)
        plain = model.law.steady(speed, model.parameters)
        assert record["friction_torque"].mean() == pytest.approx(plain, rel=1e-3)


def test_the_ripple_stays_in_its_place_at_any_speed_from_either_side() -> None:
    example = script("position")
    places = []
    for speed in (0.02, example.SPEED, -example.SPEED, 2.0):
        record = example.turned(example.rippling("gms"), speed)
        places.append(record["position"][np.argmax(np.abs(record["friction_torque"]))])
    assert np.ptp(places) <= 2.0 * 2.0 * np.pi / 720.0


@pytest.mark.parametrize("name", ["coulomb", "lugre", "gms"])
def test_friction_settles_with_its_time_constant(name: str) -> None:
    """Each period of the swing repeats the one without the change, times what is left of it."""
    example = script("time_dependence")
    changing = example.swung(example.warming(name))
    constant = example.swung(Model(name, **law(name).example))
    left = example.factor(constant.time)
    assert left[[0, -1]] == pytest.approx([1.0, 0.7], abs=0.01)
    gap = changing["friction_torque"] - left * constant["friction_torque"]
    assert np.max(np.abs(gap)) < 1e-6 * np.ptp(constant["friction_torque"])
    last = np.max(changing["friction_torque"][-example.SAMPLES :])
    second = np.max(changing["friction_torque"][example.SAMPLES : 2 * example.SAMPLES])
    assert 1.0 + example.DRIFT < last / second < 1.0 + 0.8 * example.DRIFT


# ---- direction (2.1.7) ----------------------------------------------------------------------------------------


def test_other_levels_for_the_other_direction_without_a_jump() -> None:
    example = script("direction")
    record = example.loop(example.OTHER)
    torque = record["friction_torque"]
    fastest = torque[[np.argmax(record["velocity"]), np.argmin(record["velocity"])]]
    assert -fastest[1] / fastest[0] == pytest.approx(example.SHARE, rel=0.02)
    assert np.max(np.abs(np.diff(torque))) < 0.05 * np.ptp(torque)
