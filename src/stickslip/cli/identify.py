"""Identify an axis or its friction from records: numbers with intervals, a verdict on each, a model and a report.

stickslip identify log.csv
stickslip identify log.mat --drive-gain 35.15 --loop kp=38996,kd=243.45,limit=10,span=2 --law coulomb --law lugre
stickslip identify a.csv b.csv --hold-out c.csv --law my_law.py --out friction
stickslip identify steps.csv --method sliding --law stribeck --noise 1e-4

The records are checked first (`stickslip doctor`); an error stops. Methods: `axis` (inertia, offset or gravity and
friction jointly, from any motion), `sliding` (constant velocities), `breakaway` (torque ramps), `presliding` and
`attraction` (GMS), `hysteresis` (a measured friction along its motion), `lugre` (sigma0, sigma1), `inertia`
(frequency response). Of several laws the error on data left out chooses; `sliding` without --law chooses among the
curves of the thesis. With --loop and a reference in the record the closed loop is simulated, otherwise the recorded
drive. --out names a folder for model.toml and report.html, or the model's file with the report beside it; `law =
{model = "model.toml"}` names the model in a study or simulation. What is printed ends with the next command.
"""

from __future__ import annotations

import argparse
import importlib
import sys
import threading
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from stickslip.cli import _files, _reading
from stickslip.cli._methods import METHODS, all_laws, law_file, load_note, torque_channel, values

if TYPE_CHECKING:
    from collections.abc import Sequence

    from stickslip.identify.axis_trial import Trial
    from stickslip.identify.doctor import Diagnosis
    from stickslip.identify.estimate import Identification
    from stickslip.identify.regressions import Regress
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
    _files.force_argument(parser)
    _reading.add_arguments(parser, part=True)


