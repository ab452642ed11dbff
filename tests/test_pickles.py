"""What a user sends to another process or keeps comes back as it was, and equal things are equal."""

from __future__ import annotations

import copy
import dataclasses
import pickle
import subprocess
import sys
import threading
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from multiprocessing import get_context
from pathlib import Path

import cloudpickle
import joblib
import numpy as np
import pandas
import pytest

import stickslip as ss
from stickslip.core import errors
from stickslip.laws import gms
from stickslip.laws.gms import LAW as RAW
from stickslip.models import plugins
from stickslip.simulation.machine.loop import rows_at
from support.laws import registered, variants

GMS = {"k": [1e4, 7e3], "alpha": [0.5, 0.5], "c": 24.0, "fs": 0.335, "fc": 0.285, "vs": 0.01}
OWN_LAW = '''"""Friction that rises with the root of the speed."""

import math
from typing import Annotated, NamedTuple

from stickslip.core.spec import Law, Par


class Params(NamedTuple):
    fc: Annotated[float, Par("N·m", "F_C", "level", positive=True)]


def root(v):
    """Of the speed."""
    return math.sqrt(abs(v))


def step(v0, v1, dt, z, p, u):
    """Torque, N·m."""
    return p.fc * root(v1) * v1


LAW = Law(
    "rooted", Params, step, title="Root", equation="F", source=("own",), example={"fc": 0.2},
)
'''
OWN_LOOP = '''"""A PD."""

from typing import Annotated, NamedTuple

from stickslip.core.control_spec import ControlLaw
from stickslip.core.spec import Par


class Params(NamedTuple):
    kp: Annotated[float, Par("N·m/rad", "k_p", "gain", positive=True)]
    kd: Annotated[float, Par("N·m·s/rad", "k_d", "damping", positive=True)]


def sample(y, z, p, u):
    """Torque, N·m."""
    return p.kp * y.error + p.kd * (y.reference_velocity - y.velocity)


CONTROL_LAW = ControlLaw(
    "own_pd", Params, sample, "loop", title="PD", equation="T", source=("own",), example={"kp": 6.3, "kd": 0.1},
)
'''
SINE = ss.Reference("sine", amplitude=0.1, frequency=2.0)
DURATION = 0.05


@pytest.fixture
def own(tmp_path: Path) -> tuple[ss.RigidAxis, ss.Controller, Path]:
    """An axis and a controller of files of one's own, and the law's file."""
    law, loop = tmp_path / "rooted.py", tmp_path / "own_pd.py"
    law.write_text(OWN_LAW, encoding="utf-8")
    loop.write_text(OWN_LOOP, encoding="utf-8")
    friction = ss.Model(str(law), fc=0.3)
    block = ss.ControlBlock(str(loop), kp=8.0, kd=0.1)
    return ss.RigidAxis(1e-3, friction), ss.Controller(loop=block, sample_time=1e-3), law


def usual() -> tuple[ss.RigidAxis, ss.Controller]:
    friction = ss.Model("gms", choices={"slip_rule": "literal"}, **GMS)
    gains = ss.place("PD", 1e-3, 20.0)
    return ss.RigidAxis(1e-3, friction), ss.Controller(
        gains, ss.Feedforward(friction, gain=0.9), sample_time=1e-3
    )


def things() -> list[object]:
    axis, controller = usual()
    lugre = ss.Model("lugre", sigma0=1e3, fs=1.0, fc=0.9, vs=0.1)
    asymmetric = ss.Model("coulomb", choices={"symmetry": "asymmetric"}, fc=1.0, fc_negative=2.0)
    block = ss.ControlBlock(
        "pid", choices={"anti_windup": "back_calculation"}, kp=1.0, ki=1.0, kd=0.1, tracking_time=0.1
    )
    adaptive = ss.Controller(loop=ss.ControlBlock("pd", kp=1.0, kd=0.1), sample_time=1e-3, torque_limit=2.0)
    held = ss.ControlBlock("friction_feedforward", lugre)
    return [
        axis, axis.friction, axis.friction.parameters, controller, controller.gains, controller.compensator, lugre,
        asymmetric, block, block.parameters, held, held.parameters, adaptive, SINE,
        ss.Reference.table([0.0, 1.0, 2.0], [0.0, 0.1, 0.2]), ss.load_machine("thesis-dry"), ss.control_law("pid"),
        ss.simulate(axis, controller, SINE, DURATION),
    ]  # fmt: skip


def copies(thing: object) -> list[object]:
    packed = [pickle.loads(pickle.dumps(thing, protocol)) for protocol in (2, pickle.HIGHEST_PROTOCOL)]
    return [*packed, copy.copy(thing), copy.deepcopy(thing), cloudpickle.loads(cloudpickle.dumps(thing))]


def alike(one: ss.Record, other: ss.Record) -> bool:
    """Bit for bit."""
    return all(np.array_equal(one[name], other[name]) for name in other.channels)


def nearly(one: ss.Record, other: ss.Record) -> bool:
    """To some last digits: of another process, which read a kernel from the cache that this one compiled, or the other
    way round; these may round differently."""
    return one["position"] == pytest.approx(other["position"], rel=1e-9, abs=1e-15)


