"""`stickslip compare`: friction that changed is told from friction that did not."""

from __future__ import annotations

import json
import math
import re
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tomli_w

from stickslip.cli import main
from stickslip.identification.compare import text
from stickslip.identification.compare.change import compare_models
from stickslip.identification.compare.levels import Change
from stickslip.identification.identified_file import read_identified
from stickslip.report.identification import panel_of
from support.identified_files import STRIBECK, written


def compared(first: Path, second: Path, capsys: pytest.CaptureFixture[str], *options: str) -> dict[str, Any]:
    assert main(["compare", str(first), str(second), "--json", *options]) == 0
    return json.loads(capsys.readouterr().out)


def test_friction_that_changed_is_told_from_one_that_did_not(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    before, after = written(tmp_path / "a.toml"), written(tmp_path / "b.toml", fc=0.285 * 1.1)
    same = written(tmp_path / "c.toml", fc=0.285 * 1.01)
    result = compared(before, after, capsys, "--plot", str(tmp_path / "d.png"))
    assert result["changed"]
    assert [c["name"] for c in result["parameters"] if c["changed"]] == ["fc"]
    assert result["curve_difference_over_band"] > 1.0
    assert (tmp_path / "d.png").stat().st_size > 1000
    assert not compared(before, same, capsys)["changed"]


def test_where_a_parameter_is_open_the_curves_alone_decide(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """What is not identified trades places with what is: another steep slope k, and a vs that leans on it."""
    files = [written(tmp_path / "a.toml", 0.003), written(tmp_path / "b.toml", 0.003, vs=0.103, k=500.0)]
    assert compared(*files, capsys)["changed"]
    for file in files:
        content = tomllib.loads(file.read_text(encoding="utf-8"))
        content["estimates"][0] |= {"identified": False, "lower": 1.0, "upper": 1e4}
        file.write_text(tomli_w.dumps(content), encoding="utf-8")
    result = compared(*files, capsys)
    assert any("the curves alone decide" in note for note in result["notes"])
    assert result["changed"] == (result["curve_difference_over_band"] > 1.0)
    assert not any(c["changed"] for c in result["parameters"])
    assert all(0.0 <= c["p"] <= 1.0 for c in result["parameters"])
    assert main(["compare", str(files[0]), str(files[1])]) == 0
    assert "together" not in capsys.readouterr().out


def test_a_clear_change_has_its_percentage_and_a_bound_of_its_chance(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    before, after = written(tmp_path / "a.toml"), written(tmp_path / "b.toml", fc=0.285 * 1.16)
    assert main(["compare", str(before), str(after)]) == 0
    shown = capsys.readouterr().out
    assert re.search(r"^fc .* \+16 % .* < 1e-06 +changed$", shown, re.MULTILINE)
    assert re.search(r"together: p < 1e-06$", shown, re.MULTILINE)
    assert "(p at most 0.002)" in shown
    same = compared(before, before, capsys)
    assert same["curve_p"] == 1.0
    assert [c["percent"] for c in same["parameters"]] == pytest.approx([0.0] * len(same["parameters"]))


def test_each_band_has_the_colour_of_its_curve(tmp_path: Path) -> None:
    found = [read_identified(written(tmp_path / f"{n}.toml", fc=fc)) for n, fc in (("a", 0.28), ("b", 0.32))]
    curves = panel_of(compare_models(*found).picture).curves
    bands, lines = [c for c in curves if c.kind == "band"], [c for c in curves if c.kind == "line"]
    assert [c.style.colour for c in bands] == [c.style.colour for c in lines]
    assert len({c.style.colour for c in lines}) == 2


def test_false_alarms_are_as_rare_as_said(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Estimates drawn with exactly their standard deviation: the level of the test is 5 %."""
    rng = np.random.default_rng(5)
    files = [
        written(tmp_path / f"{i}.toml", 0.02, **{n: v * float(np.exp(0.02 * rng.standard_normal()))
                for n, v in STRIBECK.items()})
        for i in range(120)
    ]  # fmt: skip
    alarms = sum(compared(a, b, capsys)["changed"] for a, b in zip(files[::2], files[1::2], strict=True))
    assert alarms <= 8  # of 60; more than 8 at 5 % each has a chance below 0.4 %


def test_models_of_different_laws_are_compared_by_their_curves(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    first, second = written(tmp_path / "a.toml"), written(tmp_path / "b.toml", law="coulomb")
    result = compared(first, second, capsys)
    assert result["parameters"] == []
    assert result["changed"]  # Coulomb's law has no Stribeck effect
    assert main(["compare", str(first), str(second)]) == 0
    shown = capsys.readouterr().out
    assert "only the curves" in shown
    assert "p (Holm)" not in shown


def test_a_change_of_what_is_near_zero_is_told_in_its_unit() -> None:
    """An offset of 0.1 mN·m that came out as 3.5 "changed by +3400 %", its interval from -3 to +10 thousand."""
    offset = Change("offset", "N·m", 1e-4, 3.5e-3, -3e-3, 9.8e-3, 0.3)
    assert math.isnan(offset.percent)
    assert offset.words() == "offset +0.0034 N·m [-0.003, +0.0098]"
    assert Change("fc", "N·m", 0.3, 0.36, 0.05, 0.07, 0.0).words() == "fc +20 % [+17, +23]"


def test_columns_of_a_comparison_never_touch() -> None:
    long = Change("friction at -0.000315 rad/s", "N·m·(s/rad)^δ", -1.2346e-5, -1.2346e-15, -1e-4, 1e-4, 0.5)
    every = [long, Change("fc", "N·m", 0.3, 0.36, 0.05, 0.07, 0.0)]
    widths = text.widths_of(every)
    for change in every:
        cells = text.cells(change)
        line = text.row(cells, widths)
        assert [c for c in re.split(r"\s{1,}", line) if c] == " ".join(cells).split()
        assert len(line) == len(text.row(("parameter", *text.HEAD), widths))
