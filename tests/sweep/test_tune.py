"""Tuning: the best of what was tried, better than a grid of settings, worse nowhere than it says."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from stickslip.cli import main
from stickslip.cli import tune as help_of_tune
from stickslip.core.errors import ConfigError, InputError
from stickslip.sweeps import tune as tuning
from stickslip.sweeps.measured import measured
from stickslip.sweeps.plan import load
from stickslip.sweeps.sample import Spread

SMALL = Path(__file__).with_name("small_tune.toml")


@pytest.fixture(scope="module")
def found():
    sweep = load(SMALL)
    return sweep, tuning.tune(sweep, sweep.runs[0])


def test_what_the_help_shows_is_a_sweep_that_can_be_tuned(tmp_path, capsys):
    shown = [line[4:] for line in help_of_tune.__doc__.splitlines() if line.startswith("    ")][1:]
    changed, tables = shown[: shown.index("percentile = 95") + 1], shown[shown.index("percentile = 95") + 1 :]
    names = {line.split(" = ")[0] for line in changed}
    assert main(["sweep", "thesis-robustness", "--print"]) == 0
    kept = [x for x in capsys.readouterr().out.splitlines() if x.split(" = ")[0] not in names]
    file = tmp_path / "my.toml"
    file.write_text("\n".join([*changed, *kept, *tables]), encoding="utf-8")
    sweep = load(file)
    assert [s.name for s in sweep.tuned] == ["controller.bandwidth_hz", "controller.gain"]
    assert [r.key for r in sweep.runs] == ["signed/low/nominal/FF-gms"]
    assert sweep.drawn.cases <= tuning.MOST_CASES


def score(sweep, settings):
    values = sweep.values(sweep.runs[0], sweep.drawn.block(0, sweep.drawn.cases))
    fixed = {name: np.full(sweep.drawn.cases, x) for name, x in settings.items()}
    metrics, *_ = measured(sweep.runs[0], values | fixed, sweep.metrics, sweep.drawn.cases)
    return np.sort(metrics[:, 0])[5]  # the sixth of eight: the 75th percentile


def test_it_beats_every_point_of_a_grid(found):
    sweep, tuned = found
    grid = [
        score(sweep, {"controller.gain": g, "controller.bandwidth_hz": b})
        for g in np.linspace(0.0, 1.5, 7)
        for b in np.linspace(20.0, 40.0, 4)
    ]
    assert tuned.scores_after[0] <= 1.02 * min(grid)
    assert tuned.scores_after[0] < tuned.scores_before[0]
    assert tuned.scores_after[0] == score(sweep, dict(zip(tuned.names, tuned.after)))
    assert np.all((tuned.tried >= [0.0, 20.0]) & (tuned.tried <= [1.5, 40.0]))


def test_the_same_again(found):
    sweep, tuned = found
    assert np.array_equal(tuning.tune(sweep, sweep.runs[0]).after, tuned.after)
    said = repr(replace(tuned, at_bounds={})).splitlines()
    assert len(said) == 1 + len(tuned.names) + len(tuned.measured)
    assert said[-1].endswith(f"{sweep.percentile:g} % of the cases below>")


def test_a_setting_that_stops_at_its_bound_is_told(found):
    sweep, tuned = found
    spreads, bases = (
        (Spread("controller.gain", 0.5, 1.5), Spread("controller.bandwidth_hz", 3.0, 12.0)),
        (1.0, 1.0),
    )
    run = sweep.runs[0]
    assert tuning.at_bounds(run, spreads, bases, np.array([1.0, 11.986])) == {"controller.bandwidth_hz": 12.0}
    assert tuning.at_bounds(run, spreads, bases, np.array([0.5, 11.5])) == {"controller.gain": 0.5}
    told = replace(tuned, at_bounds={"controller.bandwidth_hz": 12.0})
    assert "controller.bandwidth_hz stops at the end of its range, 12: the best may lie beyond" in str(told)
    assert told.as_dict()["at_bounds"] == {"controller.bandwidth_hz": 12.0}


def test_a_failed_case_counts_as_the_worst():
    found = np.array([[1.0], [2.0], [np.nan], [3.0]])
    assert tuning.percentiles(found, 75.0)[0] == 3.0
    assert np.isinf(tuning.percentiles(found, 90.0)[0])


def test_no_other_beats_the_front():
    rng = np.random.default_rng(1)
    scores = rng.uniform(size=(50, 2))
    kept = set(tuning.front(scores).tolist())
    for i, one in enumerate(scores):
        beaten = any(np.all(other < one) for other in scores)
        assert (i in kept) == (not beaten)


def test_the_command_writes_and_draws(tmp_path, capsys):
    text = (
        SMALL.read_text().replace("../data", str(SMALL.parents[1] / "data")).replace("cases = 8", "cases = 2")
    )
    path = tmp_path / "mine.toml"
    path.write_text(text)
    assert main(["tune", str(path), "--out", str(tmp_path / "out")]) == 0
    assert "controller.bandwidth_hz" in capsys.readouterr().out
    chosen = json.loads((tmp_path / "out" / "signed-sine-nominal-FF-lugre-tuned.json").read_text())
    assert 0.0 <= chosen["settings"]["controller.gain"] <= 1.5
    assert chosen["gains"]["kd"] == chosen["gains"]["kr"] > 0.0
    assert (tmp_path / "out" / "figures" / "trade-off-FF-lugre.png").exists()


COMPOSED = """
slip_rules = ["signed"]
time_step = 5e-4
[axis]
inertia = 3.8623e-4
[friction.nominal]
law = "coulomb"
fc = 0.2
[references.sine]
kind = "sine"
amplitude = 0.05
frequency = 2.0
duration = 0.25
placement = {bandwidth_hz = 15.0, damping = 1.0}
[controllers.observed]
sample_time = 1e-3
torque_limit = 1.0
loop = {law = "pd"}
observer = {law = "disturbance_observer", corner = 20.0}
"""
OF_COMPOSED = """
study = "study.toml"
cases = 2
metrics = ["position_rms_rad", "torque_rms_Nm"]
percentile = 50
[vary."friction.fc"]
scale = [0.9, 1.1]
[tune."controller.observer_corner"]
range = [10.0, 300.0]
[tune."controller.bandwidth_hz"]
range = [10.0, 25.0]
"""


def test_a_controller_made_of_control_laws_is_tuned_by_its_numbers(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(tuning, "GENERATIONS", 2)
    Path("study.toml").write_text(COMPOSED)
    Path("mine.toml").write_text(OF_COMPOSED)
    assert main(["tune", "mine.toml", "--out", "out", "--no-report"]) == 0
    chosen = json.loads(Path("out/signed-sine-nominal-observed-tuned.json").read_text())
    name = "position_rms_rad"
    assert chosen["metrics"][name] < 0.5 * chosen["metrics_before"][name]
    settings, gains = chosen["settings"], chosen["gains"]
    assert gains["observer_corner"] == settings["controller.observer_corner"] > 100.0
    w = 2.0 * np.pi * settings["controller.bandwidth_hz"]
    assert gains["loop_kp"] == pytest.approx(3.8623e-4 * w**2)
    assert gains["loop_kd"] == pytest.approx(2.0 * 3.8623e-4 * w)


ON_MACHINE = """
title = "One machine"
[machines.delayed]
machine = "thesis-dry"
only = ["delay"]
[references.sine]
kind = "sine"
amplitude = 0.05
frequency = 2.0
duration = 0.3
placement = {bandwidth_hz = 10.0, damping = 1.0}
[laws.less]
law = "lugre"
sigma0 = 3.5e4
sigma2 = 0.018
fs = 0.30
fc = 0.25
vs = 0.01
[controllers.fed]
sample_time = 1e-3
loop = {law = "pd"}
feedforward = {law = "friction_feedforward", friction = "less"}
"""
OF_MACHINE = """
title = "Gain on a machine"
study = "study.toml"
cases = 2
metrics = ["position_rms_rad"]
percentile = 75
[vary."machine.delay"]
range = [0.2, 0.8]
[tune."controller.feedforward_gain"]
range = [0.0, 1.2]
"""


def test_a_controller_is_tuned_on_a_machine_whose_delay_is_uncertain(tmp_path):
    """The law holds less friction than the machine: more than the whole of it is given."""
    (tmp_path / "study.toml").write_text(ON_MACHINE)
    (tmp_path / "tune.toml").write_text(OF_MACHINE)
    sweep = load(tmp_path / "tune.toml")
    tuned = tuning.tune(sweep, sweep.runs[0])
    assert 1.05 < tuned.after[0] <= 1.2
    assert tuned.scores_after[0] < 0.8 * tuned.scores_before[0]
    delays = sweep.values(sweep.runs[0], sweep.drawn.block(0, 2))["machine.delay"]
    assert 0.2 <= delays.min() < delays.max() <= 0.8


def test_an_interrupted_tuning_says_that_it_starts_over(tmp_path, capsys, monkeypatch):
    def interrupted(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(tuning, "measured", interrupted)
    assert main(["tune", str(SMALL), "--out", str(tmp_path / "out")]) == 130
    assert "are not kept; run the same command again to start over" in capsys.readouterr().err


def test_what_cannot_be_tuned(tmp_path, capsys):
    assert main(["sweep", str(SMALL)]) == 2
    assert "stickslip tune" in capsys.readouterr().err
    assert main(["tune", str(SMALL.with_name("small.toml"))]) == 2
    assert "has no table [tune]" in capsys.readouterr().err
    text = SMALL.read_text().replace("../data", str(SMALL.parents[1] / "data"))
    for old, new, message in (
        ("percentile = 75", "percentile = 101", "at most 100"),
        ('tune."controller.gain"', 'tune."controller.gian"', "no run has a number"),
        (
            "range = [0.0, 1.5]",
            "range = [-0.5, 1.5]",
            "tune: run .* at the end of a range: .*gain = -0.5 must be",
        ),
        (
            'tune."controller.gain"',
            'tune."friction.k"',
            r"friction.k is a list; name an element, friction.k\[0\]",
        ),
    ):
        path = tmp_path / "bad.toml"
        path.write_text(text.replace(old, new))
        with pytest.raises(ConfigError, match=message):
            load(path)
    path.write_text(text.replace("cases = 8", "cases = 100000"))
    sweep = load(path)
    with pytest.raises(InputError, match="too many for every setting"):
        tuning.tune(sweep, sweep.runs[0])


KNOCKED = COMPOSED.replace(
    'observer = {law = "disturbance_observer", corner = 20.0}',
    'observer = {law = "knocker", torque = 0.05, samples = 10, width = 2}',
).replace('law = "pd"', 'law = "pid"')


@pytest.mark.parametrize(
    ("study", "numbers", "ranges"),
    [
        (COMPOSED, {"observer_corner": 20.0, "loop_kp": None}, {"observer_corner": (4.0, 100.0)}),
        (
            KNOCKED.replace('{law = "pid"}', '{law = "pid", at_rest = "reset", kept = 0.5}'),
            {"loop_kept": 0.5, "observer_width": 2.0, "observer_samples": 10.0},
            {"loop_kept": (0.0, 1.0), "observer_width": (1.0, 10.0), "observer_samples": (2.0, 50.0)},
        ),
    ],
)
def test_a_number_without_a_range_has_that_of_its_law(tmp_path, study, numbers, ranges):
    """Between finite bounds; else factors of 5 on the study's own number, up to a bound."""
    (tmp_path / "study.toml").write_text(study)
    head = OF_COMPOSED.partition('[tune."')[0]
    (tmp_path / "mine.toml").write_text(head + "".join(f'[tune."controller.{name}"]\n' for name in numbers))
    sweep = load(tmp_path / "mine.toml")
    run = sweep.runs[0]
    for spread in sweep.tuned:
        name = spread.name.removeprefix("controller.")
        own = run.control.values()[name]
        assert numbers[name] in (None, own)
        factor = own if spread.factor else 1.0
        assert (factor * spread.low, factor * spread.high) == pytest.approx(
            ranges.get(name, (0.2 * own, 5.0 * own))
        )


