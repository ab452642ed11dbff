"""Control laws of one's own that cannot run: one line names the author's file, line and remedy."""

from __future__ import annotations

import re

import pytest

import stickslip as ss
from stickslip.analyse.controller_loop import linearised
from stickslip.core.errors import Divergence, InputError, LawError
from stickslip.studies.build import Numerics
from stickslip.studies.planned_run import PlannedRun
from stickslip.sweeps.measured import measured

HEAD = '''"""A law of one's own."""
import math
import numpy as np
from typing import Annotated, NamedTuple
from stickslip.core.control_spec import ControlLaw
from stickslip.core.spec import Par


class Params(NamedTuple):
    kp: Annotated[float, Par("N·m/rad", "k_p", "gain", lower=0.0)]


class State(NamedTuple):
    w: Annotated[STATE, Par("N·m", "w", "memory")]


'''
SAMPLE = "def sample(y, z, p, u):\n"
TAIL = """

CONTROL_LAW = ControlLaw(
    "own", Params, sample, "loop", title="t", equation="T", source=(), example={"kp": 10.0}, State=State
)
"""
LINE = HEAD.count("\n") + 2
"""Of the first statement of `sample`."""


@pytest.fixture
def block(tmp_path):
    """The block of a law with this text of `sample`."""

    def made(body: str, sample: str = SAMPLE, state: str = "float") -> ss.ControlBlock:
        text = HEAD.replace("STATE", state) + sample + "".join(f"    {line}\n" for line in body.split("\n"))
        file = tmp_path / "own.py"
        file.write_text(text + TAIL)
        return ss.ControlBlock(str(file), kp=10.0)

    return made


REFUSED = {
    "p.kp = 3.0\nreturn p.kp": "`p.kp = ...` writes a parameter, which a law only reads",
    "p.kp += 3.0\nreturn p.kp": "`p.kp = ...` writes a parameter, which a law only reads",
    "y.error = 3.0\nreturn p.kp": "`y.error = ...` writes an input, which a law only reads",
    "u.load = 3.0\nreturn p.kp": "`u.load = ...` writes a quantity of the surroundings",
    "p = 3.0\nreturn p": "hides the argument 'p'",
    "z.w = y.error": "goes on here without returning a number",
    "return float(np.tanh(y.error))": "`np.tanh` is outside the scalar subset; use math.tanh",
    "return float(np.sign(y.error))": "use math.copysign",
    "return float(np.fft(y.error))": "of modules only math is read",
    "try:\n    return y.error\nexcept ValueError:\n    return 0.0": "`Try` is outside the scalar subset",
    "return y.eror": "y has no field 'eror'; did you mean 'error'",
}


@pytest.mark.parametrize("body", REFUSED)
def test_it_is_refused_when_the_file_is_read_with_its_own_line(body, block):
    """The first three ran in Python and ended in an export; others named a text that nobody has written."""
    with pytest.raises(LawError) as found:
        block(body)
    said = str(found.value)
    assert REFUSED[body] in said
    assert f"own.py, line {LINE}:" in said
    assert "\n" not in said


def test_a_helper_is_held_to_the_same(block):
    with pytest.raises(LawError, match=r"own.py, line .*`par.kp = ...` writes a parameter"):
        block(
            "return help_out(y, p)",
            "def help_out(seen, par):\n    par.kp = seen.error\n    return 0.0\n\n" + SAMPLE,
        )


def test_what_is_no_function_of_its_arguments_is_refused(block):
    method = (
        "class H:\n    def sample(self, y, z, p, u):\n        return p.kp\nsample = H().sample\ndef no():\n"
    )
    with pytest.raises(
        LawError, match=r"own.py, line .*sample is a method; write it as `def sample\(y, z, p, u"
    ):
        block("return 0.0", method)
    with pytest.raises(LawError, match=r"own.py, line .*takes \(y, z\); write it as"):
        block("return 0.0", "def sample(y, z):\n")


