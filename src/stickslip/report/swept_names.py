"""Symbols, names and units of the metrics and numbers of a sweep."""

from __future__ import annotations

import re

from stickslip.core.spec import Field
from stickslip.studies.planned_run import PlannedRun
from stickslip.sweeps.numbers import INERTIA, parts

METRICS = {
    "position_rms": "RMS position error", "position_peak": "peak position error",
    "second_half_position_rms": "RMS position error, second half", "velocity_rms": "RMS velocity error",
    "velocity_peak": "peak velocity error", "torque_rms": "RMS motor torque", "torque_peak": "peak motor torque",
    "steady_state_error": "steady-state error", "settling": "settling time",
    "velocity_above_50Hz_rms": "RMS velocity above 50 Hz", "longest_standstill": "longest standstill",
    "limit_cycle_amplitude": "limit cycle amplitude", "limit_cycle_period": "limit cycle period",
    "reversals_beyond_reference": "extra reversals", "second_half_reversals": "reversals, second half",
}  # fmt: skip
UNITS = {"per_s": "1/s", "rad_s": "rad/s", "rad": "rad", "Nm": "N·m", "J": "J", "s": "s"}
CONTROLLER = {
    "gain": ("compensator gain", ""), "filter_hz": ("compensator filter", "Hz"), "bandwidth_hz": ("bandwidth", "Hz"),
    "damping": ("damping ratio", ""), "kp": ("$k_p$", "N·m/rad"), "ki": ("$k_i$", "N·m/(rad·s)"),
    "kd": ("$k_d$", "N·m·s/rad"), "kr": ("$k_r$", "N·m·s/rad"), "torque_limit": ("torque limit", "N·m"),
    "sample_time": ("sample time", "s"),
}  # fmt: skip
GREEK = ("alpha", "beta", "gamma", "delta", "kappa", "lambda", "phi", "sigma", "tau", "theta")
SYMBOL = re.compile(rf"([A-Za-z]|{'|'.join(GREEK)})(?:_([A-Za-z0-9,]+))?")
BELIEVED = {"law": ", model", "reference": ", reference"}
"""Suffixes of the names of numbers that are not the machine's."""


def metric_named(metric: str) -> tuple[str, str]:
    """Return the name of a metric, and its unit."""
    for ending, unit in UNITS.items():
        if metric.endswith(f"_{ending}"):
            short = metric.removesuffix(f"_{ending}")
            return METRICS.get(short, short.replace("_", " ")), unit
    return metric.replace("_", " "), "-"


def number_named(run: PlannedRun, name: str) -> tuple[str, str]:
    """Return symbol or name of a number of a run, and its unit, "" without one.

    Parameters
    ----------
    run : PlannedRun
    name : str
        As in a sweep's file: ``friction.fs``, ``controller.bandwidth_hz``, ``friction.k[0]``.
    """
    family, rest, element = parts(name)
    place = "" if element is None else f", element {element + 1}"
    if name in INERTIA:
        return "$J$", "kg·m²"
    if family == "controller" and rest in CONTROLLER:
        return CONTROLLER[rest]
    if field := next((f for f in _fields(run, family) if f.name == rest), None):
        unit = "" if field.par.unit == "-" else field.par.unit
        words = symbol(field.par.symbol) if field.par.symbol else rest.replace("_", " ")
        return words + place + BELIEVED.get(family, ""), unit
    return rest.replace("_", " ").replace(".", " "), ""


def symbol(written: str) -> str:
    """Return a law's symbol, such as ``sigma_0``, typeset for a figure."""
    match = SYMBOL.fullmatch(written)
    if match is None:
        return written.replace("$", "")
    stem = f"\\{match[1]}" if match[1] in GREEK else match[1]
    return f"${stem}_{{{match[2]}}}$" if match[2] else f"${stem}$"


def _fields(run: PlannedRun, family: str) -> tuple[Field, ...]:
    """Return the described numbers of a family."""
    if family == "friction":
        return tuple(run.axis.friction.law.fields)
    if family == "law" and run.control.is_short and run.control.compensator:
        return tuple(run.control.compensator.model.law.fields)
    if family == "reference":
        return tuple(run.motion.kind.fields)
    # Symbols of a controller's laws are ambiguous: the whole name identifies the law.
    return ()
