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
from stickslip.core.code_approval import allow_code
from stickslip.report._tables import MetricsTable, metrics_tables
from stickslip.report._view import StudyView
from stickslip.report.bench_report import shown
from stickslip.report.captions import case_caption, case_message
from stickslip.report.conclusions import helped, rig_conclusion
from stickslip.report.figures import off_scale, result_cases
from stickslip.report.plots import envelope, one_prefix, scaled
from stickslip.report.styles import LINEAR as LINEAR_STYLES
from stickslip.report.styles import REFERENCE, style_of, styles_of
from stickslip.studies.result import Run, StudyResult
from stickslip.studies.study import load, run

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
    assert "<th>least error, signed rule</th>" in page
    assert "fewer than five even periods in the last 40 % of the run, or none" in page


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


def runs(metric: str, **values: float) -> list[Run]:
    """Runs of controllers with one metric each."""
    return [Run("signed", "r", "f", name, {metric: v}, Path("no.npz")) for name, v in values.items()]


LINEAR = ("PD", "PID")


def test_the_message_names_the_best_of_all_and_the_best_compensator() -> None:
    errors = {"PD": 9.95e-3, "PID": 0.338e-3, "helped": 0.866e-3, "worse": 2e-3}
    assert case_message(runs("position_rms_rad", **errors), False, LINEAR) == (
        "Least RMS error: PID\u00a00.338 mrad; best compensator helped\u00a00.866; PD\u00a09.95"
    )
    assert case_message(runs("position_rms_rad", **{**errors, "helped": 1e-4}), False, LINEAR) == (
        "Least RMS error: helped\u00a00.1 mrad; PD\u00a09.95, PID\u00a00.338"
    )
    assert case_message(runs("position_rms_rad", PD=2e-3, PID=1e-3), False, LINEAR) == (
        "Least RMS error: PID\u00a01 mrad; PD\u00a02"
    )
    assert (
        case_message(runs("position_rms_rad", helped=1e-3), False, LINEAR)
        == "Least RMS error: helped\u00a01 mrad"
    )
    failed = [replace(r, failure="it broke") for r in runs("position_rms_rad", PD=1e-3)]
    assert case_message(failed, False, LINEAR) == "no run was finished"


def at_rest(**values: tuple[float, float, float, float]) -> list[Run]:
    """Runs by RMS error of the second half, mean error, reversals and settling."""
    names = (
        "second_half_position_rms_rad",
        "steady_state_error_rad",
        "second_half_reversals_per_s",
        "settling_s",
    )
    return [
        Run("signed", "slow", "dry", n, {**dict(zip(names, v)), "position_rms_rad": 1e-3}, Path("no.npz"))
        for n, v in values.items()
    ]


def test_at_rest_a_limit_cycle_around_the_target_is_not_the_best(result: StudyResult) -> None:
    found = at_rest(bare=(4e-4, 4e-4, 0.0, 0.5), helped=(4e-3, 1e-9, 50.0, 0.1))
    assert case_message(found, True, ["bare"]) == (
        "Least RMS error in the second half: bare\u00a00.4 mrad; best compensator helped\u00a04"
    )
    assert case_caption(found, True).startswith(
        "By RMS error in the second half in mrad, best first: bare 0.4, helped 4."
    )
    step = {"references": {"slow": {"kind": "step"}}}
    (table,) = metrics_tables(StudyView(replace(result, runs=found, config={**result.config, **step})))
    assert marked(table, "second_half_position_rms_rad") == [True, False]
    assert marked(table, "steady_state_error_rad") == [False, False]
    assert marked(table, "settling_s") == [True, False]


def marked(table: MetricsTable, metric: str) -> list[bool]:
    """Which rows are marked best in a metric's column."""
    column = [c.metric for c in table.columns].index(metric)
    return ["best" in row.cells[column].classes for row in table.rows]


def test_the_note_says_over_what_an_error_is_off_the_scale() -> None:
    sizes = {"a": 1e-3, "b": 7.63e-3}
    assert off_scale(sizes, 2e-3, (1e3, "mrad"), False) == "off scale: b 7.63 mrad"
    assert off_scale(sizes, 2e-3, (1.0, "rad"), True) == "off scale in the second half: b 0.00763 rad"
    assert off_scale(sizes, 1.0, (1e3, "mrad"), True) == ""


def test_one_figure_has_one_prefix() -> None:
    assert one_prefix(1.0, 4e-3) == (1e3, "m")  # 1000 mrad beside 4 mrad
    assert one_prefix(0.02, 5e-5) == (1e3, "m")
    assert one_prefix(2.0, 0.2) == (1.0, "")
    assert one_prefix(100.0, 1e-3) == (1.0, "")
    assert one_prefix(2e-5, 1e-6) == (1e6, "µ")
    assert one_prefix(0.0, float("nan")) == (1.0, "")


@pytest.mark.parametrize("name", ["PD", "PID", "FF-lugre", "FB-coulomb", "mine"])
def test_a_controllers_line_is_whole_and_unlike_the_reference(name: str) -> None:
    style = style_of(name, ["PD", "PID"])
    assert style.dashes == "-"  # dashes of a line that oscillates are noise
    assert style.colour != REFERENCE.colour


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


def test_a_law_keeps_its_colour_and_others_differ() -> None:
    forward, back = style_of("FF-gms"), style_of("FB-gms")
    assert style_of("gms") == forward == replace(back, hollow=False)
    assert back.hollow
    names = ["PD", "PID", "FF-gms", "FB-gms", "MINE-gms", *(f"own-{i}" for i in range(40))]
    styles = styles_of(names)
    assert list(styles) == names
    assert len(set(styles.values())) == len(names)
    # Those that one figure holds beside the linear controllers differ in colour from each other and from these.
    five = {styles[f"own-{i}"].colour for i in range(5)}
    assert len(five) == 5
    assert not five & {LINEAR_STYLES["PD"].colour, LINEAR_STYLES["PID"].colour}


