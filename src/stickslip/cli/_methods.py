"""The methods of `stickslip identify`: each takes checked records and the arguments, and gives an `Identification`."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from stickslip.identify.estimate import Identification
    from stickslip.model import Model
    from stickslip.record import Record

__all__ = ["METHODS", "values"]

TORQUES = ("motor_torque", "torque", "sensor_torque", "friction_torque")
CURVE = ("fs", "fc", "vs", "delta_s", "sigma2")


def values(pairs: Sequence[str]) -> dict[str, float]:
    """Read NAME=VALUE."""
    from stickslip.errors import InputError

    out: dict[str, float] = {}
    for pair in pairs:
        name, equals, number = pair.partition("=")
        try:
            out[name.strip()] = float(number)
        except ValueError:
            equals = ""
        if not equals:
            raise InputError(f"{pair!r} must be NAME=VALUE with a number in SI units")
    return out


def torque_channel(records: Sequence[Record], args: argparse.Namespace) -> str:
    """The channel of the torque: the one named, or the first known one that all records have."""
    from stickslip.errors import InputError, UnknownName

    have = [set(r.channels) for r in records]
    if args.torque:
        for channels in have:
            if args.torque not in channels:
                raise UnknownName("channel", args.torque, sorted(channels))
        return str(args.torque)
    for name in TORQUES:
        if all(name in channels for channels in have):
            return name
    raise InputError(
        f"{args.method} needs a torque in every record; map a column with --map torque=COLUMN:UNIT, or give "
        "--torque-constant for a current"
    )


def known_model(args: argparse.Namespace) -> Model | None:
    """The law of --model."""
    from stickslip.model import Model

    return Model.from_file(args.model) if args.model else None


def curve_values(args: argparse.Namespace) -> dict[str, float]:
    """Parameters of the sliding curve from --model and --set."""
    from stickslip.errors import InputError

    model = known_model(args)
    found: dict[str, float] = {}
    if model is not None:
        found = {n: float(getattr(model.parameters, n)) for n in CURVE if hasattr(model.parameters, n)}
    found |= {k: v for k, v in values(args.set).items() if k in CURVE}
    missing = [n for n in ("fs", "fc", "vs") if n not in found]
    if missing:
        raise InputError(
            f"--method {args.method} needs the sliding curve, which lacks {', '.join(missing)}; identify it with "
            "--method sliding and give --model model.toml, or --set fs=..,  --set fc=.. and --set vs=.."
        )
    return {"delta_s": 2.0, "sigma2": 0.0} | found


def single(records: Sequence[Record], args: argparse.Namespace) -> Record:
    """The one record that a method takes."""
    from stickslip.errors import InputError

    if len(records) != 1:
        raise InputError(f"--method {args.method} takes one record, not {len(records)}; run it for each")
    return records[0]


def breakaway(records: Sequence[Record], args: argparse.Namespace) -> Identification:
    """Torque at the break, per direction."""
    from stickslip.identify.breakaway import identify_breakaway

    options = {} if args.threshold is None else {"threshold": args.threshold}
    return identify_breakaway(records, torque=torque_channel(records, args), **options)


def sliding(records: Sequence[Record], args: argparse.Namespace) -> Identification:
    """A curve through the torques at constant velocities; of several laws, or where none is named, one is chosen."""
    from stickslip.cli import _output
    from stickslip.identify.segments import sliding_points
    from stickslip.identify.sliding import identify_sliding
    from stickslip.identify.sliding_choice import candidates, choose_sliding

    points, notes = sliding_points(records, torque=torque_channel(records, args))
    frozen = [n.partition("=")[0] for n in args.freeze]
    if not args.law:
        templates = candidates(points.velocity, points.torque, given(args))
    else:
        templates = {name: template(name, points.velocity, points.torque, args) for name in args.law}
    if len(templates) > 1:
        found = choose_sliding(points, templates, noise=args.noise, frozen=frozen, progress=_output.say)[1]
    else:
        found = identify_sliding(points, next(iter(templates.values())), noise=args.noise, frozen=frozen)
    return replace(found, notes=(*notes, *found.notes))


def given(args: argparse.Namespace) -> dict[str, float]:
    """Values of --set and --freeze."""
    return values([p for p in (*args.set, *args.freeze) if "=" in p])


def template(name: str, velocity: Any, torque: Any, args: argparse.Namespace) -> Model:
    """A law on the scales of a sliding curve, where the search starts."""
    import numpy as np

    from stickslip import plugins
    from stickslip.identify.axis_start import starts

    law = plugins.law(name)
    speed = float(np.max(np.abs(velocity)))
    known = {k: v for k, v in given(args).items() if k in {f.name for f in law.fields}}
    return starts(law, float(np.median(np.abs(torque))), 0.0, speed, 1.0, known)[0]


def presliding(records: Sequence[Record], args: argparse.Namespace) -> Identification:
    """GMS elements from loops of torque over displacement."""
    from stickslip.identify.hysteresis import Loop
    from stickslip.identify.presliding import identify_presliding

    record = single(records, args)
    loop = Loop.of(record, torque_channel(records, args))
    inertia = values(args.set).get("inertia", 0.0)
    return identify_presliding(
        loop, curve_values(args), elements=args.elements, noise=args.noise, inertia=inertia
    )


def attraction(records: Sequence[Record], args: argparse.Namespace) -> Identification:
    """GMS's attraction parameter from a motion in one direction."""
    from stickslip.errors import InputError
    from stickslip.identify.attraction import identify_attraction
    from stickslip.identify.hysteresis import Loop

    record, model = single(records, args), known_model(args)
    if model is None or model.law.name != "gms":
        raise InputError(
            "--method attraction needs a GMS law with its elements; identify it with --method presliding and give "
            "--model model.toml"
        )
    if "velocity" not in record.channels:
        raise InputError("--method attraction needs the velocity; map a column with --map velocity=COLUMN")
    loop = Loop.of(record, torque_channel(records, args), "velocity")
    return identify_attraction(loop, model, noise=args.noise)


