"""The torque over the angle found in a production record, and the axis without it."""

from __future__ import annotations

import importlib.util
import sys
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import stickslip as ss
from stickslip.cli import main
from stickslip.core.errors import InputError
from stickslip.core.record import Record

ROOT = Path(__file__).parents[2]
UNITS = {"position": "rad", "motor_torque": "N·m"}
INERTIA, FC, SIGMA2, OFFSET = 2e-3, 0.05, 0.004, 0.01
COGGING = {12: (0.02, 0.0), 24: (0.01, 1.0)}
"""Amplitude, N·m, and phase of each order."""
RIPPLE = 0.01


def motion(swing: float = 4.0, times: float = 1.0) -> tuple[np.ndarray, ...]:
    """Time, position, velocity and acceleration of two sines, their frequencies so many times as high."""
    t = np.arange(0.0, 20.0, 1e-3)
    w, size = 2.0 * np.pi * times * np.array([[0.17], [0.41]]), swing * np.array([[1.0], [0.25]])
    return (
        t, (size * np.sin(w * t)).sum(axis=0), (size * w * np.cos(w * t)).sum(axis=0),
        -(size * w**2 * np.sin(w * t)).sum(axis=0),
    )  # fmt: skip


def record(*, cogging: float = 1.0, ripple: float = 0.0, seed: int = 1, **way: float) -> Record:
    """An axis along a motion: its equation of motion, with noise on the torque and on the position."""
    rng = np.random.default_rng(seed)
    t, q, v, a = motion(**way)
    beside = sum(size * np.cos(n * q + phase) for n, (size, phase) in COGGING.items())
    friction = np.sign(v) * (FC + ripple * np.cos(3.0 * q + 0.5)) + SIGMA2 * v
    torque = INERTIA * a + friction + OFFSET + cogging * beside + 0.004 * rng.standard_normal(t.size)
    return Record(t, {"position": q + 2e-5 * rng.standard_normal(t.size), "motor_torque": torque}, UNITS)


def orders(found: Any) -> set[str]:
    return {name for name in found.parameters if name.startswith(("even", "odd"))}


def test_orders_of_both_parts_and_the_axis_without_them() -> None:
    found = ss.identify(record(ripple=RIPPLE), position_map=True, inverse=True)
    assert orders(found) == {"even[12]", "even[24]", "odd[3]"}
    true = {
        "inertia": INERTIA, "fc": FC, "sigma2": SIGMA2, "odd[3]": RIPPLE,
        **{f"even[{n}]": size for n, (size, _) in COGGING.items()},
    }  # fmt: skip
    for name, value in true.items():
        assert found[name].identified, name
        assert found[name].lower < value < found[name].upper, name
        assert found[name].value == pytest.approx(value, rel=0.02), name
    assert found.position_map is not None
    q = np.linspace(0.0, 2.0 * np.pi, 500)
    beside = sum(size * np.cos(n * q + phase) for n, (size, phase) in COGGING.items())
    assert found.position_map.beside(q) == pytest.approx(beside, abs=5e-4)
    assert found.position_map.ripple(q) == pytest.approx(RIPPLE * np.cos(3.0 * q + 0.5), abs=5e-4)
    assert found.misfit["map_sectors_left_out_Nm"] < 0.1 * found.misfit["no_map_sectors_left_out_Nm"]
    plain = ss.identify(record(ripple=RIPPLE), inverse=True)
    assert found.misfit["inverse_dynamics_relative"] < 0.3 * plain.misfit["inverse_dynamics_relative"]


def test_the_error_without_a_map_is_no_more_than_the_torque_over_the_angle() -> None:
    """Sectors that hold what no other does (here the ends of the strokes) extrapolate inertia and friction."""
    found = ss.identify(record(swing=2.8), position_map=True, inverse=True)
    beside = np.sqrt(sum(0.5 * size**2 for size, _ in COGGING.values()))
    for kind in ("sectors", "places"):
        assert found.misfit[f"no_map_{kind}_left_out_Nm"] == pytest.approx(beside, rel=0.1)
        assert found.misfit[f"map_{kind}_left_out_Nm"] < 0.1 * beside
    (note,) = (n for n in found.notes if n.startswith("Torque over the angle:"))
    assert f"(no map {found.misfit['no_map_sectors_left_out_Nm']:.3g})" in note


def test_long_strokes_at_constant_speeds_show_high_orders() -> None:
    """Their rows show no swing of the velocity at these orders: no column for it, where two of zeros ended the fit."""
    t = np.arange(0.0, 24.0, 1e-3)
    ends = np.arange(0.0, 25.0, 3.0)
    speeds = np.array([0.2, -0.2, 0.4, -0.4, 0.8, -0.8, 4.0, -4.0])
    v = np.convolve(
        np.pad(speeds[np.digitize(t, ends) - 1], 50, mode="edge"), np.hanning(101) / 50.0, "valid"
    )
    q, a = np.cumsum(v) * 1e-3, np.gradient(v, t)
    rng = np.random.default_rng(3)
    cogging = 0.7 * np.cos(60.0 * q) + 0.18 * np.cos(120.0 * q)
    torque = 0.03 * a + 1.2 * np.sign(v) + 0.2 * v + cogging + 0.01 * rng.standard_normal(t.size)
    found = ss.identify(
        Record(t, {"position": q, "motor_torque": torque}, UNITS), position_map=True, inverse=True
    )
    for name, size in {"even[60]": 0.7, "even[120]": 0.18}.items():
        assert found[name].lower < size < found[name].upper
        assert found[name].value == pytest.approx(size, rel=0.1)


