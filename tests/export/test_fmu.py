"""The units in FMPy, libcosim and the FMU manipulation toolbox against plain Python and the package's own loop."""

import ctypes
import io
import logging
import struct
import subprocess
import sys
import zipfile
from itertools import pairwise

import numpy as np
import pytest

from stickslip.control.compensator import Feedback
from stickslip.control.controller import Controller
from stickslip.control.linear import place
from stickslip.exports import target_named
from stickslip.exports.fmu_axis import driven
from stickslip.exports.job import Job
from stickslip.jit import compiled_law
from stickslip.machines.rigid import RigidAxis
from stickslip.models import plugins
from stickslip.models.model import Model, Reference
from stickslip.simulation import case_arrays
from stickslip.simulation.closed_loop import simulate
from support.laws import farthest

fmpy = pytest.importorskip("fmpy")
from fmpy.fmi1 import FMICallException  # noqa: E402
from fmpy.fmi2 import FMU2Slave  # noqa: E402
from fmpy.fmi3 import FMU3Slave  # noqa: E402

INERTIA = 3.8623e-4


def job(law, **settings):
    return Job(Model(law, **dict(law.example)), "contact", settings=settings)


def units(target, law):
    """The two files of a law's export."""
    settings = {"inertia": INERTIA} if target == "fmu-axis" else {}
    files = target_named(target).write(job(law, **settings)).files
    return {name: content for name, content in files.items() if name.endswith(".fmu")}


def instance(content, folder, start=()):
    """A unit after its initialization, and the value references by name."""
    described = fmpy.read_model_description(io.BytesIO(content))
    folder = folder / f"unit{len(list(folder.glob('unit*')))}"  # a loaded library must not be written over
    fmpy.extract(io.BytesIO(content), unzipdir=str(folder))
    second = described.fmiVersion.startswith("2")
    unit = (FMU2Slave if second else FMU3Slave)(
        guid=described.guid, unzipDirectory=str(folder), modelIdentifier="contact", instanceName="unit"
    )
    unit.instantiate()
    unit.get = unit.getReal if second else unit.getFloat64
    unit.set = unit.setReal if second else unit.setFloat64
    references = {v.name: v.valueReference for v in described.modelVariables}
    for name, value in start:
        unit.set([references[name]], [value])
    if second:
        unit.setupExperiment(startTime=0.0)
    unit.enterInitializationMode()
    unit.exitInitializationMode()
    return unit, references


both_versions = pytest.mark.parametrize("version", ["contact.fmu", "contact_fmi3.fmu"])
both_targets = pytest.mark.parametrize("target", ["fmu", "fmu-axis"])


@both_targets
@pytest.mark.parametrize("law", ["karnopp", "gms"])
def test_the_manipulation_toolbox_finds_nothing(target, law, tmp_path, caplog):
    checker = pytest.importorskip("fmu_manipulation_toolbox.checker")
    operations = pytest.importorskip("fmu_manipulation_toolbox.operations")
    for name, content in units(target, farthest(plugins.law(law))).items():
        file = tmp_path / name
        file.write_bytes(content)
        unit = operations.FMU(str(file))
        with caplog.at_level(logging.INFO):
            for check in (checker.OperationGenericCheck(), checker.OperationSemanticCheck()):
                unit.apply_operation(check)
    assert "seems to be compliant" in caplog.text
    assert [r.message for r in caplog.records if r.levelno >= logging.WARNING] == []


def test_libcosim_runs_it_as_python_does(tmp_path):
    cosim = pytest.importorskip("libcosimpy.CosimExecution")
    from libcosimpy.CosimLogging import CosimLogLevel, log_output_level
    from libcosimpy.CosimManipulator import CosimManipulator
    from libcosimpy.CosimObserver import CosimObserver
    from libcosimpy.CosimSlave import CosimLocalSlave

    law = plugins.law("gms")
    file = tmp_path / "contact.fmu"
    file.write_bytes(units("fmu", law)["contact.fmu"])
    references = {v.name: v.valueReference for v in fmpy.read_model_description(str(file)).modelVariables}
    step = 2.0**-9  # s; libcosim counts whole nanoseconds, of which this is a number without rounding
    log_output_level(CosimLogLevel.WARNING)
    execution = cosim.CosimExecution.from_step_size(step_size=int(step * 1e9))
    slave = execution.add_local_slave(local_slave=CosimLocalSlave(fmu_path=str(file), instance_name="unit"))
    manipulator, observer = CosimManipulator.create_override(), CosimObserver.create_last_value()
    assert execution.add_manipulator(manipulator=manipulator)
    assert execution.add_observer(observer=observer)
    p = Model(law, **dict(law.example)).parameters
    z, torques, expected = law.state(p), [], []
    for k in range(300):
        v, a = 0.05 * np.sin(0.05 * k), 2.5 * np.cos(0.05 * k)
        inputs = [references["velocity"], references["acceleration"]]
        assert manipulator.slave_real_values(
            slave_index=slave, variable_references=inputs, values=[float(v), float(a)]
        )
        assert execution.step()
        torque = observer.last_real_values(
            slave_index=slave, variable_references=[references["friction_torque"]]
        )
        torques.append(torque[0])
        expected.append(law.step(float(v), float(v + a * step), step, z, p, None))
    assert np.ptp(expected) > 0.3
    np.testing.assert_array_equal(torques, expected)


