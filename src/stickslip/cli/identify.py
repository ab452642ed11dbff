"""Identify an axis or its friction from records: numbers with intervals, a verdict on each, a model and a report.

stickslip identify log.csv
stickslip identify log.mat --drive-gain 35.15 --loop kp=38996,kd=243.45,limit=10,span=2 --law coulomb --law lugre
stickslip identify a.csv b.csv --hold-out c.csv --law my_law.py --out friction
stickslip identify steps.csv --method sliding --law stribeck --noise 1e-4

The records are checked first (`stickslip doctor`); an error stops. Methods: `axis` (inertia, offset or gravity and
friction jointly, from any motion), `sliding` (constant velocities), `breakaway` (torque ramps), `presliding` and
`attraction` (GMS), `lugre` (sigma0, sigma1), `inertia` (frequency response). Of several laws the error on data left
out chooses; `sliding` without --law chooses among the curves of the thesis. With --loop and a reference in the record
the closed loop is simulated, otherwise the recorded drive. --out names a folder for model.toml and report.html, or the
model's file with the report beside it; `law = {model = "model.toml"}` names the model in a study or simulation.
"""

from __future__ import annotations

import argparse
import importlib
import sys
import threading
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from stickslip.cli import _reading
from stickslip.cli._methods import METHODS, all_laws, law_file, torque_channel, values

if TYPE_CHECKING:
    from collections.abc import Sequence

    from stickslip.identify.axis_trial import Trial
    from stickslip.identify.doctor import Diagnosis
    from stickslip.identify.estimate import Estimate, Identification
    from stickslip.machines.servo import ServoAxis
    from stickslip.record import Record
    from stickslip.report.identified import Source
    from stickslip.simulation.driven import Loop

SUMMARY = "identify inertia and a friction law from records; writes model.toml and report.html"
LOOP_NAMES = ("kp", "ki", "kd", "kr", "limit", "period", "count", "span")
NOT_NEGATIVE = ("kp", "ki", "kd", "kr", "period", "count")
RANGES = {"limit": "greater than 0", **dict.fromkeys(NOT_NEGATIVE, "a finite number of 0 or more")}


def arguments(parser: argparse.ArgumentParser) -> None:
    """Files, method, axis, laws, and how to read."""
    parser.add_argument("files", nargs="+", type=Path, metavar="LOG", help="records, fitted together")
    parser.add_argument(
        "--method", choices=("axis", "inertia", *METHODS), default="axis", help="default axis"
    )
    parser.add_argument(
        "--hold-out", "--validation", dest="validation", action="append", default=[], type=Path, metavar="LOG",
        help="not fitted, judges the result (axis)",
    )  # fmt: skip
    parser.add_argument(
        "--law", action="append", default=[], metavar="LAW", help="a law's name or file, or all; repeatable"
    )
    parser.add_argument(
        "--noise", type=float, metavar="X", help="standard deviation of what is fitted: N·m, or rad (lugre)"
    )
    parser.add_argument("--set", action="append", default=[], metavar="NAME=VALUE", help="a starting value")
    parser.add_argument(
        "--freeze", action="append", default=[], metavar="NAME[=VALUE]", help="keep at its value"
    )
    parser.add_argument(
        "--free", action="append", default=[], metavar="NAME[=VALUE]", help="fit what usually stays"
    )
    parser.add_argument(
        "--model", type=Path, metavar="MODEL.toml", help="what an earlier identification found"
    )
    parser.add_argument("--torque", metavar="CHANNEL", help="motor_torque, sensor_torque, ... (not axis)")
    parser.add_argument("--elements", type=int, default=0, metavar="N", help="of GMS (presliding; 0: chosen)")
    parser.add_argument(
        "--threshold", type=float, metavar="V", help="velocity that is motion, rad/s or m/s (breakaway; 0.01)"
    )
    _axis_arguments(parser.add_argument_group("axis"))
    parser.add_argument(
        "--out",
        type=Path,
        default=Path("model.toml"),
        metavar="DIR",
        help="folder, or FILE.toml (model.toml)",
    )
    parser.add_argument("--no-report", action="store_true", help="write no report.html")
    parser.add_argument("--json", action="store_true", help="print the result as JSON")
    _reading.add_arguments(parser)


