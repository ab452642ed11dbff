"""From an identified model to a setting that is safe to switch on.

stickslip recommend model.toml --bandwidth 15 --sample-time 0.001 --counts-per-rev 65536 --torque-limit 2
stickslip recommend model.toml --bandwidth 15 --out recommended.toml
stickslip export recommended.toml --to c99 --compensator recommended

stickslip recommend model.toml --loop kv=40,kvp=0.8,kvi=25,feed=1,filter=300,limit=3 --counts-per-rev 262144
stickslip recommend model.toml --loop kp=8,ki=60,kd=0.08,kr=0.08,limit=3 --motion cycle.csv

Simulates the linear controller alone (the loop given, or PD, PID by pole placement) and every candidate (law,
feedforward or feedback, gain, deadband) on the best estimate and on axes drawn from the model's intervals, along the
motion of the log (or one given) and at rest behind it, sampled as in the drive. Recommended is what limit-cycles on
none of them and leaves the least error on the worst. It is then simulated on other axes drawn from the intervals; the
error reduction that is printed is what it did there.
"""

from __future__ import annotations

import argparse
import math
import shlex
from pathlib import Path
from typing import TYPE_CHECKING

from stickslip.cli import _files

if TYPE_CHECKING:
    from stickslip.verbs.recommend import RecommendationResult

SUMMARY = "which compensator to switch on: law, structure, gain, lead, deadband, and what to expect"


def arguments(parser: argparse.ArgumentParser) -> None:
    """Model, drive, motion."""
    parser.add_argument("model", type=Path, metavar="MODEL.toml", help="what `stickslip identify` wrote")
    for option, default, unit, what in (
        ("--bandwidth", 10.0, "HZ", "of the position loop"),
        ("--damping", 1.0, "D", "of its poles"),
        ("--sample-time", 1e-3, "S", "of the drive"),
        ("--counts-per-rev", 0.0, "N", "of the encoder; 0: exact"),
        ("--torque-limit", math.inf, "NM", "of the drive"),
    ):
        parser.add_argument(
            option, type=float, default=default, metavar=unit, help=f"{what} (default {default:g})"
        )
    parser.add_argument(
        "--linear",
        choices=("PD", "PID", "PR"),
        default="PD",
        help="what bandwidth and damping place (default PD)",
    )
    parser.add_argument(
        "--loop", metavar="kp=..,kd=..",
        help="the drive's own loop instead: kp (N·m/rad), ki, kd, kr of a PID, or kv (1/s), kvp (N·m·s/rad), kvi "
        "(N·m/rad), feed (part of the reference velocity fed forward, default 1) of position P around velocity PI; "
        "with filter (Hz, low-pass on its velocity) and limit (N·m)",
    )  # fmt: skip
    parser.add_argument(
        "--controller", type=Path, metavar="FILE.toml",
        help="the drive's own loop made of control laws instead (table [controller]), observers and all, but without "
        "friction laws",
    )  # fmt: skip
    parser.add_argument(
        "--motion", type=Path, metavar="FILE",
        help="log or CSV (time, position) of the motion that matters (default: that of the log, kept in MODEL.toml)",
    )  # fmt: skip
    parser.add_argument(
        "--amplitude",
        type=float,
        metavar="RAD",
        help="of a slow sinusoid as the motion instead (m of a linear axis)",
    )
    parser.add_argument("--frequency", type=float, metavar="HZ", help="of that sinusoid (default 0.5)")
    parser.add_argument(
        "--inertia", type=float, metavar="KGM2", help="where the model has none, or another one"
    )
    parser.add_argument(
        "--no-inertia-feedforward", dest="feed_inertia", action="store_false",
        help="leave out the inertia times the reference's acceleration, where the drive gives it itself or knows none",
    )  # fmt: skip
    parser.add_argument(
        "--axes",
        type=int,
        default=6,
        metavar="N",
        help="drawn from the intervals for all candidates (default 6)",
    )
    parser.add_argument(
        "--confirm", type=int, default=39, metavar="N",
        help="drawn for the recommended one: what it does on them is the interval of the error reduction, which holds "
        "with (N - 1)/(N + 1) (default 39: 95 %%)",
    )  # fmt: skip
    parser.add_argument(
        "--out",
        type=Path,
        metavar="FILE.toml",
        help="write what is recommended, as `stickslip export` takes it",
    )
    _files.force_argument(parser)
    parser.add_argument("--json", action="store_true", help="print the result as JSON, all candidates too")


def run(args: argparse.Namespace) -> int:
    """Print the recommendation."""
    from stickslip.cli import _output
    from stickslip.verbs.recommend import recommend

    if args.out:
        writable(args.out, args.model)
        _files.refuse_foreign([args.out], args.force)
    with _output.progress_bar("simulating") as progress:
        result = recommend(
            args.model, bandwidth=args.bandwidth, damping=args.damping, linear=args.linear, loop=args.loop,
            controller=args.controller,
            sample_time=args.sample_time, counts_per_rev=args.counts_per_rev, torque_limit=args.torque_limit,
            motion=args.motion, amplitude=args.amplitude, frequency=args.frequency, inertia=args.inertia,
            feed_inertia=args.feed_inertia, axes=args.axes, confirm=args.confirm, progress=progress,
        )  # fmt: skip
    written = args.out and store(args.out, result)
    if written:
        _files.written([written])
    if args.json:
        _output.print_json({**result.as_dict(), "file": str(written) if written else None})
        return 0
    print(result)
    if written:
        print(f"recommended: {written}")
        what = "--controller" if args.controller else "--compensator recommended"
        print(f"next: stickslip export {shlex.quote(str(written))} --to c99 {what}")
    return 0


def store(out: Path, result: RecommendationResult) -> Path | None:
    """Write the recommendation; where there is none, an earlier one must not be taken for it."""
    from stickslip.config import read_toml

    if result.chosen is not None:
        return result.save(out)
    if out.is_file() and out.suffix == ".toml" and read_toml(out).has("recommended"):
        out.unlink()
    return None


def writable(out: Path, model: Path) -> None:
    """Refuse before the simulations what cannot be written after them.

    Raises
    ------
    InputError
    """
    from stickslip.errors import InputError
    from stickslip.study.files import prepared_folder

    if out.resolve() == model.resolve():
        raise InputError(f"--out {out} is the model itself; give another name, such as recommended.toml")
    if out.is_dir():
        raise InputError(
            f"--out {out} is a folder; give the name of a file, such as {out / 'recommended.toml'}"
        )
    prepared_folder(out.parent)
