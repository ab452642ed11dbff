"""The virtual rig: blocks and samples agree bit for bit, with every imperfection; speed; pauses; complaints."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import stickslip.machines
from stickslip.control.compensator import Feedback
from stickslip.control.controller import Controller
from stickslip.control.linear import place
from stickslip.core.errors import InputError, UnknownName
from stickslip.machines.files import machine
from stickslip.machines.machine import IMPERFECTIONS
from stickslip.rigs.files import read_rig
from stickslip.rigs.loop import Loop
from stickslip.rigs.rig import BlockRig, Rig, setpoints
from stickslip.rigs.virtual import VirtualRig, virtual_rig

T = 1e-3


class OneByOne(VirtualRig):
    """The same machine without blocks."""

    @property
    def capabilities(self):
        return replace(super().capabilities, blocks=False)


def controller(name):
    gains = place("PD", 4.2757e-4, 25.0, 1.0)
    return Controller(gains, Feedback(machine(name).models["lugre"], 0.5, 10.0), torque_limit=1.0)


def tracking(seconds):
    t = T * np.arange(round(seconds / T))
    w = 2.0 * np.pi * 0.4
    return setpoints(t.size, position=0.3 * (1 - np.cos(w * t)), velocity=0.3 * w * np.sin(w * t), closed=1.0)


def test_is_a_rig():
    rig = virtual_rig("thesis-dry", ["cogging"])
    assert isinstance(rig, Rig)
    assert isinstance(rig, BlockRig)
    assert rig.name == "virtual thesis-dry without cogging"
    assert rig.limits.torque == 1.085
    assert rig.limits.speed < 37.7


@pytest.mark.parametrize(
    ("lines", "name"),
    [
        ('machine = "ideal"\nwithout = ["delay"]', "virtual ideal without delay"),
        ("", None),
        ('machine = "ideal"\nspeed = 3', None),
        ('machine = "ideal"\nwithout = "cogging"', None),
    ],
)
def test_from_a_file(tmp_path, lines, name):
    path = tmp_path / "rig.toml"
    path.write_text(f'[rig]\nkind = "virtual"\n{lines}\n')
    if name:
        assert read_rig(path).name == name
    else:
        with pytest.raises(InputError):
            read_rig(path)


def test_a_machine_is_looked_for_beside_the_rigs_file(tmp_path, monkeypatch):
    """Not in the folder that one happens to be in."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "rigs").mkdir()
    (tmp_path / "rigs" / "rig.toml").write_text('[rig]\nkind = "virtual"\nmachine = "mine.toml"\n')
    text = (Path(stickslip.machines.__file__).parent / "library" / "ideal.toml").read_text()
    (tmp_path / "rigs" / "mine.toml").write_text(text)
    assert read_rig(Path("rigs") / "rig.toml").name == "virtual mine"


@pytest.mark.parametrize("name", ["thesis-dry", "thesis-grease", "ideal"])
def test_blocks_and_single_samples_agree_bit_for_bit(name):
    wanted = tracking(3.0)
    law = controller(name) if name != "ideal" else None
    kept = []
    for kind in (VirtualRig, OneByOne):
        with Loop(kind(machine(name))) as loop:
            loop.run(wanted, law)
            loop.pause(30.0)
            kept.append(loop.run(wanted, law))
    assert np.array_equal(kept[0], kept[1])
    assert len(kept[0]) == len(wanted)


def test_pause_comes_to_rest_and_lets_time_pass():
    rig = virtual_rig("thesis-dry")
    with Loop(rig) as loop:
        loop.run(setpoints(300, torque=0.6))
        assert rig.speed > 1.0
        after = loop.pause(600.0)
        assert rig.speed < 0.05
        assert after.time == pytest.approx(600.3, abs=0.1)
        again = loop.pause(600.0)
        assert again.position == pytest.approx(after.position, abs=1e-4)


@pytest.mark.parametrize("name", list(IMPERFECTIONS))
def test_the_rig_runs_without_each_imperfection(name):
    rig = virtual_rig("thesis-grease", [name])
    rig.open()
    for _ in range(50):
        measured = rig.exchange(0.2)
    assert np.all(np.isfinite(measured))


def test_complaints():
    with pytest.raises(UnknownName, match="coggin"):
        virtual_rig("thesis-dry", ["coggin"])
    with pytest.raises(InputError, match="finite"):
        virtual_rig("ideal").pause(-1.0)