def test_a_copy_is_equal_and_looks_alike() -> None:
    """Pickles failed on a law's functions, and copies were unequal, as nothing but a model itself equalled it."""
    for thing in things():
        for other in copies(thing):
            assert other == thing, thing
            assert repr(other) == repr(thing)
            assert type(thing).__hash__ is None or hash(other) == hash(thing)


def test_laws_come_back_as_themselves() -> None:
    """So that nothing is compiled again."""
    for law in (*registered(), *variants(), RAW):
        assert all(found is law for found in copies(law)), law
    for name in plugins.reference_names():
        assert all(found is plugins.reference_kind(name) for found in copies(plugins.reference_kind(name)))


def test_default_options_are_those_of_the_law_itself() -> None:
    law = ss.law("gms")
    defaults = {choice.name: choice.default for choice in law.choices}
    assert law.having(**defaults) is law
    assert law.having(slip_rule="literal").having(**defaults) is law
    assert ss.Model("gms", choices=defaults, **GMS) == ss.Model("gms", **GMS)


def test_equality_is_that_of_values() -> None:
    assert ss.Model("coulomb", fc=1) == ss.Model("coulomb", fc=1.0)
    assert hash(ss.Model("coulomb", fc=1)) == hash(ss.Model("coulomb", fc=1.0))
    assert ss.Model("coulomb", fc=1.0) != ss.Model("coulomb", fc=2.0)
    assert ss.Model("gms", **GMS) != ss.Model("gms", choices={"slip_rule": "literal"}, **GMS)
    assert ss.Model("coulomb", fc=1.0) != "coulomb"
    assert ss.Reference("sine", amplitude=1.0, frequency=1.0) != ss.Reference(
        "plain_sine", amplitude=1.0, frequency=1.0
    )
    pid, cascade = ss.Gains(1.0, 2.0, 3.0, 1.0), ss.Cascade(1.0, 2.0, 3.0, 1.0)
    assert pid != cascade
    assert cascade != pid
    assert pid == ss.Gains(1.0, 2.0, 3.0, 1.0)
    machine = ss.load_machine("thesis-dry")
    assert machine == ss.load_machine("thesis-dry")
    assert machine != machine.without("cogging")


def test_records_are_equal_where_their_values_are() -> None:
    axis, controller = usual()
    record, again = (ss.simulate(axis, controller, SINE, DURATION) for _ in range(2))
    # When it was run, and how long that took, is part of a record.
    again = dataclasses.replace(again, meta=record.meta)
    assert again == record
    changed = {**record.channels, "position": record["position"] + 1e-15}
    assert dataclasses.replace(record, channels=changed) != record
    assert dataclasses.replace(record, meta={**record.meta, "more": 1}) != record
    holes = dataclasses.replace(
        record, channels={"position": np.full(len(record), np.nan)}, meta={"x": float("nan")}
    )
    assert copy.deepcopy(holes) == holes
    with pytest.raises(TypeError, match="unhashable"):
        hash(record)


def test_the_text_of_a_thing_makes_it_again() -> None:
    """It left choices out, and options that bring parameters of their own made a text that is refused."""
    names = {name: getattr(ss, name) for name in ss.__all__ if name[0].isupper()}
    made = [
        x
        for x in things()
        if isinstance(x, (ss.Model, ss.RigidAxis, ss.Controller, ss.ControlBlock, ss.Gains))
    ]
    for thing in made:
        assert eval(repr(thing), names) == thing
    assert repr(ss.Gains(np.float64(2.0), kd=0.5)) == "Gains(kp=2.0, kd=0.5)"
    assert repr(ss.Controller(ss.Gains(1.0))) == "Controller(gains=Gains(kp=1.0))"
    assert repr(ss.Feedforward(ss.Model("viscous", sigma2=1.0), gain=0.9)).endswith("gain=0.9)")


def test_own_files_travel_with_their_text(own: tuple[ss.RigidAxis, ss.Controller, Path]) -> None:
    """To a process that starts anew, and where the file is another one by then, or gone."""
    axis, controller, law = own
    names = {"Model": ss.Model, "RigidAxis": ss.RigidAxis}
    assert eval(repr(axis), names) == axis
    packed = pickle.dumps((axis, controller))
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
        law.write_text(law.read_text(encoding="utf-8").replace("* v1", "* v1 * v1"), encoding="utf-8")
        edited = ss.Model(str(law), fc=0.3)
        law.unlink()
        there = pool.submit(ss.simulate, axis, controller, SINE, DURATION)
        other = pool.submit(ss.simulate, ss.RigidAxis(1e-3, edited), controller, SINE, DURATION)
        here = ss.simulate(axis, controller, SINE, DURATION)
        assert alike(ss.simulate(*pickle.loads(packed), SINE, DURATION), here)
        assert nearly(there.result(), here)
        assert edited != axis.friction
        assert not nearly(other.result(), here)
    code = ss.export(axis.friction, to="c99").files["friction.c"]
    assert "sqrt" in str(code)


