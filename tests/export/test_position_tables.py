"""Tables of a map for firmware: what they hold is the map, within what they say they leave."""

from __future__ import annotations

import re
import shutil
import subprocess
import tomllib
from dataclasses import replace
from xml.etree import ElementTree

import numpy as np
import pytest
import tomli_w

import stickslip as ss
from stickslip.cli import main
from stickslip.core.errors import InputError, UnknownName
from stickslip.exports.maps import MAP_TARGETS, map_target, written
from stickslip.exports.position_tables import c_table, moteus, odrive, vesc
from stickslip.machines.position_map import PositionMap, Waves
from support.hal_component import Component
from support.lisp import Lisp
from support.structured_text import Program

TURN = 2.0 * np.pi
MAP = PositionMap(
    Waves((12.0, 72.0), (0.02, 0.1), (-0.01, 0.05)), unit="A", lower=0.0, upper=TURN, residual=0.008
)


def said(export):
    """RMS that a table leaves of its map, as its note says it."""
    return float(re.search(r"map by ([\d.e-]+)", export.notes[0])[1])


@pytest.mark.skipif(shutil.which("gcc") is None, reason="no gcc")
def test_the_c_table_is_read_by_its_own_function(tmp_path):
    export = c_table(MAP, points=1024)
    (tmp_path / "cogging.h").write_text(export.files["cogging.h"], encoding="ascii")
    angles = np.linspace(-9.0, 40.0, 997)
    listed = ", ".join(f"{x:.9e}f" for x in angles)
    (tmp_path / "main.c").write_text(
        '#include <stdio.h>\n#include "cogging.h"\nstatic const float at[] = {' + listed + "};\n"
        'int main(void) { for (int i = 0; i < 997; i++) printf("%.9g\\n", (double)cogging_at(at[i])); return 0; }\n',
        encoding="ascii",
    )
    subprocess.run(
        ["gcc", "-std=c99", "-Wall", "-Wextra", "-Werror", "main.c", "-o", "main", "-lm"],
        cwd=tmp_path,
        check=True,
    )
    out = subprocess.run([tmp_path / "main"], capture_output=True, check=True, text=True).stdout.split()
    bow = 0.112 * (72.0 * TURN / 1024.0) ** 2 / 8.0  # of a wave of order 72 between two points
    assert np.array(out, dtype=float) == pytest.approx(MAP.beside(angles), abs=1.1 * bow)
    rms = np.sqrt(np.mean((np.array(out, dtype=float) - MAP.beside(angles)) ** 2))
    assert rms == pytest.approx(said(export), rel=0.1)
    assert "0.008" in export.notes[0]


def test_moteus_commands_hold_the_map():
    export = moteus(MAP)
    lines = export.files["moteus_cogging.cfg"].splitlines()
    scale = float(lines[0].split()[-1])
    values = [int(x.split()[-1]) for x in lines[1:-1]]
    assert [x.split()[2] for x in lines[1:-1]] == [f"motor.cogging_dq_comp.{i}" for i in range(1024)]
    assert lines[-1] == "conf write"
    assert max(map(abs, values)) == 127
    assert scale * np.array(values) == pytest.approx(MAP.sampled(1024), abs=0.51 * scale)
    at = np.random.default_rng(1).uniform(0.0, TURN, 5000)
    read = np.interp(at, TURN * np.arange(1025) / 1024, scale * np.array([*values, values[0]]))
    assert np.sqrt(np.mean((read - MAP.beside(at)) ** 2)) == pytest.approx(said(export), rel=0.1)


def test_odrive_holds_its_values_between_the_points():
    torque = MAP.scaled(0.03, "N·m")
    export = odrive(torque)
    values = np.array(re.findall(r"(-?[\d.e-]+)f,", export.files["odrive_cogging_map.h"]), dtype=float)
    assert values.size == 3600
    at = np.random.default_rng(1).uniform(0.0, TURN, 5000)
    rms = np.sqrt(np.mean((values[np.floor(at / TURN * 3600).astype(int)] - torque.beside(at)) ** 2))
    assert rms == pytest.approx(said(export), rel=0.1)