def lugre(records: Sequence[Record], args: argparse.Namespace) -> Identification:
    """LuGre's sigma0 and sigma1 from a stick-slip response."""
    from stickslip.errors import InputError
    from stickslip.identify.lugre_dynamics import Response, identify_lugre_dynamics

    record, given = single(records, args), values(args.set)
    if "inertia" not in given:
        raise InputError("--method lugre needs the inertia in kg·m²; give --set inertia=...")
    response = Response.of(record, torque_channel(records, args))
    return identify_lugre_dynamics(response, given["inertia"], curve_values(args), noise=args.noise)


HYSTERESIS_ROWS = 8000
"""Rows that a loop is fitted to: of 25,000 the same values come in a tenth of the time."""


def hysteresis(records: Sequence[Record], args: argparse.Namespace) -> Identification:
    """A law along the measured motion, from a measured friction: Dahl, per direction, or Maxwell-slip."""
    import numpy as np

    from stickslip.errors import UnknownName
    from stickslip.identify.hysteresis import Loop, choose_hysteresis, templates_for

    whole = Loop.of(single(records, args), torque_channel(records, args))
    every = max(1, whole.time.size // HYSTERESIS_ROWS)
    loop = Loop(whole.time[::every], whole.position[::every], whole.torque[::every], whole.unit)
    templates = templates_for(loop, np.arange(loop.time.size))
    names = sorted({model.law.name for model in templates.values()})
    for law in args.law:
        if law not in names:
            raise UnknownName("law of --method hysteresis", law, names)
    wanted = {k: m for k, m in templates.items() if not args.law or m.law.name in args.law}
    chosen, found, table = choose_hysteresis(loop, wanted)
    said = [
        f"Chosen: {chosen}. Error on blocks left out: "
        + "; ".join(f"{name} {100.0 * row['cross_validated']:.2g} %" for name, row in table.items())
        + "."
    ]
    if every > 1:
        said.append(f"One row of {every} was fitted, {loop.time.size} in all.")
    details = {**found.details, "chosen": chosen}
    return replace(found, notes=(*said, *found.notes), details=details)


def load_note(records: Sequence[Record], found: Identification) -> list[str]:
    """What the recorded normal load means for the friction found; empty without one."""
    import numpy as np

    loads = [r["load"] for r in records if "load" in r.channels and r.units["load"] == "N"]
    if not loads:
        return []
    values = np.abs(np.concatenate(loads))
    low, mean, high = np.nanpercentile(values, 5), np.nanmean(values), np.nanpercentile(values, 95)
    said = f"Normal load recorded: {mean:.4g} N ({low:.4g} to {high:.4g} in 90 % of the rows); friction holds at it"
    levels = {e.name: e.value for e in found.estimates}
    linear = all(r.units.get("position") == "m" for r in records)
    if linear and mean > 0.0 and levels.get("fc", 0.0) > 0.0:
        each = [levels["fc"], levels.get("fc_negative", levels["fc"])]
        said += f", a coefficient of friction F_C / N of {0.5 * sum(each) / mean:.3g}"
    return [f"{said}. No fit here follows the load: identify records of other loads alone."]


def all_laws() -> tuple[list[str], list[str]]:
    """The registered laws for ``--law all``: those that say their torque at constant velocity, and the others."""
    from stickslip import plugins

    steady = [name for name in plugins.law_names() if plugins.law(name).steady]
    return steady, [name for name in plugins.law_names() if name not in steady]


METHODS: Mapping[str, Callable[[Sequence[Record], argparse.Namespace], Identification]] = {
    "sliding": sliding, "breakaway": breakaway, "presliding": presliding, "attraction": attraction, "lugre": lugre,
    "hysteresis": hysteresis,
}  # fmt: skip
"""Methods that need records alone; `axis` and `inertia` need the axis too."""


def law_file(found: Identification, laws: Sequence[str]) -> str:
    """The file of the law that was taken, if it came from one."""
    from stickslip import plugins

    if found.model is None:
        return ""
    return next(
        (x for x in laws if Path(x).suffix == ".py" and plugins.law(x).name == found.model.law.name), ""
    )
