"""A brushless motor mapped at standstill (LAAS), against the numbers that its authors' data give."""

from __future__ import annotations

import numpy as np
import pytest

from stickslip.core.errors import InputError
from stickslip.core.record import Record
from stickslip.identification.cogging import identify_cogging
from stickslip.identification.cogging.moving import in_motion
from stickslip.identification.experiment import Experiment
from stickslip.identification.output_error.over_angle import over_angle
from stickslip.identification.sliding import estimate_sliding
from stickslip.machines.servo import ServoAxis
from support import places
from support.places import needs_data

DATA = places.DATA / "laas_cogging"

pytestmark = needs_data("laas_cogging")


def read(name, reference=False):
    table = np.genfromtxt(DATA / f"{name}.csv.gz", delimiter=",", names=True)
    channels = {"position": table["theta_rad"], "current": table["iq_A"]}
    units = {"position": "rad", "current": "A"}
    if reference:
        channels["position_reference"] = 2e-3 * table["ref_index"]
        units["position_reference"] = "rad"
    else:
        channels["velocity"] = table["omega_rad_s"]
        units["velocity"] = "rad/s"
    return Record(table["t_s"], channels, units), table


@pytest.fixture(scope="module")
def found():
    records = [read("standstill", True)[0], read("speed_a")[0], read("rolling_a")[0]]
    return identify_cogging(records, torque="current")


def test_orders_and_friction(found):
    for order, amplitude in (
        (72, 0.1845),
        (18, 0.0418),
        (12, 0.0302),
        (144, 0.0235),
        (24, 0.0183),
        (36, 0.0144),
    ):
        assert found[f"even[{order}]"].value == pytest.approx(amplitude, rel=0.03)
    assert found["friction"].value == pytest.approx(0.054, abs=0.003)


def test_the_half_difference_of_order_72_is_a_lag(found):
    assert found["lag"].value == pytest.approx(1.07e-3, rel=0.03)
    assert not found["odd[72]"].identified
    assert any("Order 72" in n and "lag of 1.07 mrad" in n for n in found.notes)


def test_sectors_decide_for_harmonics(found):
    assert found.misfit["places_left_out"] <= 0.0085
    assert found.misfit["sectors_left_out"] <= 0.0090
    assert found.misfit["table_sectors_left_out"] > 0.1
    assert found.details["map"].form == "harmonics"


def test_references_that_were_never_seen():
    record, table = read("standstill", True)
    inside = (table["ref_index"] >= 50) & (table["ref_index"] <= 3090)

    def rows(keep):
        return Record(record.time[keep], {k: v[keep] for k, v in record.channels.items()}, record.units)

    fitted = identify_cogging([rows(table["ref_index"] % 4 == 0)], torque="current").details["map"]
    out = inside & (table["ref_index"] % 4 == 2)
    names, at = np.unique(table["ref_index"][out] * table["direction"][out], return_inverse=True)
    count = np.bincount(at)
    angle, current, side = (
        np.bincount(at, table[c][out]) / count for c in ("theta_rad", "iq_A", "direction")
    )
    assert names.size == 1522
    assert np.sqrt(np.mean((current - fitted(angle, side)) ** 2)) <= 0.0085


def test_records_in_motion(found):
    assert found.misfit["in_motion"] <= 0.0180
    assert found.misfit["in_motion_no_map"] > 0.12
    assert any("50.7 rad/s" in n and "neither fitted nor applied" in n for n in found.notes)
    assert any("speed controller, not friction" in n for n in found.notes)
    fast = next(m for m in found.details["motions"] if m.speed > 40.0)
    assert not fast.visible


def test_the_recorded_velocity_gives_the_acceleration(found):
    """The computer stamps rows late: the angle's second derivative leaves nearly twice as much."""
    record = read("speed_a")[0]
    own = {k: v for k, v in record.channels.items() if k != "velocity"}
    blind = in_motion(Record(record.time, own, record.units), "current", found.details["map"])
    seen = next(m for m in found.details["motions"] if m.visible)
    assert blind.with_map > 1.5 * seen.with_map
    _, table = read("acceleration")
    wave = np.exp(4j * np.pi * table["t_s"])
    current, speed = (2.0 * np.mean(table[c] * np.conj(wave)) for c in ("iq_A", "omega_rad_s"))
    assert seen.inertia == pytest.approx((current / (4j * np.pi * speed)).real, rel=0.07)


def test_motion_without_slow_rows_gives_an_axis_no_map():
    axis = ServoAxis(drive_side="load")
    for name, why in (("acceleration", "neither fitted nor applied"), ("speed_a", "a revolution each way")):
        _, table = read(name)
        experiment = Experiment(name, table["t_s"] - table["t_s"][0], table["theta_rad"], table["iq_A"])
        with pytest.raises(InputError, match=why):
            over_angle([experiment], axis, None, estimate_sliding)