class Contact:
    """A law's step whose every call runs in the unit: the state goes in and out serialized."""

    def __init__(self, model, unit, references):
        law, p = model.law, model.parameters
        self.unit, self.torque = unit, [references["friction_torque"]]
        self.inputs = [references["velocity"], references["acceleration"]]
        count = law.elements_in(p)
        order = [f"{f.name}[{i + 1}]" for f in law.state_fields if f.per_element for i in range(count)]
        order = [f.name for f in law.state_fields if not f.per_element] + order  # as engines pack it
        self.states = [references[name] for name in order]
        first = min(self.states)
        self.saved = unit.getFMUState()
        self.bytes = bytearray(unit.serializeFMUState(self.saved))
        start = 8 * (4 + len(law.pack(p)) - (1 if count else 0))  # four numbers, then the parameters
        self.places = [start + 8 * (reference - first) for reference in self.states]
        kind = ctypes.CFUNCTYPE(
            ctypes.c_double, *[ctypes.c_double] * 3, *[ctypes.POINTER(ctypes.c_double)] * 3
        )
        self.function = kind(self.step)
        self.calls = 0

    def step(self, v0, v1, h, z, p, u):
        self.calls += 1
        for i, place_ in enumerate(self.places):
            struct.pack_into("d", self.bytes, place_, z[i])
        self.saved = self.unit.deserializeFMUState(bytes(self.bytes), self.saved)
        self.unit.setFMUState(self.saved)
        self.unit.set(self.inputs, [v0, (v1 - v0) / h if h > 0.0 else 0.0])
        self.unit.doStep(0.0, h)
        for i, value in enumerate(self.unit.get(self.states)):
            z[i] = value
        return self.unit.get(self.torque)[0]

    @property
    def address(self):
        return ctypes.cast(self.function, ctypes.c_void_p).value


@both_versions
@pytest.mark.parametrize("law", ["lugre", "gms"])
def test_a_closed_loop_with_the_unit_as_friction_is_the_packages_own(law, version, tmp_path, monkeypatch):
    model = Model(law, **dict(plugins.law(law).example))
    axis = RigidAxis(INERTIA, model)
    control = Controller(place("PD", INERTIA, 60.0, 0.85), Feedback(Model("coulomb", fc=0.2), filter_hz=80.0))
    wanted = Reference("sine", amplitude=0.02, frequency=8.0)
    run = {"integrator": "fixed", "time_step": 2.5e-4, "output": 2.5e-4, "metered": False}
    own = simulate(axis, control, wanted, 0.15, **run)
    contact = Contact(model, *instance(units("fmu", plugins.law(law))[version], tmp_path))

    def compiled(each):
        pointers = compiled_law(each)
        return pointers._replace(step=contact.address) if each.name == law else pointers

    monkeypatch.setattr(case_arrays, "compiled_law", compiled)
    with_unit = simulate(axis, control, wanted, 0.15, **run)
    assert contact.calls > 1000
    np.testing.assert_array_equal(with_unit.time, own.time)
    assert np.ptp(own["friction_torque"]) > 0.3
    for channel in ("friction_torque", "motor_torque", "position"):
        assert np.abs(with_unit[channel] - own[channel]).max() <= 1e-9


@both_versions
def test_a_saved_state_repeats_the_step(version, tmp_path):
    law = plugins.law("gms")
    unit, references = instance(units("fmu", law)[version], tmp_path)
    inputs, torque = [references["velocity"], references["acceleration"]], [references["friction_torque"]]
    unit.set(inputs, [0.01, 1.0])
    unit.doStep(0.0, 1e-3)
    saved = unit.getFMUState()
    unit.doStep(1e-3, 1e-3)
    after = unit.get(torque)
    unit.set(inputs, [-5.0, 0.0])
    unit.doStep(2e-3, 1e-2)
    assert unit.get(torque) != after
    unit.setFMUState(saved)
    unit.doStep(1e-3, 1e-3)
    assert unit.get(torque) == after
    unit.reset()
    unit.set([references["sigma2"]], [0.5])
    unit.enterInitializationMode()
    unit.set(inputs, [2.0, 0.0])
    unit.exitInitializationMode()
    assert unit.get(torque)[0] == pytest.approx(1.0, abs=0.1)  # the viscous part of a contact without load


