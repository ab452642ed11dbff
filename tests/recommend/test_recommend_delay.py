"""A drive whose commands act a known number of samples late, as on a bus."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from test_recommend_axes import INERTIA, identified
from test_recommend_composed import MODEL

import stickslip as ss
from stickslip.cli import main
from stickslip.core.errors import InputError
from stickslip.recommendation.axes import plants_of
from stickslip.recommendation.following import simulated
from stickslip.recommendation.plant import Plant
from stickslip.recommendation.recommend import Drive, recommend

QUICK = {"amplitude": 0.2, "axes": 2, "confirm": 3}


@pytest.fixture
def model(tmp_path: Path) -> Path:
    file = tmp_path / "model.toml"
    file.write_text(MODEL)
    return file


def test_every_axis_is_as_late_as_the_drive_is_and_else_as_it_was() -> None:
    late = list(plants_of(identified(), INERTIA, 8, 1, delay=2.5))
    drawn = list(plants_of(identified(), INERTIA, 8, 1))
    assert {p.delay for p in late} == {2.5}
    assert max(p.delay for p in drawn) < 1.0 < len({p.delay for p in drawn})
    for one, other in zip(late, drawn, strict=True):
        assert replace(one, delay=0.0) == replace(other, delay=0.0)


def test_a_loop_that_is_unstable_while_it_slides_is_refused_with_one_that_is_not(model: Path) -> None:
    """Along a slow motion friction hid it: 0.26 of an error of its own left was "safe"."""
    prompt = ss.recommend(model, bandwidth=40.0, delay=0.0, **QUICK)
    assert prompt.chosen is not None
    assert "0 samples of delay" in "\n".join(prompt.notes)
    with pytest.raises(
        InputError, match=r"40 Hz is unstable .* 6 samples \(6 ms\) late.*bandwidth="
    ) as refused:
        ss.recommend(model, bandwidth=40.0, delay=6.0, **QUICK)
    slower = float(re.search(r"bandwidth=([\d.]+)", str(refused.value))[1])
    machine = ss.Machine("late", INERTIA, ss.Contact(prompt.model), delay=6.0)
    for bandwidth, stable in ((40.0, False), (slower, True)):
        loop = ss.Controller(ss.place("PD", INERTIA, bandwidth), sample_time=1e-3)
        said = str(ss.stability(machine, loop))
        assert re.search(r"sliding +(\w+)", said)[1] == ("stable" if stable else "unstable")
    assert not any(
        "hardly damped" in n for n in ss.recommend(model, bandwidth=slower, delay=6.0, **QUICK).notes
    )


def test_a_loop_that_is_hardly_damped_for_the_delay_is_told(model: Path) -> None:
    notes = ss.recommend(model, bandwidth=20.0, delay=4.0, **QUICK).notes
    assert any(
        re.search(r"4 samples late this loop is hardly damped .* Hz would be well damped", n) for n in notes
    )


def test_a_loop_of_ones_own_that_the_delay_contradicts_is_refused(model: Path) -> None:
    with pytest.raises(InputError, match=r"this loop is unstable .* check the delay, which is in samples"):
        ss.recommend(model, loop={"kp": 25.0, "kd": 0.2, "kr": 0.2}, delay=8.0, **QUICK)


def test_a_longer_delay_leaves_more(model: Path) -> None:
    left = [ss.recommend(model, bandwidth=10.0, delay=d, **QUICK).chosen for d in (0.0, 3.0)]
    errors = [c.errors[0] for c in left if c is not None]
    assert len(errors) == 2
    assert np.all(np.diff(errors) > 0.0)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--delay", "-1"], "--delay -1 must be from 0 to 100"),
        (["--delay", "101"], "--delay 101 must be from 0 to 100"),
        (["--delay", "2", "--machine", "thesis-dry"], "--delay 2, and the machine thesis-dry has its own"),
    ],
)
def test_a_delay_that_cannot_be_is_refused_in_a_line(
    model: Path, options: list[str], said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["recommend", str(model), "--amplitude", "0.2", *options]) == 2
    error = capsys.readouterr().err
    assert said in error
    assert error.count("\n") == 1


def test_a_drive_knows_how_late_it_is() -> None:
    dry = ss.load_machine("thesis-dry")
    counts = dry.encoder.counts
    assert Drive(amplitude=0.1).latest == 0.0
    assert Drive(amplitude=0.1, delay=2.0).latest == 2.0
    assert Drive(amplitude=0.1, encoder_counts=counts, machine=replace(dry, delay=3.0)).latest == 3.0


def test_a_delay_that_looks_like_seconds_is_told(model: Path) -> None:
    notes = ss.recommend(model, bandwidth=10.0, delay=2e-3, **QUICK).notes
    assert any("delay of 0.002 is in samples" in n and "delay=2" in n for n in notes)


def test_friction_that_grows_with_the_load_is_not_compensated_as_if_it_did_not() -> None:
    """What was recommended promised 99 % and left 82 % of the error."""
    loaded = replace(identified(), axis={**identified().axis, "load_motor": 0.5})
    with pytest.raises(InputError, match=r"grows with the load \(load_motor\).* identify without load=True"):
        recommend(loaded, Drive(amplitude=0.2), axes=1, confirm=0)


@pytest.mark.parametrize("delay", [0.002, 0.1, 0.5, 0.9, 1.5])
def test_a_load_that_hovers_at_the_break_away_is_no_end_of_a_run(delay: float) -> None:
    """It came loose by rounding and rested again, ten thousand times a sample, and the run was called diverging."""
    drive = Drive(10.0, amplitude=0.2)
    coulomb = ss.Model("coulomb", fc=0.285, sigma2=0.018)
    moved, prompt = (
        simulated(Plant(INERTIA, coulomb, delay=d), drive.loop(INERTIA), drive.reference)
        for d in (delay, 0.0)
    )
    assert moved is not None
    assert prompt is not None
    assert np.max(np.abs(moved - prompt)) < 2e-3 * (1.0 + delay)
