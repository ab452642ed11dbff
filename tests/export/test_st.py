"""The structured text is read by the norm's grammar and its statements give the law's torque."""

from pathlib import Path
from tempfile import TemporaryDirectory
from types import SimpleNamespace

import numpy as np
import pytest
from lark.exceptions import UnexpectedInput

from stickslip.core.spec import Surroundings
from stickslip.exports import st
from stickslip.exports.golden import PACE, golden_around
from stickslip.exports.job import Job
from stickslip.models import plugins
from stickslip.models.model import Model
from support import matiec
from support.laws import farthest, label, registered
from support.structured_text import Program

HERE = Path(__file__).parent
HARD = [plugins.law(str(HERE.parent / "support" / f"{name}.py")) for name in ("odd_names", "hard_names")]
LAWS = [*HARD, *registered(), *(farthest(law) for law in registered() if law.choices)]
BOUND = 1e-11
"""Of the largest torque: the norm's library has neither expm1 nor a power that rounds as C's does."""


@pytest.mark.parametrize("law", LAWS, ids=label)
def test_the_statements_give_the_torque_of_the_law(law):
    model = Model(law, **dict(law.example))
    program = Program(st.write(Job(model, "friction")).files["friction.st"])
    v = {"p": {}, **program.instance("friction")}
    vectors = golden_around(model, PACE, count=150, seed=3)
    third = list(program.instance("friction_step"))[2]  # dt, a word of the norm
    word = dict(zip(Surroundings._fields, v["u"]))
    errors = []
    for v0, v1, dt, x, torque, *around in zip(*vectors):
        inner = {**program.instance("friction_step"), "friction_step": 0.0, third: float(dt)}
        for name, value in zip(("position", "load", "temperature", "time"), (x, *around)):
            v["u"][word[name]] = float(value)
        inner |= {"v0": float(v0), "v1": float(v1), "z": v["z"], "p": v["p"], "u": v["u"]}
        program.run("friction_step", inner)
        errors.append(abs(inner["friction_step"] - torque))
    assert max(errors) <= BOUND * abs(vectors.torque).max()


@pytest.mark.skipif(bool(matiec.missing()), reason=f"needs {', '.join(matiec.missing())}")
@pytest.mark.parametrize("law", LAWS, ids=label)
def test_a_real_compiler_takes_it_and_gives_the_torque_of_the_law(law, tmp_path):
    model = Model(law, **dict(law.example))
    (tmp_path / "friction.st").write_text(st.write(Job(model, "friction")).files["friction.st"])
    assert matiec.translated(tmp_path / "friction.st", tmp_path) == ""
    vectors = golden_around(model, count=2000, seed=3)
    v0, dt, x = vectors.v0, vectors.dt, vectors.position
    still = (np.full(v0.size, value) for value in (1.0, 20.0))
    load, temperature = vectors[5:7] or tuple(still)
    z, u = law.state(model.parameters), SimpleNamespace(**Surroundings()._asdict())
    expected = []
    rows = zip(*(column.tolist() for column in (v0, dt, x, load, temperature)))
    for k, (speed, time, u.position, u.load, u.temperature) in enumerate(rows):
        last = v0[k - 1].item() if k else speed
        u.time += time if k else 0.0
        expected.append(law.step(last, speed, time if k else 0.0, z, model.parameters, u))
    found = matiec.torques("friction", tmp_path, v0, dt, x, load, temperature)
    assert np.abs(found - expected).max() <= BOUND * np.abs(expected).max()


@pytest.mark.parametrize(
    "name", ["end_if", "my_end_function_x", "end_program", "torque", "my__axis_", "LIMIT", "u"]
)
def test_a_block_has_a_name_that_the_norm_permits(name):
    text = st.write(Job(Model("coulomb", fc=0.3), name)).files[f"{name}.st"]
    program = Program(text)
    assert len(program.types) == 3
    if not matiec.missing():
        with TemporaryDirectory() as folder:
            Path(folder, "friction.st").write_text(text)
            assert matiec.translated(Path(folder, "friction.st"), folder) == ""


@pytest.mark.parametrize(
    ("wrong", "right"),
    [("dt_", "dt_var"), ("d__t", "dt_var"), ("time", "dt_var"), ("V0", "dt_var"), ("friction_step", "dt_var"),
     ("done := 0.0", "done := TRUE"), ("1.0E-3", "1E-3"), ("IF 1.0 THEN", "IF TRUE THEN")],
)  # fmt: skip
def test_the_grammar_is_as_strict_as_the_norm(wrong, right):
    """What a compiler refuses is refused here, in a file that is fine otherwise."""
    text = """TYPE friction_state : STRUCT z : LREAL; END_STRUCT; END_TYPE
FUNCTION friction_step : LREAL
VAR_INPUT v0 : LREAL; dt_var : LREAL; END_VAR
VAR done : BOOL; END_VAR
    done := TRUE;
    IF TRUE THEN
        friction_step := v0 * 1.0E-3;
    END_IF;
END_FUNCTION
"""
    wrong, right = (right, wrong) if wrong == "1.0E-3" else (wrong, right)

    def run(program):
        Program(program).run("friction_step", {"v0": 1.0, "friction_step": 0.0, "done": False})

    run(text)
    assert right in text
    with pytest.raises((AssertionError, UnexpectedInput)):
        run(text.replace(right, wrong))


def test_the_block_runs_from_rest_and_restarts():
    law = plugins.law("lugre")
    model = Model(law, **dict(law.example))
    program = Program(st.write(Job(model, "friction")).files["friction.st"])
    block = program.instance("friction")
    z, p, last = law.state(model.parameters), model.parameters, 0.01

    def cycle(velocity, restart=False):
        block.update(velocity=velocity, sample_time=1e-3, position=0.0, restart=restart)
        program.run("friction", block)
        return block["torque"]

    first = cycle(0.01)
    assert first == pytest.approx(law.step(0.01, 0.01, 0.0, z, p, None), abs=1e-15)
    for velocity in (0.02, 0.05, -0.01, 0.0):
        expected = law.step(last, velocity, 1e-3, z, p, None)
        assert cycle(velocity) == pytest.approx(expected, abs=1e-12)
        last = velocity
    assert cycle(0.01, restart=True) == first