@pytest.mark.parametrize(
    ("made", "why"),
    [
        ({"cogging": 0.0}, "no order up to"),
        ({"swing": 1.5}, "less than a revolution"),
        ({"times": 15.0}, "the slower rows alone tell anything, too few for a map"),
    ],
)
def test_without_a_map_the_axis_is_what_it_was(made: dict[str, float], why: str) -> None:
    one = record(**made)
    found, plain = ss.identify(one, position_map=True, inverse=True), ss.identify(one, inverse=True)
    (note,) = (n for n in found.notes if n.startswith("No torque over the angle is identified"))
    assert why in note
    assert [n for n in found.notes if n != note] == list(plain.notes)
    assert [e.as_dict() for e in found.identification.estimates] == [
        e.as_dict() for e in plain.identification.estimates
    ]
    assert found.misfit == plain.misfit
    assert found.position_map is None


def test_a_pendulums_own_order_stays_with_the_pendulum() -> None:
    one = record(swing=8.0, times=0.5)
    hanging = 0.03 * np.sin(one["position"] - 0.4)
    swung = Record(one.time, {**one.channels, "motor_torque": one["motor_torque"] + hanging}, UNITS)
    found = ss.identify(swung, position_map=True, inverse=True, pendulum=True)
    assert orders(found) == {"even[12]", "even[24]"}
    assert found["gravity"].value == pytest.approx(0.03, rel=0.02)


def test_the_drive_signals_own_unit_and_side() -> None:
    """A current in A: what is taken out of it is a current."""
    one = record(ripple=RIPPLE)
    found = ss.identify(
        t=one.time, position=one["position"], current=one["motor_torque"] / 0.1, torque_constant=0.1,
        position_map=True, inverse=True,
    )  # fmt: skip
    assert orders(found) == {"even[12]", "even[24]", "odd[3]"}
    assert found["fc"].value == pytest.approx(FC, rel=0.01)
    assert found["even[12]"].value == pytest.approx(0.02, rel=0.02)


def test_the_command_writes_a_map_that_exports_take(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    one = record()
    log = tmp_path / "log.csv"
    rows = np.column_stack([one.time, one["position"], one["motor_torque"]])
    np.savetxt(
        log,
        rows,
        delimiter=",",
        header="time [s],position [rad],motor_torque [N·m]",
        comments="",
        encoding="utf-8",
    )
    out = tmp_path / "model.toml"
    assert main(["identify", str(log), "--position", "--inverse", "--no-report", "--out", str(out)]) == 0
    assert "even[12]" in capsys.readouterr().out
    written = tomllib.loads(out.read_text(encoding="utf-8"))
    assert written["law"] == "coulomb"
    assert written["position_map"]["even_order"] == [12.0, 24.0]
    assert written["angle"]["torque_offset"] == pytest.approx(written["axis"]["offset"])
    for target, more in (("odrive", ["--set", "torque_constant=0.1"]), ("st", ["--position-map"])):
        folder = tmp_path / target
        assert main(["export", str(out), "--to", target, *more, "--out", str(folder)]) == 0
        assert any(folder.iterdir())


def test_what_is_refused() -> None:
    one = record()
    with pytest.raises(InputError, match='method="cogging" does not use position_map'):
        ss.identify(one, method="cogging", position_map=True)
    with pytest.raises(InputError, match="harmonics=3"):
        ss.identify(one, harmonics=3, position_map=True)
    looped = Record(
        one.time,
        {**one.channels, "position_reference": one["position"]},
        {**UNITS, "position_reference": "rad"},
    )
    found = ss.identify(looped, loop={"kp": 1.0}, position_map=True, inverse=True)
    assert any("leave loop out" in n for n in found.notes)


@pytest.mark.slow
def test_a_drives_log_with_cogging_is_explained_better_where_it_was_not_fitted() -> None:
    """Law, controller and cogging of plain code of its own; the last rows are held out."""
    spec = importlib.util.spec_from_file_location("ordinary_logs", ROOT / "benchmarks" / "ordinary_logs.py")
    assert spec is not None
    assert spec.loader is not None
    logs = importlib.util.module_from_spec(spec)
    sys.modules["ordinary_logs"] = logs
    spec.loader.exec_module(logs)
    log = logs.draw(102, "actual", 1000, "p-pi", "production", "cogging", duration=20.0)
    part = log.time.size * 7 // 10
    fitted, held = (
        Record(log.time[rows], {"position": log.position[rows], "motor_torque": log.torque[rows]}, UNITS)
        for rows in (slice(part), slice(part, None))
    )
    found, plain = (
        ss.identify(fitted, hold_out=held, law="coulomb", position_map=on) for on in (True, False)
    )
    sizes = dict(zip(log.machine.orders, log.machine.sizes[:, 0], strict=True))
    assert orders(found) == {f"even[{n:g}]" for n in sizes}
    for n, size in sizes.items():
        assert found[f"even[{n:g}]"].lower < size < found[f"even[{n:g}]"].upper
    for name in ("inertia", "fc", "sigma2"):
        assert found[name].lower < log.truth[name] < found[name].upper
    assert found.misfit["held_out_force_relative"] < 0.95 * plain.misfit["held_out_force_relative"]
