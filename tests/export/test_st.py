"""The structured text is read by the norm's grammar and its statements give the law's torque."""

import pytest
from structured_text import Program

from laws import farthest, label, registered
from stickslip import plugins
from stickslip.export import st
from stickslip.export.golden import golden
from stickslip.export.job import Job
from stickslip.model import Model

LAWS = [*registered(), *(farthest(law) for law in registered() if law.choices)]
BOUND = 1e-11
"""Of the largest torque: the norm's library has neither expm1 nor a power that rounds as C's does."""


@pytest.mark.parametrize("law", LAWS, ids=label)
def test_the_statements_give_the_torque_of_the_law(law):
    model = Model(law, **dict(law.example))
    program = Program(st.write(Job(model, "friction")).files["friction.st"])
    v = {"p": {}, **program.instance("friction")}
    vectors = golden(model, count=150, seed=3)
    errors = []
    for v0, v1, dt, x, torque in zip(*vectors):
        inner = {**program.instance("friction_step"), "friction_step": 0.0}
        v["u"]["position"] = float(x)
        inner |= {"v0": float(v0), "v1": float(v1), "dt_": float(dt), "z": v["z"], "p": v["p"], "u": v["u"]}
        program.run("friction_step", inner)
        errors.append(abs(inner["friction_step"] - torque))
    assert max(errors) <= BOUND * abs(vectors.torque).max()


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
