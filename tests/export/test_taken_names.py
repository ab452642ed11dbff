"""Exports: names that the target has for itself, laws without a source or docstrings, the velocity of an own law."""

from __future__ import annotations

import pytest

import stickslip as ss
from stickslip.core.errors import InputError
from stickslip.exports._sliding import slowest_scale, velocity_scale

LAW = ss.Model("coulomb", fc=0.3, sigma2=0.02)
OWN = '''"""Friction with an excess at low velocity."""
import math
from typing import Annotated, NamedTuple
from stickslip.core.spec import Law, Par


class Params(NamedTuple):
    level: Annotated[float, Par("N·m", "F", "level", positive=True)]
    excess: Annotated[float, Par("N·m", "dF", "excess", lower=0.0)]
    slow: Annotated[float, Par("rad/s", "w", "velocity of the excess", positive=True)]
    damping: Annotated[float, Par("N·m·s/rad", "c", "viscous", lower=0.0)]


def shape(v, p):
    return p.level + p.excess / (1.0 + (v / p.slow) ** 2)


def steady(v, p):
    if v == 0.0:
        return 0.0
    return math.copysign(shape(v, p), v) + p.damping * v


def step(v0, v1, dt, z, p, u):
    return steady(v1, p)


LAW = Law(
    "excess", Params, step, title="Excess", equation="F", source=(), steady=steady, continuous=False,
    example={"level": 0.5, "excess": 0.15, "slow": 0.1, "damping": 0.02},
)
'''


@pytest.fixture
def own(tmp_path):
    """A law that states neither source nor velocity, with a helper that has no docstring."""
    file = tmp_path / "excess.py"
    file.write_text(OWN)
    return lambda **values: ss.Model(
        str(file), **{"level": 0.5, "excess": 0.15, "slow": 0.1, "damping": 0.02, **values}
    )


@pytest.mark.parametrize(
    ("to", "name"),
    [("python", "class"), ("python", "math"), ("modelica", "model"), ("linuxcnc", "pin"), ("c99", "math")],
)
def test_a_name_that_is_taken_in_the_language_is_refused(to, name):
    """`from class import Contact` was in the README of `class.py`."""
    with pytest.raises(InputError, match=f'name="{name}": .* is taken in {to}; give another name'):
        ss.export(LAW, to=to, name=name)


@pytest.mark.parametrize(
    ("to", "stem"), [("modelica", "model"), ("python", "random"), ("c99", "math"), ("linuxcnc", "pin")]
)
def test_a_files_name_that_is_taken_is_changed_with_a_note(to, stem, tmp_path):
    """`identify` saves model.toml, which `--to modelica` refused for a name that nobody had given."""
    text = 'law = "coulomb"\n\n[parameters]\nfc = 0.3\nsigma2 = 0.02\n'
    for name in (stem, "axis"):
        (tmp_path / f"{name}.toml").write_text(text)
    made = ss.export(tmp_path / f"{stem}.toml", to=to)
    assert made.name == f"{stem}_friction"
    assert any(f"{stem} is taken in {to}; name=" in note for note in made.notes)
    free = ss.export(tmp_path / "axis.toml", to=to)
    assert free.name == "axis"
    assert not any("is taken" in note for note in free.notes)


def test_a_block_that_is_renamed_says_so():
    assert any("the block is called IF_var" in note for note in ss.export(LAW, to="st", name="IF").notes)
    assert not any("is called" in note for note in ss.export(LAW, to="st", name="axis").notes)


@pytest.mark.parametrize("to", ["c99", "st", "matlab"])
def test_no_comment_is_empty(to, own):
    files = ss.export(own(), to=to, name="own").files
    text = "\n".join(t for name, t in files.items() if isinstance(t, str) and not name.endswith(".md"))
    assert "shape()" in text
    for empty in ("/*  */", "(*  *)", "Source: \n", "    % \n"):
        assert empty not in text


def test_a_controllers_law_without_source_ends_without_a_semicolon(tmp_path):
    """The README had "loop: PD; "."""
    text = """from typing import Annotated, NamedTuple
from stickslip.core.control_spec import ControlLaw
from stickslip.core.spec import Par


class Params(NamedTuple):
    kp: Annotated[float, Par("N·m/rad", "k_p", "gain", lower=0.0)]


def sample(y, z, p, u):
    return p.kp * y.error


CONTROL_LAW = ControlLaw("p", Params, sample, "loop", title="P", equation="T", source=(), example={"kp": 1.0})
"""
    (tmp_path / "p.py").write_text(text)
    loop = ss.ControlBlock(str(tmp_path / "p.py"), kp=1.0)
    readme = ss.export(ss.Controller(loop=loop, sample_time=1e-3), to="c99", name="p").files["README.md"]
    assert "- loop: P\n" in readme


def test_the_fmu_says_what_returns_an_error():
    assert "no finite number" in ss.export(LAW, to="fmu", name="x").files["README.md"]


@pytest.mark.parametrize("slow", [1e-3, 0.1, 2.0])
def test_the_velocity_over_which_an_own_law_changes_is_found(slow, own):
    """It was taken as 0.01 rad/s of any law that does not state it, and a robot got no damping."""
    assert velocity_scale(own(slow=slow)) == pytest.approx(slow, rel=0.3)
    assert velocity_scale(LAW) == 0.0


@pytest.mark.parametrize("slow", [0.1, 2.0])
def test_a_smooth_sign_is_not_the_velocity_over_which_an_own_law_changes(slow, tmp_path):
    """The top speed was 100 times the width of its sign, and a robot's law was fitted where the fall had not begun."""
    file = tmp_path / "smooth.py"
    file.write_text(OWN.replace("math.copysign(shape(v, p), v)", "math.tanh(200.0 * v) * shape(v, p)"))
    model = ss.Model(str(file), level=0.5, excess=0.15, slow=slow, damping=0.02)
    assert velocity_scale(model) == pytest.approx(slow, rel=0.3)
    assert slowest_scale(model) == pytest.approx(1.0 / 200.0, rel=0.3)


def test_the_nearest_law_of_a_robot_keeps_the_damping(own):
    made = ss.export(own(), to="urdf", nearest=True, name="joint").files["joint.urdf"]
    damping = float(made.partition('damping="')[2].partition('"')[0])
    assert damping == pytest.approx(0.02, rel=0.1)


@pytest.mark.parametrize("slope", [20.0, 200.0, 2000.0])
@pytest.mark.parametrize("top", [None, 4.0])
def test_the_nearest_law_of_a_smooth_sign_has_its_level_and_damping(slope, top, own, tmp_path):
    """The slope of the sign was fitted too: a damping of 0.052 in place of 0.02."""
    file = tmp_path / "smooth.py"
    file.write_text(OWN.replace("math.copysign(shape(v, p), v)", f"math.tanh({slope} * v) * p.level"))
    model = ss.Model(str(file), level=0.5, excess=0.0, slow=1.0, damping=0.02)
    made = ss.export(model, to="urdf", nearest=True, top_speed=top, name="joint")
    dynamics = made.files["joint.urdf"].partition("<dynamics ")[2]
    friction, damping = (
        float(dynamics.partition(f'{key}="')[2].partition('"')[0]) for key in ("friction", "damping")
    )
    assert friction == pytest.approx(0.5, rel=1e-3)
    assert damping == pytest.approx(0.02, rel=0.02)