@both_versions
def test_values_out_of_bounds_are_refused(version, tmp_path):
    content = units("fmu", plugins.law("lugre"))[version]
    with pytest.raises(FMICallException):
        instance(content, tmp_path, start=[("vs", 0.0)])
    with pytest.raises(FMICallException):
        instance(content, tmp_path, start=[("sigma0", float("nan"))])
    unit, references = instance(content, tmp_path)
    with pytest.raises(FMICallException):
        unit.set([references["sigma0"]], [1e4])  # fixed once the first step has begun
    with pytest.raises(FMICallException):
        unit.set([references["friction_torque"]], [0.0])
    with pytest.raises(FMICallException):
        unit.doStep(0.0, -1e-3)


@both_versions
@pytest.mark.parametrize("target", ["fmu", "fmu-axis"])
def test_shares_of_a_whole_are_refused_unless_they_add_up(target, version, tmp_path):
    content = units(target, plugins.law("gms"))[version]
    with pytest.raises(FMICallException):
        instance(content, tmp_path, start=[("alpha[1]", 0.9)])  # with the others 1.65
    instance(content, tmp_path, start=[("alpha[1]", 0.3), ("alpha[2]", 0.2)])


@both_versions
def test_fmpy_simulates_a_recorded_motion(version, tmp_path):
    law = plugins.law("lugre")
    file = tmp_path / "contact.fmu"
    file.write_bytes(units("fmu", law)[version])
    time = np.arange(200) * 1e-3
    velocity = 0.1 * np.sin(30.0 * time)
    slope = np.append(np.diff(velocity) / 1e-3, 0.0)
    kinds = [(name, "f8") for name in ("time", "velocity", "acceleration")]
    signal = np.array(list(zip(time, velocity, slope)), dtype=kinds)
    result = fmpy.simulate_fmu(
        str(file),
        input=signal,
        output=["friction_torque"],
        stop_time=0.199,
        step_size=1e-3,
        output_interval=1e-3,
    )
    p = Model(law, **dict(law.example)).parameters
    z = law.state(p)
    own = [law.step(float(a), float(b), 1e-3, z, p, None) for a, b in pairwise(velocity)]
    np.testing.assert_allclose(result["friction_torque"][1:], own, atol=1e-12)


def test_a_derivative_of_the_velocity_is_its_slope(tmp_path):
    law = plugins.law("lugre")
    unit, references = instance(units("fmu", law)["contact.fmu"], tmp_path)
    unit.set([references["velocity"]], [0.01])
    unit.setRealInputDerivatives([references["velocity"]], [1], [20.0])
    unit.doStep(0.0, 1e-3)
    p = Model(law, **dict(law.example)).parameters
    expected = law.step(0.01, 0.01 + 20.0 * 1e-3, 1e-3, law.state(p), p, None)
    assert unit.get([references["friction_torque"]])[0] == expected
    with pytest.raises(FMICallException):
        unit.setRealInputDerivatives([references["velocity"]], [2], [1.0])


@pytest.mark.slow
def test_fmpy_builds_the_sources(tmp_path):
    law, target = plugins.law("karnopp"), target_named("fmu-axis")
    export = target.write(job(law, inertia=INERTIA))
    built = dict(export.files)
    for name in units("fmu-axis", law):
        with (
            zipfile.ZipFile(io.BytesIO(export.files[name])) as old,
            zipfile.ZipFile(tmp_path / name, "w") as new,
        ):
            for entry in old.namelist():
                if not entry.startswith("binaries/"):
                    new.writestr(entry, old.read(entry))
        command = [sys.executable, "-m", "fmpy.cli", "compile", str(tmp_path / name)]
        done = subprocess.run(command, capture_output=True, text=True)
        assert done.returncode == 0, done.stdout + done.stderr
        built[name] = (tmp_path / name).read_bytes()
        assert any("binaries/" in entry for entry in zipfile.ZipFile(tmp_path / name).namelist())
    result = target.check(job(law, inertia=INERTIA), type(export)(built))
    assert result.passed, result.text


def test_the_axis_moves_and_rests():
    motion = driven(job(plugins.law("gms"), inertia=INERTIA))
    assert np.ptp(motion.velocity) > 1.0
    assert np.mean(np.abs(motion.velocity) < 1e-4) > 0.05