def test_a_state_of_no_length_is_refused(block):
    """It ended in a ValueError, and its elements were written beside the state."""
    with pytest.raises(LawError, match="state 'w' has a value per element, and no parameter tells how many"):
        block("z.w[0] = y.error\nreturn p.kp", state="tuple[float, ...]")


def test_arguments_may_have_other_names(block):
    assert (
        block("seen = s.error\nreturn par.kp * seen", "def sample(s, own, par, around):\n").law.name == "own"
    )


def test_a_friction_law_that_writes_its_parameters_is_refused(tmp_path):
    text = """from typing import Annotated, NamedTuple
from stickslip.core.spec import Law, Par


class Params(NamedTuple):
    fc: Annotated[float, Par("N·m", "F_C", "level", positive=True)]


def step(v0, v1, dt, z, p, u):
    p.fc = 2.0
    return p.fc * v1


LAW = Law("writes", Params, step, title="t", equation="F", source=(), example={"fc": 1.0})
"""
    file = tmp_path / "writes.py"
    file.write_text(text)
    with pytest.raises(LawError, match=r"writes.py, line 10: `p.fc = ...` writes a parameter"):
        ss.Model(str(file), fc=1.0)


# ---- a torque that is no number ------------------------------------------------------------------------------------

AXIS = ss.RigidAxis(1e-3, ss.Model("coulomb", fc=0.1))
SINE = ss.Reference("sine", amplitude=0.1, frequency=1.0)


def controller(loop: ss.ControlBlock, **more) -> ss.Controller:
    return ss.Controller(loop=loop, sample_time=1e-3, torque_limit=2.0, **more)


@pytest.mark.parametrize("axis", ["axis", "machine"])
def test_a_controller_that_gives_no_number_is_named_with_what_it_was_handed(axis, block):
    """It was "no step that meets the tolerance was found"."""
    plant = AXIS if axis == "axis" else ss.load_machine("thesis-dry")
    late = "if y.reference > 0.001:\n    return p.kp * math.sqrt(-y.reference)\nreturn p.kp * y.error"
    with pytest.raises(Divergence) as found:
        ss.simulate(plant, controller(block(late)), SINE, 0.2)
    said = str(found.value)
    assert "the loop 'own' gave no finite number in sample" in said
    assert "(of 0.001 s each)" in said
    assert "reference = 0.00" in said
    assert found.value.time > 0.01
    assert found.value.record.time[-1] >= found.value.time - 2e-3


def test_the_place_is_told_where_it_can_be(block):
    ahead = ss.ControlBlock("inertia_feedforward", inertia=1e-3)
    with pytest.raises(Divergence, match="the loop 'own' gave no"):
        ss.simulate(AXIS, controller(block("return y.error / y.velocity"), feedforward=ahead), SINE, 0.2)


def test_an_export_says_where_plain_python_ends(tmp_path, block):
    """It was a traceback."""
    bad = controller(block("return math.sqrt(y.error)"))
    with pytest.raises(LawError, match=rf"own.py, line {LINE}: ValueError .*test the value with `if`"):
        ss.export(bad, to="c99", folder=tmp_path / "c")


# ---- the linear loop about rest ------------------------------------------------------------------------------------


@pytest.mark.parametrize("width", [1.0, 0.1, 1e-2, 1e-4])
def test_a_smooth_law_is_linear_about_rest_however_soon_it_bends(width, block):
    """Laws that bend within 0.02 rad/s were refused: 1e-5 rad are 0.01 rad/s in a sample."""
    bent = controller(block(f"return -{width} * math.tanh(y.velocity / {width})"))
    straight = controller(block("return -1.0 * y.velocity"))
    found, wanted = (linearised(c, 1e-6, 100.0).state_space() for c in (bent, straight))
    assert found[3] == pytest.approx(wanted[3], rel=1e-4)


