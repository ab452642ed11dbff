"""Draw a law: its response to a slow sine, to small motion, and to steps in velocity.

The picture is computed from the law's own `step`, for any law: built in, installed, or a user's file. The scales of the
motions are determined from the law (`scales_of`), so a new law needs only its description.
"""

from __future__ import annotations

import importlib
import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from stickslip.core.errors import InputError
from stickslip.core.spec import Law
from stickslip.core.whole_files import draft_of
from stickslip.jit import flat
from stickslip.models.model import Model
from stickslip.report.plots import DATES, DPI, FORMATS, RC, WIDTH, Array, Curve, Panel, save, scaled
from stickslip.report.styles import Style
from stickslip.simulation.prescribed.motion import Samples, packed_numbers, torque_along

USUAL_VELOCITY = 0.01  # rad/s, for a law without a declared scale: the thesis's Stribeck velocity
USUAL_DISTANCE = 1e-4  # rad, for a law without presliding
RISING = Style("#D55E00", (0, (4, 1.2)), 1.4)
FALLING = Style("#0072B2", "-", 1.2)
OUTER = Style("#777777", "-", 1.0)
INNER = Style("#D55E00", (0, (4, 1.2)), 1.6)
STEADY = Style("#000000", (0, (1, 1.5)), 1.0)
TORQUE = Style("#0072B2", "-", 1.4)


@dataclass(frozen=True)
class Response:
    """A law's response to a motion that starts at rest: arrays of shape (n,).

    Attributes
    ----------
    time, position, velocity, torque : array
        s, rad, rad/s, N·m (or m, m/s, N).
    """

    time: Array
    position: Array
    velocity: Array
    torque: Array

    def part(self, chosen: Any) -> Response:
        """Return the rows of a slice or a mask."""
        return Response(self.time[chosen], self.position[chosen], self.velocity[chosen], self.torque[chosen])


@dataclass(frozen=True)
class Scales:
    """Velocity (rad/s) and displacement (rad) over which a law's torque changes."""

    velocity: float
    distance: float


def follow(model: Model, time: Any, velocity: Any) -> Response:
    """Simulate a contact that starts at rest along velocities that are linear between the times.

    Parameters
    ----------
    model : Model
    time, velocity : array, shape (n,)
        s and rad/s. A time that occurs twice makes a jump of the velocity.
    """
    before, after, span = velocity[:-1], velocity[1:], np.diff(time)
    position = np.concatenate([[0.0], np.cumsum(0.5 * (before + after) * span)])
    # A jump is a step of zero length with the new velocity, without motion.
    samples = Samples(flat(time), position, np.where(span > 0.0, before, after), flat(after))
    torque = torque_along(model.law, packed_numbers(model), model.parameters, samples)
    return Response(np.asarray(time, float), position, np.asarray(velocity, float), torque)


def scales_of(model: Model) -> Scales:
    """Determine the scales of a law from its responses.

    The velocity is that declared by the law; the displacement is that at which a creeping contact reaches 90 % of its
    largest torque.
    """
    law = model.law
    velocity = law.velocity_scale(model.parameters) if law.velocity_scale else USUAL_VELOCITY
    creep = 1e-3 * velocity
    distance = np.concatenate([[0.0], np.geomspace(1e-9, 1.0, 361)])
    torque = np.abs(follow(model, distance / creep, np.full(distance.size, creep)).torque)
    reached = float(distance[np.argmax(torque >= 0.9 * np.max(torque))])
    return Scales(velocity, reached if reached > 1e-9 else USUAL_DISTANCE)


def slow_sine(model: Model, scales: Scales) -> Response:
    """Return the second period of a sinusoidal velocity, with five times the velocity scale and travel much longer than
    presliding."""
    peak, n = 5.0 * scales.velocity, 6000
    w = peak / (1000.0 * scales.distance)
    time = np.arange(2 * n + 1) * (2.0 * math.pi / w / n)
    return follow(model, time, peak * np.sin(w * time)).part(slice(n, None))


