"""The picture of every law: its curves are the law's, it is drawn unasked, and bad settings get one line."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from stickslip.cli import main
from stickslip.models import plugins
from stickslip.models.model import Model, Reference
from stickslip.report.law_pictures import (
    draw_gallery,
    draw_law,
    presliding,
    scales_of,
    slow_sine,
    velocity_steps,
)
from stickslip.simulation.prescribed.open_loop import respond

every_law = pytest.mark.parametrize("name", plugins.law_names())
CONTRIBUTING = (Path(__file__).parents[2] / "CONTRIBUTING.md").read_text()


def example(name: str) -> Model:
    law = plugins.law(name)
    return Model(law, **law.example)


@every_law
def test_every_law_is_drawn(name: str, tmp_path: Path) -> None:
    draw_law(example(name), tmp_path / "law.svg", tmp_path / "law.png")
    assert (tmp_path / "law.png").stat().st_size > 10_000
    assert "</svg>" in (tmp_path / "law.svg").read_text()


def test_the_laws_are_drawn_side_by_side(tmp_path: Path) -> None:
    draw_gallery([example("lugre"), example("gms")], tmp_path / "laws.svg")
    assert "</svg>" in (tmp_path / "laws.svg").read_text()


@every_law
def test_what_is_drawn_is_finite_and_moves(name: str) -> None:
    model = example(name)
    scales = scales_of(model)
    outer, inner = presliding(model, scales)
    steps, _ = velocity_steps(model, scales)
    for answer in (slow_sine(model, scales), outer, inner, steps):
        assert np.all(np.isfinite(answer.torque))
        assert np.ptp(answer.position) > 0.0


@pytest.mark.parametrize("name", ["lugre", "gms"])
def test_the_slow_sine_is_the_law_to_a_line_s_width(name: str) -> None:
    """The march through the law's steps against the adaptive integration of its rates."""
    model = example(name)
    scales = scales_of(model)
    drawn = slow_sine(model, scales)
    peak = 5.0 * scales.velocity
    w = peak / (1000.0 * scales.distance)
    motion = Reference(
        "harmonic", amplitude=peak / w, frequency=w / (2 * np.pi), phase=-0.5 * np.pi, velocity=0.0
    )
    chosen = slice(0, None, 20)
    exact = respond(model, motion, drawn.time[chosen], tolerance=1e-9)["friction_torque"]
    assert np.max(np.abs(drawn.torque[chosen] - exact)) < 2e-3 * np.ptp(exact)


def test_the_inner_loop_of_gms_closes_and_that_of_lugre_does_not() -> None:
    """Non-local memory, as the picture shows it: the torque where the interruption began is met again."""
    gaps = {}
    for name in ("gms", "lugre"):
        model = example(name)
        outer, inner = presliding(model, scales_of(model))
        gaps[name] = abs(inner.torque[-1] - inner.torque[0]) / np.ptp(outer.torque)
    assert gaps["gms"] < 2e-3
    assert gaps["lugre"] > 5e-3


def test_steps_end_at_the_steady_torque() -> None:
    for name in ("lugre", "gms"):
        model = example(name)
        answer, levels = velocity_steps(model, scales_of(model))
        for i, v in enumerate(levels):
            assert answer.torque[(i + 1) * 800 - 1] == pytest.approx(
                model.law.steady(v, model.parameters), rel=1e-3
            )


def test_the_command_draws_a_law_with_other_values(tmp_path, monkeypatch, capsys) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["law", "gms", "--plot", "--set", "slip_rule=literal", "--set", "k=[9e3,8e3]",
                 "--set", "alpha=[0.5, 0.5]"]) == 0  # fmt: skip
    said = capsys.readouterr().out
    assert 'slip_rule = "literal"' in said
    assert "k = [9000.0, 8000.0]" in said
    assert (tmp_path / "law-gms.png").exists()


def test_the_command_draws_a_law_of_the_user(tmp_path, capsys) -> None:
    (text,) = re.findall(r"```python\n(.*?)```", CONTRIBUTING, re.DOTALL)
    (tmp_path / "mine.py").write_text(text)
    assert main(["law", str(tmp_path / "mine.py"), "--plot", str(tmp_path / "sub" / "mine.svg")]) == 0
    assert "</svg>" in (tmp_path / "sub" / "mine.svg").read_text()


@pytest.mark.parametrize(
    ("argv", "said"),
    [
        (["law", "lugre", "--set", "fs"], "--set 'fs' must be NAME=VALUE"),
        (["law", "lugre", "--set", "f_s=1"], "no parameter 'f_s'"),
        (["law", "lugre", "--set", "fs=-0.1"], "fs = -0.1 N·m must be greater than 0"),
        (["law", "gms", "--set", "slip_rule=other"], "slip rule"),
        (["law", "lugre", "--plot", "x.bmp"], "end the name in .svg, .png or .pdf"),
        (["law", "lugre", "--plot", "/proc/none/x.png"], "cannot write"),
    ],
)
def test_bad_settings_get_one_line(argv, said, capsys) -> None:
    assert main(argv) == 2
    error = capsys.readouterr().err
    assert said in error
    assert error.count("\n") == 1