OWN_LOOP = '''
from typing import Annotated, NamedTuple
from stickslip.core.control_spec import ControlLaw
from stickslip.core.spec import Par

class Params(NamedTuple):
    slope: Annotated[float, Par("N·m/rad", "k", "slope", positive=True)]

def sample(y, z, p, u):
    """Torque, N·m."""
    return min(max(p.slope * y.error, -1.0), 1.0)

CONTROL_LAW = ControlLaw("own_loop", Params, sample, "loop", title="A saturated slope", source=("own",),
                         equation="T", example={"slope": 1.0})
'''


def test_own_laws_and_observers_count_among_the_compensators_and_parts_say_so(tmp_path: Path) -> None:
    (tmp_path / "own_loop.py").write_text(OWN_LOOP, encoding="utf-8")
    lines = ["sample_time = 1e-3", 'loop = {law = "pd"}']
    more = [
        "[controllers.own]", lines[0], 'loop = {law = "own_loop", slope = 3.0}',
        "[controllers.observer]", *lines, 'observer = {law = "disturbance_observer", corner = 200.0}',
        "[controllers.inertia]", *lines, 'feedforward = {law = "inertia_feedforward"}',
        "[controllers.law]", *lines, 'feedforward = {law = "friction_feedforward", friction = "guess"}',
        *(line for i in range(6) for line in (f"[controllers.gain-{i}]", 'linear = "PD"',
          'compensator = "feedforward"', 'law = "guess"', f"gain = 0.{i + 1}")),
    ]  # fmt: skip
    text = 'plugins = ["own_loop.py"]\n' + STUDY.replace("fc = 0.25", "fc = 0.25\nsigma2 = 0.01")
    (tmp_path / "own.toml").write_text(text + "\n".join(more), encoding="utf-8")
    with allow_code():
        planned = load(tmp_path / "own.toml").runs
    kinds = {run.controller: run.compensation for run in planned}
    assert {name: kinds[name] for name in ("bare", "own", "observer", "inertia", "law", "helped")} == {
        "bare": "", "own": "feedback", "observer": "feedback", "inertia": "", "law": "feedforward",
        "helped": "feedforward",
    }  # fmt: skip
    made = [
        Run(p.slip_rule, p.reference, p.friction, p.controller, {"position_rms_rad": 1e-3 * (i + 1)},
            Path("no.npz"), compensation=p.compensation)
        for i, p in enumerate(planned)
    ]  # fmt: skip
    view = StudyView(StudyResult(tmp_path, made, {}, {}))
    parts = [case for case in result_cases(view, "signed") if case.kind == "feedforward"]
    assert [(case.part, case.parts) for case in parts] == [(0, 2), (1, 2)]
    said = [
        case_message(c.every, False, ["bare", "inertia"], shown=[r.controller for r in c.runs]) for c in parts
    ]
    assert "best compensator helped\u00a02; inertia" in said[0]
    assert "best compensator helped\u00a02 (another part)" in said[1]


def test_importing_the_report_loads_no_matplotlib() -> None:
    code = "import sys, stickslip.report; print([m for m in ('matplotlib', 'jinja2', 'pandas') if m in sys.modules])"
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True).stdout.strip() == "[]"


def test_an_unwritable_folder_is_one_line(result: StudyResult, tmp_path: Path) -> None:
    from stickslip.core.errors import InputError

    (tmp_path / "figures").write_text("in the way")
    with pytest.raises(InputError, match="; choose another place"):
        report.write(replace(result, folder=tmp_path))


def test_the_report_begins_with_a_conclusion_and_its_tables_have_one_set_of_columns(
    result: StudyResult,
) -> None:
    twice = [*result.runs, *(replace(r, slip_rule="literal") for r in result.runs)]
    both = replace(result, runs=twice)
    page = report.write(both).read_text(encoding="utf-8")
    begin = page.index('<section id="summary">')
    first = page[begin : page.index("</p>", begin)]
    assert "<h2>Conclusion</h2>" in first
    assert re.search(
        r"smaller error than the best linear controller in \d of 2\s", first.replace("\u00a0", " ")
    )
    (table,) = metrics_tables(StudyView(both))
    assert {len(row.cells) for row in table.rows} == {len(table.columns)}
    assert [row.rule for row in table.rows] == ["signed", "signed", "literal", "literal"]
    assert page.count(f'<th class="rule" colspan="{len(table.columns) + 1}">') == 2
    report.write(result)


def test_a_conclusion_says_by_how_much() -> None:
    said = helped([(1.0, 0.5), (1.0, 2.0), (8.0, 1.0)], "cases")
    assert said == (
        "The best friction compensator has a smaller error than the best linear controller in 2 of 3 cases; the linear "
        "controller's error is 2 times the compensator's in the median case (0.5 to 8)."
    )
    assert "more than 1000 times the compensator's." in helped([(1.0, 1e-14)], "cases")
    lines = rig_conclusion(
        [{"count": 3, "words": "statements hold"}], {"a": (2, 2), "b": (1, 3)}, [(2.0, 1.0)]
    )
    assert lines[0] == "Of the thesis's statements 3 hold."
    assert "hold wherever they were tested: a." in lines[1]
    assert "do not hold everywhere: b (1 of 3 parts)." in lines[2]
    assert "2 times the compensator's" in lines[3]


def test_a_small_ratio_of_the_bench_is_not_rounded_to_nothing() -> None:
    assert [shown(x) for x in (1.234, 0.2214, 0.0131, 0.00042)] == ["1.23", "0.221", "0.013", "0.00042"]
