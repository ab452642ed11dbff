"""The answer of `recommend`: a few lines in the terminal, a figure, and a page that an engineer can show."""

from __future__ import annotations

import base64
import re
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest

import stickslip as ss
from stickslip.cli import main

INERTIA = 4e-4
TRUE = {"fc": 0.285, "sigma2": 0.018}
MODEL = f"""
law = "coulomb"

[parameters]
fc = {TRUE["fc"]}
sigma2 = {TRUE["sigma2"]}

[axis]
inertia = {INERTIA}
offset = 0.03

[correlation]
matrix = [[1.0, 0.0], [0.0, 1.0]]

[[estimates]]
name = "fc"
unit = "N·m"
value = {TRUE["fc"]}
std = 0.003
lower = 0.279
upper = 0.291
identified = true

[[estimates]]
name = "sigma2"
unit = "N·m·s/rad"
value = {TRUE["sigma2"]}
std = 0.0002
lower = 0.0176
upper = 0.0184
identified = true
"""
LOOP = {"bandwidth": 20.0, "counts_per_rev": 65536.0, "torque_limit": 3.0, "sample_time": 1e-3}
MOTION = {"amplitude": 0.1, "frequency": 1.0}


@pytest.fixture
def few(monkeypatch: pytest.MonkeyPatch) -> None:
    """One gain, so that a recommendation is quick."""
    monkeypatch.setattr("stickslip.recommendation.recommend.GAINS", (1.0,))
    monkeypatch.setattr("stickslip.recommendation.recommend.LEADS", (0.0,))


@pytest.fixture
def model(tmp_path: Path) -> Path:
    path = tmp_path / "model.toml"
    path.write_text(MODEL)
    return path


def advised(model: Path, **options) -> ss.RecommendationResult:
    return ss.recommend(model, axes=1, confirm=4, **{**LOOP, **MOTION, **options})


class Text(HTMLParser):
    """The words of a page, and its images."""

    def __init__(self, html: str) -> None:
        super().__init__()
        self.words, self.images, self.silent = "", list[str](), False
        self.feed(html)

    def handle_starttag(self, tag, attrs):
        self.silent = tag in ("style", "script")
        if tag == "img":
            self.images.append(dict(attrs)["src"])

    def handle_data(self, data):
        self.words += "" if self.silent else f" {data}"


@pytest.mark.usefixtures("few")
def test_the_error_before_and_after_is_that_of_a_simulation_of_the_recommended_loop(model: Path) -> None:
    """By the drive's own simulation of the best estimate, which has no imperfections here."""
    advice = advised(model, counts_per_rev=0, delay=0.0, reference_velocity="instant")
    best, worst = advice.recommendation.comparisons
    slow = ss.Reference("sine", amplitude=MOTION["amplitude"], frequency=MOTION["frequency"])
    axis = ss.RigidAxis(INERTIA, ss.Model("coulomb", **TRUE))
    found = ss.simulate(axis, ss.Controller(advice.loop.gains, sample_time=1e-3), slow, duration=2.0)
    reference, position = found["position_reference"], found["position"]
    alone = float(np.sqrt(np.mean((reference - position) ** 2)))
    # The simulated axis has no constant torque, and the model has one of a tenth of friction.
    assert best.errors[0] == pytest.approx(alone, rel=0.1)
    assert advice.chosen is not None
    for comparison, left in ((best, advice.chosen.errors[0]), (worst, max(advice.chosen.errors))):
        before, after = comparison.errors
        assert after / before == pytest.approx(left, rel=1e-9)


@pytest.mark.usefixtures("few")
def test_the_terminal_shows_setting_error_margin_and_limits_in_a_few_lines(
    model: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "recommended.toml"
    options = [f"--{k.replace('_', '-')}={v}" for k, v in {**LOOP, **MOTION, "axes": 1, "confirm": 4}.items()]
    assert main(["recommend", str(model), *options, "--out", str(out)]) == 0
    lines = capsys.readouterr().out.splitlines()
    said = {name: text.strip() for name, _, text in (line.partition(":") for line in lines)}
    assert len(lines) <= 12
    assert said["switch on"].startswith("feedforward of law 'coulomb', gain 1")
    assert re.match(
        r"[\d.]+ to [\d.]+ mrad RMS \(best estimate\); .* \(worst of 4 sampled axes\)", said["error"]
    )
    assert "60 % interval" in said["error reduction"]
    assert said["loop"].endswith("sampled every 1 ms")
    assert "phase margin" in said["margins"]
    assert "resonances, backlash" in said["not simulated"]
    assert (said["recommended"], said["report"]) == (str(out), str(out.with_suffix(".html")))
    assert main(["recommend", str(model), *options, "--all"]) == 0
    table = capsys.readouterr().out
    assert "coulomb         feedback         1" in table
    assert "parameters:        fc" in table


@pytest.mark.usefixtures("few")
def test_the_report_answers_what_to_set_for_which_loop_and_when_to_repeat(
    model: Path, tmp_path: Path
) -> None:
    advice = advised(model)
    page = Text(advice.report(tmp_path / "page.html").read_text())
    before, after = (1e3 * error for error in advice.recommendation.comparisons[0].errors)
    words = page.words.replace("\N{NO-BREAK SPACE}", " ")
    assert f"the RMS position error falls from {before:.3g} to {after:.3g} mrad" in words
    for shown in (
        "What to set", "inertia times the reference's acceleration", "PD at 20 Hz", "65536 counts per revolution",
        "sliding, best estimate", "gain margin", "What was not simulated", "backlash", "When to repeat",
        "stickslip export recommended.toml --to c99 --compensator recommended",
    ):  # fmt: skip
        assert shown in words, shown
    (image,) = page.images
    svg = base64.b64decode(image.partition("base64,")[2]).decode()
    assert svg.count('<g id="axes_') == 3


@pytest.mark.usefixtures("few")
def test_without_a_safe_compensator_the_report_gives_the_reason_and_the_error_of_the_loop_alone(
    model: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("stickslip.recommendation.candidates.WORTH", 0.0)
    advice = advised(model)
    assert advice.chosen is None
    words = Text(advice.report(tmp_path / "page.html").read_text()).words
    assert "Switch on no friction compensator: " in words
    assert "RMS error without compensation" in words
    assert "stickslip export recommended" not in words
    assert str(advice).startswith("switch on:         no friction compensator: ")
    assert len(advice.plot().axes) == 2


@pytest.mark.usefixtures("few")
def test_the_figure_is_one_that_a_notebook_shows(model: Path) -> None:
    figure = advised(model).plot()
    reference, best, worst = figure.axes
    assert [len(axes.get_lines()) for axes in (reference, best, worst)] == [1, 2, 2]
    assert all("mrad" in axes.get_ylabel() for axes in (best, worst))
    # What is left with the compensator is the smaller one, on the worst axis too.
    for axes in (best, worst):
        without, with_it = (np.max(np.abs(line.get_ydata())) for line in axes.get_lines())
        assert with_it < 0.5 * without
    assert figure._repr_png_().startswith(b"\x89PNG")
