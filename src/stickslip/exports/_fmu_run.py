"""Validate a functional mock-up unit in FMPy and run it step by step (the extra ``fmu``)."""

from __future__ import annotations

import importlib
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from stickslip.core.messages import axis_unit
from stickslip.exports.job import Check, Export

Array = np.ndarray[Any, np.dtype[np.float64]]


def checked(
    export: Export,
    time: Array,
    dt: Array,
    inputs: Mapping[str, Array],
    expected: Mapping[str, Array],
    bound: float = 0.0,
    off: str = "",
) -> Check:
    """Validate the units of an export, and play them: their outputs may be `bound` off what is expected, (n,) each."""
    errors: dict[str, float] = {}
    for name, unit in export.files.items():
        if not name.endswith(".fmu"):
            continue
        answer = played(unit, time, dt, inputs, tuple(expected))
        if isinstance(answer, Check):
            return answer
        errors[name] = float(np.abs(answer - np.column_stack([*expected.values()])).max())
    worst, said = max(errors.values()), f"{axis_unit('N·m')} off the definition"
    return Check(worst <= bound, f"FMPy: valid; at most {worst:.3g} {off or said}", errors)


def played(
    unit: str | bytes,
    time: Array,
    dt: Array,
    inputs: Mapping[str, Array],
    outputs: Sequence[str],
    **start: float,
) -> Array | Check:
    """Outputs after each communication step, shape (n, outputs); a `Check` where it cannot run or is not valid.

    Parameters
    ----------
    unit : bytes
        The file.
    time, dt : array, shape (n,)
        Communication points and steps, s.
    inputs : mapping of str to array, shape (n,)
        Set before each step; those that the unit does not have are left out.
    outputs : sequence of str
    **start
        Parameters.
    """
    try:
        fmpy: Any = importlib.import_module("fmpy")
        validation: Any = importlib.import_module("fmpy.validation")
    except ImportError:
        return Check(None, "FMPy is not installed (pip install 'stickslip[fmu]')")
    with TemporaryDirectory() as folder:
        file = Path(folder, "unit.fmu")
        file.write_bytes(unit.encode() if isinstance(unit, str) else unit)
        problems = validation.validate_fmu(str(file))
        if problems:
            return Check(False, f"FMPy: {problems[0]}")
        described = fmpy.read_model_description(str(file), validate=False)  # it just was
        fmpy.extract(str(file), unzipdir=folder)
        if not Path(folder, "binaries").exists():
            return Check(None, "FMPy: valid; not run, there is no binary in it")
        return stepped(described, folder, time, dt, inputs, outputs, start)


def stepped(
    described: Any, folder: str, time: Array, dt: Array, inputs: Mapping[str, Array], outputs: Sequence[str],
    start: Mapping[str, float],
) -> Array:  # fmt: skip
    """Instantiate the unit in the folder and step it."""
    second = described.fmiVersion.startswith("2")
    name = "fmi2" if second else "fmi3"
    unit: Any = getattr(importlib.import_module(f"fmpy.{name}"), name.replace("fmi", "FMU") + "Slave")(
        guid=described.guid,
        unzipDirectory=folder,
        modelIdentifier=described.coSimulation.modelIdentifier,
        instanceName="unit",
    )
    references = {v.name: v.valueReference for v in described.modelVariables}
    unit.instantiate()
    set_values, get_values = (unit.setReal, unit.getReal) if second else (unit.setFloat64, unit.getFloat64)
    set_values([references[name] for name in start], list(start.values()))
    if second:
        unit.setupExperiment(startTime=0.0)
    unit.enterInitializationMode()
    unit.exitInitializationMode()
    known = [name for name in inputs if name in references]
    columns: Iterable[Sequence[float]] = (
        zip(*(inputs[name].tolist() for name in known)) if known else ((),) * dt.size
    )
    rows: list[Any] = []
    for now, h, values in zip(time.tolist(), dt.tolist(), columns):
        set_values([references[name] for name in known], list(values))
        unit.doStep(now, h)
        rows.append(get_values([references[name] for name in outputs]))
    unit.terminate()
    unit.freeInstance()
    return np.array(rows, dtype=np.float64)
