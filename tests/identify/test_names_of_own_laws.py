"""A law of one's own may call its parameters as the package's laws do, and mean something else."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

import stickslip as ss
from stickslip import plugins
from stickslip.identify.axis.form import never_falls, of_sliding_form, static_by_name
from stickslip.laws import LAWS
from stickslip.model import Model
from support.sines import sines

CAUCHY = '''"""Friction that falls as 1 / (1 + (v / vs)^2)."""
import math
from typing import Annotated, Any, NamedTuple

from stickslip.spec import Law, Par


class Params(NamedTuple):
    fc: Annotated[float, Par("N·m", "F_C", "level at high velocity", positive=True)]
    df: Annotated[float, Par("N·m", "dF", "excess at rest", lower=0.0)]
    vs: Annotated[float, Par("rad/s", "v_s", "velocity of the fall", positive=True)]
    sigma2: Annotated[float, Par("N·m·s/rad", "sigma_2", "viscous coefficient", lower=0.0)]


def steady(v: float, p: Any) -> float:
    r = v / p.vs
    return math.tanh(200.0 * v) * (p.fc + p.df / (1.0 + r * r)) + p.sigma2 * v


def step(v0: float, v1: float, dt: float, z: Any, p: Any, u: Any) -> float:
    return steady(v1, p)


LAW = Law(
    "cauchy", Params, step, title="Cauchy's fall", equation="F(v)", source=(), steady=steady, passive="always",
    example={"fc": 0.5, "df": 0.2, "vs": 0.1, "sigma2": 0.02},
)
'''
TRUTH = {"fc": 0.5, "df": 0.2, "vs": 0.3, "sigma2": 0.02}
OTHER = {"fc": "level", "df": "excess", "vs": "fall", "sigma2": "slope"}


@pytest.fixture(scope="module")
def record() -> dict[str, np.ndarray]:
    """Six seconds of three sines, and the torque of an inertia of 0.003 kg·m² under that friction, with noise."""
    t = 1e-3 * np.arange(6001)
    q, v, a = sines(t, ((0.9, 0.7, 0.0), (0.35, 1.7, 1.0), (0.12, 3.1, 2.0)))
    friction = np.tanh(200.0 * v) * (0.5 + 0.2 / (1.0 + (v / 0.3) ** 2)) + 0.02 * v
    torque = 0.003 * a + friction + 0.005 * np.random.default_rng(7).standard_normal(t.size)
    return {"t": t, "position": q, "torque": torque}


def written(folder: Path, names: dict[str, str]) -> str:
    """The law's file, its parameters under these names."""
    text = CAUCHY
    for old, new in names.items():
        text = (
            text.replace(f"p.{old}", f"p.{new}")
            .replace(f"    {old}:", f"    {new}:")
            .replace(f'"{old}":', f'"{new}":')
        )
    (folder / "cauchy.py").write_text(text, encoding="utf-8")
    return str(folder / "cauchy.py")


def test_a_name_that_means_another_thing_is_a_name(tmp_path: Path, record: dict[str, np.ndarray]) -> None:
    """As under names that no law of the package has: certain sliding fits another curve than this one."""
    folders = [tmp_path / "own", tmp_path / "renamed"]
    for folder in folders:
        folder.mkdir()
    found = ss.identify(law=written(folders[0], {}), torque_is="actual", delay=0.0, **record)
    renamed = ss.identify(law=written(folders[1], OTHER), torque_is="actual", delay=0.0, **record)
    for name, other in OTHER.items():
        assert found[name].value == pytest.approx(renamed[other].value, rel=1e-6)
        assert found[name].identified == renamed[other].identified
    for name, value in TRUTH.items():
        e = found[name]
        assert not e.identified or e.lower <= value <= e.upper


