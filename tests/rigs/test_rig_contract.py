"""What every registered kind of rig keeps."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from test_ds402 import drive  # noqa: F401

from stickslip.core.code_approval import allow_code
from stickslip.core.errors import InputError, RigError
from stickslip.rigs.ds402 import Ds402
from stickslip.rigs.files import read_rig
from stickslip.rigs.kinds import rig_kind_names
from stickslip.rigs.loop import Loop
from stickslip.rigs.replay import Replay
from stickslip.rigs.rig import BlockRig, Capabilities, Limits, Measurement, Rig, Watchdog, setpoints
from stickslip.rigs.virtual import virtual_rig
from support.axis_rig import AxisRig

OWN = """
from stickslip.rigs.files import limits_in
from stickslip.rigs.rig import Capabilities, Measurement, RigKind, Watchdog


class Mass:
    name = "mass"
    sample_time = 1e-3

    def __init__(self, limits, inertia):
        self.limits, self.inertia = limits, inertia
        self.capabilities = Capabilities(Watchdog(0.0, "it stops with the process"), real_clock=False)
        self.time = self.position = self.velocity = 0.0

    def open(self):
        return Measurement(self.time, self.position, 0.0)

    def exchange(self, torque):
        self.velocity += 1e-3 * torque / self.inertia
        self.position += 1e-3 * self.velocity
        self.time += 1e-3
        return Measurement(self.time, self.position, torque)

    def pause(self, seconds):
        self.time += seconds
        self.velocity = 0.0
        return self.open()

    def close(self):
        self.velocity = 0.0


RIG = RigKind("mass", lambda table: Mass(limits_in(table), table.positive("inertia", "kg·m²", 1e-3)), "a mass")
"""


def replayed() -> Rig:
    with Loop(AxisRig()) as loop:
        loop.run(setpoints(300, torque=0.4))
        return Replay(loop.record())


def own(folder: Path) -> Rig:
    (folder / "mass.py").write_text(OWN)
    (folder / "mass.toml").write_text('[rig]\nkind = "mass.py"\n[rig.limits]\ntorque = 1\nspeed = 50\n')
    with allow_code():
        return read_rig(folder / "mass.toml")


MAKE: dict[str, Callable[[Any, Path], Rig]] = {
    "virtual": lambda bus, folder: virtual_rig("thesis-dry"),
    "replay": lambda bus, folder: replayed(),
    "ds402": lambda bus, folder: Ds402(bus.settings()),
    "own": lambda bus, folder: own(folder),
}


@pytest.fixture(params=list(MAKE))
def rig(request, tmp_path) -> Iterator[Rig]:
    bus = request.getfixturevalue("drive") if request.param == "ds402" else None
    made = MAKE[request.param](bus, tmp_path)
    yield made
    made.close()


def test_every_kind_is_tested():
    assert set(rig_kind_names()) <= set(MAKE)


def test_it_declares_what_it_is(rig):
    assert isinstance(rig, Rig)
    assert rig.name
    assert rig.sample_time > 0.0
    assert isinstance(rig.limits, Limits)
    assert isinstance(rig.capabilities, Capabilities)
    assert isinstance(rig.capabilities.watchdog, Watchdog)
    assert rig.capabilities.blocks == isinstance(rig, BlockRig)


def test_it_closes_at_any_time(rig):
    rig.close()
    rig.open()
    rig.exchange(0.05)
    rig.close()
    rig.close()
    again = rig.open()
    assert math.isfinite(again.position)


def test_its_clock_ascends_and_it_measures_what_it_says(rig):
    rows = [rig.open()]
    rows += [rig.exchange(0.05) for _ in range(50)]
    rows += [rig.pause(0.02), rig.exchange(0.0)]
    assert all(isinstance(row, Measurement) for row in rows)
    time = np.array([row.time for row in rows])
    assert np.all(np.diff(time) > 0.0) or (np.all(np.diff(time) >= 0.0) and rig.name == "replay")
    if not rig.capabilities.real_clock:
        assert np.allclose(np.diff(time[:51]), rig.sample_time)
    for field, able in (
        ("sensor", rig.capabilities.torque_sensor),
        ("temperature", rig.capabilities.temperature),
    ):
        assert math.isnan(getattr(rows[-1], field)) != able
    assert all(row.status == 0.0 for row in rows)


def test_the_loop_stops_it_like_any_other(rig, tmp_path):
    with pytest.raises(RigError), Loop(rig, path=tmp_path / "run.stream") as loop:
        loop.run(setpoints(100, torque=np.where(np.arange(100) < 50, 0.05, 1e10)))
    assert loop.account().samples <= 100


def test_a_file_that_is_no_rig(tmp_path):
    for text, message in (
        ("x = 1", "defines no rig"),
        ("x = ", "cannot be imported"),
        ("raise SystemExit(3)", "cannot be imported"),
    ):
        (tmp_path / "own.py").write_text(text)
        (tmp_path / "rig.toml").write_text('[rig]\nkind = "own.py"\n')
        with pytest.raises(InputError, match=message), allow_code():
            read_rig(tmp_path / "rig.toml")
        (tmp_path / "own.py").unlink()
    with pytest.raises(InputError, match="no file"):
        read_rig(tmp_path / "rig.toml")
