"""The friction torque of a law whose motion is prescribed, as the thesis identifies and compares laws (3.1.2)."""

from __future__ import annotations

from typing import Any

import numpy as np

from stickslip.core.arguments import arguments_checked
from stickslip.core.errors import InputError, StepFailure, UnknownName
from stickslip.core.record import Record
from stickslip.core.reprs import Vector
from stickslip.core.spec import Surroundings
from stickslip.jit import compiled_profile, flat
from stickslip.models.model import Model, Reference
from stickslip.simulation.case_arrays import Side, ruled, slip_rules
from stickslip.simulation.prescribed.kernels import Motion, march
from stickslip.subset import Layout

METHODS = ("auto", "step", "rate")

Array = np.ndarray[Any, np.dtype[np.float64]]


@arguments_checked
def respond(
    model: Model,
    reference: Reference,
    times: Vector,
    *,
    slip_rule: str | None = None,
    method: str = "auto",
    tolerance: float = 1e-10,
    surroundings: Surroundings | None = None,
    applied: Vector | None = None,
) -> Record:
    """Move a contact along a reference, from rest with all states zero at t = 0.

    Parameters
    ----------
    model : Model
    reference : Reference
        The motion: rad, rad/s.
    times : array, shape (n,)
        Ascending, s, none before 0.
    slip_rule : {"signed", "literal"}, optional
        For a law that has one, in place of its own choice.
    method : {"auto", "step", "rate"}
        "rate" integrates the law's rates (Dormand-Prince, located switches), "step" its own steps, extrapolated;
        "auto" takes rates where the law gives them. A law without states is evaluated at the times.
    tolerance : float
        Error of a step relative to the largest value that each state has had.
    surroundings : Surroundings, optional
        Load and temperature; position and time are those of the motion.
    applied : array, shape (n,), optional
        Torque applied from outside at the times, N·m, which a contact at rest balances; for laws without states.

    Returns
    -------
    Record
        Channels ``position`` (rad), ``velocity`` (rad/s) and ``friction_torque`` (N·m), shape (n,).

    Raises
    ------
    InputError
        If the times do not ascend from 0 on, the tolerance is out of bounds, the law gives no rates, or a law with
        states is given an applied torque.
    UnknownName
        If the method is unknown.
    StepFailure
        If no step meets the tolerance; the error holds the record until then.
    """
    time = checked(times)
    if not 1e-14 <= tolerance < 1.0:
        raise InputError(f"tolerance = {tolerance:g} must lie between 1e-14 (rounding) and 1")
    if method not in METHODS:
        raise UnknownName("method", method, METHODS)
    if method == "rate" and model.law.rate is None:
        raise InputError(f"law {model.law.name!r} gives no `rate`; use method 'step'")
    bound = ruled(model, slip_rule)
    by_step = method == "step" or bound.law.rate is None
    motion = reference.sample(time)
    around = surroundings or Surroundings()
    if not bound.law.state_fields:
        torque = evaluated(bound, motion, time, around, applied_torques(applied, time))
    elif applied is not None:
        raise InputError(f"law {bound.law.name!r} has states and needs no applied torque; leave it out")
    else:
        torque = integrated(bound, reference, time, by_step, tolerance, around)
    reached = torque.size
    record = Record(
        time[:reached],
        {"position": motion[:reached, 0], "velocity": motion[:reached, 1], "friction_torque": torque},
        {"position": "rad", "velocity": "rad/s", "friction_torque": "N·m"},
        {
            "model": bound.as_dict(),
            "slip_rules": slip_rules(model=bound),
            "reference": reference.as_dict(),
            "tolerance": tolerance,
        },
    )
    if reached < time.size:
        raise StepFailure(
            f"{bound.law.name}: no step meets the tolerance before t = {time[reached]:g} s; use a looser one",
            float(time[reached]),
            record,
        )
    return record


def checked(times: Vector) -> Array:
    """The times as an array; refuses what does not ascend from 0 on."""
    time = np.ascontiguousarray(times, dtype=np.float64)
    if time.ndim != 1 or not np.all(np.isfinite(time)) or np.any(np.diff(time) < 0.0) or np.any(time < 0.0):
        raise InputError("times must be one ascending list of finite seconds, none before 0")
    return time


def applied_torques(applied: Vector | None, time: Array) -> Array:
    """The applied torque at the times, N·m; 0 where none is given."""
    if applied is None:
        return np.zeros(time.size)
    torques = np.asarray(applied, dtype=np.float64)
    if torques.shape != time.shape or not np.all(np.isfinite(torques)):
        raise InputError(
            f"applied has shape {torques.shape}; give one finite torque (N·m) for each of the times"
        )
    return torques


def evaluated(model: Model, motion: Array, time: Array, around: Surroundings, applied: Array) -> Array:
    """Torque of a law without states at every row of position, velocity and acceleration, N·m."""
    law, p = model.law, model.parameters
    z = law.state(p)
    torques: list[float] = []
    for (x, v, _), t, torque in zip(motion.tolist(), time.tolist(), applied.tolist()):
        u = around._replace(position=x, time=t, applied=torque)
        torques.append(law.step(v, v, 0.0, z, p, u))
    return np.array(torques, dtype=np.float64)


def integrated(
    model: Model, reference: Reference, time: Array, by_step: bool, tolerance: float, around: Surroundings
) -> Array:
    """Torque of a law with states at the times, N·m; shorter than they are where no step was found."""
    side = Side.of(model)
    kind = reference.kind
    end = float(time[-1]) if time.size else 0.0
    kinks = np.array(reference.breaks(end), dtype=np.float64)
    stops, place = np.unique(np.concatenate([time, kinks]), return_inverse=True)
    size = side.state.size
    m = Motion(
        side.pointers,
        side.parameters,
        side.modes,
        side.velocity_scale,
        compiled_profile(kind.name, kind.profile, Layout.of(kind.fields, counted=True)),
        flat(kind.pack(reference.parameters)),
        tolerance,
        np.zeros(size),
        np.zeros(2),
        np.zeros(3),
        np.array(around),
        np.zeros((7, size)),
        np.zeros(size),
        np.zeros(size),
    )
    torques = np.zeros(stops.size)
    reached = march(m, side.state.copy(), stops, np.isin(stops, kinks), torques, by_step)
    wanted = place[: time.size]
    return torques[wanted[wanted < reached]]
