"""Parts of a record: times, rows, rows left out; positions counted on."""

from __future__ import annotations

import json
import math
import tomllib
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from stickslip import Record
from stickslip.cli import main
from stickslip.core.errors import InputError
from stickslip.identification.doctor import examine
from stickslip.readers.cut import Cut, cut, file_rows, parse_rows, pieces, unwrapped

SEED = 3
INERTIA, FC = 1e-3, 0.3


def log(rows: int = 6000) -> dict[str, np.ndarray]:
    """An axis that turns to and fro, with Coulomb friction."""
    t = np.arange(rows) * 1e-3
    v = 9.0 * np.sin(2.0 * np.pi * 1.5 * t) + 4.0 * np.sin(2.0 * np.pi * 0.4 * t)
    noise = np.random.default_rng(SEED).normal(0.0, 2e-3, rows)
    torque = INERTIA * np.gradient(v, t) + FC * np.sign(v) + 0.005 * v + noise
    return {"t": t, "q": np.cumsum(v) * 1e-3, "tau": torque}


def written(path: Path, table: dict[str, np.ndarray]) -> Path:
    head = "time [s],position [rad],motor_torque [N·m]"
    np.savetxt(path, np.stack(list(table.values()), axis=1), "%.9f", ",", header=head, comments="")
    return path


def record(rows: int = 1000) -> Record:
    t = np.arange(rows) * 1e-3
    return Record(t, {"position": t**2}, {"position": "rad"})


def test_the_rows_kept_are_those_of_the_file():
    part = cut(record(), Cut(start=0.1, end=0.8, leave_out=((301, 310),)))
    assert part.time[[0, -1]] == pytest.approx([0.1, 0.8])
    assert file_rows(part)[[0, 199, 200, -1]].tolist() == [101, 300, 311, 801]
    again = cut(part, Cut(rows=(51, 100)))
    assert file_rows(again)[[0, -1]].tolist() == [151, 200]


def test_a_hole_cuts_the_record_and_a_spike_does_not():
    several, said = pieces(cut(record(), Cut(leave_out=((300, 303), (600, 604)))))
    assert [file_rows(p)[[0, -1]].tolist() for p in several] == [[1, 599], [605, 1000]]
    assert not said
    several, said = pieces(cut(record(), Cut(leave_out=((40, 80),))))
    assert (len(several), [f.code for f in said]) == (1, ["short-piece"])


@pytest.mark.parametrize("text", ["", ":", "5:2", "0:7", "a:b", "1:2:3", "1.5:9", "-3:9"])
def test_rows_that_are_none(text):
    with pytest.raises(InputError, match=r"rows.*must be rows A:B"):
        parse_rows("rows", text)


@pytest.mark.parametrize(
    ("asked", "said"),
    [
        (Cut(rows=(2000, math.inf)), "rows begins at row 2000, but the record has 1000 rows"),
        (Cut(leave_out=((1500, 1600),)), "leave_out begins at row 1500"),
        (Cut(start=5.0), "0 of 1000 rows are left.*t = 0 to 0.999 s"),
        (Cut(leave_out=((1, 990),)), "10 of 1000 rows are left"),
    ],
)
def test_nothing_left_is_said(asked, said):
    with pytest.raises(InputError, match=said):
        cut(record(), asked)


@pytest.mark.parametrize("span", [2.0 * math.pi, 3.7])
def test_a_position_within_one_turn_is_counted_on(span):
    true = 4.0 * log()["q"]
    t = np.arange(true.size) * 1e-3
    columns = {"position": np.mod(true, span), "position_reference": np.mod(true + 1e-3, span)}
    wrapped = Record(t, columns, {"position": "rad", "position_reference": "rad"})
    mended = unwrapped(wrapped)
    assert np.ptp(mended["position"] - true) < 1e-3 * span
    assert np.ptp(mended["position_reference"] - true) < 1e-3 * span
    assert "counted on" in mended.meta["derived"]["position"]


def fast() -> np.ndarray:
    """Position of an axis that turns by up to 22 degrees from row to row, in the counts of an encoder."""
    v = 93.0 * np.sin(np.linspace(0.0, 20.0, 1800)) * np.linspace(0.01, 1.0, 1800)
    return 2.0 + np.round(np.cumsum(v) * 4e-3 * 2**18 / (2.0 * np.pi)) / 2**18 * 2.0 * np.pi