def _axis_arguments(parser: argparse._ArgumentGroup) -> None:  # type: ignore[reportPrivateUsage]
    """What only the method `axis` (and `inertia`) looks at."""
    parser.add_argument("--inverse", action="store_true", help="linear least squares only, no simulation")
    parser.add_argument(
        "--per-direction", action="store_true", help="friction with parameters of its own for each direction"
    )
    parser.add_argument("--pendulum", action="store_true", help="gravity m g l sin(q - q0)")
    parser.add_argument("--drive-gain", type=float, metavar="G", help="torque per unit of the drive's signal")
    parser.add_argument(
        "--resistance", type=float, metavar="OHM", help="of the motor, where a voltage drives it"
    )
    parser.add_argument(
        "--loop", action="append", default=[], metavar="kp=..,kd=..",
        help="sampled controller kp e + ki (integral of e) + kr v_ref - kd v, its output the recorded drive's signal "
        "(a torque: kp in N·m/rad, kd and kr in N·m·s/rad), what is left out 0; limit: of that output; period: s from "
        "sample to sample (0: the rows); count: rad of its encoder; span: samples that its velocity spans, 1 or 2. "
        "Once for each LOG, in their order, where they ran with different gains",
    )  # fmt: skip
    parser.add_argument(
        "--loop-output", choices=("torque", "current", "voltage"),
        help="what the loop's output is where no drive signal is recorded (torque; voltage with --resistance); of a "
        "voltage the duty cycle, where the record has the supply",
    )  # fmt: skip
    parser.add_argument(
        "--extra-torque",
        metavar="CHANNEL",
        help="a known torque that acts beside the recorded one, such as compensation_torque; is added to it",
    )
    parser.add_argument(
        "--torque-is", choices=("commanded", "actual", "mean"),
        help="what the column of the torque holds: the command from this row to the next, the value at the row, or "
        "the mean over the row before; found from the record unless given",
    )  # fmt: skip
    parser.add_argument(
        "--delay", type=float, metavar="S",
        help="s from then until it acts (current loop, dead time); 0 where --torque-is is given alone",
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
    from stickslip.cli._identified import show
    from stickslip.identify.regressions import Regressions
    from stickslip.report.answers import answers_of
    from stickslip.report.identified import files_of

    sane(args)
    model_file, report_file = places(args.out)
    files, regress = [*args.files, *args.validation], Regressions()
    beside, loops = _reading.beside_of(args, len(files)), loops_of(args, len(files))
    sources: list[Source] = []
    for number, (path, more, loop) in enumerate(zip(files, beside, loops, strict=True)):
        read = checked(path, args, regress, held_out=number >= len(args.files), beside=more)
        sources += [replace(s, record=with_loop(s.record, loop)) for s in read]
    if friction_alone([s.record for s in sources], args):
        args.method = "hysteresis"
        why = "the friction itself is recorded, and no torque of a drive"
        print(f"stickslip: {why}: --method hysteresis is taken, a law along the motion", file=sys.stderr)
    driven([s.record for s in sources], args)
    _files.refuse_foreign([model_file, *([] if args.no_report else [report_file])], args.force)
    for s in sources:
        for finding in s.findings:
            if finding.level == "warning":
                print(f"stickslip: {s.about['file']}: {finding.line()}", file=sys.stderr)
    left_out: list[str] = []
    if "all" in args.law:
        tried, left_out = all_laws()
        args.law = [*tried, *(x for x in args.law if x != "all" and x not in tried)]
    _output.say(f"method {args.method}, {sum(len(s.record) for s in sources)} samples")
    if not args.no_report:
        # What writes it loads while compiled code runs.
        threading.Thread(target=lambda: importlib.import_module("jinja2")).start()
    found = identified(sources, args, regress)
    if left_out:
        names = ", ".join(left_out)
        note = (
            f"Not among all laws, as they say no torque at constant velocity: {names}; name one with --law."
        )
        found = replace(found, notes=(*found.notes, note))
    made = written(found, sources, args, model_file, report_file)
    _files.written(made.values())
    fitted = [s for s in sources if not s.held_out]
    answers = answers_of(found, [s.record for s in fitted], model_file, files_of(fitted))
    if args.json:
        data = [s.about for s in sources]
        findings = {s.name: [f.as_data() for f in s.findings] for s in sources}
        _output.print_json(
            {
                **found.as_dict(), "data": data, "findings": findings, **{k: str(v) for k, v in made.items()},
                "next": [s.command for s in answers.steps if s.command],
            }
        )  # fmt: skip
    else:
        show(found, answers)
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
    if args.delay is not None and not (math.isfinite(args.delay) and abs(args.delay) < 1.0):
        raise InputError(
            f"--delay {args.delay:g} s, the time until the torque acts, must lie between -1 and 1 s"
        )
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


def identified(sources: Sequence[Source], args: argparse.Namespace, regress: Regress) -> Identification:
    """The method's result, with the doctor's findings."""
    from stickslip.identify.on_a_line import along_a_line

    records = [s.record for s in sources]
    if args.method in METHODS:
        found = METHODS[args.method](records, args)
        if all(r.units.get("position") == "m" for r in records):
            found = along_a_line(found)
    else:
        found = whole_axis(records, args, sum(s.held_out for s in sources), regress)
    notes = (*found.notes, *assumptions(found, args), *load_note(records, found))
    return replace(found, notes=notes, findings=tuple(f for s in sources for f in s.findings))


def assumptions(found: Identification, args: argparse.Namespace) -> list[str]:
    """That parameters of the law which nobody gave were not fitted, and their values."""
    given = {p.partition("=")[0] for p in (*args.set, *args.freeze)} | set(found.details.get("untouched", ()))
    values: dict[str, list[float]] = {}
    for name, value in found.assumed.items() if not args.model else ():
        if name not in given and name.partition("[")[0] not in given:
            values.setdefault(name.partition("[")[0], []).append(value)
    if not values:
        return []
    listed = ", ".join(f"{name} = {', '.join(f'{x:.4g}' for x in own)}" for name, own in values.items())
    fit = "; --free NAME fits one" if args.method == "axis" else ""
    return [f"Assumed, not fitted: {listed}{fit}, --set NAME=VALUE takes another."]


def whole_axis(
    records: Sequence[Record], args: argparse.Namespace, held_out: int, regress: Regress
) -> Identification:
    """The methods `axis` and `inertia`; the last `held_out` records judge."""
    from stickslip.cli import _output
    from stickslip.identify.axis import AUTOMATIC, identify_axis
    from stickslip.identify.axis_agreed import regressed
    from stickslip.identify.axis_inverse import inverse_dynamics
    from stickslip.identify.axis_output import Extras
    from stickslip.identify.axis_plain import inverse_identification

    axis = axis_of(records[0], args)
    trials = [trial(r, axis, args) for r in records]
    fitted, held = trials[: len(trials) - held_out], trials[len(trials) - held_out :]
    if args.method == "inertia":
        from stickslip.identify.inertia import inertia

        return inertia(fitted, axis)
    if args.inverse:
        plain = inverse_dynamics(fitted, axis, per_direction=args.per_direction, harmonics=args.harmonics)
        sliding, _ = regressed(fitted, axis, skew_of(fitted, args), regress=regress)
        return inverse_identification(plain, axis, sliding, held)
    given = values([p for p in (*args.set, *args.freeze, *args.free) if p in args.set or "=" in p])
    return identify_axis(
        fitted, axis, args.law or list(AUTOMATIC), validation=held, free=[n.partition("=")[0] for n in args.free],
        frozen=[n.partition("=")[0] for n in args.freeze], values=given,
        extras=Extras(harmonics=args.harmonics, load=args.load), per_direction=args.per_direction,
        robust=args.robust, intervals=args.intervals, skew=skew_of(fitted, args), regress=regress,
        progress=_output.say,
    )  # fmt: skip


def skew_of(trials: Sequence[Trial], args: argparse.Namespace) -> float | None:
    """s by which the torque's column lies behind the torque that acted, if --torque-is or --delay say so."""
    if args.torque_is is None and args.delay is None:
        return None
    # A command acts half a row after its row, on average; a mean over the row before acted half a row before it.
    rows = {"commanded": -0.5, "actual": 0.0, "mean": 0.5}[args.torque_is or "commanded"]
    return rows * max(t.period for t in trials) - (args.delay or 0.0)


def written(
    found: Identification, sources: Sequence[Source], args: argparse.Namespace, model_file: Path, report_file: Path
) -> dict[str, Path]:  # fmt: skip
    """Write the model (where there is a whole law) and the report."""
    from stickslip.identify.model_file import versions, write_model

    made: dict[str, Path] = {}
    if found.model is not None:
        found.model.warn(str(model_file))
        laws: list[str] = [] if args.inverse else args.law
        data = [s.about for s in sources]
        made["model_file"] = write_model(
            model_file, found, data=data, law=law_file(found, laws), more=recorded(sources)
        )
    if not args.no_report:
        from stickslip.cli import _output
        from stickslip.report.identified import write_identification

        _output.say("report")
        made["report_file"] = write_identification(
            report_file, found, sources, versions=versions(), model_file=model_file
        )
    return made


def recorded(sources: Sequence[Source]) -> dict[str, Any]:
    """Tables of what the records hold beside friction: the motion of the first that moves, speeds, side of the gear."""
    from stickslip.errors import InputError
    from stickslip.identify.motion import motion_of, speeds_of

    fitted = [s for s in sources if not s.held_out and "position" in s.record.channels]
    out: dict[str, Any] = {}
    if fitted and (speeds := speeds_of([s.record for s in fitted])):
        out["speeds"] = speeds
    for source in fitted:
        try:
            out["trajectory"] = motion_of(source.record, source.name).table()
            break
        except InputError:
            continue
    drive: dict[str, Any] = fitted[0].record.meta.get("reading", {}).get("drive", {}) if fitted else {}
    if "gear_ratio" in drive:
        out["axis"] = {"seen_from": drive.get("side", "motor"), "gear_ratio": float(drive["gear_ratio"])}
    return out


def driven(records: Sequence[Record], args: argparse.Namespace) -> None:
    """Refuse records that lack what the method needs, before anything else is said of them."""
    if args.method in METHODS:
        torque_channel(records, args)
        return
    axis = axis_of(records[0], args)
    trials = [trial(record, axis, args) for record in records]
    refuse_unused(records, trials, args)


def friction_alone(records: Sequence[Record], args: argparse.Namespace) -> bool:
    """Whether a record holds what an axis has no equation of motion for: friction as a sensor measures it."""
    from stickslip.identify.axis_trial import DRIVES

    channels = set[str]().union(*(r.channels for r in records))
    asked = args.inverse or args.loop or args.validation or len(records) != 1 or args.method != "axis"
    return not asked and "friction_torque" in channels and not channels & set(DRIVES)


def refuse_unused(records: Sequence[Record], trials: Sequence[Trial], args: argparse.Namespace) -> None:
    """A motor's constant that nothing is multiplied by would be left out in silence."""
    from stickslip.errors import InputError

    quantities = {t.quantity for t in trials} if args.drive_gain is None else {"gain"}
    derived = any("motor_torque" in r.meta.get("derived", {}) for r in records)
    unused: list[str] = []
    if args.torque_constant is not None and not quantities & {"current", "voltage"} and not derived:
        unused.append(f"--torque-constant {args.torque_constant:g}")
    if args.resistance is not None and "voltage" not in quantities:
        unused.append(f"--resistance {args.resistance:g}")
    if unused:
        instead = "; --drive-gain says all of it" if args.drive_gain is not None else ""
        made = ", the loop's output" if any(t.drive is None for t in trials) else ""
        raise InputError(
            f"{' and '.join(unused)} would not be used: the drive's signal is a {' and a '.join(sorted(quantities))}"
            f"{made}{instead}; leave it out, map the current or voltage (--map current=COLUMN), or say --loop-output"
        )


def checked(
    path: Path, args: argparse.Namespace, regress: Regress, held_out: bool = False, beside: Path | None = None
) -> list[Source]:
    """Read a record and let the doctor look at it; several pieces where many rows in a row are left out."""
    from stickslip.errors import InputError
    from stickslip.identify.doctor import examine
    from stickslip.readers.cut import file_rows, pieces
    from stickslip.report.identified import Source

    def accepted(record: Record) -> list[Diagnosis]:
        parts, short = pieces(record)
        every = [examine(part, accept=args.accept, regress=regress) for part in parts]
        for found in every:
            if found.errors:
                raise InputError(f"{path}: {found.errors[0].line()}; see `stickslip doctor {path}`")
        return [replace(every[0], findings=(*every[0].findings, *short)), *every[1:]]

    opened = _reading.open_record(path, args, accepted, beside)
    if opened.written or opened.tells_numbers:
        for finding in opened.notes[:1]:
            print(f"stickslip: {path}: {finding.line()}", file=sys.stderr)
    every = accepted(opened.record)
    names = [path.name]
    if len(every) > 1:
        ends = [file_rows(d.record)[[0, -1]] for d in every]
        names = [f"{path.name} rows {first}:{last}" for first, last in ends]
    return [
        Source(name, d.record, d.findings, source_of(d.record), held_out)
        for name, d in zip(names, every, strict=True)
    ]


def axis_of(record: Record, args: argparse.Namespace) -> ServoAxis:
    """The axis; the reader has brought the record to one side of the gearing already."""
    from stickslip.machines.servo import Motor, ServoAxis

    known = record.meta.get("reading", {}).get("drive", {})  # a profile's, too
    constant = args.torque_constant if args.torque_constant is not None else known.get("torque_constant")
    return ServoAxis(
        motion="linear" if record.units.get("position") == "m" else "rotary", drive_side="load",
        gravity="pendulum" if args.pendulum else "constant", drive_gain=args.drive_gain,
        motor=Motor(torque_constant=constant, resistance=args.resistance),
    )  # fmt: skip


def trial(record: Record, axis: ServoAxis, args: argparse.Namespace) -> Trial:
    """The record as a trial."""
    from stickslip.errors import InputError
    from stickslip.identify.axis_trial import DRIVES, trial_of

    name, loop = str(record.meta.get("reading", {}).get("file", "record")), str(record.meta.get("loop", ""))
    if loop and not {"position_reference", "reference"} & set(record.channels):
        raise InputError(
            f"{name}: --loop needs the reference position beside {', '.join(record.channels)}; map its column with "
            "--map position_reference=COLUMN, or leave --loop out"
        )
    recorded = bool(set(DRIVES) & set(record.channels))
    output = args.loop_output or ("torque" if args.resistance is None else "voltage")
    if recorded or output != "voltage":  # a signal in V or A is what it is, whatever supplies it
        record = replace(record, channels={k: v for k, v in record.channels.items() if k != "supply"})
    if args.extra_torque:
        record = with_extra(record, args.extra_torque, loop)
    return trial_of(record, axis, loop=loop_of(loop) if loop else None, name=name, output=output)


def with_extra(record: Record, channel: str, loop: str) -> Record:
    """The record with a known torque added to the recorded one."""
    from stickslip.errors import InputError, UnknownName

    if channel not in record.channels:
        raise UnknownName("channel of --extra-torque", channel, sorted(record.channels))
    if loop or "motor_torque" not in record.channels:
        why = "the loop that --loop simulates would not make it" if loop else "no torque is recorded"
        raise InputError(
            f"--extra-torque {channel} is added to the recorded torque, but {why}; leave one out"
        )
    total = record["motor_torque"] + record[channel]
    return replace(record, channels={**record.channels, "motor_torque": total})


def loops_of(args: argparse.Namespace, count: int) -> list[str]:
    """The text of --loop for every LOG: one for all, or one for each."""
    from stickslip.errors import InputError

    if len(args.loop) > 1 and len(args.loop) != count:
        raise InputError(
            f"--loop is given {len(args.loop)} times for {count} LOGs; give it once, or once for each"
        )
    return args.loop if len(args.loop) > 1 else (args.loop or [""]) * count


def with_loop(record: Record, loop: str) -> Record:
    """The record, its loop's text in meta."""
    return replace(record, meta={**record.meta, "loop": loop}) if loop else record


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
    said = {"file": str(reading.get("file", "")), "sha256": reading.get("sha256", ""), "rows": len(record)}
    kept = ", ".join(f"{a}:{b}" for a, b in reading.get("kept_rows", [])[:20])
    return {**said, "rows_of_file": kept} if kept else said
