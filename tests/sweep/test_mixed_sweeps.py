"""Sweeps of studies with rigid axes and machines: what varies where, and what is said of a run that lacks a number."""

import csv
import json
from pathlib import Path

import numpy as np
import pytest

import stickslip as ss
from stickslip.sweeps import dataset, numbers
from stickslip.sweeps.checked_numbers import unvaried_lines
from stickslip.sweeps.plan import load
from stickslip.sweeps.rerun import rerun

STUDY = """
[axis]
inertia = 3.8623e-4

[friction.lug]
law = "lugre"
sigma0 = 3.5e4
sigma1 = 0.1
fs = 0.335
fc = 0.285
vs = 0.01

[machines.dry]
machine = "thesis-dry"

[references.slow]
kind = "sine"
amplitude = 0.05
frequency = 1.0
duration = 0.1
placement = {bandwidth_hz = 20.0, damping = 1.0}

[controllers.PD]
linear = "PD"
sample_time = 1e-3
"""
SWEEP = 'study = "study.toml"\nmethod = "grid"\ncheck = false\nmetrics = ["position_rms_rad"]\n'
FACTORS = '[vary."{}"]\nvalues = [0.8, 1.2]\nof = "factor"\n'


def swept(folder: Path, *tables: str) -> Path:
    (folder / "study.toml").write_text(STUDY)
    file = folder / "sweep.toml"
    file.write_text(SWEEP + "\n".join(tables))
    return file


@pytest.mark.parametrize("name", ["axis.inertia", "machine.inertia"])
def test_an_inertia_varies_on_whatever_axis_a_run_has(tmp_path: Path, name: str) -> None:
    sweep = load(swept(tmp_path, FACTORS.format(name)))
    assert unvaried_lines(sweep) == []
    for run, own in zip(sweep.runs, numbers.INERTIA, strict=True):
        values = sweep.values(run, sweep.drawn.block(0, 2))
        assert list(values) == [own]
        assert values[own] == pytest.approx([0.8 * run.axis.inertia, 1.2 * run.axis.inertia])
        assert numbers.varied(run, {name: 5e-4}).axis.inertia == pytest.approx(5e-4)
        assert numbers.value_of(run, name) == run.axis.inertia


def test_inertias_drawn_under_both_names_are_those_of_their_own_kind_of_axis(tmp_path: Path) -> None:
    table = '[vary."machine.inertia"]\nvalues = [4e-4, 5e-4, 6e-4]\n'
    sweep = load(swept(tmp_path, FACTORS.format("axis.inertia"), table))
    assert [sweep.varied(run) for run in sweep.runs] == [["axis.inertia"], ["machine.inertia"]]


def test_a_run_without_a_number_is_named_and_its_rows_do_not_list_it(tmp_path: Path) -> None:
    """A machine that stayed the same in every case looked perfectly robust."""
    file, out, told = swept(tmp_path, FACTORS.format("friction.sigma0")), tmp_path / "out", list[str]()
    found = ss.sweep(file, out, figures=True, tell=told.append)
    said = (
        "not varied, as the run has no such number: friction.sigma0 in signed/slow/dry/PD; nothing varies there, and "
        "all cases are the same"
    )
    assert said in told
    assert said in repr(found)
    assert [row["varied"] for row in found.rows] == ["friction.sigma0", ""]
    with (out / "summary.csv").open() as table:
        assert [row["not_varied"] for row in csv.DictReader(table)] == ["", "friction.sigma0"]
    runs = json.loads((out / "manifest.json").read_text())["runs"]
    assert [run["varied"] for run in runs] == [["friction.sigma0"], []]
    kept = [dataset.read(out, found.sweep, run, ["friction.sigma0"]) for run in found.sweep.runs]
    np.testing.assert_array_equal(kept[0]["friction.sigma0"], [0.8, 1.2])
    np.testing.assert_array_equal(kept[1]["friction.sigma0"], [np.nan, np.nan])
    assert not list((out / "figures").glob("tornado-*-dry-*"))
    assert rerun(out).differences == []


def test_columns_have_what_varied_in_the_run(tmp_path: Path) -> None:
    tables = FACTORS.format("friction.sigma0"), FACTORS.format("axis.inertia")
    found = ss.sweep(swept(tmp_path, *tables), tmp_path / "out", figures=False)
    rigid, machine = found.columns(0), found.columns(1)
    assert list(rigid) == ["friction.sigma0", "axis.inertia", "position_rms_rad", "flagged"]
    assert list(machine) == ["axis.inertia", "position_rms_rad", "flagged"]
    np.testing.assert_array_equal(rigid["axis.inertia"], [0.8, 1.2, 0.8, 1.2])
    assert np.unique(machine["position_rms_rad"]).size == 2


@pytest.mark.parametrize("name", ["machine.delay", "controller.torque_limit"])
def test_factors_that_change_nothing_are_refused(tmp_path: Path, name: str) -> None:
    said = rf"{name} is (0|inf) in run signed/slow/\w+/PD, which no factor changes; give values = .* or leave such runs"
    with pytest.raises(ss.InputError, match=said):
        load(swept(tmp_path, FACTORS.format(name)))
    values = f'[vary."{name}"]\nvalues = [0.0005, 0.001]\n'
    assert load(swept(tmp_path, values)).drawn.cases == 2
