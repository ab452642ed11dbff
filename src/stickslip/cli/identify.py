"""Identify an axis from its records: inertia, offset or gravity, and a friction law, with intervals and verdicts.

stickslip identify log.csv
stickslip identify log.mat --drive-gain 35.15 --loop kp=38996,kd=243.45,limit=10,span=2 --law coulomb --law lugre
stickslip identify a.csv b.csv --validation c.csv --law my_law.py --out model.toml

The records are checked first (`stickslip doctor`); an error stops. Of several laws the error on held-out data chooses.
With --loop and a reference in the record the closed loop is simulated, otherwise the recorded drive. The law is
written to model.toml, which `law = {model = "model.toml"}` names in a study or simulation.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from stickslip.cli import _reading

if TYPE_CHECKING:
    from collections.abc import Sequence

    from stickslip.identify.axis_trial import Trial
    from stickslip.identify.estimate import Identification
    from stickslip.machines.servo import ServoAxis
    from stickslip.record import Record
    from stickslip.simulation.driven import Loop

SUMMARY = "identify inertia and a friction law from records; writes model.toml"
LOOP_NAMES = ("kp", "ki", "kd", "kr", "limit", "period", "count", "span")


def arguments(parser: argparse.ArgumentParser) -> None:
    """Files, axis, laws, and how to read."""
    parser.add_argument("files", nargs="+", type=Path, metavar="LOG", help="records, fitted together")
    parser.add_argument(
        "--validation", action="append", default=[], type=Path, metavar="LOG", help="held out"
    )
    parser.add_argument(
        "--law", action="append", default=[], metavar="LAW", help="a law's name or file; repeatable"
    )
    parser.add_argument("--inverse", action="store_true", help="linear least squares only, no simulation")
    parser.add_argument("--per-direction", action="store_true", help="friction per direction (linear part)")
    parser.add_argument("--pendulum", action="store_true", help="gravity m g l sin(q - q0)")
    parser.add_argument("--drive-gain", type=float, metavar="G", help="torque per unit of the drive's signal")
    parser.add_argument(
        "--resistance", type=float, metavar="OHM", help="of the motor, where a voltage drives it"
    )
    parser.add_argument("--loop", metavar="kp=..,kd=..", help=f"sampled controller: {', '.join(LOOP_NAMES)}")
    parser.add_argument("--set", action="append", default=[], metavar="NAME=VALUE", help="a starting value")
    parser.add_argument("--freeze", action="append", default=[], metavar="NAME", help="keep at its value")
    parser.add_argument("--free", action="append", default=[], metavar="NAME", help="fit what usually stays")
    parser.add_argument("--harmonics", type=int, default=0, metavar="N", help="of a torque over the position")
    parser.add_argument(
        "--load", action="store_true", help="friction that grows with the load of the gearing"
    )
    parser.add_argument("--robust", action="store_true", help="outliers count linearly")
    parser.add_argument("--out", type=Path, default=Path("model.toml"), metavar="FILE.toml")
    parser.add_argument("--json", action="store_true", help="print the result as JSON")
    _reading.add_arguments(parser)


def run(args: argparse.Namespace) -> int:
    """Print estimates and verdicts, write the model."""
    from stickslip.cli import _output
    from stickslip.errors import InputError
    from stickslip.identify.axis import AUTOMATIC, identify_axis, inverse_identification
    from stickslip.identify.axis_inverse import inverse_dynamics
    from stickslip.identify.axis_output import Extras
    from stickslip.identify.model_file import write_model

    if args.harmonics < 0:
        raise InputError(f"--harmonics {args.harmonics} must be 0 or more")
    records = [checked(path, args) for path in (*args.files, *args.validation)]
    axis = axis_of(records[0], args)
    trials = [trial(r, axis, args) for r in records]
    fitted, held = trials[: len(args.files)], trials[len(args.files) :]
    laws: list[str] = args.law or list(AUTOMATIC)
    if args.inverse:
        found = inverse_identification(
            inverse_dynamics(fitted, axis, per_direction=args.per_direction, harmonics=args.harmonics), axis
        )
        laws = []
    else:
        found = identify_axis(
            fitted, axis, laws, validation=held, free=args.free, frozen=args.freeze, values=values(args.set),
            extras=Extras(harmonics=args.harmonics, load=args.load), per_direction=args.per_direction,
            robust=args.robust,
        )  # fmt: skip
    data = [source_of(r) for r in records]
    path = write_model(args.out, found, data=data, law=path_of(found, laws))
    if args.json:
        _output.print_json({**found.as_dict(), "data": data, "model_file": str(path)})
    else:
        show(found)
        print(f"model: {path}")
    return 0


def checked(path: Path, args: argparse.Namespace) -> Record:
    """Read a record and let the doctor look at it; warnings go to stderr."""
    import sys

    from stickslip.errors import InputError
    from stickslip.identify.doctor import examine

    record = _reading.open_record(path, args).record
    diagnosis = examine(record)
    if diagnosis.errors:
        raise InputError(f"{path}: {diagnosis.errors[0].line()}; see `stickslip doctor {path}`")
    for finding in diagnosis.warnings:
        print(f"stickslip: {path}: {finding.line()}", file=sys.stderr)
    return record


def axis_of(record: Record, args: argparse.Namespace) -> ServoAxis:
    """The axis; the reader has brought the record to one side of the gearing already."""
    from stickslip.machines.servo import Motor, ServoAxis

    return ServoAxis(
        motion="linear" if record.units.get("position") == "m" else "rotary", drive_side="load",
        gravity="pendulum" if args.pendulum else "constant", drive_gain=args.drive_gain,
        motor=Motor(torque_constant=args.torque_constant, resistance=args.resistance),
    )  # fmt: skip


def trial(record: Record, axis: ServoAxis, args: argparse.Namespace) -> Trial:
    """The record as a trial."""
    from stickslip.identify.axis_trial import trial_of

    name = str(record.meta.get("reading", {}).get("file", "record"))
    return trial_of(record, axis, loop=loop_of(args.loop) if args.loop else None, name=name)


def loop_of(text: str) -> Loop:
    """Read ``kp=..,kd=..``."""
    from stickslip.errors import UnknownName
    from stickslip.simulation.driven import Loop

    given = values(text.split(","))
    for name in given:
        if name not in LOOP_NAMES:
            raise UnknownName("number of --loop", name, LOOP_NAMES)
    span = int(given.pop("span", 1))
    return Loop(velocity_span=span, **given)


def values(pairs: list[str]) -> dict[str, float]:
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


def path_of(found: Identification, laws: Sequence[str]) -> str:
    """The file of the law that was taken, if it came from one."""
    from stickslip import plugins

    assert found.model is not None
    return next((x for x in laws if x.endswith(".py") and plugins.law(x).name == found.model.law.name), "")


def source_of(record: Record) -> dict[str, Any]:
    """File, hash and size of a record."""
    reading: dict[str, Any] = record.meta.get("reading", {})
    return {"file": str(reading.get("file", "")), "sha256": reading.get("sha256", ""), "rows": len(record)}


def show(found: Identification) -> None:
    """Estimates with 95 % intervals, misfits, what is not identified and what to measure."""
    assert found.model is not None
    print(f"{found.method}: law {found.model.law.name!r}\n")
    for e in found.estimates:
        verdict = "" if e.identified else f"  not identified: {e.verdict}"
        print(f"{e.name:<16}{e.value:>12.5g}  [{e.lower:.5g}, {e.upper:.5g}] {e.unit}{verdict}")
    print()
    for name, number in found.misfit.items():
        print(f"{name:<32}{number:>12.5g}")
    for sentence in (*found.notes, *found.measure_next):
        print(sentence)
