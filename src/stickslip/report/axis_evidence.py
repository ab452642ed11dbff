"""Evidence next to the fit in the report of an axis: measured friction, slow motion in detail, and noise."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from stickslip.core.messages import Note, code_of, name_option, render
from stickslip.core.record import encoder_step
from stickslip.identification.estimate import Identification
from stickslip.identification.experiment import Experiment
from stickslip.identification.fit.noise import white_std
from stickslip.identification.output_error.loop_check import position_noise
from stickslip.identification.output_error.search import FittedAxis
from stickslip.identification.regression.inverse import InverseDynamics
from stickslip.simulation.recorded_input.simulation import Mechanics

Array = np.ndarray[Any, np.dtype[np.float64]]

BINS, FEWEST = 24, 8
"""Bins of speed over three decades, and fewest samples of a bin."""
ACCELERATING, STEADY = 0.3, 0.1
"""Shares of friction: largest acceleration torque, and largest interquartile range of a bin, for a valid point."""
WINDOW, STEPS, SLOWER = 15, 12, 0.3
"""Divisor of the record for the detail; fewest encoder steps in it, and largest share of the usual travel."""
GOOD_CODE = "good"
"""Code of a judgement that a misfit is explained by noise."""
GOOD = 3.0
"""Multiple of the noise up to which a misfit is called good."""


# ---- friction as measured -----------------------------------------------------------------------------------------


def measured_friction(inverse: InverseDynamics, mechanics: Mechanics | None) -> list[tuple[Array, Array]]:
    """Return speeds and friction torques of the record itself, for positive and negative direction.

    These are medians over bins of speed of the torque minus acceleration and external torques. Only rows with little
    acceleration and a steady torque are used: at reversals and during stick-slip, friction is not a function of the
    speed.

    Parameters
    ----------
    inverse : InverseDynamics
    mechanics : Mechanics or None
        With the final inertia and offset; None: those of the inverse dynamics.

    Returns
    -------
    list of (array, array)
        rad/s (m/s) and N·m (N), both positive; may be empty.
    """
    values = dict(zip(inverse.names, inverse.values.tolist(), strict=True))
    if mechanics is not None:
        values["inertia"] = mechanics.inertia
        if "offset" in values:
            values["offset"] = mechanics.offset
    other = [i for i, n in enumerate(inverse.names) if not n.startswith(("fc", "fv"))]
    outside: Array = inverse.matrix[:, other] @ np.array([values[inverse.names[i]] for i in other])
    friction = inverse.torque - outside
    accelerating = values["inertia"] * inverse.matrix[:, inverse.names.index("inertia")]
    even = np.abs(accelerating) < ACCELERATING * np.abs(friction)
    top = float(np.max(np.abs(inverse.velocity)))
    edges = np.geomspace(1e-3 * top, top * (1.0 + 1e-9), BINS + 1)
    out: list[tuple[Array, Array]] = []
    for side in (1.0, -1.0):
        speed, torque = side * inverse.velocity[even], side * friction[even]
        points: list[tuple[float, float]] = []
        for low, high in itertools.pairwise(edges.tolist()):
            inside = (speed >= low) & (speed < high)
            if np.sum(inside) < FEWEST:
                continue
            first, middle, last = np.percentile(torque[inside], [25.0, 50.0, 75.0])
            if last - first < STEADY * middle:
                points.append((float(np.median(speed[inside])), float(middle)))
        table = np.array(points).reshape(-1, 2)
        out.append((table[:, 0], table[:, 1]))
    return out


# ---- the slow motion ------------------------------------------------------------------------------------------------


def slow_rows(experiment: Experiment) -> slice | None:
    """Return the rows of the fifteenth of a record with the least motion, but at least some encoder steps and a
    thousandth of its travel; None if the motion is uniform or the record short."""
    length = experiment.time.size // WINDOW
    if length < 100:
        return None
    whole = float(np.ptp(experiment.position))
    least = max(STEPS * encoder_step(experiment.position), 1e-3 * whole)
    begins = range(0, experiment.time.size - length, max(length // 4, 1))
    ways = {
        b: float(np.ptp(experiment.position[b : b + length]))
        for b in begins
        if experiment.rows[b : b + length].all()
    }
    moving = {b: w for b, w in ways.items() if w > least}
    if not moving:
        return None
    begin = min(moving, key=lambda b: moving[b])
    return (
        slice(begin, begin + length) if moving[begin] < SLOWER * float(np.median([*ways.values()])) else None
    )


# ---- how large a misfit is ------------------------------------------------------------------------------------------


def judgements(found: Identification) -> dict[str, str]:
    """What a misfit is beside the noise of its signal, by its name among the headline numbers."""
    output, inverse = found.details.get("output"), found.details.get("inverse")
    out: dict[str, str] = {}
    if isinstance(output, FittedAxis):
        experiments = output.problem.experiments
        noise = {"position": levels([position_noise(t.position) for t in experiments])}
        if "drive" in output.problem.signals:
            noise["drive"] = levels([white_std(t.signal()) for t in experiments])
        what = {
            "position": "the encoder's rounding" if has_encoder(experiments) else "the noise of the position"
        }
        for signal, level in noise.items():
            rms = float(found.misfit.get(f"{signal}_rms", math.nan))
            out[f"{signal}_relative"] = beside(rms, level, what.get(signal, "the noise of the signal"))
        told = out["position_relative"]
        if told and code_of(told) != GOOD_CODE and not all(t.closed_loop for t in experiments):
            drifts = f"the recorded torque alone lets it drift ({name_option('loop')} holds it)"
            out["position_relative"] = render(f"{told}: {drifts}")
        if inverse is not None:
            # Its filters smooth every reversal: even the true axis has a residual of some percent.
            out["inverse_dynamics_relative"] = "a first look, from which the search starts"
    return {k: v for k, v in out.items() if v}


def beside(rms: float, level: float, what: str) -> str:
    """Return a misfit relative to noise as text; empty without noise."""
    if not (rms >= 0.0 and level > 1e-6 * rms):
        return ""
    times = rms / level
    return Note(f"good: at {what}", GOOD_CODE) if times <= GOOD else f"{float(f'{times:.2g}'):g} times {what}"


def has_encoder(experiments: Sequence[Experiment]) -> bool:
    """Whether every position is quantised."""
    return all(encoder_step(t.position) > 0.0 for t in experiments)


def levels(each: Sequence[float]) -> float:
    """Return the root mean square level of several records together."""
    return math.sqrt(math.fsum(x * x for x in each) / len(each))
