"""The interval that a learned value is told with: it holds as often as it says, and is not told where nobody knows."""

from __future__ import annotations

import math
from types import SimpleNamespace

import numpy as np
import pytest

import stickslip as ss
from stickslip.control.learned import WIDTH, learned_values, read_learned, told, write_learned
from stickslip.core.errors import InputError
from stickslip.core.spec import Surroundings
from stickslip.machines.contact import Contact
from stickslip.machines.encoder import Encoder
from stickslip.machines.machine import Machine
from support.golden_rows import LUGRE, ROWS

INERTIA, TIME, LEVEL = 3.8623e-4, 1e-3, 0.8
FC, SIGMA2 = 0.285, 0.018
SCALE, LEAST_SQUARES = (
    "PD + FF LuGre .9 scale adapted + DOB 200 residual",
    "PD + FF LuGre .9 RLS + DOB 200 residual",
)


def learnt(law, seed, samples, noise=0.05):
    """State and parameters of a law after a sine, its torque measured with white noise (N·m), friction 20 % lower."""
    own = ss.control_law(law)
    block = ss.ControlBlock(own, ss.Model("coulomb", fc=FC, sigma2=SIGMA2), **own.example)
    v = 1.5 * np.sin(math.pi * TIME * np.arange(samples))
    applied = INERTIA * np.diff(v, prepend=0.0) / TIME + LEVEL * FC * np.sign(v) + SIGMA2 * v
    applied += noise * np.random.default_rng(seed).standard_normal(samples)
    z, p, u = block.state(), block.parameters, SimpleNamespace(**Surroundings()._asdict())
    y, sample = SimpleNamespace(torque_limit=10.0, elapsed=TIME), block.function("sample")
    for y.velocity, y.applied in zip(v.tolist(), applied.tolist()):
        y.reference_velocity = y.slow_velocity = y.velocity
        sample(y, z, p, u)
    return own, z, p


def deviations(law, z, p):
    """Of what the law tells one of."""
    found = {name: deviation(z, p, TIME) for name, deviation in law.deviations.items()}
    return {name: value for name, value in found.items() if value >= 0.0}


@pytest.mark.parametrize(
    ("law", "samples", "truth"),
    [
        ("scaled_feedforward", 5900, {"scale": LEVEL}),
        (
            "least_squares_feedforward",
            11_400,
            {"coulomb": LEVEL * FC, "viscous": SIGMA2 * 0.1, "offset": 0.0},
        ),
    ],
)
def test_intervals_of_white_noise_hold_as_often_as_they_say(law, samples, truth):
    held, spread, said = [], [], []
    for seed in range(80):
        own, z, p = learnt(law, seed, samples)
        deviation = deviations(own, z, p)
        assert deviation.keys() == truth.keys()
        off = np.array([getattr(z, name) - value for name, value in truth.items()])
        half = WIDTH * np.array(list(deviation.values()))
        held.append(np.abs(off) <= half)
        spread.append(off)
        said.append(half / WIDTH)
    assert np.std(spread, axis=0) / np.mean(said, axis=0) == pytest.approx(1.0, abs=0.25)
    assert np.all(np.mean(held, axis=0) >= 0.90)
    assert np.all(np.mean(held, axis=0) <= 0.99)


@pytest.mark.parametrize(
    ("row", "name", "truth"), [(SCALE, "feedforward_scale", 1.0), (LEAST_SQUARES, "feedforward_coulomb", FC)]
)
def test_in_the_loop_with_a_noisy_encoder_an_interval_holds_more_often(row, name, truth):
    """White noise of a position that is differentiated twice averages out faster than white noise of a torque."""
    reference = ss.Reference("sine", amplitude=0.25, frequency=0.5)
    held = []
    for seed in range(1, 9):
        machine = Machine("noisy", INERTIA, Contact(LUGRE), encoder=Encoder(noise=1e-5), seed=seed)
        record = ss.simulate(machine, ROWS[row], reference, 6.0, metered=False)
        found = record.meta["learned"][name]
        held.append(abs(found["value"] - truth) <= found["uncertainty"])
    assert all(held)


@pytest.mark.parametrize(
    "row", ["PD + Makkar adaptive", "Lee-Kim delta .5", "PD + Friedland-Park 200 on v_f"]
)
def test_a_law_without_covariance_tells_no_uncertainty(row):
    controller = ROWS[row]
    values = learned_values(controller, controller.state())
    assert values
    assert all(v.uncertainty is None and v.text.endswith("; no uncertainty given") for v in values)
    assert not any(v.name.endswith("_known") for v in values)


def test_nothing_is_told_before_anything_is_learned_at_a_bound_or_by_a_covariance_that_was_cut_back():
    for law, name in (("scaled_feedforward", "scale"), ("least_squares_feedforward", "coulomb")):
        own, z, p = learnt(law, 1, 3000)
        assert name in deviations(own, z, p)
        setattr(z, name, p.lowest * (1.0 if name == "scale" else p.fc))
        assert name not in deviations(own, z, p)
        z.variance = 0.0
        assert deviations(own, z, p) == {}
    own, z, p = learnt("least_squares_feedforward", 1, 3000)
    z.p22 = p.trace - z.p11 - z.p33
    assert deviations(own, z, p) == {}


def test_an_axis_without_imperfections_tells_what_it_has_learned_too():
    record = ss.simulate(
        ss.RigidAxis(INERTIA, LUGRE), ROWS[SCALE], ss.Reference("sine", amplitude=0.25, frequency=0.5), 2.0
    )
    assert record.meta["learned"]["feedforward_scale"]["value"] == pytest.approx(1.0, abs=5e-3)
    (line,) = told(record.meta)
    assert line.startswith("friction over that of the law (feedforward_scale) = ")
    assert " ± " in line


def test_what_was_learned_is_kept_in_a_file_that_others_neither_read_nor_overwrite(tmp_path):
    controller, path = ROWS[SCALE], tmp_path / "learned.toml"
    learned = {"feedforward_scale": 0.7, "feedforward_variance": 1e-4, "feedforward_known": 1.0}
    assert read_learned(path, controller, "press") == {}
    write_learned(path, controller, learned, "press")
    assert read_learned(path, controller, "press") == learned
    assert "[uncertainty]\nfeedforward_scale = 0.00" in path.read_text()
    write_learned(path, controller, {**learned, "feedforward_scale": 0.8}, "press")
    assert read_learned(path, controller, "press")["feedforward_scale"] == 0.8
    for other, machine, said in (
        (controller, "lathe", "other machine"),
        (ROWS[LEAST_SQUARES], "press", "other laws"),
    ):
        with pytest.raises(InputError, match=said):
            read_learned(path, other, machine)
    path.write_text("title = 'mine'\n")
    with pytest.raises(InputError, match="holds nothing that was learned"):
        write_learned(path, controller, learned, "press")