def _axis_arguments(parser: argparse._ArgumentGroup) -> None:  # type: ignore[reportPrivateUsage]
    """What only the method `axis` (and `inertia`) looks at."""
    parser.add_argument("--inverse", action="store_true", help="linear least squares only, no simulation")
    parser.add_argument("--per-direction", action="store_true", help="friction per direction (linear part)")
    parser.add_argument("--pendulum", action="store_true", help="gravity m g l sin(q - q0)")
    parser.add_argument("--drive-gain", type=float, metavar="G", help="torque per unit of the drive's signal")
    parser.add_argument(
        "--resistance", type=float, metavar="OHM", help="of the motor, where a voltage drives it"
    )
    parser.add_argument(
        "--loop", metavar="kp=..,kd=..",
        help="sampled controller kp e + ki (integral of e) + kr v_ref - kd v, its output the recorded drive's signal "
        "(a torque: kp in N·m/rad, kd and kr in N·m·s/rad), what is left out 0; limit: of that output; period: s from "
        "sample to sample (0: the rows); count: rad of its encoder; span: samples that its velocity spans, 1 or 2",
    )  # fmt: skip
    parser.add_argument("--harmonics", type=int, default=0, metavar="N", help="of a torque over the position")
    parser.add_argument(
        "--load", action="store_true", help="friction that grows with the load of the gearing"
    )
    parser.add_argument(
        "--intervals", choices=("prediction", "covariance"), default="prediction",
        help="covariance: that of the output error, too narrow under coloured noise",
    )  # fmt: skip
    parser.add_argument(
        "--robust",
        action="store_true",
        help="outliers count linearly in the output error; the prediction error weighs them anyway",
    )


def run(args: argparse.Namespace) -> int:
    """Print estimates and verdicts, write the model and the report."""
    from stickslip.cli import _output

    sane(args)
    model_file, report_file = places(args.out)
    sources = [checked(path, args) for path in args.files]
    sources += [checked(path, args, held_out=True) for path in args.validation]
    driven([s.record for s in sources], args)
    for path, s in zip([*args.files, *args.validation], sources, strict=True):
        for finding in s.findings:
            if finding.level == "warning":
                print(f"stickslip: {path}: {finding.line()}", file=sys.stderr)
    left_out: list[str] = []
    if "all" in args.law:
        tried, left_out = all_laws()
        args.law = [*tried, *(x for x in args.law if x != "all" and x not in tried)]
    _output.say(f"method {args.method}, {sum(len(s.record) for s in sources)} samples")
    if not args.no_report:
        # What draws and writes it loads while compiled code runs.
        names = ("matplotlib.figure", "matplotlib.backends.backend_svg", "jinja2")
        threading.Thread(target=lambda: [importlib.import_module(name) for name in names]).start()
    found = identified(sources, args)
    if left_out:
        names = ", ".join(left_out)
        note = (
            f"Not among all laws, as they say no torque at constant velocity: {names}; name one with --law."
        )
        found = replace(found, notes=(*found.notes, note))
    made = written(found, sources, args, model_file, report_file)
    if args.json:
        data = [s.about for s in sources]
        findings = {s.name: [f.as_data() for f in s.findings] for s in sources}
        _output.print_json(
            {**found.as_dict(), "data": data, "findings": findings, **{k: str(v) for k, v in made.items()}}
        )
    else:
        show(found)
        for what, path in made.items():
            print(f"{what.partition('_')[0]}: {path}")
        for path in dict.fromkeys(s.record.meta["reading"].get("profile", "") for s in sources):
            if path:
                print(f"profile: {path}")
    return 0


