"""Whether the motion is sufficient for friction to show."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from stickslip.core.finding import Finding
from stickslip.core.messages import name_columns, name_option
from stickslip.core.record import encoder_step
from stickslip.identification.doctor.view import NEVER, View


def channels(view: View) -> Iterator[Finding]:
    """Yield findings on missing channels that an identification requires."""
    if not (view.has("position") or view.has("velocity")):
        yield Finding(
            "error",
            "missing-column",
            "there is neither position nor velocity",
            remedy=f"say which column it is, such as {name_columns(position='COLUMN:deg')}",
        )
    elif not view.has("position") and view.torque_channel != "friction_torque":
        yield Finding(
            "warning",
            "missing-column",
            "there is a velocity but no position: `identify` integrates it, from 0, so that neither the first "
            "hundredths of a degree after a reversal nor anything that depends on the position shows",
            remedy="log the position as well, and say which column it is, such as "
            f"{name_columns(position='COLUMN:rad')}",
        )
    if not view.torque_channel:
        if view.has("current"):
            screw = (
                f"give {name_option('force_constant', 'N_PER_A')}, or of a screw "
                f"{name_option('torque_constant', 'NM_PER_A')} and {name_option('lead', 'MM')}"
            )
            yield Finding(
                "error",
                "missing-column",
                "there is current but no torque",
                remedy=screw
                if view.effort == "N"
                else f"give {name_option('torque_constant', 'NM_PER_AMPERE')}",
            )
        else:
            maybe = view.unused_drives
            listed = ", ".join(repr(name) for name in maybe[:4])
            which = f" (not used, with a unit that may say it: {listed})" if maybe else ""
            mapped = f"if a column{which} holds it, say {name_columns(torque=f'COLUMN:{view.effort}')}"
            message = "there is no torque, force or current: only a machine model can replace it"
            if view.has("voltage"):
                message = "there is a voltage and no torque, force or current"
                mapped = (
                    f"identify computes the torque from the voltage with {name_option('resistance', 'OHM')} and "
                    f"{name_option('torque_constant', 'NM_PER_A')}; {mapped}"
                )
            yield Finding("warning", "missing-column", message, remedy=mapped)


def moved(view: View) -> Iterator[Finding]:
    """Yield an error if the motor never moved or the torque never changed."""
    for channel in ("position", "velocity"):
        if view.has(channel) and view.time.size >= 20:
            if (still := _standing(view, channel)) is not None:
                yield still
            break
    if view.torque_channel and view.time.size >= 20:
        torque = view.values(view.torque_channel)
        if np.ptp(torque) == 0.0:
            yield Finding(
                "error",
                "no-torque",
                f"{view.torque_channel} is {torque[0]:g} throughout",
                remedy=f"check that {view.name(view.torque_channel)!r} was logged; if the axis coasts with the drive "
                f"off, log the push before it as well, or take {name_option('method', 'sliding')} with "
                f"{name_option('inertia', 'KGM2')}",
            )


def _standing(view: View, channel: str) -> Finding | None:
    """Return an error if a position or velocity shows only a flickering count or noise."""
    values = view.values(channel)
    span, unit = float(np.ptp(values)), view.record.units[channel]
    remedy = "check the enable signal, the brake and the torque limit; break-away needs a larger torque"
    steps = np.unique(np.abs(np.diff(values)))
    steps = steps[steps > 1e-12 * max(span, 1e-300)]
    smallest = float(steps[0]) if steps.size else 0.0
    places = np.unique(values).size
    if span == 0.0 or (span <= 2.01 * smallest and places <= 3):
        message = (
            f"{channel} is {values[0]:g} {unit} throughout: the axis never moved"
            if span == 0.0
            else f"{channel} has only {places} values, over {span:.3g} {unit}: the axis hardly moved, or the encoder "
            "is too coarse to show the motion"
        )
        return Finding("error", "never-moved", message, remedy=remedy)
    if float(np.var(np.diff(values))) > 1.2 * float(np.var(values)) and encoder_step(values) < 0.1 * span:
        message = (
            f"{channel} is noise of {float(np.std(values)):.3g} {unit} about a fixed value: the axis never"
            " moved"
        )
        return Finding("error", "never-moved", message, remedy=remedy)
    return None


def reversed_and_slow(view: View, stribeck_velocity: float | None = None) -> Iterator[Finding]:
    """Yield findings on missing reversals, less than a revolution, and missing slow speeds."""
    smooth = view.smooth
    if smooth is None or smooth.fast <= 0.0:
        return
    unit = "rad" if view.record.units.get("position") == "rad" else "m"
    direction = np.sign(smooth.velocity[smooth.moving])
    if direction.size and np.all(direction == direction[0]):
        far, back = max(smooth.travel), min(smooth.travel)
        moves = (
            "the axis never reverses"
            if back < NEVER * far
            else f"the axis moves {far:.3g} {unit} in one direction and at most {back:.3g} {unit} in the other"
        )
        yield Finding(
            "warning",
            "no-reversal",
            f"{moves}: friction of the other direction and hysteresis stay unknown, and friction cannot be "
            "distinguished from a constant torque (weight, offset)",
            remedy="add motion in the other direction",
        )
    travel = float(np.ptp(smooth.position))
    if view.has("position") and view.record.units["position"] == "rad" and travel < 2.0 * math.pi:
        message = (
            f"the axis turns by {travel:.3g} rad, less than a revolution: what depends on the angle (cogging, gravity) "
            "does not average out"
        )
        yield Finding(
            "note", "less-than-a-revolution", message, remedy="turn at least once where the machine can"
        )
    speed = np.abs(smooth.velocity)
    low, high = (0.005 * smooth.fast, 0.1 * smooth.fast)
    if stribeck_velocity is not None:
        low, high = stribeck_velocity / 3.0, 3.0 * stribeck_velocity
    slow = float(np.mean((speed > low) & (speed < high)))
    if slow < 0.01:
        message = (
            f"{100 * slow:.3g} % of the record lies between {low:.3g} and {high:.3g} {unit}/s: the Stribeck"
            " velocity stays unknown"
        )
        yield Finding("warning", "no-slow-motion", message, remedy="add slow motion in both directions")
