"""Identify an axis or its friction from records; gives intervals, verdicts, a model and a report.

stickslip identify log.csv
stickslip identify log.mat --drive-gain 35.15 --loop kp=38996,kd=243.45,limit=10,span=2 --law coulomb --law lugre
stickslip identify a.csv b.csv --hold-out c.csv --law my_law.py --out friction
stickslip identify steps.csv --method sliding --law stribeck --noise 1e-4

The records are checked first (`stickslip doctor`); an error stops the identification. Methods: `axis` (inertia, offset
or gravity and friction jointly, from any motion), `sliding` (constant velocities, in a log or as a table of velocities
and torques without times), `breakaway` (torque ramps), `presliding` and `attraction` (GMS), `hysteresis` (friction
measured along a motion), `lugre` (sigma0, sigma1), `inertia` (frequency response), `cogging` (torque over the angle).
Several laws are compared by their error on held-out data; `sliding` without --law compares the curves of the thesis.
An option that the method does not use is refused. With --loop and a reference in the record the closed
loop is simulated, otherwise the recorded drive signal is the input. --out names a folder for model.toml and
report.html, or the model file, with the report next to it; a study or simulation uses the model by `law = {model =
"model.toml"}`. The last line printed is the next command.
"""

from __future__ import annotations

import argparse
import importlib
import sys
import threading
from pathlib import Path
from typing import TYPE_CHECKING, Any

from stickslip.cli import _files, _reading
from stickslip.core.errors import one_line
from stickslip.identification.methods import METHODS

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from stickslip.report.answers import Answers
    from stickslip.verbs.identification import IdentificationResult

SUMMARY = "identify inertia and friction; writes model.toml and report.html"


def arguments(parser: argparse.ArgumentParser) -> None:
    """Files, method, axis, laws, and how to read."""
    parser.add_argument(
        "files", nargs="+", type=Path, metavar="LOG", help="logs to identify from, fitted together"
    )
    parser.add_argument(
        "--method", choices=METHODS, default="axis", help="method of identification (default axis)"
    )
    parser.add_argument(
        "--hold-out", "--validation", dest="validation", action="append", default=[], type=Path, metavar="LOG",
        help="log for validation only, not fitted (axis)",
    )  # fmt: skip
    _law_arguments(parser)
    parser.add_argument("--model", type=Path, metavar="MODEL.toml", help="model of an earlier identification")
    parser.add_argument(
        "--torque", metavar="CHANNEL", help="torque channel: motor_torque, sensor_torque, ... (not axis)"
    )
    parser.add_argument(
        "--extra-torque",
        metavar="CHANNEL",
        help="known torque added to the recorded one, such as compensation_torque",
    )
    parser.add_argument(
        "--elements",
        type=int,
        default=0,
        metavar="N",
        help="number of GMS elements (presliding; 0: automatic)",
    )
    parser.add_argument(
        "--shares",
        choices=("free", "equal"),
        default="free",
        help="shares of the GMS elements (presliding; default free)",
    )
    parser.add_argument(
        "--threshold",
        type=float,
        metavar="V",
        help="velocity that counts as motion (breakaway), rad/s or m/s (default 0.01)",
    )
    _axis_arguments(parser.add_argument_group("axis"))
    parser.add_argument(
        "--out",
        type=Path,
        default=Path("model.toml"),
        metavar="DIR",
        help="folder or model file (default model.toml)",
    )
    parser.add_argument("--no-report", action="store_true", help="write no report.html")
    parser.add_argument("--json", action="store_true", help="print the result as JSON")
    _files.force_argument(parser)
    _reading.add_arguments(parser, part=True)


