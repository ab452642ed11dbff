"""Pictures of the analyses: each function converts a result to a title, a message and panels."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from stickslip.analyse.dependence import Dependence
from stickslip.analyse.flexibility import Flexibility
from stickslip.analyse.motor_vs_sensor import Sides
from stickslip.analyse.repeatability import Repeated
from stickslip.analyse.spectrum import Spectrum
from stickslip.identification.presliding.attraction import OvershootRule
from stickslip.machines.drivetrain import Chain, Modes
from stickslip.report.plots import Curve, Panel, envelope, save, scaled
from stickslip.report.styles import Style

Array = np.ndarray[Any, np.dtype[np.float64]]
Drawn = tuple[str, str, Sequence[Panel], float]
"""Title, message, panels, height of one in inches."""

MAIN = Style("#0072B2", "-", 1.3)
OTHER = Style("#D55E00", (0, (4, 1.2)), 1.3)
BOUND = Style("#000000", (0, (1, 1.5)), 1.3)
BAND = Style("#0072B2", "-", 0.6)
DASHED = (
    Style("#D55E00", (0, (4, 1))), Style("#CC79A7", (0, (1.5, 0.8))), Style("#0072B2", (0, (6, 2))),
    Style("#009E73", (0, (2, 2))), Style("#E69F00", (0, (1, 0.7))), Style("#56B4E9", (0, (8, 2))),
    Style("#7f7f7f", (0, (3, 1, 1, 1, 1, 1))),
)  # fmt: skip
LINES = (MAIN, OTHER, *DASHED[1:])
POINT = Style("#009E73", "", 1.6)
SHOWN = 50.0
"""Duration of a response to a sudden velocity, ms."""
SHARES = np.linspace(0.02, 0.98, 97)
SPLITS = {"the rest at the motor": 0.001, "the rest in the middle": 0.999}


def draw_analysis(picture: Drawn, path: Path) -> None:
    """Save a picture to a path that ends in .svg, .png or .pdf."""
    title, message, panels, height = picture
    save([path], title, message, panels, height, option="plot")


def picture_of_spectra(found: Sequence[Spectrum]) -> Drawn:
    """Return the spectral densities, one panel per record, with the modes as vertical lines."""
    panels = [_density(one) for one in found]
    first = found[0].peaks[0] if found[0].peaks else None
    where = f"strongest peak at {first.frequency:.0f} Hz" if first else "no peak stands out"
    mode = f", {first.mode}" if first and first.mode else ""
    return f"Spectrum of the {found[0].channel.replace('_', ' ')}", where + mode, panels, 2.0


def _density(one: Spectrum) -> Panel:
    peak = float(one.density[1:].max())
    modes = [
        Curve(np.array([f]), np.array([peak]), f"{name} ({f:.0f} Hz)", style, "vertical")
        for (name, f), style in zip(one.modes.items(), _marks(len(one.modes)))
    ]
    low = max(1e-6 * peak, 0.3 * float(one.density[1:].min()))
    note = one.name + "".join(f"  {p.frequency:.0f} Hz" for p in one.peaks[:3])
    return Panel(
        [Curve(one.frequency[1:], one.density[1:], "measured", MAIN), *modes],
        f"density ({one.unit}²/Hz)", "frequency (Hz)", (0.0, 0.5 * one.sample_rate),
        (low, 3.0 * peak), note, y_scale="log",
    )  # fmt: skip


def _marks(count: int) -> list[Style]:
    return [Style(DASHED[i % len(DASHED)].colour, DASHED[i % len(DASHED)].dashes, 1.0) for i in range(count)]


def picture_of_repeatability(found: Sequence[Repeated]) -> Drawn:
    """Return every controller's runs over time, with range and mean."""
    worst = max(found, key=lambda one: one.relative)
    message = f"the runs of {worst.name} differ most: {100 * worst.relative:.2g} % of the amplitude RMS"
    return "Repeated runs", message, [p for one in found for p in (_runs(one), _spread(one))], 1.6