def test_workers_of_joblib_take_models() -> None:
    axis, controller = usual()
    here = ss.simulate(axis, controller, SINE, DURATION)
    loops = joblib.Parallel(n_jobs=2)(
        joblib.delayed(ss.simulate)(axis, controller, SINE, DURATION) for _ in range(2)
    )
    assert all(nearly(there, here) for there in loops)
    assert alike(ss.simulate(*pickle.loads(pickle.dumps((axis, controller))), SINE, DURATION), here)


def test_what_stands_in_no_file_says_so() -> None:
    """A law made in a function, and one whose module another process does not have."""

    def step(v0, v1, dt, z, p, u):
        return p.fc * v1

    made = ss.Law(
        "inside", RAW.Params, step, title="t", equation="e", source=("own",), example=dict(RAW.example)
    )
    with pytest.raises(errors.LawError, match="'inside' cannot be sent to another process or kept"):
        pickle.dumps(made)
    sent = pickle.dumps(made.coming_from(plugins.completed, RAW))
    assert pickle.loads(sent) is ss.law("gms")
    lost = "from stickslip.core.pickling import in_module; in_module('nowhere', 'LAW', 'mine')"
    found = subprocess.run([sys.executable, "-c", lost], capture_output=True, text=True, check=False)
    assert (
        "LawError: 'mine' was LAW of the module 'nowhere', which has none here; write it in a file"
        in found.stderr
    )


def test_errors_come_back_from_a_worker() -> None:
    """Those whose constructor takes more than a message could not be unpacked, and a pool waited for them for ever."""
    record = ss.simulate(*usual(), SINE, DURATION)
    for error in (
        errors.UnknownName("law", "x", ["y"]),
        errors.StepFailure("late", 1.5, record),
        errors.CodeRefused("no", "x.py", b"1"),
    ):
        there = pickle.loads(pickle.dumps(error))
        assert type(there) is type(error)
        assert str(there) == str(error)
        assert vars(there) == vars(error)


def test_options_of_a_raw_law_are_those_of_its_family() -> None:
    """They were a second family, whose law without options had no way back."""
    literal = RAW.having(slip_rule="literal")
    model = ss.Model(literal, **GMS)
    assert model == ss.Model("gms", {"slip_rule": "literal"}, **GMS)
    assert model.law.having(slip_rule="signed") is ss.law("gms")
    assert pickle.loads(pickle.dumps(model)) == model


def test_a_file_may_end_in_a_law_with_options(tmp_path: Path) -> None:
    """Another process finds it with its options, and without them."""
    file = tmp_path / "literal.py"
    body = Path(gms.__file__).read_text(encoding="utf-8")
    file.write_text(f'{body}\nLAW = LAW.having(slip_rule="literal")\n', encoding="utf-8")
    law = ss.law(str(file))
    assert law.option_of("slip_rule") == "literal"
    for found in (law, law.having(slip_rule="signed")):
        find, arguments = found.variants[()].home
        assert find(*arguments) is found.variants[()]
        assert arguments[0] == str(file)
        assert pickle.loads(pickle.dumps(found)) is found


def test_threads_get_one_law(tmp_path: Path) -> None:
    file = tmp_path / "rooted.py"
    file.write_text(OWN_LAW, encoding="utf-8")
    together = threading.Barrier(4)

    def found(_: int) -> object:
        together.wait()
        return ss.law(str(file))

    with ThreadPoolExecutor(4) as pool:
        assert len(set(pool.map(found, range(4)))) == 1


def test_a_name_too_long_for_a_file_is_unknown() -> None:
    for make in (ss.Model, ss.ControlBlock):
        with pytest.raises(errors.UnknownName):
            make("x" * 300)
        with pytest.raises(errors.LawError):
            make("x" * 300 + ".py")


class Column:
    """As of a data frame that has no `tolist`."""

    shape = (2,)

    def __iter__(self):
        return iter([1e4, 7e3])


def test_numbers_of_other_kinds() -> None:
    """Columns, NumPy's numbers in what is printed and as a spacing, and what a record's meta may hold."""
    assert ss.Model("gms", **{**GMS, "k": Column()}) == ss.Model("gms", **GMS)
    assert "np." not in repr(ss.Controller(ss.Gains(np.float32(1.0), np.int64(1))))
    axis, controller = usual()
    whole = ss.simulate(axis, controller, SINE, DURATION, output=0.01)
    machine = ss.load_machine("thesis-dry")
    assert len(ss.simulate(axis, controller, SINE, DURATION, output=np.float32(0.01))) == len(whole)
    assert len(ss.simulate(axis, controller, SINE, DURATION, output=np.int64(1))) >= 1
    assert rows_at(np.float32(machine.sample_time), machine.sample_time, 0.1).size > 2
    one, other = (dataclasses.replace(whole, meta={"n": pandas.Series([1.0, np.nan])}) for _ in range(2))
    assert one == other
    assert one != dataclasses.replace(whole, meta={"n": pandas.Series([1.0, 2.0])})