def test_the_packages_own_names_mean_what_sliding_tells() -> None:
    for name in LAWS:
        model = Model(name, **plugins.law(name).example)
        assert of_sliding_form(model, 0.1, 10.0), name
        assert static_by_name(model), name
    slow = Model("stribeck", k=0.5, fs=0.335, fc=0.285, vs=0.01, sigma2=0.018)
    assert static_by_name(slow)  # a slope so flat that its fall begins before fs is reached
    law = plugins.law("lugre").having(viscous="power")
    assert not of_sliding_form(Model(law, **law.example), 0.1, 10.0)


def test_the_form_does_not_depend_on_the_numbers_of_the_example(tmp_path: Path) -> None:
    """A fall far below the slowest sliding is none there, whatever the example's."""
    law = plugins.law(written(tmp_path, {}))
    assert of_sliding_form(Model(law, fc=0.5, df=0.2, vs=1e-5, sigma2=0.02), 0.1, 10.0)
    assert not of_sliding_form(Model(law, fc=0.5, df=0.2, vs=0.3, sigma2=0.02), 0.1, 10.0)


def test_a_contact_that_creeps_on_a_steep_slope_is_of_the_same_law() -> None:
    """A slope fitted so flat that the slowest rows lie on it: level and fall of the rows above are still those."""
    for slope in (3.5e4, 10.0, 1.0):
        assert of_sliding_form(Model("stribeck", k=slope, fc=0.5, fs=0.7, vs=0.3, sigma2=0.02), 0.1, 10.0), (
            slope
        )


def test_an_excess_that_is_called_fs_is_no_static_torque(
    tmp_path: Path, record: dict[str, np.ndarray]
) -> None:
    """It was made equal to `fc`, since no static torque lies below the level."""
    text = CAUCHY.replace("p.df", "p.fs").replace("    df:", "    fs:").replace('"df":', '"fs":')
    (tmp_path / "excess.py").write_text(text.replace('"cauchy"', '"excess"'), encoding="utf-8")
    law = plugins.law(str(tmp_path / "excess.py"))
    assert not static_by_name(Model(law, fc=0.5, fs=0.2, vs=0.3, sigma2=0.02))
    found = ss.identify(law=str(tmp_path / "excess.py"), torque_is="actual", delay=0.0, **record)
    assert found["fs"].value == pytest.approx(0.2, rel=0.05)


def test_a_curve_that_ends_in_a_large_number_does_not_end_the_identification(
    tmp_path: Path, record: dict[str, np.ndarray]
) -> None:
    """`math.cosh` of a speed that no record has is an OverflowError in plain Python."""
    text = CAUCHY.replace("p.df / (1.0 + r * r)", "p.df / math.cosh(r)").replace('"cauchy"', '"sech"')
    (tmp_path / "sech.py").write_text(text, encoding="utf-8")
    found = ss.identify(law=["coulomb", str(tmp_path / "sech.py")], torque_is="actual", delay=0.0, **record)
    assert found.model is not None


def test_a_law_of_ones_own_that_falls_is_compared(tmp_path: Path, record: dict[str, np.ndarray]) -> None:
    """It has no `fs`; those that cannot fall are left out, and that is said."""
    found = ss.identify(
        law=["coulomb", "stribeck_plain", written(tmp_path, {})], torque_is="actual", delay=0.0, **record
    )
    (said,) = (note for note in found.notes if note.startswith("Not compared"))
    assert said.endswith(": coulomb.")
    (compared,) = (note for note in found.notes if "held-out misfit" in note)
    assert {"cauchy", "stribeck_plain"} <= set(re.findall(r"\w+", compared))


def test_which_laws_cannot_fall() -> None:
    assert {n for n in LAWS if never_falls(plugins.law(n))} == {
        "coulomb", "viscous", "static", "dahl", "maxwell_slip",
    }  # fmt: skip


def test_much_viscous_friction_hides_no_fall(tmp_path: Path) -> None:
    path = written(tmp_path, {})
    text = Path(path).read_text(encoding="utf-8").replace('"sigma2": 0.02}', '"sigma2": 3.0}')
    Path(path).write_text(text, encoding="utf-8")
    assert not never_falls(plugins.law(path))
