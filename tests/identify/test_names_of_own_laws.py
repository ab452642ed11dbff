"""A law of one's own may call its parameters as the package's laws do, and mean something else."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

import stickslip as ss
from support.sines import sines

CAUCHY = '''"""Friction that falls as 1 / (1 + (v / vs)^2)."""
import math
from typing import Annotated, Any, NamedTuple

from stickslip.core.spec import Law, Par


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


def test_an_excess_that_is_called_fs_is_no_static_torque(
    tmp_path: Path, record: dict[str, np.ndarray]
) -> None:
    """It was made equal to `fc`, since no static torque lies below the level."""
    text = CAUCHY.replace("p.df", "p.fs").replace("    df:", "    fs:").replace('"df":', '"fs":')
    (tmp_path / "excess.py").write_text(text.replace('"cauchy"', '"excess"'), encoding="utf-8")
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
    found = ss.identify(
        law=["coulomb", "stribeck_plain", written(tmp_path, {})], torque_is="actual", delay=0.0, **record
    )
    (compared,) = (note for note in found.notes if "held-out misfit" in note)
    assert {"cauchy", "stribeck_plain", "coulomb"} <= set(re.findall(r"\w+", compared))
