"""Torque over the angle from standstill maps and slow rotations whose truth is known."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest

import stickslip as ss
from stickslip.cli import main
from stickslip.core.errors import InputError, UnknownName
from stickslip.core.record import Record
from stickslip.exports.maps import map_target, written
from stickslip.identification.cogging import identify_cogging
from stickslip.identification.cogging.moving import speed_control
from stickslip.identification.methods import method_named
from stickslip.identification.methods.method import Options
from stickslip.machines.files import machine
from stickslip.machines.position_map import PositionMap, Waves
from stickslip.report.after_a_map import after_a_map
from stickslip.rigs.procedures.base import perform
from stickslip.rigs.procedures.cogging import Cogging
from stickslip.rigs.procedures.standstill import Standstill
from stickslip.rigs.virtual import VirtualRig

TURN = 2.0 * np.pi
CIRCLE = np.linspace(0.0, TURN, 2000)
COGGING = Waves((12.0, 24.0, 72.0), (0.02, -0.01, 0.08), (0.01, 0.0, 0.05))
FRICTION = 0.05
UNITS = {"position": "rad", "position_reference": "rad", "motor_torque": "N·m", "velocity": "rad/s"}


def standstill(
    torque, *, places=1000, low=0.0, high=TURN, noise=0.003, seed=1, rows=5, measured=lambda x: x, unit="N·m"
):
    """Places forth and back, some rows at each; the axis rests up to 1 mrad beside its reference."""
    rng = np.random.default_rng(seed)
    way = np.linspace(low, high, places)
    way = np.concatenate([way, way[::-1]])
    side = np.repeat([1.0, -1.0], places)
    rests = way + rng.uniform(-1e-3, 1e-3, way.size)
    mean = torque(rests, side) + noise * rng.standard_normal(way.size)
    n = way.size * rows
    channels = {
        "position": np.repeat(measured(rests), rows), "position_reference": np.repeat(way, rows),
        "motor_torque": np.repeat(mean, rows) + 0.002 * rng.standard_normal(n),
    }  # fmt: skip
    units = {**UNITS, "motor_torque": unit}
    return Record(0.002 * np.arange(n), channels, {k: units[k] for k in channels})


def rotation(torque, *, speed, turns=2.0, noise=0.004, seed=1, period=1e-3):
    """Forth and back at a speed."""
    rng = np.random.default_rng(seed)
    half = np.arange(0.0, turns * TURN, speed * period)
    q = np.concatenate([half, half[::-1]])
    side = np.repeat([1.0, -1.0], half.size)
    channels = {
        "position": q, "velocity": speed * side,
        "motor_torque": torque(q, side) + noise * rng.standard_normal(q.size),
    }  # fmt: skip
    return Record(period * np.arange(q.size), channels, {k: UNITS[k] for k in channels})


def plain(q, side):
    return COGGING.at(q) + FRICTION * side + 0.004


def test_orders_and_levels_of_a_standstill_map():
    found = identify_cogging([standstill(plain)])
    own = found.details["map"]
    assert own.even.order == COGGING.order
    assert own.odd.order == ()
    assert own.even.amplitude == pytest.approx(COGGING.amplitude, abs=0.0006)
    for name, true in (("friction", FRICTION), ("offset", 0.004), *((f"even[{n:g}]", a) for n, a in
                       zip(COGGING.order, COGGING.amplitude, strict=True))):  # fmt: skip
        assert found[name].value == pytest.approx(true, abs=4.0 * found[name].std)
        assert found[name].identified
    assert own.form == "harmonics"
    assert found.misfit["sectors_left_out"] < 0.0036
    assert found.misfit["table_sectors_left_out"] > 10.0 * found.misfit["sectors_left_out"]
    assert found.model is not None
    assert found.model.parameters.fc == pytest.approx(FRICTION, abs=0.001)
    assert found.details["angle"].beside.order == COGGING.order


def test_a_slow_rotation_says_the_same_and_friction_over_the_angle_is_odd():
    def torque(q, side):
        return plain(q, side) + side * 0.015 * np.cos(3.0 * q + 0.5)

    own = identify_cogging([rotation(torque, speed=0.5)]).details["map"]
    assert own.even.order == COGGING.order
    assert own.odd.order == (3.0,)
    assert own.odd.amplitude == pytest.approx((0.015,), abs=0.0005)
    assert own(CIRCLE, -1.0) == pytest.approx(torque(CIRCLE, -1.0), abs=0.002)


def test_viscous_friction_comes_from_several_speeds():
    records = [
        rotation(lambda q, s, v=v: plain(q, s) + 0.02 * v * s, speed=v, seed=int(10 * v)) for v in (0.2, 0.5, 0.9)
    ]  # fmt: skip
    found = identify_cogging(records)
    assert found["viscous"].value == pytest.approx(0.02, abs=4.0 * found["viscous"].std)
    assert found["viscous"].std < 0.002
    assert found["friction"].value == pytest.approx(FRICTION, abs=0.002)


def test_a_curve_of_friction_over_three_speeds_hides_no_order():
    """What a straight line through three levels leaves would drown a small order."""
    levels = {0.2: 0.05, 0.3: 0.09, 0.6: 0.04}
    records = [
        rotation(lambda q, s, f=f: 0.002 * np.cos(q) + f * s, speed=v, seed=int(10 * v))
        for v, f in levels.items()
    ]
    found = identify_cogging(records)
    assert found.details["map"].even.order == (1.0,)
    assert found["even[1]"].value == pytest.approx(0.002, abs=0.0002)
    v = 0.3
    said = found["friction"].value + found["viscous"].value * v + found["curve"].value * v**2
    assert said == pytest.approx(0.09, abs=0.001)


def test_friction_beside_the_contact_does_not_ripple():
    """What ripples changes by more with the speed than all of friction, and bearings grow with it."""
    contact = {0.2: 0.05, 0.3: 0.06, 0.6: 0.03}
    records = [
        rotation(lambda q, s, f=f, v=v: (f * (1.0 + 0.1 * np.cos(3 * q)) + 0.05 + 0.04 * v) * s, speed=v, noise=5e-4)
        for v, f in contact.items()
    ]  # fmt: skip
    own = identify_cogging(records)["odd[3]"]
    true = 0.1 * np.mean(list(contact.values()))
    assert own.lower < true < own.upper
    assert own.std < 1e-3 * true


def test_means_over_an_angle_are_taken_into_account():
    """A cell is a 1/8192 of a turn, an eighth of a period of order 1100: its mean is 2.9 % smaller."""
    record = rotation(lambda q, s: 0.1 * np.cos(1100.0 * q) + FRICTION * s, speed=0.1, turns=1.1, period=5e-4)
    found = identify_cogging([record])
    assert found["even[1100]"].value == pytest.approx(0.1, rel=0.003)


@pytest.mark.slow
def test_cogging_behind_a_gear_is_recovered():
    """Order 1200 of the output shaft: the procedure goes slower for it."""
    gear = machine(Path(__file__).parents[1] / "data" / "gear_50.toml")
    run = Cogging(
        velocities=(0.6, 0.4), inertia=gear.inertia, bandwidth=30.0, degrees=380.0, order=24.0, gear=50.0
    )
    found = identify_cogging([perform(run, VirtualRig(gear)).record])
    own = found.details["map"].beside(CIRCLE)
    true = -np.array([gear.cogging.at(x) for x in CIRCLE])
    assert np.std(own - true) < 0.01 * np.std(true)
    for n, amplitude in zip(gear.cogging.order, gear.cogging.amplitude, strict=True):
        assert found[f"even[{n:g}]"].lower < amplitude < found[f"even[{n:g}]"].upper


def test_the_procedure_is_slow_enough_for_the_highest_order():
    free, bound = Cogging(), Cogging(order=24.0, gear=50.0, bandwidth=30.0)
    assert free.speeds == (0.6, 0.4, 0.25)
    assert bound.speeds[0] * 1200.0 / TURN == pytest.approx(30.0 / 5.0)
    assert bound.speeds[1] / bound.speeds[0] == pytest.approx(0.4 / 0.6)
    assert Cogging(order=2.0).speeds == free.speeds


@pytest.mark.slow
def test_a_standstill_map_of_a_rig_is_identified():
    """Friction is not: at rest it has what the loop left of it."""
    plant = machine(Path(__file__).parents[1] / "data" / "direct_drive_24.toml")
    run = Standstill(inertia=plant.inertia, bandwidth=30.0, places=480, hold=0.2)
    done = perform(run, VirtualRig(plant))
    assert done.passed
    found = identify_cogging([done.record])
    for n, amplitude in zip(plant.cogging.order, plant.cogging.amplitude, strict=True):
        assert found[f"even[{n:g}]"].value == pytest.approx(amplitude, rel=0.05)


def test_nothing_is_made_up():
    for seed in range(10):
        found = identify_cogging([standstill(lambda q, s: FRICTION * s + 0.0 * q, seed=seed)])
        assert found.details["map"].even.order == ()
        assert found.details["map"].odd.order == ()


def test_a_lag_with_direction_is_no_friction_over_the_angle():
    found = identify_cogging([standstill(lambda q, s: plain(q - 1.5e-3 * s, s), noise=0.001)])
    assert found["lag"].value == pytest.approx(1.5e-3, rel=0.1)
    assert not found["odd[72]"].identified
    assert "lag of 1.5" in found["odd[72]"].verdict
    assert any("equals a lag" in n for n in found.notes)
    assert found.details["angle"].ripple.order == ()


def test_an_eccentric_encoder_is_told_from_a_torque():
    def eccentric(x):
        return x + 2e-3 * np.cos(x + 0.7)

    found = identify_cogging([standstill(plain, noise=0.001, measured=eccentric)])
    assert found["eccentricity[1]"].value == pytest.approx(2e-3, rel=0.1)
    assert any("encoder" in n for n in found.notes)

    def uneven(q, s):  # the same orders, as of a rotor that is nearer to the stator on one side
        return plain(q, s) + 0.012 * np.cos(q) * COGGING.at(q) / 0.1

    names = [e.name for e in identify_cogging([standstill(uneven, noise=0.001)]).estimates]
    assert {"even[71]", "even[73]"} <= set(names)
    assert "eccentricity[1]" not in names


def test_a_dent_is_left_to_a_table():
    def dent(q, s):
        return FRICTION * s + 0.2 * np.exp(-(((np.mod(q, TURN) - 2.0) / 0.01) ** 2))

    own = identify_cogging([standstill(dent, noise=0.0005, places=2500)]).details["map"]
    assert own.form == "table"
    assert own.beside(np.array([2.0, 4.0]))[0] - own.beside(np.array([4.0]))[0] > 0.1


def test_less_than_a_turn_says_what_it_cannot_know():
    found = identify_cogging([standstill(plain, low=0.5, high=3.0)])
    own = found.details["map"]
    inside = np.linspace(0.7, 2.8, 500)
    true = COGGING.at(inside)
    assert np.std(own.beside(inside) - true - np.mean(own.beside(inside) - true)) < 0.05 * np.std(true)
    assert any("less than a turn" in n for n in found.notes)
    assert "whole turn" in found.measure_next[0]


@pytest.mark.parametrize("rows", [1, 5])
@pytest.mark.parametrize("first", [0.0, -np.pi, 100.0])
def test_a_turn_without_its_doubled_end_point_is_a_whole_turn(rows, first):
    """Place 0 is the neighbour of the last place, whether the record has one row at each place or several."""
    last = first + TURN * 255.0 / 256.0
    record = standstill(plain, places=256, low=first, high=last, rows=rows, unit="A")
    if rows == 1:
        record = Record(
            np.arange(512.0), {k: record[k] for k in ("position", "motor_torque")}, dict(record.units)
        )
    found = identify_cogging([record])
    own = found.details["map"]
    assert not any("less than a turn" in note for note in found.notes)
    assert written(own, map_target("moteus"), "cogging").files
    angle = np.linspace(first, first + TURN, 500)
    assert np.std(own.beside(angle) - COGGING.at(angle)) < 0.1 * np.std(COGGING.at(angle))


def test_a_turn_with_a_wider_gap_at_its_end_is_refused():
    found = identify_cogging([standstill(plain, places=256, high=TURN * 252.0 / 256.0)])
    assert any("less than a turn" in note for note in found.notes)
    with pytest.raises(InputError, match="identify a whole turn"):
        written(found.details["map"], map_target("c99"), "cogging")


def test_orders_behind_a_gear_are_fractions_of_a_turn():
    def torque(q, s):
        return FRICTION * s + 0.03 * np.cos(q / 5.0) + 0.02 * np.cos(6.0 * q)

    record = standstill(torque, high=5.0 * TURN, places=2000)
    own = method_named("cogging").identify([record], Options(values={"gear_ratio": 5.0})).details["map"]
    assert own.even.order == pytest.approx((0.2, 6.0))


def test_fast_records_are_not_fitted():
    with pytest.raises(InputError, match="inertia carries the cogging"):
        identify_cogging([rotation(plain, speed=50.0, turns=20.0)])
    found = identify_cogging([standstill(plain), rotation(plain, speed=50.0, turns=20.0)])
    assert any("neither fitted nor applied" in n for n in found.notes)
    assert found["friction"].value == pytest.approx(FRICTION, abs=0.001)


def test_a_speed_controllers_torque_is_named():
    rng = np.random.default_rng(1)
    v = 6.0 + np.convolve(rng.standard_normal(4000), np.ones(20) / 20.0, "same")
    y = np.roll(0.09 * (6.3 - v), 2)
    record = Record(
        1e-3 * np.arange(4000.0), {"velocity": v, "motor_torque": y, "position": np.cumsum(v) * 1e-3}, UNITS
    )
    line = speed_control(record, "motor_torque")
    assert line is not None
    assert line[0] == pytest.approx(-0.09, rel=0.01)
    friction = Record(record.time, {**record.channels, "motor_torque": 0.05 + 0.01 * v}, UNITS)
    assert speed_control(friction, "motor_torque") is None


def test_what_is_refused():
    record = standstill(plain)
    one_way = Record(record.time[:5000], {k: x[:5000] for k, x in record.channels.items()}, record.units)
    with pytest.raises(InputError, match="only one direction"):
        identify_cogging([one_way])
    method = method_named("cogging")
    with pytest.raises(InputError, match=r"map=..current."):
        method.check([Record(record.time, {"position": record["position"]}, UNITS)], Options())
    with pytest.raises(UnknownName, match="slots"):
        method.check([record], Options(values={"slots": 12.0}))


def record_of_torque():
    return standstill(plain, places=300)


def test_from_arrays_to_a_report(tmp_path):
    record = standstill(plain, unit="A")
    result = ss.identify(
        t=record.time, position=record["position"], reference=record["position_reference"],
        current=record["motor_torque"], method="cogging",
    )  # fmt: skip
    assert result.identification.details["map"].unit == "A"
    assert result.identification["friction"].unit == "A"
    in_torque = ss.identify(record_of_torque(), method="cogging").identification
    assert not any("Assumed" in n for n in in_torque.notes)  # the level of friction is what was identified
    assert "orders" in result.report(tmp_path / "report.html").read_text(encoding="utf-8")


def test_the_command_after_a_map_runs(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    for unit in ("A", "N·m"):
        rows = standstill(plain, places=300, unit=unit)
        column = "current [A]" if unit == "A" else "motor_torque [N·m]"
        head = f"time [s],position [rad],position_reference [rad],{column}"
        table = [rows.time, rows["position"], rows["position_reference"], rows["motor_torque"]]
        np.savetxt(
            "map.csv", np.column_stack(table), delimiter=",", header=head, comments="", encoding="utf-8"
        )
        assert main(["identify", "map.csv", "--method", "cogging", "--out", "found"]) == 0
        (last,) = (x for x in capsys.readouterr().out.splitlines() if x.startswith("next: "))
        assert main(last.removeprefix("next: stickslip ").split()) == 0
        assert "cogging_table" in (tmp_path / "cogging" / "cogging.h").read_text(encoding="utf-8")
        shutil.rmtree("cogging")


def test_without_a_torque_over_the_angle_the_axis_is_next():
    found = identify_cogging([standstill(lambda q, s: FRICTION * s + 0.0 * q)])
    assert after_a_map(found, "model.toml")[1].startswith("stickslip identify ")


def test_a_map_is_read_back():
    own = PositionMap(COGGING, Waves((3.0,), (0.1,), (0.0,)), 0.1, 0.2, "A", 0.0, TURN, (1.0, 2.0), (), 0.1)
    assert PositionMap.of(own.as_dict()) == own
    assert own.scaled(2.0, "N·m").friction == 0.4
    with pytest.raises(InputError, match="identify the axis again"):
        PositionMap.of({"even_order": [1.0]})


def test_the_procedure_shows_a_machines_cogging_and_ripple():
    plant = machine("thesis-dry")
    record = perform(Cogging(velocities=(0.9, 0.6), inertia=plant.inertia), VirtualRig(plant)).insist().record
    own = identify_cogging([record]).details["map"]
    true = -np.array([plant.cogging.at(x) for x in CIRCLE])
    assert np.corrcoef(own.beside(CIRCLE), true)[0, 1] > 0.95
    ripple = own.friction * np.array([plant.contact.ripple.at(x) for x in CIRCLE])
    assert np.std(own.ripple(CIRCLE) - ripple) < 0.05 * np.std(ripple)
