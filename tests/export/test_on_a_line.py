"""Exports of a linear axis say N, m and kg, and their code is that of any other axis."""

from __future__ import annotations

import io
import re
import zipfile
from pathlib import Path
from xml.etree import ElementTree

import pytest

import stickslip as ss
from stickslip.exports import TARGETS

WORDED = ("c99", "arduino", "python", "matlab", "st", "linuxcnc", "modelica")
"""Targets with code."""

MODEL = """
law = "coulomb"
motion = "{motion}"

[parameters]
fc = 54.0
sigma2 = 64.0

[axis]
inertia = 30.0
offset = -0.5
gravity = 2.0

[recommended]
compensator = "feedforward"
gain = 1.0
bandwidth = 10.0
damping = 1.0
inertia = 30.0
inertia_feedforward = 30.0
offset = -0.5
sample_time = 5e-4
torque_limit = 600.0
"""
ROTARY = re.compile(r"N[·*.]m|kg[·*.]m|(?<![A-Za-z_])rad(?![A-Za-z_])")
COMMENT = re.compile(
    r"/\*.*?\*/|//[^\n]*|\(\*.*?\*\)|%[^\n]*|\"\"\".*?\"\"\"|#[^\n]*|\"[^\"\n]*\"", re.DOTALL
)
CODE = (".c", ".h", ".cpp", ".ino", ".st", ".m", ".py", ".comp", ".mo")


def model(folder: Path, motion: str) -> Path:
    path = folder / f"{motion}.toml"
    path.write_text(MODEL.format(motion=motion))
    return path


@pytest.mark.parametrize("compensator", [None, "ff", "recommended"])
def test_notes_header_and_readme_have_the_units_of_the_axis(tmp_path, compensator):
    made = ss.export(model(tmp_path, "linear"), to="c99", compensator=compensator, check=True)
    assert not [
        text for name, text in made.files.items() if not name.endswith(".csv") and ROTARY.search(text)
    ]
    assert not ROTARY.search(" ".join([*made.notes, made.check.text]))
    assert made.check.passed is not False
    assert "Coulomb torque, N *" in made.files["linear.h"]
    if compensator:
        assert "| kg | inertia |" in made.files["README.md"]
        assert "= 30 kg times the reference's acceleration" in " ".join(made.notes)


@pytest.mark.parametrize("to", WORDED)
@pytest.mark.parametrize("compensator", [None, "ff"])
def test_the_code_is_that_of_any_axis(tmp_path, to, compensator):
    if compensator and to in ("linuxcnc", "modelica"):
        return
    line, round_ = (
        ss.export(model(tmp_path, motion), to=to, name="axis", compensator=compensator)
        for motion in ("linear", "rotary")
    )
    for name, text in line.files.items():
        if name.endswith(CODE):
            assert not ROTARY.search(text), name
            assert COMMENT.sub("", text) == COMMENT.sub("", round_.files[name]), name
        elif name.endswith(".csv"):
            assert text == round_.files[name]
    assert any(ROTARY.search(text) for text in round_.files.values())


def test_an_export_that_is_called_as_a_unit_keeps_its_name(tmp_path):
    """``from rad import Contact`` became ``from m import Contact``."""
    made = ss.export(model(tmp_path, "linear"), to="python", name="rad")
    assert "rad.py" in made.files
    assert "from rad import Contact" in made.files["README.md"]
    assert "Coulomb torque, N" in made.files["rad.py"]


def test_what_a_turn_stands_for_is_said(tmp_path):
    made = ss.export(model(tmp_path, "linear"), to="c99", compensator="ff")
    assert any("a turn in these files stands for 2π m" in note for note in made.notes)


@pytest.mark.parametrize("to", [t for t in TARGETS if t not in ("bam", "fmu", "fmu-axis")])
def test_no_text_of_a_linear_axis_has_a_rotary_unit(tmp_path, to):
    settings = {"torque_per_unit": 0.1} if to == "beckhoff" else {}
    made = ss.export(model(tmp_path, "linear"), to=to, settings=settings)
    for name, text in made.files.items():
        assert name.endswith(".csv") or not ROTARY.search(text), name
    assert not ROTARY.search(" ".join(made.notes))


@pytest.mark.parametrize(("motion", "joint"), [("linear", "slide"), ("rotary", "hinge")])
def test_a_joint_of_mujoco_moves_as_the_axis_does(tmp_path, motion, joint):
    made = ss.export(model(tmp_path, motion), to="mujoco", check=True)
    (element,) = ElementTree.fromstring(made.files[f"{motion}.xml"]).iter("joint")
    assert element.get("type") == joint
    assert (float(element.get("frictionloss")), float(element.get("damping"))) == (54.0, 64.0)
    assert float(element.get("armature")) == 30.0
    assert made.check.passed is not False


@pytest.mark.parametrize(("motion", "joint"), [("linear", "prismatic"), ("rotary", "continuous")])
def test_a_joint_of_urdf_moves_as_the_axis_does(tmp_path, motion, joint):
    made = ss.export(model(tmp_path, motion), to="urdf", check=True)
    (element,) = ElementTree.fromstring(made.files[f"{motion}.urdf"]).iter("joint")
    assert element.get("type") == joint
    # The specification requires limits of a prismatic joint.
    assert (element.find("limit") is not None) == (motion == "linear")
    assert element.find("dynamics").attrib == {"friction": "54.0", "damping": "64.0"}
    assert made.check.passed is not False


@pytest.mark.parametrize(("to", "compensator"), [("fmu", None), ("fmu", "ff"), ("fmu-axis", None)])
def test_a_unit_for_simulators_declares_newtons_and_metres(tmp_path, to, compensator):
    made = ss.export(model(tmp_path, "linear"), to=to, compensator=compensator, check=True)
    assert made.check.passed is not False
    assert not any("stand for" in note for note in made.notes)
    for name, content in made.files.items():
        if not name.endswith(".fmu"):
            continue
        archive = zipfile.ZipFile(io.BytesIO(content))
        root = ElementTree.fromstring(archive.read("modelDescription.xml"))
        units = {e.get("name"): dict(e.find("BaseUnit").attrib) for e in root.iter("Unit")}
        assert units["N"] == {"kg": "1", "m": "1", "s": "-2"}
        assert units["m/s"] == {"m": "1", "s": "-1"}
        declared = {e.get("unit") for e in root.iter() if e.get("unit")}
        assert not any("rad" in unit or "N.m" in unit for unit in declared)
        for source in (n for n in archive.namelist() if n.endswith((".c", ".h"))):
            assert not ROTARY.search(archive.read(source).decode()), source


def test_the_compensation_of_twincat_is_that_of_a_linear_axis(tmp_path):
    given = {"torque_per_unit": 0.1}
    line = ss.export(model(tmp_path, "linear"), to="beckhoff", settings=given)
    assert "table[i].in: um/s" in line.files["linear_frict_comp.lis"]
    asked = ss.export(model(tmp_path, "linear"), to="beckhoff", settings={**given, "motion": "rotary"})
    assert "0.001 deg/s" in asked.files["linear_frict_comp.lis"]


def test_a_target_of_rotary_actuators_says_what_its_units_stand_for(tmp_path):
    line, round_ = (ss.export(model(tmp_path, motion), to="bam") for motion in ("linear", "rotary"))
    assert line.notes[-1] == "the axis is linear: N·m, rad and kg·m² in these files stand for N, m and kg"
    assert not [note for note in round_.notes if "linear" in note]