def presliding(model: Model, scales: Scales) -> tuple[Response, Response]:
    """Return a slow loop of small motion, and a smaller inner loop that interrupts it: (all, inner loop)."""
    turns = [scales.distance * x for x in (0.0, 1.6, -1.6, 0.7, -0.7, 1.6)]
    speed, n = 1e-3 * scales.velocity, 1500
    time, velocity = [0.0], [0.0]
    for x0, x1 in pairwise(turns):
        # Half a cosine between two turning points: velocity zero at both.
        phase = np.linspace(0.0, math.pi, n + 1)[1:]
        took = abs(x1 - x0) / speed
        velocity += (0.5 * math.pi * (x1 - x0) / took * np.sin(phase)).tolist()
        time += (time[-1] + took * phase / math.pi).tolist()
    whole = follow(model, np.array(time), np.array(velocity))
    back = 4 * n + int(np.searchsorted(whole.position[4 * n :], turns[3]))
    return whole.part(slice(n, None)), whole.part(slice(3 * n, back + 1))


def velocity_steps(model: Model, scales: Scales) -> tuple[Response, tuple[float, float, float]]:
    """Return the response to steps from rest to a low velocity, to a high one, and back; each lasts until the torque
    has settled."""
    levels = (0.2 * scales.velocity, 3.0 * scales.velocity, 0.2 * scales.velocity)
    took = 20.0 * scales.distance / levels[0]
    for _ in range(8):
        answer = _steps(model, levels, took)
        span = float(np.ptp(answer.torque)) or 1.0
        ends = [answer.part(slice(i * 800 + 400, (i + 1) * 800)).torque for i in range(3)]
        if all(float(np.ptp(end)) < 2e-3 * span for end in ends):
            break
        took *= 2.0
    return _steps(model, levels, took), levels


def _steps(model: Model, levels: Sequence[float], took: float) -> Response:
    time = np.concatenate([np.linspace(i * took, (i + 1) * took, 800) for i in range(len(levels))])
    return follow(model, time, np.repeat(np.array(levels), 800))


# ---- drawing -------------------------------------------------------------------------------------------------


def units_of(law: Law) -> tuple[str, str]:
    """Return the units of torque and position: N·m and rad, or N and m for a law of a linear axis."""
    units = " ".join(f.par.unit for f in (*law.fields, *law.state_fields))
    rotary = "rad" in units or "N·m" in units or "N" not in units
    return ("N·m", "rad") if rotary else ("N", "m")


def draw_law(model: Model, *targets: Path) -> None:
    """Draw the picture of a law with its parameters.

    Parameters
    ----------
    model : Model
    *targets : Path
        Files that end in .svg, .png or .pdf.

    Raises
    ------
    InputError
        If a suffix is none of these, or a file cannot be written.
    """
    for target in targets:
        if target.suffix not in FORMATS:
            raise InputError(f"{target}: no format {target.suffix!r}; end the name in .svg, .png or .pdf")
    scales = scales_of(model)
    torque, length = units_of(model.law)
    word = "torque" if torque == "N·m" else "force"
    chosen = ", ".join(f"{name} {option}" for name, option in model.law.chosen.items())
    panels = [
        _sine_panel(slow_sine(model, scales), (word, torque), f"{length}/s"),
        _presliding_panel(*presliding(model, scales), (word, torque), length),
        _steps_panel(model, velocity_steps(model, scales), (word, torque), f"{length}/s"),
    ]
    title = model.law.title + (f", {chosen}" if chosen else "")
    save(targets, title, _described(model), panels, 2.0, option="plot")