def test_whole_numbers_are_tuned_as_whole_numbers(tmp_path, monkeypatch):
    monkeypatch.setattr(tuning, "GENERATIONS", 1)
    (tmp_path / "study.toml").write_text(KNOCKED)
    head = OF_COMPOSED.partition('[tune."')[0]
    (tmp_path / "mine.toml").write_text(
        head + '[tune."controller.observer_samples"]\n[tune."controller.observer_torque"]\n'
    )
    sweep = load(tmp_path / "mine.toml")
    tuned = tuning.tune(sweep, sweep.runs[0])
    periods = tuned.tried[:, 0]
    assert np.array_equal(periods, np.round(periods))
    assert len(set(periods)) > 3
    # A period not longer than a pulse is refused by the law: such a setting fails, and is not chosen.
    assert np.array_equal(np.isinf(tuned.scores[:, 0]), periods <= 2.0)
    assert tuned.scores_after[0] < tuned.scores_before[0]


def test_a_number_that_has_no_usual_range_is_told(tmp_path):
    study = COMPOSED.replace("corner = 20.0", "corner = 20.0, delay = 0")
    (tmp_path / "study.toml").write_text(study.replace('law = "pd"', 'law = "gains", kp = 1.0'))
    head = OF_COMPOSED.partition('[tune."')[0]
    for name, said in (
        ("loop_ki", r"controller.loop_ki = 0 has no usual range; give range = \[low, high\]"),
        ("observer_cornre", "no run has a number|give one of scale"),
    ):
        (tmp_path / "mine.toml").write_text(head + f'[tune."controller.{name}"]\n')
        with pytest.raises(ConfigError, match=said):
            load(tmp_path / "mine.toml")