def test_what_is_refused():
    with pytest.raises(InputError, match="moteus adds a current"):
        moteus(MAP.scaled(0.03, "N·m"))
    with pytest.raises(InputError, match="ODrive adds a torque"):
        odrive(MAP)
    with pytest.raises(InputError, match="none in C"):
        c_table(MAP, "my map")
    with pytest.raises(InputError, match="the VESC adds a current"):
        vesc(MAP.scaled(0.03, "N·m"))
    with pytest.raises(InputError, match=r"is a table; take to=.c99."):
        written(replace(MAP, table=(0.0, 0.1)), map_target("st"), "cogging")
    with pytest.raises(InputError, match="is no name in most languages"):
        written(MAP, map_target("st"), "2nd")


# ---- what every target of a map keeps to ----------------------------------------------------------------------------


def numbers(pattern, text):
    return np.array(re.findall(pattern, text), dtype=float)


def read_moteus(files, angles, folder):
    lines = files["cogging.cfg"].splitlines()
    values = float(lines[0].split()[-1]) * np.array([int(x.split()[-1]) for x in lines[1:-1]])
    return np.interp(angles, TURN * np.arange(1025) / 1024, [*values, values[0]])


def read_odrive(files, angles, folder):
    values = numbers(r"(-?[\d.e-]+)f,", files["cogging.h"])
    return values[np.floor(angles / TURN * 3600).astype(int)]


def read_c(files, angles, folder):
    text = files["cogging.h"]
    scale = float(re.search(r"scale = ([\d.e-]+)f;", text)[1])
    body = text[text.index("_table[") : text.index("};")]
    values = scale * numbers(r"(-?\d+),", body)
    return np.interp(angles, TURN * np.arange(values.size + 1) / values.size, [*values, values[0]])


def read_vesc(files, angles, folder):
    program = Lisp(files["cogging.lisp"])
    return np.array([program("cogging-at", degrees) for degrees in np.degrees(angles).tolist()])


def read_st(text, angles):
    program = Program(text)
    out = []
    for angle in angles.tolist():
        inner = {**program.instance("cogging"), "cogging": 0.0, "angle": angle}
        program.run("cogging", inner)
        out.append(inner["cogging"])
    return np.array(out)


def read_beckhoff(files, angles, folder):
    """The POU's two parts are the function that structured text has in one."""
    root = ElementTree.fromstring(files["cogging.TcPOU"])
    assert root.tag == "TcPlcObject"
    assert root.find("POU").get("Name") == "cogging"
    parts = [root.find("POU/Declaration").text, root.find("POU/Implementation/ST").text]
    return read_st("\n".join([*parts, "END_FUNCTION\n"]), angles)


def read_linuxcnc(files, angles, folder):
    for name, text in files.items():
        (folder / name).write_text(text)
    made = Component(files["cogging.comp"], folder)
    out = []
    for angle in angles.tolist():
        made.place("position").value = angle
        made.run(1_000_000)
        out.append(made.place("output").value)
    made.place("enable").value = 0
    made.run(1_000_000)
    assert made.place("output").value == 0.0
    return np.array(out)


READERS = {
    "c99": read_c, "moteus": read_moteus, "odrive": read_odrive, "vesc": read_vesc, "beckhoff": read_beckhoff,
    "st": lambda files, angles, folder: read_st(files["cogging.st"], angles), "linuxcnc": read_linuxcnc,
}  # fmt: skip


@pytest.mark.parametrize("name", MAP_TARGETS)
def test_what_is_written_gives_the_map_within_what_it_says(name, tmp_path):
    if name == "linuxcnc" and shutil.which("gcc") is None:
        pytest.skip("no gcc")
    target = map_target(name)
    export = written(MAP, target, "cogging", {"torque_constant": 0.05})
    angles = np.random.default_rng(1).uniform(0.0, TURN, 3000)
    true = (MAP.scaled(0.05, "N·m") if target.unit == "N·m" else MAP).beside(angles)
    error = np.sqrt(np.mean((READERS[name](export.files, angles, tmp_path) - true) ** 2))
    if "harmonics are those of the map" in export.notes[0]:
        assert error < 1e-12
    else:
        assert error == pytest.approx(said(export), rel=0.1)
    assert "remain" in export.notes[0]