def draw_gallery(models: Sequence[Model], path: Path) -> None:
    """Draw the loops of many laws in presliding and along a slow sine, side by side.

    Parameters
    ----------
    models : sequence of Model
    path : Path
        A file that ends in .svg, .png or .pdf.
    """
    columns = 5
    rows = 2 * math.ceil(len(models) / columns)
    context: Any = importlib.import_module("matplotlib").rc_context({**RC, "axes.grid": False})
    with context:
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure

        figure: Any = Figure(figsize=(1.8 * WIDTH, 1.1 * rows), layout="constrained")
        FigureCanvasAgg(figure)
        for i, model in enumerate(models):
            place, scales = 2 * columns * (i // columns) + i % columns + 1, scales_of(model)
            sine, loop = slow_sine(model, scales), presliding(model, scales)[0]
            above = figure.add_subplot(rows, columns, place)
            above.set_title(model.law.name, fontweight="bold")
            _sketch(above, sine.velocity, sine.torque, "velocity")
            _sketch(
                figure.add_subplot(rows, columns, place + columns), loop.position, loop.torque, "position"
            )
        # No date in the file, so equal laws give equal bytes.
        undated = {"metadata": {DATES[path.suffix]: None}} if path.suffix in DATES else {}
        with draft_of(path, "plot") as draft:
            figure.savefig(draft, format=path.suffix[1:], dpi=DPI, **undated)


def _sketch(axes: Any, x: Array, y: Array, word: str) -> None:
    """Draw a curve without numbers, with its zero lines."""
    axes.axhline(0.0, color="#bbbbbb", linewidth=0.5)
    axes.axvline(0.0, color="#bbbbbb", linewidth=0.5)
    axes.plot(x, y, color=TORQUE.colour, linewidth=1.1)
    axes.set(xticks=[], yticks=[])
    axes.set_xlabel(word, fontsize=6.5, labelpad=1.0)
    axes.set_ylabel("torque", fontsize=6.5, labelpad=1.0)


def _described(model: Model) -> str:
    """Return the parameters in one or two lines."""
    words: list[str] = []
    for f in model.law.fields:
        value = getattr(model.parameters, f.name)
        numbers = [f"{x:.5g}" for x in value] if f.per_element else [f"{value:.5g}"]
        words.append(f"{f.name} = {' '.join(numbers)}".replace(" ", "\u00a0"))
    return ", ".join(words)


def _readable(answer: Response, label: tuple[str, str]) -> tuple[Response, float, str]:
    """Return the response with its torque in a readable unit, the factor, and the label of the axis."""
    factor, unit = scaled(float(np.max(np.abs(answer.torque))), label[1])
    readable = Response(answer.time, answer.position, answer.velocity, factor * answer.torque)
    return readable, factor, f"{label[0]} ({unit})"


def _sine_panel(answer: Response, label: tuple[str, str], unit: str) -> Panel:
    answer, _, y_label = _readable(answer, label)
    factor, unit = scaled(float(np.max(np.abs(answer.velocity))), unit)
    curves = [
        Curve(factor * part.velocity, part.torque, name, style)
        for name, style, part in (
            ("speed rising", RISING, _where(answer, _gaining(answer))),
            ("speed falling", FALLING, _where(answer, ~_gaining(answer))),
        )
    ]
    return Panel(curves, y_label, f"velocity ({unit})", note="slow sine", legend="lower right")


def _gaining(answer: Response) -> Any:
    return np.gradient(np.abs(answer.velocity)) >= 0.0


def _where(answer: Response, chosen: Any) -> Response:
    """Return the response with gaps where it is not selected, joined to its neighbours."""
    wide = chosen | np.roll(chosen, 1)
    return Response(answer.time, answer.position, answer.velocity, np.where(wide, answer.torque, np.nan))


def _presliding_panel(outer: Response, inner: Response, label: tuple[str, str], unit: str) -> Panel:
    outer, times, y_label = _readable(outer, label)
    reach = float(np.max(np.abs(outer.position)))
    factor, unit = scaled(reach, unit)
    limits = (-1.1 * factor * reach, 1.9 * factor * reach)  # space for the names
    curves = [
        Curve(factor * outer.position, outer.torque, "outer loop", OUTER),
        Curve(factor * inner.position, times * inner.torque, "inner loop", INNER),
    ]
    note = "presliding: slow motion, with an inner reversal"
    return Panel(curves, y_label, f"position ({unit})", limits, note=note, legend="lower right")


def _steps_panel(
    model: Model, answered: tuple[Response, tuple[float, float, float]], label: tuple[str, str], unit: str
) -> Panel:
    (answer, times, y_label), levels = _readable(answered[0], label), answered[1]
    factor, second = scaled(float(answer.time[-1]), "s")
    curves = [Curve(factor * answer.time, answer.torque, label[0], TORQUE)]
    if model.law.steady:
        steady = np.array([model.law.steady(v, model.parameters) for v in levels])
        curves.append(
            Curve(factor * answer.time, times * np.repeat(steady, 800), "at constant velocity", STEADY)
        )
    each, unit = scaled(levels[1], unit)
    words = ", ".join(f"{each * v:.3g}" for v in levels)
    note = f"from rest, steps in velocity: {words} {unit}"
    low, high = float(np.min(answer.torque)), float(np.max(answer.torque))
    limits = (min(0.0, 1.1 * low), max(0.0, 1.1 * high) or 1.0)
    return Panel(curves, y_label, f"time ({second})", None, limits, note, legend="lower right")
