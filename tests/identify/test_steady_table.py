"""A table of steady points (velocity, torque; no times) gives a sliding curve, from files and from arrays."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import stickslip as ss
from stickslip.cli import main
from stickslip.core.errors import InputError
from stickslip.identification.fit.multistart import separable_starts
from stickslip.identification.fit.parameter_vector import Vector

Array = np.ndarray[Any, np.dtype[np.float64]]
TRUTH = {"fc": 0.4, "fs": 0.55, "vs": 0.15, "sigma2": 0.08, "offset": 0.01}
SPEEDS = np.geomspace(0.02, 3.0, 14)
BOTH = np.concatenate([-SPEEDS[::-1], SPEEDS])


def torque(v: Array, seed: int = 0) -> Array:
    falling = (TRUTH["fs"] - TRUTH["fc"]) * np.exp(-((v / TRUTH["vs"]) ** 2))
    noise = 4e-3 * np.random.default_rng(seed).standard_normal(v.size)
    return np.sign(v) * (TRUTH["fc"] + falling) + TRUTH["sigma2"] * v + TRUTH["offset"] + noise


def write(folder: Path, header: str, *columns: Array, sep: str = ",", point: str = ".") -> str:
    rows = (sep.join(f"{x:.6g}".replace(".", point) for x in row) for row in zip(*columns, strict=True))
    file = folder / "table.csv"
    file.write_text("\n".join([header, *rows]) + "\n", encoding="utf-8")
    return str(file)


def contained(found: dict[str, Any]) -> bool:
    """Whether every identified interval contains the truth."""
    return all(e["lower"] <= TRUTH[e["name"]] <= e["upper"] for e in found["estimates"] if e["name"] in TRUTH)


def test_the_command_line_fits_reports_and_exports(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = write(tmp_path, "velocity [rad/s],torque [Nm]", BOTH, torque(BOTH))
    out = str(tmp_path / "m")
    assert (
        main(["identify", file, "--method", "sliding", "--law", "stribeck_plain", "--json", "--out", out])
        == 0
    )
    found = json.loads(capsys.readouterr().out)
    assert {e["name"] for e in found["estimates"] if e["identified"]} >= set(TRUTH)
    assert contained(found)
    assert (tmp_path / "m" / "report.html").is_file()
    for target in ("mujoco", "st"):
        more = ["--set", "inertia=0.02", "--nearest"] if target == "mujoco" else []
        place = str(tmp_path / target)
        assert main(["export", f"{out}/model.toml", "--to", target, *more, "--out", place]) == 0


@pytest.mark.parametrize(
    ("header", "scale", "sep", "point", "options"),
    [
        ("speed (rpm),current (A)", (30.0 / math.pi, 1.0 / 0.12), ",", ".", ["--torque-constant", "0.12"]),
        ("speed [1/min];torque [%]", (30.0 / math.pi, 50.0), ";", ",", ["--rated-torque", "2"]),
        ("velocity [deg/s];torque [mNm]", (180.0 / math.pi, 1000.0), ";", ",", []),
    ],
)
def test_units_and_separators(
    header: str, scale: tuple[float, float], sep: str, point: str, options: list[str], tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    file = write(tmp_path, header, scale[0] * BOTH, scale[1] * torque(BOTH), sep=sep, point=point)
    command = ["identify", file, "--method", "sliding", "--law", "stribeck_plain", "--json", "--no-report"]
    assert main([*command, *options, "--out", str(tmp_path / "m.toml")]) == 0
    assert contained(json.loads(capsys.readouterr().out))


def test_arrays_frames_and_what_is_left_out() -> None:
    v = np.concatenate([[0.0], BOTH, [1.0]])
    t = np.concatenate([[0.5], torque(BOTH), [math.nan]])
    found = ss.identify(velocity=v, torque=t, method="sliding", law="stribeck_plain")
    assert found["fc"].lower <= 0.4 <= found["fc"].upper
    assert any("at velocity 0 any torque" in note and "rows 1" in note for note in found.notes)
    assert any("a value is missing: rows 30" in note for note in found.notes)
    again = ss.identify({"velocity": v, "torque": t}, method="sliding", law="stribeck_plain")
    assert again["fc"].value == found["fc"].value


def test_one_direction_determines_no_level() -> None:
    found = ss.identify(velocity=SPEEDS, torque=torque(SPEEDS) + 0.2, method="sliding", law="stribeck_plain")
    assert not found["fc"].identified
    assert found["vs"].identified
    level = ss.identify(
        velocity=SPEEDS, torque=torque(SPEEDS) - 0.01, method="sliding", law="stribeck_plain", frozen=["offset"],
        values={"offset": 0.0},
    )  # fmt: skip
    assert level["fc"].lower <= 0.4 <= level["fc"].upper


def test_few_points_and_repeats() -> None:
    five = np.array([-4.0, -2.0, 1.0, 2.0, 4.0])
    exact = 0.3 * np.sign(five) + 0.05 * five
    noise = 1e-3 * np.array([1.0, -1.0, 0.5, -0.5, 0.3])
    alone = ss.identify(velocity=five, torque=exact + noise, method="sliding", law="coulomb")
    assert alone["fc"].value == pytest.approx(0.3, abs=5e-3)
    assert "noise level is unknown" in alone["fc"].verdict
    twice = ss.identify(
        velocity=np.tile(five, 2), torque=np.concatenate([exact + noise, exact - noise]), method="sliding",
        law="coulomb",
    )  # fmt: skip
    assert twice["fc"].identified


@pytest.mark.parametrize(
    ("v", "t", "said"),
    [
        (BOTH, -torque(BOTH), "friction would drive the axis"),
        (BOTH, np.abs(torque(BOTH)), "a magnitude without its sign"),
        (np.zeros(10), np.ones(10), "no row has a velocity other than 0"),
        (
            np.linspace(-1.0, 1.0, 3000),
            np.linspace(-1.0, 1.0, 3000),
            "more than a table of steady points has",
        ),
    ],
)
def test_what_is_ambiguous_is_refused(v: Array, t: Array, said: str) -> None:
    with pytest.raises(InputError, match=said):
        ss.identify(velocity=v, torque=t, method="sliding", law="coulomb")


def test_other_methods_name_the_method_for_tables(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = write(tmp_path, "velocity [rad/s],torque [Nm]", BOTH, torque(BOTH))
    assert main(["identify", file]) == 2
    assert (
        "a table of constant velocities and their torques is for --method sliding" in capsys.readouterr().err
    )
    unnamed = write(tmp_path, "velocity [rad/s],M", BOTH, torque(BOTH))
    assert main(["identify", unnamed, "--method", "sliding"]) == 2
    assert "give --map torque=COLUMN:UNIT" in capsys.readouterr().err


@pytest.mark.filterwarnings("error")
def test_starts_far_off_overflow_without_a_warning() -> None:
    """Powers of the velocity overflow where an exponent is drawn large."""
    vector = Vector(ss.Model("coulomb", fc=1.0, sigma2=1.0))
    found = separable_starts(lambda values: 1e200 * values[0] * np.ones(5), np.ones(5), vector, 3)
    assert np.all(np.isfinite(found))


def test_a_break_away_torque_below_sliding_is_not_identified() -> None:
    """A curve that rises from rest fits with fs below fc, which no contact has."""
    rising = np.sign(BOTH) * (0.4 - 0.1 * np.exp(-((BOTH / 0.15) ** 2))) + 0.08 * BOTH
    noise = 1e-3 * np.random.default_rng(1).standard_normal(BOTH.size)
    found = ss.identify(velocity=BOTH, torque=rising + noise, method="sliding", law="stribeck_plain")
    assert found["fc"].identified
    assert not found["fs"].identified
    assert "below fc" in found["fs"].verdict
