"""The report of a user's own study: figures, tables, failed runs, and nothing but its own file."""

from __future__ import annotations

import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from stickslip import report
from stickslip.report._tables import metrics_tables
from stickslip.report._view import StudyView
from stickslip.report.plots import envelope, scaled, style_of
from stickslip.study.result import StudyResult
from stickslip.study.study import load, run

STUDY = """
title = "Gantry <axis> & friends"
[axis]
inertia = 1e-3
[friction.dry]
law = "coulomb"
fc = 0.3
[references.slow]
kind = "sine"
amplitude = 0.1
frequency = 1.0
duration = 1.0
placement = {bandwidth_hz = 10.0, damping = 1.0}
[laws.guess]
law = "coulomb"
fc = 0.25
[controllers.bare]
linear = "PD"
[controllers.helped]
linear = "PD"
compensator = "feedforward"
law = "guess"
"""


@pytest.fixture(scope="module")
def result(tmp_path_factory: pytest.TempPathFactory) -> StudyResult:
    folder = tmp_path_factory.mktemp("gantry")
    (folder / "gantry.toml").write_text(STUDY)
    return run(load(folder / "gantry.toml"), folder / "out")


def test_report_of_a_users_study(result: StudyResult) -> None:
    path = report.write(result)
    page = path.read_text(encoding="utf-8")
    assert path == result.folder / "report.html"
    assert "<title>Gantry &lt;axis&gt; &amp; friends</title>" in page
    assert "The thesis" not in page.split("<h2>Notes")[0]
    for name in ("both/figure-reference-slow", "signed/figure-slow-dry-feedforward"):
        assert (result.folder / "figures" / f"{name}.svg").stat().st_size < 300_000
        assert (result.folder / "figures" / f"{name}.png").read_bytes().startswith(b"\x89PNG")
    assert page.count("<figure ") == 2
    assert "No run failed" in page


def test_nothing_is_loaded_from_elsewhere(result: StudyResult) -> None:
    page = report.write(result).read_text(encoding="utf-8")
    assert not re.search(r'(?:src|href)="(?!data:|#)', page)
    assert "<script" not in page
    assert "@import" not in page
    assert "url(" not in page


def test_a_failed_run_is_listed_and_the_rest_is_shown(result: StudyResult) -> None:
    broken = replace(result.runs[1], failure="the run ended at 0.5 s: <no> step", metrics={})
    page = report.write(replace(result, runs=[result.runs[0], broken])).read_text(encoding="utf-8")
    assert "failed: the run ended at 0.5 s: &lt;no&gt; step" in page
    assert 'id="failed"' in page
    assert "1 of 2 runs failed" in page


def test_a_missing_record_leaves_its_line_out(result: StudyResult) -> None:
    gone = replace(result.runs[1], failure="it vanished", metrics={}, path=result.folder / "no.npz")
    assert report.write(replace(result, runs=[result.runs[0], gone])).exists()


def test_the_best_of_a_column_is_marked(result: StudyResult) -> None:
    (table,) = metrics_tables(StudyView(result))
    column = [c.metric for c in table.columns].index("position_rms_rad")
    errors = [r.metrics["position_rms_rad"] for r in result.runs]
    marked = ["best" in row.cells[column].classes for row in table.rows]
    assert marked == [e == min(errors) for e in errors]


def test_figures_are_the_same_bytes_again(result: StudyResult) -> None:
    path = result.folder / "figures" / "signed" / "figure-slow-dry-feedforward.svg"
    report.write(result)
    first = path.read_bytes()
    report.write(result)
    assert path.read_bytes() == first


def test_envelope_keeps_every_extreme() -> None:
    x = np.linspace(0.0, 1.0, 20_001)
    y = np.sin(400.0 * x) + 3.0 * (np.abs(x - 0.3) < 1e-4)
    xs, ys = envelope(x, y, 100)
    assert xs.size <= 202
    assert (xs[0], xs[-1]) == (0.0, 1.0)
    assert np.all(np.diff(xs) > 0.0)
    assert (ys.min(), ys.max()) == (y.min(), y.max())


def test_units_are_those_that_read_well() -> None:
    assert [scaled(v, "rad") for v in (2.0, 0.02, 2e-6)] == [(1.0, "rad"), (1e3, "mrad"), (1e6, "µrad")]


def test_a_law_keeps_its_colour_and_strangers_differ() -> None:
    assert style_of("FF-gms") == style_of("FB-gms") == style_of("gms")
    names = ["a", "b", "PD", "c"]
    assert len({style_of(n, names) for n in names}) == 4


def test_importing_the_report_loads_no_matplotlib() -> None:
    code = "import sys, stickslip.report; print([m for m in ('matplotlib', 'jinja2', 'pandas') if m in sys.modules])"
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True).stdout.strip() == "[]"


def test_an_unwritable_folder_is_one_line(result: StudyResult, tmp_path: Path) -> None:
    from stickslip.errors import InputError

    (tmp_path / "figures").write_text("in the way")
    with pytest.raises(InputError, match="choose another place with --out"):
        report.write(replace(result, folder=tmp_path))