@pytest.mark.parametrize("name", MAP_TARGETS)
def test_every_target_refuses_what_is_no_map(name):
    target = map_target(name)
    unit = target.unit or "A"
    with pytest.raises(InputError, match="no order"):
        written(PositionMap(unit=unit), target, "cogging")
    with pytest.raises(InputError, match="whole turn"):
        written(PositionMap(MAP.even, unit=unit, lower=0.0, upper=3.0), target, "cogging")
    if target.unit:
        other = replace(MAP, unit="A" if unit == "N·m" else "N·m")
        with pytest.raises(InputError, match=r"give settings=..torque_constant.: VALUE"):
            written(other, target, "cogging")
        with pytest.raises(InputError, match="greater than 0"):
            written(other, target, "cogging", {"torque_constant": "nothing"})
    with pytest.raises(UnknownName, match="setting"):
        written(MAP, target, "cogging", {"poles": 7.0})


# ---- from a log to a table -----------------------------------------------------------------------------------------


@pytest.fixture
def log(tmp_path):
    """A standstill map in A, as a drive's log."""
    turn = np.linspace(0.0, TURN, 1000)
    way = np.concatenate([turn, turn[::-1]])
    side = np.repeat([1.0, -1.0], 1000)
    rng = np.random.default_rng(3)
    current = MAP.beside(way) + 0.05 * side + 0.002 * rng.standard_normal(way.size)
    rows = np.repeat(np.column_stack([way, current]), 5, axis=0)
    table = np.column_stack([0.002 * np.arange(len(rows)), rows, rows[:, 0]])
    path = tmp_path / "map.csv"
    head = "time_s,position_rad,current_A,position_reference_rad"
    np.savetxt(path, table, delimiter=",", header=head, comments="")
    return path


def test_the_command_line_goes_from_a_log_to_every_table(log, tmp_path, capsys):
    model = tmp_path / "out" / "model.toml"
    assert main(["identify", str(log), "--method", "cogging", "--no-report", "--out", str(model.parent)]) == 0
    assert tomllib.loads(model.read_text())["position_map"]["unit"] == "A"
    for name in MAP_TARGETS:
        more = ["--set", "torque_constant=0.05"] if name == "odrive" else []
        folder = tmp_path / name
        assert main(["export", str(model), "--to", name, "--out", str(folder), *more]) == 0
        assert "RMS remain" in capsys.readouterr().out
        assert list(folder.iterdir())
    assert main(["export", "--list"]) == 0
    listed = capsys.readouterr().out
    assert all(t.title in listed for t in MAP_TARGETS.values())


def test_the_command_line_says_what_is_missing(log, tmp_path, capsys):
    model = tmp_path / "out" / "model.toml"
    main(["identify", str(log), "--method", "cogging", "--no-report", "--out", str(model.parent)])
    capsys.readouterr()
    for command, word in (
        (["export", str(model), "--to", "odrive"], "torque_constant"),
        (["export", str(model), "--to", "urdf"], "target for a torque over the angle"),
        (["export", str(model), "--to", "st", "--nearest"], "leave it out"),
        (["recommend", str(model)], "torque over the angle"),
    ):
        assert main(command) == 2
        error = capsys.readouterr().err
        assert word in error
        assert "Traceback" not in error
    law = tmp_path / "law.toml"
    law.write_text('law = "coulomb"\n[parameters]\nfc = 0.1\n')
    assert main(["export", str(law), "--to", "moteus"]) == 2
    assert "--method cogging" in capsys.readouterr().err


def test_a_law_with_a_map_exports_either(tmp_path):
    files = ss.export(MAP, "st").files
    assert "FUNCTION cogging" in files["cogging.st"]
    path = tmp_path / "both.toml"
    path.write_text(tomli_w.dumps({
        "law": "coulomb", "parameters": {"fc": 0.05}, "position_map": MAP.as_dict()
    }))  # fmt: skip
    assert "FUNCTION cogging" in ss.export(path, "st", position_map=True).files["cogging.st"]
    assert "both_step" in ss.export(path, "st").files["both.st"]
