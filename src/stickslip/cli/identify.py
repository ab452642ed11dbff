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
from pathlib import Path
from typing import TYPE_CHECKING, Any

from stickslip.cli import _files, _reading
from stickslip.identify.methods import METHODS

if TYPE_CHECKING:
    from collections.abc import Mapping

    from stickslip.report.answers import Answers
    from stickslip.verbs.identification import IdentificationResult

SUMMARY = "identify inertia and a friction law from records; writes model.toml and report.html"


def arguments(parser: argparse.ArgumentParser) -> None:
    """Files, method, axis, laws, and how to read."""
    parser.add_argument("files", nargs="+", type=Path, metavar="LOG", help="records, fitted together")
    parser.add_argument("--method", choices=METHODS, default="axis", help="default axis")
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
    from stickslip.report.result_text import result_lines
    from stickslip.verbs.identify import identify

    model_file, report_file = places(args.out)
    written = [model_file, *([] if args.no_report else [report_file])]
    if not args.no_report:
        # What writes it loads while compiled code runs.
        threading.Thread(target=lambda: importlib.import_module("jinja2")).start()

    def begins(what: str) -> None:
        """Logs and options are fine: before anything is computed, whether there is a place for what comes of it."""
        _files.refuse_foreign(written, args.force)
        _output.say(what)

    options = options_of(args)
    options["progress"] = begins
    result = identify(*args.files, **options, **_reading.reading_of(args))
    made: dict[str, Path] = {}
    if result.identification.model is not None:
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
    for path in dict.fromkeys(s.record.meta["reading"].get("profile", "") for s in result.sources):
        if path:
            print(f"profile: {path}")
    return 0


def options_of(args: argparse.Namespace) -> dict[str, Any]:
    """What `stickslip.verbs.identify.identify` takes besides how logs are read."""
    from stickslip.cli import _output
    from stickslip.config import named_numbers

    fixed = (*args.freeze, *args.free)
    return {
        "method": args.method, "law": args.law, "hold_out": args.validation, "model": args.model, "noise": args.noise,
        "values": named_numbers([*args.set, *(p for p in fixed if "=" in p)]),
        "frozen": [p.partition("=")[0] for p in args.freeze], "free": [p.partition("=")[0] for p in args.free],
        "torque_channel": args.torque or "", "elements": args.elements, "threshold": args.threshold,
        "loop": args.loop, "loop_output": args.loop_output, "inverse": args.inverse,
        "per_direction": args.per_direction, "pendulum": args.pendulum, "drive_gain": args.drive_gain,
        "resistance": args.resistance, "extra_torque": args.extra_torque or "", "torque_is": args.torque_is,
        "delay": args.delay, "harmonics": args.harmonics, "load": args.load, "intervals": args.intervals,
        "robust": args.robust, "accept": args.accept, "progress": _output.say, "tell": tell,
    }  # fmt: skip


def tell(line: str) -> None:
    """What is odd about a log, before anything is computed."""
    print(f"stickslip: {line}", file=sys.stderr)


def as_data(result: IdentificationResult, made: Mapping[str, Path], answers: Answers) -> dict[str, Any]:
    """What --json prints."""
    return {
        **result.as_dict(), "data": [s.about for s in result.sources],
        "findings": {s.name: [f.as_data() for f in s.findings] for s in result.sources},
        **{k: str(v) for k, v in made.items()}, "next": [s.command for s in answers.steps if s.command],
    }  # fmt: skip


def places(out: Path) -> tuple[Path, Path]:
    """The files of model and report; the folder is made."""
    from stickslip.study.files import prepared_folder

    if out.suffix == ".toml":
        prepared_folder(out.parent)
        name = "report.html" if out.name == "model.toml" else f"{out.stem}.html"
        return out, out.parent / name
    prepared_folder(out)
    return out / "model.toml", out / "report.html"