def sane(args: argparse.Namespace) -> None:
    """Refuse numbers that mean nothing."""
    import math

    from stickslip.errors import InputError

    if args.harmonics < 0:
        raise InputError(f"--harmonics {args.harmonics} must be 0 or more")
    if args.elements < 0:
        raise InputError(f"--elements {args.elements} must be 0 or more")
    if args.noise is not None and not (math.isfinite(args.noise) and args.noise > 0.0):
        raise InputError(f"--noise {args.noise:g} must be greater than 0")
    if args.threshold is not None and not (math.isfinite(args.threshold) and args.threshold > 0.0):
        raise InputError(f"--threshold {args.threshold:g} must be greater than 0")
    if args.threshold is not None and args.method != "breakaway":
        raise InputError(f"--threshold is for --method breakaway; --method {args.method} has none")
    if args.validation and args.method != "axis":
        raise InputError(f"--hold-out is for --method axis; --method {args.method} has none")


def places(out: Path) -> tuple[Path, Path]:
    """The files of model and report; the folder is made."""
    from stickslip.study.files import prepared_folder

    if out.suffix == ".toml":
        prepared_folder(out.parent)
        name = "report.html" if out.name == "model.toml" else f"{out.stem}.html"
        return out, out.parent / name
    prepared_folder(out)
    return out / "model.toml", out / "report.html"


def identified(sources: Sequence[Source], args: argparse.Namespace) -> Identification:
    """The method's result, with the doctor's findings."""
    records = [s.record for s in sources]
    if args.method in METHODS:
        found = METHODS[args.method](records, args)
    else:
        found = whole_axis(records, args)
    return replace(found, findings=tuple(f for s in sources for f in s.findings))


def whole_axis(records: Sequence[Record], args: argparse.Namespace) -> Identification:
    """The methods `axis` and `inertia`."""
    from stickslip.cli import _output
    from stickslip.identify.axis import AUTOMATIC, identify_axis, inverse_identification
    from stickslip.identify.axis_inverse import inverse_dynamics
    from stickslip.identify.axis_output import Extras

    axis = axis_of(records[0], args)
    trials = [trial(r, axis, args) for r in records]
    fitted, held = trials[: len(args.files)], trials[len(args.files) :]
    if args.method == "inertia":
        from stickslip.identify.inertia import inertia

        return inertia(fitted, axis)
    if args.inverse:
        return inverse_identification(
            inverse_dynamics(fitted, axis, per_direction=args.per_direction, harmonics=args.harmonics), axis
        )
    given = values([p for p in (*args.set, *args.freeze, *args.free) if p in args.set or "=" in p])
    return identify_axis(
        fitted, axis, args.law or list(AUTOMATIC), validation=held, free=[n.partition("=")[0] for n in args.free],
        frozen=[n.partition("=")[0] for n in args.freeze], values=given,
        extras=Extras(harmonics=args.harmonics, load=args.load), per_direction=args.per_direction,
        robust=args.robust, intervals=args.intervals, progress=_output.say,
    )  # fmt: skip


def written(
    found: Identification, sources: Sequence[Source], args: argparse.Namespace, model_file: Path, report_file: Path
) -> dict[str, Path]:  # fmt: skip
    """Write the model (where there is a whole law) and the report."""
    from stickslip.identify.model_file import versions, write_model

    made: dict[str, Path] = {}
    if found.model is not None:
        laws: list[str] = [] if args.inverse else args.law
        data = [s.about for s in sources]
        made["model_file"] = write_model(model_file, found, data=data, law=law_file(found, laws))
    if not args.no_report:
        from stickslip.cli import _output
        from stickslip.report.identified import write_identification

        _output.say("report")
        made["report_file"] = write_identification(report_file, found, sources, versions=versions())
    return made


