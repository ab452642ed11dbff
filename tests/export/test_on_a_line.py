"""Exports of a linear axis say N, m and kg, and their code is that of any other axis."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

import stickslip as ss
from stickslip.export.on_a_line import WORDED

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
ROTARY = re.compile(r"N[·*]m|kg[·*]m|(?<![A-Za-z_])rad(?![A-Za-z_])")
COMMENT = re.compile(
    r"/\*.*?\*/|//[^\n]*|\(\*.*?\*\)|%[^\n]*|\"\"\".*?\"\"\"|#[^\n]*|\"[^\"\n]*\"", re.DOTALL
)
CODE = (".c", ".h", ".cpp", ".ino", ".st", ".m", ".py", ".comp")


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
    if compensator and to == "linuxcnc":
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
    assert not re.search(r"\b(from|import) m\b", " ".join(made.files.values()))
    assert made.notes[-1].startswith("the axis is linear")


def test_what_a_turn_stands_for_is_said(tmp_path):
    made = ss.export(model(tmp_path, "linear"), to="c99", compensator="ff")
    assert any("a turn in these files stands for 2π m" in note for note in made.notes)


def test_a_target_that_declares_units_says_what_they_stand_for(tmp_path):
    line, round_ = (ss.export(model(tmp_path, motion), to="modelica") for motion in ("linear", "rotary"))
    assert line.notes[-1] == "the axis is linear: N·m, rad and kg·m² in these files stand for N, m and kg"
    assert not [note for note in round_.notes if "linear" in note]