def _runs(one: Repeated) -> Panel:
    factor, unit = scaled(float(np.max(np.abs(one.runs))), one.unit)
    x, low = _thin(one.time, factor * one.low)
    high = _thin(one.time, factor * one.high)[1]
    grey = Style("#777777", "-", 0.5)
    curves = [Curve(x, low, "range", BAND, "band", high)]
    curves += [
        Curve(*envelope(one.time, factor * run), "runs" if i == 0 else "", grey)
        for i, run in enumerate(one.runs)
    ]
    curves.append(Curve(*_thin(one.time, factor * one.mean), "mean", MAIN))
    note = f"{one.name}: {len(one.runs)} runs, spread {100 * one.relative:.2g} % of the amplitude"
    channel = one.channel.replace("_", " ")
    return Panel(curves, f"{channel} ({unit})", "time (s)", (0.0, float(one.time[-1])), None, note)


def _spread(one: Repeated) -> Panel:
    factor, unit = scaled(float(np.max(one.spread)), one.unit)
    curve = Curve(*envelope(one.time, factor * one.spread), "spread", OTHER)
    return Panel([curve], f"spread ({unit})", "time (s)", (0.0, float(one.time[-1])))


def _thin(x: Array, y: Array, most: int = 760) -> tuple[Array, Array]:
    step = max(1, x.size // most)
    return x[::step], y[::step]


def picture_of_dependence(found: Dependence) -> Drawn:
    """Return the torque over the angle, one line per pass."""
    angle = np.degrees(found.angle)
    curves = [
        Curve(angle, p.torque, f"{p.name}, {p.time:.0f} s", LINES[i % len(LINES)])
        for i, p in enumerate(found.passes[: len(LINES)])
    ]
    panels = [
        Panel(
            curves, f"{found.channel.replace('_', ' ')} (N·m)", "angle of the shaft (degrees)", (0.0, 360.0)
        )
    ]
    swing = max(p.swing for p in found.passes)
    message = f"peak to peak up to {swing:.3g} N·m"
    speeds = np.abs([p.velocity for p in found.passes])
    if len({p.time for p in found.passes}) > 2 and np.ptp(speeds) < 0.02 * float(np.mean(speeds)):
        panels.append(Panel([*_means(found)], "mean (N·m)", "time (s)"))
        message += f"; the mean changes by {100.0 * found.drift:.2g} % in one direction"
    return "Torque against position", message, panels, 2.4 if len(panels) == 1 else 2.0


def _means(found: Dependence) -> Iterator[Curve]:
    """Return the mean torque of every pass over time, separately for each direction."""
    for forth, word, style, kind in ((True, "forth", MAIN, "points"), (False, "back", OTHER, "open points")):
        some = [p for p in found.passes if (p.velocity > 0.0) == forth]
        yield Curve(np.array([p.time for p in some]), np.array([p.mean for p in some]), word, style, kind)


def picture_of_sides(found: Sides) -> Drawn:
    """Return both torques over velocity, and their difference with its fit."""
    v = np.array([p.velocity for p in found.points])
    order = np.argsort(v)
    motor = np.array([p.motor for p in found.points])[order]
    sensor = np.array([p.sensor for p in found.points])[order]
    v = v[order]
    span: Array = np.linspace(float(found.velocity.min()), float(found.velocity.max()), 401)
    fit = np.where(np.abs(span) > 1e-3 * np.max(np.abs(span)), found.difference(span), math.nan)
    top = Panel(
        [Curve(v, motor, "motor", MAIN, "points"), Curve(v, sensor, "sensor", OTHER, "open points")],
        "torque (N·m)", "velocity (rad/s)",
    )  # fmt: skip
    below = Panel(
        [
            Curve(v, motor - sensor, "motor minus sensor", BOUND, "points"),
            Curve(span, fit, "Coulomb and viscous", MAIN),
        ],
        "difference (N·m)", "velocity (rad/s)",
    )  # fmt: skip
    message = f"between them {found.coulomb:.3g} N·m sign(v) + {found.viscous:.3g} N·m·s/rad v"
    return "Motor and sensor torque", message, (top, below), 1.8


def picture_of_overshoot(found: OvershootRule) -> Drawn:
    """Return responses of GMS to a sudden velocity for several C (thesis figures 4.14, 4.38), and the overshoot over
    C."""
    drawn: dict[float, str] = dict.fromkeys(found.values[:: found.values.size // 2].tolist(), "")
    drawn[float(found.model.parameters.c)] = "of the model"
    if found.c is not None:
        drawn[found.c] = "first without overshoot"
    steady = found.model.sliding_torque(found.velocity)
    curves: list[Curve] = []
    for (c, word), style in zip(sorted(drawn.items()), itertools.cycle(LINES)):
        time, torque = found.response(c)
        curves.append(Curve(1e3 * time, torque, f"C = {c:.4g} N·m/s{f', {word}' if word else ''}", style))
    curves.append(Curve(np.array([0.0, SHOWN]), np.full(2, steady), "steady", BOUND))
    limits = 0.9 * steady, max(1.05 * float(curve.y.max()) for curve in curves)
    top = 110.0 * max(float(found.overshoot.max()), 0.01)
    panels = (
        Panel(curves, "friction torque (N·m)", "time (ms)", (0.0, SHOWN), limits),
        Panel([Curve(found.values, 100.0 * found.overshoot, "overshoot", Style("#000000", "-", 1.3))],
              "overshoot (%)", "C (N·m/s)", (float(found.values[0]), float(found.values[-1])), (0.0, top),
              x_scale="log"),
    )  # fmt: skip
    return f"Response of GMS to a sudden {found.velocity:g} rad/s", found.sentence, panels, 2.6


def picture_of_flexibility(found: Flexibility) -> Drawn:
    """Return the first mode over the share of the last inertia, and the modes of given inertias (thesis figure 4.57).

    With no division of the rest is a first mode below the bound.
    """
    curves: list[Curve] = []
    if len(found.stiffness) == 2:
        for i, (label, part) in enumerate(SPLITS.items()):
            # `part` is the middle inertia's share of the rest.
            f = [
                Chain(((1 - s) * (1 - part) * found.inertia, (1 - s) * part * found.inertia, s * found.inertia),
                      found.stiffness).modes().frequencies[1]
                for s in SHARES
            ]  # fmt: skip
            curves.append(Curve(100.0 * SHARES, np.array(f), label, LINES[i]))
    else:
        f = [
            Chain(((1 - s) * found.inertia, s * found.inertia), found.stiffness[-1:]).modes().frequencies[1]
            for s in SHARES
        ]
        curves.append(Curve(100.0 * SHARES, np.array(f), "last spring alone", MAIN))
    ends = np.array([0.0, 100.0])
    curves.append(
        Curve(ends, np.full(2, found.floor), f"lowest possible, {found.floor:.0f} Hz", Style("#000000", "-", 1.6))
    )  # fmt: skip
    curves += [
        Curve(
            ends, np.full(2, f), f"claimed first mode, {f:.0f} Hz", Style(DASHED[0].colour, BOUND.dashes, 1.4)
        )
        for f in found.claimed[:1]
    ]
    if found.chain and found.modes:
        share = 100.0 * found.chain.inertias[-1] / found.chain.total
        label = f"these inertias, {found.modes.frequencies[1]:.0f} Hz"
        curves.append(Curve(np.array([share]), found.modes.frequencies[1:2], label, POINT, "points"))
    top = 2.5 * found.floor
    impossible = [f for i, f in enumerate(found.claimed, 1) if f < found.lowest(i)]
    what = " and ".join(f"{f:g} Hz" for f in impossible)
    message = f"no division of {found.inertia:.4g} kg·m² puts the first mode below {found.floor:.0f} Hz" + (
        f"; {what}: impossible" if impossible else ""
    )
    panels = [
        Panel(
            curves, "first mode (Hz)", "share of the last inertia in the whole (%)", (0.0, 100.0),
            (0.6 * found.floor, top),
        )
    ]  # fmt: skip
    if found.chain and found.modes:
        panels.append(_shapes(found.chain, found.modes))
    return "Possible first modes of the drivetrain", message, panels, 2.6


def _shapes(chain: Chain, modes: Modes) -> Panel:
    """Draw the angle of every inertia in every mode, the largest 1."""
    row = np.arange(float(len(chain.inertias)))
    curves = [
        Curve(modes.shapes[:, i], row, f"mode at {f:.0f} Hz", replace(LINES[i % len(LINES)], marker="o"))
        for i, f in enumerate(modes.frequencies)
    ]
    names = [f"$J_{{{i}}}$ = {x:.3g} kg·m²" for i, x in enumerate(chain.inertias, 1)]
    return Panel(curves, "", "angle in a mode, the largest 1", (-1.15, 1.15), y_names=names)
