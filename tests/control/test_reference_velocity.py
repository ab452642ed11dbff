"""How a controller forms its reference velocity: as it is given, or as the difference of two reference positions."""

from __future__ import annotations

import math
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import stickslip as ss
from stickslip.control.controller import Controller
from stickslip.control.files import read_controller
from stickslip.control.linear import Cascade, Gains
from stickslip.control.own_loop import loop_text, split_loop
from stickslip.control.plain import plain_sample
from stickslip.control.recommended import Recommended, read_recommended
from stickslip.control.written import table_as_given, tables_of
from stickslip.core.errors import ConfigError, InputError, ParameterError, UnknownName
from stickslip.core.spec import Surroundings
from stickslip.exports.controllers import given_by
from stickslip.identification.methods._experiments import loop_of as identify_loop
from stickslip.verbs.recommend import loop_of, one_of

T = 1e-3
LOOP = Cascade(40.0, 0.06, 1.5)


def torques(controller: Controller, velocity: np.ndarray, turns: int = 0) -> list[float]:
    """The torques of a controller along a sine at rest, with these reference velocities."""
    m, z = controller.memory(), controller.state()
    u = SimpleNamespace(**Surroundings()._asdict())
    t = T * np.arange(velocity.size)
    whole = 2.0 * math.pi * turns + np.sin(3.0 * t)
    return [
        plain_sample(
            controller.functions["sample"], whole[0], float(x), float(v), 0.0, controller.settings, m, z,
            controller.parameters, u,
        )
        for x, v in zip(whole, velocity, strict=True)
    ]  # fmt: skip


def test_the_difference_is_that_of_the_reference_positions_whatever_velocity_is_given() -> None:
    t = T * np.arange(50)
    own = Controller(LOOP, sample_time=T, reference_velocity="difference")
    plain = Controller(LOOP, sample_time=T)
    difference = np.diff(np.sin(3.0 * t), prepend=0.0) / T
    expected = torques(plain, difference)
    assert torques(own, np.full(50, 123.0)) == pytest.approx(expected, rel=1e-9, abs=1e-12)
    assert torques(own, np.zeros(50), turns=1000) == pytest.approx(expected, rel=1e-6, abs=1e-9)
    stated = Controller(LOOP, sample_time=T, reference_velocity="instant")
    assert torques(stated, 3.0 * np.cos(3.0 * t)) == torques(plain, 3.0 * np.cos(3.0 * t))


def test_a_simulation_runs_with_it_and_says_so() -> None:
    axis = ss.Model("coulomb", fc=0.01)
    reference = ss.Reference(
        "table", time=[0.0, 0.5, 1.0], position=[0.0, 1.0, 0.0], velocity=[0.0, 0.0, 0.0]
    )
    kinds = (None, "instant", "difference")
    runs = {
        kind: ss.simulate(
            ss.RigidAxis(4e-4, axis),
            Controller(Gains(1.6, 0.0, 0.05, 0.05), sample_time=T, reference_velocity=kind), reference, 1.0,
        )
        for kind in kinds
    }  # fmt: skip
    error = {kind: np.asarray(run["position"] - run["position_reference"]) for kind, run in runs.items()}
    assert np.array_equal(error[None], error["instant"])
    # Half a sample late, the reference velocity acts as a lag.
    assert not np.allclose(error["difference"], error["instant"], atol=1e-6)
    assert [run.meta["reference_velocity"] for run in runs.values()] == ["instant", "instant", "difference"]


def test_files_keep_it(tmp_path: Path) -> None:
    for kind in ("difference", "instant"):
        controller = Controller(LOOP, sample_time=T, reference_velocity=kind)
        assert table_as_given(controller, lambda _: "law")["reference_velocity"] == kind
        file = tmp_path / f"{kind}.toml"
        file.write_text(
            f'[controller]\nsample_time = 0.001\nloop = {{law = "pd", kp = 1.0, kd = 0.1}}\n'
            f'reference_velocity = "{kind}"\n'
        )
        read = read_controller(file, 1e-3)
        assert read.reference_velocity == kind
        assert tables_of(read)["controller"]["reference_velocity"] == kind
        assert (
            eval(repr(controller), {"Controller": Controller, "Cascade": Cascade}).reference_velocity == kind
        )
    file.write_text(file.read_text().replace("instant", "instantaneous"))
    with pytest.raises(ConfigError, match=r"reference_velocity = .instantaneous. is not known"):
        read_controller(file, 1e-3)


def test_a_recommended_file_keeps_it(tmp_path: Path) -> None:
    import tomli_w

    own = Recommended(
        "feedforward", 0.9, 0.0, 0.0, 1e-3, gains=LOOP, sample_time=T, reference_velocity="difference"
    )
    file = tmp_path / "recommended.toml"
    file.write_bytes(tomli_w.dumps({"recommended": own.table()}).encode())
    again = read_recommended(file)
    assert again.reference_velocity == "difference"
    assert again.controller(ss.Model("coulomb", fc=0.1)).reference_velocity == "difference"


def test_in_continuous_time_there_is_no_difference() -> None:
    with pytest.raises(ParameterError, match="'difference' needs a sampled controller; give a sample_time"):
        Controller(Gains(1.0, 0.0, 0.1), reference_velocity="difference")
    with pytest.raises(ParameterError, match="reference_velocity"):
        Controller(Gains(1.0, 0.0, 0.1), sample_time=T, reference_velocity="mean")  # type: ignore[arg-type]


def test_an_exported_controller_says_so() -> None:
    made = Controller(LOOP, sample_time=T, reference_velocity="difference")
    assert "the reference velocity formed as the difference of two reference positions" in given_by(made)
    assert made.settings.difference == 1.0


def test_a_loops_description_has_it() -> None:
    text = "kv=40,kvp=0.06, reference_velocity = difference ,limit=3"
    assert split_loop(text) == ({"kv": 40.0, "kvp": 0.06, "limit": 3.0}, "difference")
    mapping = {"kv": 40.0, "kvp": 0.06, "reference_velocity": "instant"}
    assert split_loop(mapping) == ({"kv": 40.0, "kvp": 0.06}, "instant")
    assert split_loop(loop_text(mapping)) == split_loop(mapping)
    gains, own, formed = loop_of(text)
    assert (gains, own, formed) == (Cascade(40.0, 0.06), {"limit": 3.0}, "difference")
    assert identify_loop("kp=1,kd=0.1,reference_velocity=difference") == identify_loop("kp=1,kd=0.1")


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: loop_of("kp=1,reference_velocity=diff"), "reference_velocity of loop.*diff"),
        (lambda: loop_of("kp=1,reference_velocity="), "loop 'reference_velocity=' must be NAME=VALUE"),
        (
            lambda: loop_of("kp=1,reference_velocity=instant,reference_velocity=difference"),
            "gives both instant and difference; give reference_velocity once",
        ),
        (lambda: ss.recommend("a.toml", loop={"kp": "1"}), r"loop\['kp'\] = '1' must be a number"),
        (lambda: identify_loop("kp=1,reference_velocity=instant"), "is not in a record"),
        (
            lambda: one_of("instant", "difference", "--loop"),
            "and --loop states difference; leave one",
        ),
    ],
)
def test_what_it_cannot_be_is_refused_in_a_line(call, message) -> None:
    with pytest.raises((InputError, UnknownName), match=message) as refused:
        call()
    assert "\n" not in str(refused.value)