@pytest.mark.parametrize("turn", [2.0 * math.pi, 2.9])
def test_wraps_of_a_fast_axis_are_found(turn):
    true = fast()
    t = np.arange(true.size) * 4e-3
    columns = {"position": np.mod(true, turn), "motor_torque": np.sign(np.gradient(true))}
    wrapped = Record(t, columns, {"position": "rad", "motor_torque": "N·m"})
    (said,) = [f for f in examine(wrapped).errors if f.code == "position-wrap"]
    turns = np.count_nonzero(np.diff(np.floor(true / turn)))
    assert f"jumps {turns} times by {turn:.4g} rad" in said.message
    assert "unwrap=True" in said.remedy
    assert np.ptp(unwrapped(wrapped)["position"] - true) < 1e-3 * turn


@pytest.mark.parametrize("kind", ["steps", "one count"])
def test_what_an_axis_moves_is_no_jump(kind):
    rise = 1.0 - np.exp(-np.arange(80) / 2.0) * np.cos(np.arange(80) / 3.0)
    height = 0.01 * np.random.default_rng(SEED).integers(-4, 5, 50)
    position = np.concatenate([a + (b - a) * rise for a, b in pairwise(height)])
    if kind == "one count":
        position = np.where(np.arange(position.size) == 1000, 7.7e-4, 0.0)
    t = np.arange(position.size) * 4e-3
    seen = Record(
        t, {"position": position, "motor_torque": np.sin(t)}, {"position": "rad", "motor_torque": "N·m"}
    )
    found = {f.code for f in examine(seen).findings}
    assert not found & {"position-jump", "position-wrap"}
    assert ("never-moved" in found) == (kind == "one count")


def test_a_position_that_does_not_jump_is_not_counted_on():
    with pytest.raises(InputError, match="nowhere jumps"):
        unwrapped(record())


def test_findings_name_rows_of_the_file():
    part = cut(record(), Cut(rows=(501, 1000)))
    part["position"][10] = math.nan
    found = {f.code: f for f in examine(part).findings}
    assert found["nan"].where.startswith("row 511,")
    assert "rows 511" in found["trimmed"].message


def test_identify_takes_the_part_that_is_asked_for(tmp_path, capsys):
    """Twice the friction from 3 s on: each part gives its own, and what is left out does not count."""
    table = log()
    table["tau"] = table["tau"] + np.where(table["t"] > 3.0, FC * np.sign(np.gradient(table["q"])), 0.0)
    table["tau"][1000:1100] = 40.0
    path = written(tmp_path / "log.csv", table)
    common = ["identify", str(path), "--inverse", "--no-report", "--json"]
    first = ["--to", "2.99", "--leave-out", "1001:1100"]
    for options, level in ((first, FC), (["--rows", "3002:"], 2.0 * FC)):
        out = tmp_path / "model.toml"
        assert main([*common, *options, "--out", str(out)]) == 0
        found = {e["name"]: e["value"] for e in json.loads(capsys.readouterr().out)["estimates"]}
        assert found["fc"] == pytest.approx(level, rel=0.03)
        kept = [d["rows_of_file"] for d in tomllib.loads(out.read_text(encoding="utf-8"))["data"]]
        assert kept == (["1:1000", "1101:2991"] if options is first else ["3002:6000"])


def test_the_doctors_remedy_for_a_wrapped_position_works(tmp_path, capsys):
    table = log()
    table["q"] = np.mod(table["q"] + 4.0, 2.0 * np.pi)
    path = str(written(tmp_path / "log.csv", table))
    assert main(["doctor", path]) == 2
    assert "say --unwrap" in capsys.readouterr().out
    assert main(["doctor", path, "--unwrap"]) == 0
    assert "counted on where it jumps by 6.28319 rad" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--from", "4", "--to", "2"], "--from 4 s must lie before --to 2 s"),
        (["--rows", "x"], "--rows 'x' must be rows A:B"),
        (["--unwrap"], "nowhere jumps"),
        (["--from", "99"], "0 of 6000 rows are left"),
    ],
)
def test_parts_that_are_none_are_one_line(tmp_path, capsys, options, said):
    path = str(written(tmp_path / "log.csv", log()))
    for verb in ("doctor", "identify"):
        assert main([verb, path, *options]) == 2
        err = capsys.readouterr().err
        assert said in err
        assert "Traceback" not in err
