"""Whatever stands in an argument's place, it works or is refused in one line that names the argument.

Every callable of the package and every public method of what it hands back is called once as it should be, and then
with something wild in the place of each of its arguments in turn.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from types import MappingProxyType, SimpleNamespace
from typing import Any, NamedTuple

import numpy as np
import pytest

import stickslip as ss
from stickslip.analyse.controller_margins import ControllerStability
from stickslip.core.config import Document, Table
from stickslip.exports import target_named
from stickslip.identification.compare.change import Comparison
from stickslip.identification.doctor import Diagnosis
from stickslip.identification.estimate import Identification
from stickslip.identification.identified_file import Identified
from stickslip.machines.drivetrain import LinearContact
from stickslip.recommendation.recommendation import Recommendation
from stickslip.sweeps.plan import Sweep
from stickslip.sweeps.tune import Tuned
from stickslip.verbs import learn
from stickslip.verbs.reading import Reading

SWEEPS = Path(__file__).parents[1] / "sweep"
STUDY = Path(__file__).parents[1] / "data" / "small_study.toml"
WILD: dict[str, Any] = {
    "3": 3, "2.5": 2.5, "foo": "foo", "None": None, "object": object(), "list": [1, "a"], "dict": {},
}  # fmt: skip
MEANT = {
    "3": "float int Any", "2.5": "float Any", "foo": "str Any Literal Loops IdentifiedModel Source",
    "None": "None Any ArrayLike Blocks Loops", "object": "",
    "list": "", "dict": "Mapping Any",
}  # fmt: skip
"""Of each wild thing, what annotations that it may be meant for say."""
T = np.arange(0.0, 1.0, 0.01)
LAW, BRISTLE = ss.Model("coulomb", fc=0.3), ss.Model("dahl", sigma0=3e4, fc=0.3)
AXIS, GAINS = ss.RigidAxis(1e-3, LAW), ss.pd(4.0, 0.1)
SINE, BLOCK = ss.Reference("sine", amplitude=0.1, frequency=1.0), ss.ControlBlock("pd", kp=1.0, kd=0.1)
LOOP, SAMPLED = ss.Controller(GAINS), ss.Controller(GAINS, ss.Feedforward(LAW), sample_time=1e-3)
RECORD = ss.Record(T, {"position": np.sin(T)}, {"position": "rad"})
DATA = {"time [s]": T, "position [rad]": np.sin(T), "torque [Nm]": np.cos(T)}
RUNS = {"axis": AXIS, "controller": LOOP, "reference": SINE, "duration": 1e-3}


def bare(kind: type[Any]) -> Any:
    """One of a class that nothing is asked of."""
    return object.__new__(kind)


class Reached(ss.InputError):
    """The work would begin: nothing was wrong with the arguments."""


def reached(*_: object, **__: object) -> Any:
    raise Reached


def own(thing: Any) -> dict[str, Any]:
    """What a law or a parameter was made with."""
    names = inspect.signature(type(thing)).parameters
    return {n: getattr(thing, n) for n in names if hasattr(thing, n)}


class Call(NamedTuple):
    function: Callable[..., Any]
    given: Mapping[str, Any] = MappingProxyType({})
    first: tuple[Any, ...] = ()
    """What it is called on."""


def calls() -> dict[str, Call]:
    """Every one as it should be."""
    law, control, par = ss.law("coulomb"), ss.control_law("pd"), ss.law("coulomb").fields[0].par
    table = Table({"law": "coulomb", "parameters": {"fc": 0.3}}, Document("model.toml", Path()))
    sweep = SimpleNamespace(metrics=[], runs=["", ""], drawn=SimpleNamespace(nested=False), varied=str.split)
    swept = SimpleNamespace(folder=Path(), sweep=sweep)
    whole = bare(ss.RecommendationResult)
    return {
        "Amplifier": Call(ss.Amplifier, {"torque_constant": 0.2, "command": ss.Converter(12, 5.0)}),
        "Bearings": Call(ss.Bearings, {"coulomb": 0.01}),
        "Cascade": Call(ss.Cascade, {"kv": 10.0, "kvp": 0.1}),
        "ControlBlock": Call(ss.ControlBlock, {"law": "pd", "kp": 1.0, "kd": 0.1}),
        "ControlBlock.function": Call(BLOCK.function, {"name": "sample"}),
        "ControlBlock.holding": Call(BLOCK.holding, {"change": lambda model: model}),
        "ControlBlock.with_values": Call(BLOCK.with_values, {"values": {"kp": 2.0}, "friction": {}}),
        "ControlLaw": Call(ss.ControlLaw, own(control)),
        "ControlLaw.having": Call(control.having),
        "Controller": Call(ss.Controller, {"gains": GAINS, "sample_time": 1e-3}),
        "Controller.holding": Call(SAMPLED.holding, {"change": lambda model: model}),
        "Controller.learned": Call(SAMPLED.learned, {"z": SAMPLED.state()}),
        "Controller.packed_state": Call(SAMPLED.packed_state),
        "Controller.state": Call(SAMPLED.state),
        "Controller.unpacked_state": Call(SAMPLED.unpacked_state, {"flat": SAMPLED.packed_state()}),
        "Controller.with_blocks": Call(SAMPLED.with_blocks, {"blocks": [BLOCK]}),
        "Controller.with_numbers": Call(SAMPLED.with_numbers, {"numbers": {"kp": 2.0}}),
        "Controller.with_values": Call(SAMPLED.with_values, {"values": {"loop_kp": 2.0}}),
        "Diagnosis.raise_for_errors": Call(Diagnosis.raise_for_errors, {}, (Diagnosis((), RECORD),)),
        "ExportResult": Call(ss.ExportResult, {"target": target_named("c99"), "name": "x", "files": {}}),
        "ExportResult.save": Call(ss.ExportResult.save, {"folder": "x"}, (bare(ss.ExportResult),)),
        "Contact": Call(ss.Contact, own(ss.Contact(LAW, bearings=ss.Bearings(0.1)))),
        "Converter": Call(ss.Converter, {"bits": 12, "range": 5.0}),
        "Drift": Call(ss.Drift, {"change": 0.1}),
        "Encoder": Call(ss.Encoder, {"counts": 4096.0}),
        "Feedback": Call(ss.Feedback, {"model": LAW}),
        "Feedforward": Call(ss.Feedforward, {"model": LAW}),
        "FlexibleAxis": Call(ss.FlexibleAxis, own(ss.FlexibleAxis(1e-4, 1e-4, 1e-4, 1e4, 400.0))),
        "TwoMassAxis": Call(ss.TwoMassAxis, own(ss.TwoMassAxis(1e-4, 2e-4, 400.0))),
        "Gains": Call(ss.Gains, {"kp": 1.0}),
        "Harmonics": Call(ss.Harmonics, {"order": (1.0,), "amplitude": (0.1,), "phase": (0.0,)}),
        "Heat": Call(ss.Heat, {"coefficient": 0.01}),
        "IdentificationResult": Call(
            ss.IdentificationResult, {"identification": bare(Identification), "sources": ()}
        ),
        "IdentificationResult.answers_with": Call(
            ss.IdentificationResult.answers_with, {"model_file": "x"}, (SimpleNamespace(sources=(), identification=0),)
        ),
        "IdentificationResult.report": Call(ss.IdentificationResult.report, {}, (bare(ss.IdentificationResult),)),
        "IdentificationResult.save": Call(ss.IdentificationResult.save, {}, (bare(ss.IdentificationResult),)),
        "Law": Call(ss.Law, own(law)),
        "Law.having": Call(law.having, {"viscous": "linear"}),
        "LearningResult": Call(
            ss.LearningResult,
            {"over": "time", "errors": (1.0,), "block": BLOCK, "controller": LOOP,
             "convergence": bare(learn.Convergence), "record": RECORD, "inertia": 1e-3},
        ),
        "LearningResult.write": Call(ss.LearningResult.write, {"path": "x"}, (bare(ss.LearningResult),)),
        "Machine": Call(ss.Machine, own(ss.load_machine("thesis-dry"))),
        "Machine.linear": Call(ss.load_machine("thesis-dry").linear, {"bearings": LinearContact(0.0, 0.0)}),
        "Machine.without": Call(ss.load_machine("thesis-dry").without),
        "Machine.write": Call(ss.load_machine("thesis-dry").write, {"path": "x.toml"}),
        "Mode": Call(ss.Mode, own(par)),
        "Model": Call(ss.Model, {"law": "coulomb", "fc": 0.3}),
        "Model.from_file": Call(ss.Model.from_file, {"path": "x.toml"}),
        "Model.from_table": Call(ss.Model.from_table, {"table": table}),
        "Model.having": Call(LAW.having, {"slip_rule": "signed"}),
        "Model.scaled": Call(LAW.scaled, {"fc": 1.1}),
        "Model.sliding_torque": Call(LAW.sliding_torque, {"velocity": [0.0, 1.0]}),
        "Model.warn": Call(LAW.warn),
        "Par": Call(ss.Par, own(par)),
        "RecommendationResult": Call(
            ss.RecommendationResult, {"recommendation": bare(Recommendation), "identified": bare(Identified)}
        ),
        "RecommendationResult.plot": Call(ss.RecommendationResult.plot, {}, (whole,)),
        "RecommendationResult.report": Call(ss.RecommendationResult.report, {}, (whole,)),
        "RecommendationResult.save": Call(ss.RecommendationResult.save, {}, (whole,)),
        "Record": Call(ss.Record, own(RECORD)),
        "Record.load": Call(ss.Record.load, {"path": "x.npz"}),
        "Record.plot": Call(RECORD.plot),
        "Record.save": Call(RECORD.save, {"path": "x.npz"}),
        "Reference": Call(ss.Reference, {"kind": "sine", "amplitude": 0.1, "frequency": 1.0}),
        "Reference.breaks": Call(SINE.breaks, {"duration": 1.0}),
        "Reference.sample": Call(SINE.sample, {"time": [0.0, 1.0]}),
        "Reference.table": Call(ss.Reference.table, {"time": [0.0, 1.0], "position": [0.0, 1.0]}),
        "RigidAxis": Call(ss.RigidAxis, {"inertia": 1e-3, "friction": LAW}),
        "Sensor": Call(ss.Sensor, {"noise": 0.01}),
        "SweepResult": Call(
            ss.SweepResult, {"sweep": bare(Sweep), "folder": Path(), "rows": [], "manifest": {}, "files": ()}
        ),
        "SweepResult.columns": Call(ss.SweepResult.columns, {}, (swept,)),
        "allow_code": Call(ss.allow_code),
        "compare": Call(ss.compare, {"first": "a.toml", "second": "b.toml"}),
        "control_law": Call(ss.control_law, {"name": "pd"}),
        "control_law_names": Call(ss.control_law_names),
        "doctor": Call(ss.doctor, {"log": DATA}),
        "doctor of arrays": Call(ss.doctor, {"t": T, "position": np.sin(T)}),
        "export": Call(ss.export, {"source": LAW, "to": "c99"}),
        "export as ff": Call(ss.export, {"source": LAW, "to": "c99", "compensator": "ff"}),
        "identify": Call(ss.identify, {"method": "sliding"}, (DATA,)),
        "identify arrays": Call(ss.identify, {"t": T, "position": np.sin(T), "torque": np.cos(T)}),
        "law": Call(ss.law, {"name": "coulomb"}),
        "law_names": Call(ss.law_names),
        "learn": Call(ss.learn, {**RUNS, "controller": SAMPLED, "duration": 0.01}),
        "load_machine": Call(ss.load_machine, {"name": "thesis-dry"}),
        "pd": Call(ss.pd, {"kp": 1.0, "kd": 1.0}),
        "pid": Call(ss.pid, {"kp": 1.0, "ki": 1.0, "kd": 1.0}),
        "place": Call(ss.place, {"kind": "PD", "inertia": 1e-3, "bandwidth": 10.0}),
        "pr": Call(ss.pr, {"kp": 1.0, "kd": 1.0}),
        "read": Call(ss.read, {"log": DATA}),
        "read arrays": Call(ss.read, {"t": T, "position": np.sin(T)}),
        "recommend": Call(ss.recommend, {"model": "a.toml", "amplitude": 0.1}),
        "respond": Call(ss.respond, {"model": LAW, "reference": SINE, "times": [0.0, 0.1]}),
        "simulate": Call(ss.simulate, RUNS),
        "stability": Call(ss.stability, {"machine": "thesis-dry", "controller": SAMPLED}),
        "study": Call(ss.study, {"file": STUDY}),
        "sweep": Call(ss.sweep, {"file": SWEEPS / "small.toml"}),
        "warm_up": Call(ss.warm_up, {"tell": print}),
        "tune": Call(ss.tune, {"file": SWEEPS / "small_tune.toml"}),
    }  # fmt: skip


CALLS = calls()
RESULTS = (
    ss.ControlBlock, ss.Controller, ss.ExportResult, ss.IdentificationResult, ss.LearningResult, ss.Machine, ss.Model,
    ss.RecommendationResult, ss.Record, ss.Reference, ss.RigidAxis, ss.SweepResult, Comparison, ControllerStability,
    Diagnosis, Tuned,
)  # fmt: skip


def arguments(call: Call) -> Iterator[tuple[str, str]]:
    """Name and annotation of what it may be given under a name."""
    for p in inspect.signature(call.function).parameters.values():
        if p.kind is p.VAR_KEYWORD and "Reading" in str(p.annotation):
            yield from (
                (n, getattr(a, "__forward_arg__", str(a))) for n, a in Reading.__annotations__.items()
            )
        elif p.kind is p.VAR_KEYWORD:
            yield from (
                (n, f"{p.annotation} None")
                for n in call.given
                if n not in inspect.signature(call.function).parameters
            )
        elif p.kind is not p.VAR_POSITIONAL and p.name != "self":
            yield p.name, str(p.annotation)


@pytest.fixture(autouse=True)
def _no_work(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """What takes long is only reached, and files are written where they belong."""
    monkeypatch.chdir(tmp_path)
    for place in (
        "verbs.identify.identified", "verbs.doctor.examine",
        "verbs.compare.read_identified", "verbs.sweep.execute.run", "verbs.tune.search", "verbs.study.studies.run",
        "verbs.learn._over_time", "verbs.learn._over_angle", "verbs.identification.prepared_folder",
        "verbs.recommendation.prepared_folder", "verbs.learn.prepared_folder", "verbs.export.prepared_folder",
        "verbs.identification.answers_of", "verbs.sweep.dataset.read", "cli.warm_up.failures",
        "report.plots.house_style",
    ):  # fmt: skip
        monkeypatch.setattr(f"stickslip.{place}", reached)
    monkeypatch.setattr("stickslip.verbs.examiner.examine", lambda record, **_: Diagnosis((), record))


@pytest.mark.parametrize("name", CALLS)
def test_a_call_as_it_should_be_works(name: str) -> None:
    call = CALLS[name]
    absent = name in ("Model.from_file", "Record.load")  # the file
    refused = ""
    try:
        call.function(*call.first, **call.given)
    except Reached:
        pass  # the work would begin
    except ss.StickslipError as error:
        refused = str(error)
    assert bool(refused) is absent, refused


@pytest.mark.parametrize("name", CALLS)
def test_something_wild_is_refused_by_the_name_of_the_argument(name: str) -> None:
    call = CALLS[name]
    wrong: list[str] = []
    for argument, annotation in arguments(call):
        for label, wild in WILD.items():
            said = f"{name}({argument}={label})"
            meant = any(word in annotation for word in MEANT[label].split())
            try:
                call.function(*call.first, **{**call.given, argument: wild})
            except Reached:
                wrong += [] if meant else [f"{said} is taken"]
            except ss.StickslipError as error:
                text = str(error)
                if "\n" in text or not (argument in text or (label == "foo" and "foo" in text)):
                    wrong.append(f"{said}: {text}")
            except Exception as error:
                wrong.append(f"{said}: {type(error).__name__}: {error}")
            else:
                wrong += [] if meant else [f"{said} is taken"]
    assert not wrong, "\n".join(wrong)


def test_every_function_class_and_method_is_among_them() -> None:
    names = {name.split(" ")[0] for name in CALLS}
    public = {
        n
        for n in ss.__all__
        if not (isinstance(getattr(ss, n), type) and issubclass(getattr(ss, n), Exception))
    }
    assert public <= names
    for kind in RESULTS:
        for name, method in inspect.getmembers(kind, callable):
            if name.startswith("_") or not getattr(method, "__module__", "").startswith("stickslip."):
                continue
            if set(inspect.signature(method).parameters) - {"self"}:
                assert f"{kind.__name__}.{name}" in names


@pytest.mark.parametrize(
    "name", [n for n in CALLS if n not in ("control_law_names", "law_names") and "." not in n]
)
def test_an_unknown_argument_is_refused_with_those_that_there_are(name: str) -> None:
    call = CALLS[name]
    with pytest.raises(ss.InputError, match="speling"):
        call.function(*call.first, **call.given, speling=1)


def test_a_channels_name_stands_for_the_argument_of_its_signal() -> None:
    with pytest.raises(ss.InputError, match="'position_reference'; did you mean 'reference'"):
        ss.identify(t=T, position_reference=T)
    with pytest.raises(ss.InputError, match="'time'; did you mean 't'"):
        ss.doctor(time=T)


@pytest.mark.parametrize(
    ("kind", "missing"), [(ss.RigidAxis, "inertia"), (ss.Feedback, "model"), (ss.Machine, "name")]
)
def test_what_a_constructor_must_be_given_is_named(kind: type, missing: str) -> None:
    with pytest.raises(ss.InputError, match=f"{kind.__name__}: missing a required argument: '{missing}'"):
        kind()
