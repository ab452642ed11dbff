"""Texts of a law that end comments and strings stay texts in every export: compilers and parsers say so."""

from __future__ import annotations

import ast
import io
import json
import re
import shutil
import subprocess
import zipfile
from xml.etree import ElementTree

import pytest
import yaml

import stickslip as ss
from stickslip.exports import CONTROLLER_TARGETS, TARGETS, target_named
from stickslip.exports.maps import MAP_TARGETS, map_target, written
from stickslip.machines.position_map import PositionMap, Waves
from support import matiec
from support.hostile_texts import BREAKS, SAFE, law_file, own_lines, visible
from support.structured_text import Program

NEEDED = {"inertia": 1e-3, "torque_per_unit": 0.01}


@pytest.fixture(scope="module")
def hostile(tmp_path_factory):
    """The law with parameters of its own."""
    return ss.Model(str(law_file(tmp_path_factory.mktemp("law"))), fc=0.3, sigma2=0.01)


def files_in(export):
    """Every file of an export that is text, those inside of archives too."""
    for name, content in export.files.items():
        if isinstance(content, bytes):
            archive = zipfile.ZipFile(io.BytesIO(content))
            texts = (n for n in archive.namelist() if n.endswith((".xml", ".c", ".h")))
            yield from ((f"{name}/{n}", archive.read(n).decode("utf-8")) for n in texts)
        else:
            yield name, content


def insist_on_syntax(name, text):
    """A parser of the file's format takes it, as it takes that of any law."""
    if name.endswith(".py"):
        ast.parse(text)
    elif name.endswith((".xml", ".urdf")):
        ElementTree.fromstring(text)
    elif name.endswith(".yaml"):
        assert len(yaml.safe_load(text)) == 1
    elif name.endswith(".json"):
        json.loads(text)
    elif name.endswith(".st"):
        Program(text)
    elif name.endswith(".mo"):
        pymoca = pytest.importorskip("pymoca.parser")
        assert pymoca.parse(text) is not None
    elif name.endswith((".lis", ".properties")):
        assert all(re.match(r"#|[\w.\[\]]+(=|\s+[-\d])", line) for line in text.splitlines())


@pytest.mark.parametrize("to", TARGETS)
def test_texts_of_a_law_stay_texts(to, hostile):
    target = target_named(to)
    settings = {s.name: NEEDED[s.name] for s in target.settings if s.default is None}
    if target.forms:
        with pytest.raises(ss.InputError) as refusal:
            ss.export(hostile, to=to, name="axis", settings=settings)
        assert str(refusal.value).isprintable()
    made = ss.export(hostile, to=to, name="axis", nearest=bool(target.forms), settings=settings, check=True)
    assert made.check is None or made.check.passed is not False, made.check
    for name, text in files_in(made):
        assert visible(text), name
        assert own_lines(text) or name.endswith((".h", ".st", ".mo")), (
            name
        )  # there an equation has several lines
        insist_on_syntax(name, text)
    assert all(note.isprintable() for note in made.notes)
    assert SAFE in "".join(text for _, text in files_in(made)) or to in ("mujoco", "table")


@pytest.mark.parametrize("to", CONTROLLER_TARGETS)
def test_texts_of_a_controllers_law_stay_texts(to, hostile):
    made = ss.export(hostile, to=to, name="axis", compensator="ff", check=True)
    assert made.check is None or made.check.passed is not False, made.check
    for name, text in files_in(made):
        assert visible(text), name
        assert own_lines(text), name
        insist_on_syntax(name, text)


@pytest.mark.skipif(bool(matiec.missing()), reason=f"needs {', '.join(matiec.missing())}")
def test_a_compiler_takes_the_structured_text(hostile, tmp_path):
    (tmp_path / "axis.st").write_text(ss.export(hostile, to="st", name="axis").files["axis.st"])
    assert matiec.translated(tmp_path / "axis.st", tmp_path) == ""


@pytest.mark.parametrize("to", MAP_TARGETS)
def test_the_unit_of_a_map_stays_a_text(to, tmp_path):
    own = PositionMap(Waves((3.0,), (0.1,), (0.2,)), unit=map_target(to).unit or "A" + BREAKS)
    for name, text in files_in(written(own, map_target(to), "cogging")):
        assert visible(text), name
        assert own_lines(text), name
        insist_on_syntax(name, text)
        if name.endswith(".TcPOU"):
            code = "".join(ElementTree.fromstring(text).itertext())
            assert code.count("*)") == code.count("(*")
        if name.endswith(".h") and shutil.which("gcc"):
            (tmp_path / name).write_text(text)
            command = ["gcc", "-std=c99", "-Wall", "-Wextra", "-Wno-unused", "-Werror", "-fsyntax-only", name]
            done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
            assert done.returncode == 0, done.stderr


def test_tables_of_a_readme_keep_their_cells(hostile):
    for to in ("c99", "fmu"):
        readme = ss.export(hostile, to=to, name="axis").files["README.md"]
        tables = re.findall(r"(?:^\|.*\n)+", readme, re.MULTILINE)
        assert tables
        for table in tables:
            cells = {len(re.findall(r"(?<!\\)\|", line)) for line in table.splitlines()}
            assert len(cells) == 1
        assert "<script" not in readme