@pytest.mark.parametrize("power", [1.3, 1.5, 2.0])
@pytest.mark.parametrize("layer", [1e-4, 0.5])
def test_a_law_that_bends_at_once_has_the_slope_of_rest(power, layer, block):
    """|s|^1.5 in a boundary layer was refused as not smooth, and a boundary layer advised."""
    straight = "0.02 * s + 3.0 * y.error"
    surface = "s = 60.0 * y.error + y.reference_velocity - y.velocity\n"
    sat = f"min(max(s / {layer}, -1.0), 1.0)"
    bent = f"{surface}return {straight} + 0.05 * abs({sat}) ** {power - 1.0} * {sat}"
    found, wanted = (
        linearised(controller(block(text)), 1e-6, 100.0).state_space()
        for text in (bent, f"{surface}return {straight}")
    )
    assert found[3] == pytest.approx(wanted[3], rel=1e-3)


@pytest.mark.parametrize(
    ("body", "what"),
    [
        ("return -math.copysign(0.1, y.velocity)", "after a change of .*, the torque .*: a sign, a jump"),
        ("return math.sqrt(abs(y.error)) * math.copysign(1.0, y.error)", "after .*, the torque .*: .* or a root"),
        ("return math.sqrt(abs(y.error))", "after .*, the torque .*: a sign, a jump or a root"),
        ("return -abs(y.velocity)", "after .*, the torque .*: a kink"),
        ("z.w = max(y.velocity, 0.0)\nreturn z.w", "after .*, loop.w changes by .*: a kink"),
    ],
)  # fmt: skip
def test_a_bend_at_rest_is_refused_with_what_it_is_and_its_remedy(body, what, block):
    with pytest.raises(
        InputError, match=rf"own is not smooth about rest \({what}.*write a smooth function in place"
    ):
        linearised(controller(block(body)), 1e-6, 100.0)


def test_no_torque_at_rest_is_no_linear_loop(block):
    with pytest.raises(LawError, match=r"own.py, line .*ZeroDivisionError"):
        linearised(controller(block("return y.error / y.velocity")), 1e-6, 100.0)
    with pytest.raises(InputError, match="gives a torque that is not finite at rest"):
        linearised(controller(block("return y.error * math.inf")), 1e-6, 100.0)


def test_a_helper_that_was_edited_is_read_again(block):
    """The law's own lines are the same."""
    inner = "def sample(y, z, p, u):\n    return helped(y.error)\n\n\ndef helped(e):\n"
    block("return 2.0 * e", sample=inner)
    with pytest.raises(LawError, match=r"own.py, line .*`Try` is outside the scalar subset"):
        block("try:\n    return e\nexcept ValueError:\n    return 0.0", sample=inner)


def test_a_sweep_names_the_controller_that_gives_no_number(block):
    """Its reason was empty."""
    loop = controller(block("return p.kp * math.sqrt(-y.reference)"))
    run = PlannedRun("own", "sine", "coulomb", "own", AXIS, loop, SINE, 0.1, Numerics())
    (said,) = measured(run, {}, ["position_rms_rad"], 1).failures
    assert re.match(r"ended at \S+ s: the loop 'own' gave no finite number in sample", said)


def test_an_option_outside_the_subset_is_refused_when_it_is_chosen(block, tmp_path):
    """It was first refused when a controller was compiled."""
    block("return y.error")
    text = (tmp_path / "own.py").read_text()
    before, after = text.split("def sample")
    options = """
from stickslip.core.spec import Choice, Option


class Nothing(NamedTuple):
    pass


def shaped(e):
    return e


def steep(e):
    try:
        return 2.0 * e
    except ValueError:
        return 0.0


"""
    file = tmp_path / "chosen.py"
    chosen = (
        'choices=(Choice("shape", "shaped", {"flat": Option(function=shaped), '
        '"steep": Option(function=steep)}, "flat"),), State=State'
    )
    file.write_text(
        before
        + options
        + "def sample"
        + after.replace("State=State", chosen).replace("y.error", "shaped(y.error)")
    )
    ss.ControlBlock(str(file), kp=10.0)
    with pytest.raises(LawError, match=r"chosen.py, line .*`Try` is outside the scalar subset"):
        ss.ControlBlock(str(file), choices={"shape": "steep"}, kp=10.0)