def driven(records: Sequence[Record], args: argparse.Namespace) -> None:
    """Refuse records that lack what the method needs, before anything else is said of them."""
    if args.method in METHODS:
        torque_channel(records, args)
    else:
        axis = axis_of(records[0], args)
        for record in records:
            trial(record, axis, args)


def checked(path: Path, args: argparse.Namespace, held_out: bool = False) -> Source:
    """Read a record and let the doctor look at it."""
    from stickslip.errors import InputError
    from stickslip.identify.doctor import examine
    from stickslip.report.identified import Source

    def accepted(record: Record) -> Diagnosis:
        found = examine(record)
        if found.errors:
            raise InputError(f"{path}: {found.errors[0].line()}; see `stickslip doctor {path}`")
        return found

    opened = _reading.open_record(path, args, accepted)
    if opened.written:
        for finding in opened.notes:
            print(f"stickslip: {path}: {finding.line()}", file=sys.stderr)
    diagnosis = accepted(opened.record)
    return Source(path.name, diagnosis.record, diagnosis.findings, source_of(diagnosis.record), held_out)


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
    from stickslip.errors import InputError
    from stickslip.identify.axis_trial import trial_of

    name = str(record.meta.get("reading", {}).get("file", "record"))
    if args.loop and not {"position_reference", "reference"} & set(record.channels):
        raise InputError(
            f"{name}: --loop needs the reference position beside {', '.join(record.channels)}; map its column with "
            "--map position_reference=COLUMN, or leave --loop out"
        )
    return trial_of(record, axis, loop=loop_of(args.loop) if args.loop else None, name=name)


def loop_of(text: str) -> Loop:
    """Read ``kp=..,kd=..``."""
    import math

    from stickslip.errors import InputError, UnknownName
    from stickslip.simulation.driven import Loop

    given = values(text.split(","))
    for name in given:
        if name not in LOOP_NAMES:
            raise UnknownName("number of --loop", name, LOOP_NAMES)
    for name, value in given.items():
        above = math.isfinite(value) or name == "limit"
        if not above or (name in NOT_NEGATIVE and value < 0.0) or (name == "limit" and not value > 0.0):
            raise InputError(f"--loop: {name} = {value:g} must be {RANGES.get(name, 'a finite number')}")
    span = given.pop("span", 1.0)
    if span not in (1.0, 2.0):
        raise InputError(f"--loop: span = {span:g} must be 1 or 2 samples")
    return Loop(velocity_span=int(span), **given)


def source_of(record: Record) -> dict[str, Any]:
    """File, hash and size of a record."""
    reading: dict[str, Any] = record.meta.get("reading", {})
    return {"file": str(reading.get("file", "")), "sha256": reading.get("sha256", ""), "rows": len(record)}


def show(found: Identification) -> None:
    """Estimates with 95 % intervals, misfits, what is not identified and what to measure."""
    law = f": law {found.model.law.name!r}" if found.model else ""
    print(f"{found.method.replace('_', ' ')}{law}\n")
    width = max(16, *(len(e.name) + 2 for e in found.estimates)) if found.estimates else 16
    for e in found.estimates:
        value = f"{'not determined':<40}" if e.undetermined else f"{e.value:>12.5g}  {interval(e):<26}"
        print(f"{e.name:<{width}}{value} {e.unit:<11} {verdict(e)}".rstrip())
    print()
    for name, number in found.misfit.items():
        print(f"{name:<32}{number:>12.5g}  {found.misfit_unit(name)}".rstrip())
    for sentence in found.notes:
        print(sentence)
    for sentence in found.measure_next:
        print(f"measure next: {sentence}")


def interval(e: Estimate) -> str:
    """The 95 % interval."""
    import math

    if math.isnan(e.lower) or math.isnan(e.upper):
        return "[unknown]"
    return f"[{e.lower:.5g}, {e.upper:.5g}]"


def verdict(e: Estimate) -> str:
    """Identified, or why not."""
    return "identified" if e.identified else f"not identified{': ' if e.verdict else ''}{e.verdict}"