def _law_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options for laws, known parameters and the signal."""
    parser.add_argument(
        "--law",
        action="append",
        default=[],
        metavar="LAW",
        help="friction law: name, file or all; repeatable",
    )
    parser.add_argument(
        "--noise", type=float, metavar="X", help="standard deviation of the fitted signal, N·m (lugre: rad)"
    )
    parser.add_argument(
        "--set", action="append", default=[], metavar="NAME=VALUE", help="initial value of a parameter"
    )
    parser.add_argument(
        "--freeze",
        action="append",
        default=[],
        metavar="NAME[=VALUE]",
        help="keep a parameter at this value (without one, at --set NAME=.. or a default)",
    )
    parser.add_argument(
        "--free",
        action="append",
        default=[],
        metavar="NAME[=VALUE]",
        help="fit a parameter that is normally fixed",
    )


def _axis_arguments(parser: argparse._ArgumentGroup) -> None:  # type: ignore[reportPrivateUsage]
    """Add the options of the method `axis`, and of those that need an experiment of an axis."""
    parser.add_argument(
        "--inertia", type=float, metavar="J", help="known inertia, kg·m² (kg of a linear axis): not fitted"
    )
    parser.add_argument("--inverse", action="store_true", help="linear least squares only, no simulation")
    parser.add_argument(
        "--per-direction", action="store_true", help="separate friction parameters for each direction"
    )
    parser.add_argument("--pendulum", action="store_true", help="include gravity, m g l sin(q - q0)")
    parser.add_argument("--drive-gain", type=float, metavar="G", help="torque per unit of the drive's signal")
    parser.add_argument(
        "--resistance", type=float, metavar="OHM", help="motor resistance, for logs of a voltage"
    )
    parser.add_argument(
        "--loop", action="append", default=[], metavar="kp=..,kd=..",
        help="sampled controller kp e + ki (integral of e) + kr v_ref - kd v whose output is the recorded drive signal "
        "(of a torque: kp in N·m/rad, kd and kr in N·m·s/rad); omitted gains are 0. Or kv (1/s), kvp (N·m·s/rad), kvi "
        "(N·m/rad), feed (share of the velocity feedforward, default 1) of a position P loop around a velocity PI "
        "loop, as for `stickslip recommend`. limit: of the output; filter: velocity low-pass, Hz; period: "
        "sample time, s (0: that of the rows); count: encoder resolution, rad; span: samples per velocity difference, "
        "1 or 2. Repeat once per LOG, in the same order, if the gains differ",
    )  # fmt: skip
    parser.add_argument(
        "--loop-output", choices=("torque", "current", "voltage"),
        help="quantity that the loop outputs if no drive signal is recorded (default torque, or voltage with "
        "--resistance); a voltage is a duty cycle if the record has the supply voltage",
    )  # fmt: skip
    parser.add_argument(
        "--torque-is", choices=("commanded", "actual", "mean"),
        help="meaning of the torque column: commanded from this row to the next, actual at the row, or "
        "mean since the previous row; held fixed together with --delay; otherwise the timing is estimated from "
        "the record (default)",
    )  # fmt: skip
    parser.add_argument(
        "--delay", type=float, metavar="S",
        help="delay until the torque acts (current loop, dead time), s; with it alone the column counts as commanded",
    )  # fmt: skip
    parser.add_argument(
        "--harmonics",
        type=int,
        default=0,
        metavar="N",
        help="number of harmonics of a position-dependent torque",
    )
    parser.add_argument(
        "--position", dest="position_map", action="store_true",
        help="identify the torque over the angle (cogging, friction by angle), subtract it and write its map",
    )  # fmt: skip
    parser.add_argument(
        "--load", action="store_true",
        help="let all friction, viscous included, grow with the load of the gear: times 1 + |load_motor T + "
        "load_external T0|, T the drive's torque and T0 that from outside",
    )  # fmt: skip
    parser.add_argument(
        "--intervals", choices=("prediction", "covariance"), default="prediction",
        help="source of the intervals; covariance is too narrow under coloured noise",
    )  # fmt: skip
    parser.add_argument(
        "--robust",
        action="store_true",
        help="weight outliers linearly in the output error",
    )


def run(args: argparse.Namespace) -> int:
    """Print estimates and verdicts, write the model and the report."""
    from stickslip.cli import _output
    from stickslip.report.result_text import result_lines
    from stickslip.verbs.identify import identify

    model_file, report_file = places(args.out)
    written = [model_file, *([] if args.no_report else [report_file])]
    if not args.no_report:
        # Load the modules for writing while compiled code runs.
        threading.Thread(target=lambda: importlib.import_module("jinja2")).start()

    def begins(what: str) -> None:
        """Check, before anything is computed, that the results can be written."""
        _files.refuse_foreign(written, args.force)
        _output.say(what)

    options = options_of(args)
    options["progress"] = begins
    result = identify(*args.files, **options, **_reading.reading_of(args))
    made: dict[str, Path] = {}
    if result.identification.model is not None or result.position_map is not None:
        made["model_file"] = result.save(model_file)
    if not args.no_report:
        _output.say("report")
        made["report_file"] = result.report(report_file, model_file)
    _files.written(made.values())
    answers = result.answers_with(model_file)
    if args.json:
        _output.print_json(as_data(result, made, answers))
        return 0
    for line in result_lines(result.identification, answers):
        print(line)
    for what, path in made.items():
        print(f"{what.partition('_')[0]}: {path}")
    for path in profiles(result):
        print(f"profile: {path}")
    return 0


def profiles(result: IdentificationResult) -> list[str]:
    """Return the saved profiles with which the logs were read, without duplicates."""
    found = dict.fromkeys(s.record.meta["reading"].get("profile", "") for s in result.sources)
    return [path for path in found if path]


def values_given(options: Mapping[str, Sequence[str]]) -> dict[str, float]:
    """Return the values of parameters by name; --freeze and --free may leave a value out.

    Raises
    ------
    InputError
        If two options give one parameter different values.
    """
    from stickslip.core.config import named_numbers
    from stickslip.core.errors import InputError

    out: dict[str, float] = {}
    for option, pairs in options.items():
        for name, value in named_numbers([p for p in pairs if "=" in p or option == "--set"], option).items():
            if out.get(name, value) != value:
                raise InputError(
                    f"{option} {name}={value:g} contradicts {name}={out[name]:g}; give one of them"
                )
            out[name] = value
    return out


def options_of(args: argparse.Namespace) -> dict[str, Any]:
    """Return the arguments of `stickslip.verbs.identify.identify` without those for reading logs."""
    from stickslip.cli import _output

    return {
        "method": args.method, "law": args.law, "hold_out": args.validation, "model": args.model, "noise": args.noise,
        "values": values_given({"--set": args.set, "--freeze": args.freeze, "--free": args.free}),
        "frozen": [p.partition("=")[0] for p in args.freeze], "free": [p.partition("=")[0] for p in args.free],
        "inertia": args.inertia,
        "torque_channel": args.torque or "", "elements": args.elements, "shares": args.shares,
        "threshold": args.threshold,
        "loop": args.loop, "loop_output": args.loop_output, "inverse": args.inverse,
        "per_direction": args.per_direction, "pendulum": args.pendulum, "drive_gain": args.drive_gain,
        "resistance": args.resistance, "extra_torque": args.extra_torque or "", "torque_is": args.torque_is,
        "delay": args.delay, "harmonics": args.harmonics, "position_map": args.position_map, "load": args.load,
        "intervals": args.intervals, "robust": args.robust, "accept": args.accept,
        "progress": _output.say, "tell": tell,
    }  # fmt: skip


def tell(line: str) -> None:
    """Print a warning about a log on stderr."""
    print(f"stickslip: {one_line(line)}", file=sys.stderr)


def as_data(result: IdentificationResult, made: Mapping[str, Path], answers: Answers) -> dict[str, Any]:
    """Return the data for --json."""
    return {
        **result.as_dict(), "data": [s.about for s in result.sources],
        "findings": {s.name: [f.as_data() for f in s.findings] for s in result.sources},
        **{k: str(v) for k, v in made.items()}, "next": [s.command for s in answers.steps if s.command],
        "steps": [{"what": s.what, "command": s.command} for s in answers.steps], "profiles": profiles(result),
    }  # fmt: skip


def places(out: Path) -> tuple[Path, Path]:
    """Return the paths of model and report; create the folder."""
    from stickslip.core.whole_files import prepared_folder

    if out.suffix == ".toml":
        prepared_folder(out.parent)
        name = "report.html" if out.name == "model.toml" else f"{out.stem}.html"
        return out, out.parent / name
    prepared_folder(out)
    return out / "model.toml", out / "report.html"
