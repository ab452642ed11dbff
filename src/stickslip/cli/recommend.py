"""Recommend a compensator that is safe to switch on, from an identified model.

stickslip recommend model.toml --bandwidth 15 --sample-time 0.001 --counts-per-rev 65536 --torque-limit 2
stickslip recommend model.toml --bandwidth 15 --out recommended.toml
stickslip export recommended.toml --to c99 --compensator recommended

stickslip recommend model.toml --loop kv=40,kvp=0.8,kvi=25,feed=1,filter=300,limit=3 --counts-per-rev 262144
stickslip recommend model.toml --bandwidth 15 --compensators all
stickslip recommend model.toml --loop kp=8,ki=60,kd=0.08,kr=0.08,limit=3 --motion cycle.csv

Simulates the linear controller alone (the given loop, or PD or PID by pole placement) and every candidate (inertia
feedforward alone; law, feedforward or feedback, gain, dead band) on the best estimate and on axes sampled from the
model's intervals. The motion is that of the log, or a given one, from rest to rest, followed by a standstill; one that
never rests is begun and braked smoothly, which is not judged. Sampling is that of the drive. The recommended candidate
has a limit cycle on none of these axes; of those within a tenth of the smallest error on the worst axis, it is the one
with the lowest gain; where friction compensation takes less than a tenth of what the inertia feedforward alone leaves,
it is that alone. It is then simulated on further sampled axes; the error reduction printed is the one found there.
A candidate is simulated on more axes only while it can still be the best; the table of --all marks those that were
stopped. The report shows the error before and after, what to set, margins, what was not simulated and when to repeat.
"""

from __future__ import annotations

import argparse
import math
import os
import shlex
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from stickslip.cli import _files

if TYPE_CHECKING:
    from stickslip.verbs.recommendation import RecommendationResult

SUMMARY = "recommend a compensator for an identified model"
RECOMMENDED = "recommended.toml"
"""The setting's file in the commands of a report, if none is written."""


def arguments(parser: argparse.ArgumentParser) -> None:
    """Model, drive, motion, search."""
    parser.add_argument(
        "model", type=Path, metavar="MODEL.toml", help="model written by `stickslip identify`"
    )
    drive_arguments(parser)
    motion_arguments(parser)
    search_arguments(parser)
    parser.add_argument(
        "--out",
        type=Path,
        metavar="FILE.toml",
        help="write the recommended setting, for `stickslip export`, and a report beside it (FILE.html)",
    )
    parser.add_argument(
        "--report", type=Path, metavar="FILE.html", help="write the report: verdict, plots, margins, limits"
    )
    _files.force_argument(parser)
    parser.add_argument("--all", action="store_true", help="print all candidates, parameters and notes")
    parser.add_argument("--json", action="store_true", help="print the result and all candidates as JSON")


def drive_arguments(parser: argparse.ArgumentParser) -> None:
    """The drive and its loop."""
    for option, default, unit, what in (
        ("--bandwidth", 10.0, "HZ", "bandwidth of the position loop"),
        ("--damping", 1.0, "D", "damping of its poles"),
        ("--torque-limit", math.inf, "NM", "torque limit of the drive"),
    ):
        parser.add_argument(
            option, type=float, default=default, metavar=unit, help=f"{what} (default {default:g})"
        )
    parser.add_argument(
        "--machine", metavar="MACHINE",
        help="machine to simulate (library name or TOML file), with its resonances, delay, amplifier, encoder and "
        "noise",
    )  # fmt: skip
    parser.add_argument(
        "--sample-time",
        type=float,
        metavar="S",
        help="sample time of the drive (default the machine's, else the time between rows of the identified "
        "record, or 0.001 where the loop would be hardly damped at those; a --controller file may set it)",
    )
    parser.add_argument(
        "--delay", type=float, metavar="SAMPLES",
        help="command delay in samples (default: up to one, sampled; a --machine has its own)",
    )  # fmt: skip
    parser.add_argument(
        "--reference-velocity", choices=("difference", "instant"),
        help="how the drive forms its reference velocity: difference of two reference positions, or that of the "
        "trajectory at the sample (default: both are simulated)",
    )  # fmt: skip
    parser.add_argument(
        "--counts-per-rev",
        type=float,
        metavar="N",
        help="encoder counts per revolution, of a linear axis per 2π m (2π over the scale's step in m); 0: no "
        "quantisation (default the machine's, else by the position step of the identified record, else 0)",
    )
    parser.add_argument(
        "--linear",
        choices=("PD", "PID", "PR"),
        default="PD",
        help="controller designed by pole placement (default PD)",
    )
    parser.add_argument(
        "--loop", metavar="kp=..,kd=..",
        help="gains of the existing loop: kp (N·m/rad), ki, kd, kr of a PID; or kv (1/s), kvp (N·m·s/rad), kvi "
        "(N·m/rad), feed (share of the velocity feedforward, default 1) of a position P loop around a velocity PI "
        "loop; optionally filter (Hz, first-order low-pass on the velocity), limit (N·m) and reference_velocity",
    )  # fmt: skip
    parser.add_argument(
        "--controller", type=Path, metavar="FILE.toml",
        help="existing loop as control laws (table [controller]), including observers, without friction "
        "compensation",
    )  # fmt: skip


def motion_arguments(parser: argparse.ArgumentParser) -> None:
    """The motion of the application."""
    parser.add_argument(
        "--motion", type=Path, metavar="FILE",
        help="log or CSV (time, position) of the application's motion (default: that of the identified log)",
    )  # fmt: skip
    parser.add_argument(
        "--motion-map", action="append", default=[], metavar="CHANNEL=COLUMN[:UNIT]",
        help="column and unit of a channel of that log, as --map of `stickslip identify`; repeatable (positions in "
        "counts: --counts-per-rev)",
    )  # fmt: skip
    parser.add_argument(
        "--amplitude",
        type=float,
        metavar="RAD",
        help="amplitude of a slow sinusoid as the motion (linear axis: m)",
    )
    parser.add_argument(
        "--frequency", type=float, metavar="HZ", help="frequency of that sinusoid (default 0.5)"
    )


def search_arguments(parser: argparse.ArgumentParser) -> None:
    """What is tried, and on how many axes."""
    parser.add_argument(
        "--inertia", type=float, metavar="KGM2", help="inertia, if missing in the model or different"
    )
    parser.add_argument(
        "--no-inertia-feedforward", dest="feed_inertia", action="store_false",
        help="simulate and recommend without inertia feedforward, as for a drive that feeds no acceleration forward",
    )  # fmt: skip
    parser.add_argument(
        "--compensators", metavar="NAMES",
        help="observers, adaptive compensators and others to try too: names separated by commas, or all (a minute); a "
        "TOML file with a table [controller] stands for a controller of your own",
    )  # fmt: skip
    parser.add_argument(
        "--axes",
        type=int,
        default=6,
        metavar="N",
        help="sampled axes for all candidates (default 6)",
    )
    parser.add_argument(
        "--confirm", type=int, default=39, metavar="N",
        help="further sampled axes for the recommended candidate; they give the interval of the error reduction with a "
        "probability of (N - 1)/(N + 1) (default 39: 95 %%)",
    )  # fmt: skip


def run(args: argparse.Namespace) -> int:
    """Print the recommendation."""
    from stickslip.cli import _output
    from stickslip.verbs.recommend import recommend

    report: Path | None = args.report or (args.out.with_suffix(".html") if args.out else None)
    for option, target in (("--out", args.out), ("--report", report)):
        if target:
            writable(target, args.model, option)
            _files.refuse_foreign([target], args.force)
    with _output.progress_bar("simulating") as progress:
        result = recommend(
            args.model, bandwidth=args.bandwidth, damping=args.damping, linear=args.linear, loop=args.loop,
            controller=args.controller, machine=args.machine, sample_time=args.sample_time, delay=args.delay,
            reference_velocity=args.reference_velocity, counts_per_rev=args.counts_per_rev,
            torque_limit=args.torque_limit, motion=args.motion, motion_map=args.motion_map, remember=True,
            amplitude=args.amplitude,
            frequency=args.frequency, inertia=args.inertia, feed_inertia=args.feed_inertia,
            compensators=[n.strip() for n in args.compensators.split(",")] if args.compensators is not None else (),
            axes=args.axes, confirm=args.confirm, progress=progress,
        )  # fmt: skip
    written, removed = store(args.out, result) if args.out else (None, False)
    if written:
        _files.written([written])
    elif args.out:
        which = "the earlier recommendation in it was removed" if removed else "it is not written"
        print(f"stickslip: --out {args.out}: nothing is recommended, so {which}", file=sys.stderr)
    made = {
        "recommended": written,
        "report": result.report(report, args.out or RECOMMENDED) if report else None,
    }
    if args.json:
        files = {"file": str(written) if written else None, "report_file": str(report) if report else None}
        _output.print_json({**result.as_dict(), **files})
        return 0
    print(result.details if args.all else result)
    for what, path in made.items():
        if path:
            print(f"{what}: {path}")
    if not args.all:
        print(
            "more: --all prints every candidate, the parameters and the notes; --report FILE.html writes a page"
        )
    if written:
        whole = args.controller or result.recommendation.instead
        what = "--controller" if whole else "--compensator recommended"
        print(f"next: stickslip export {shlex.quote(str(written))} --to c99 {what}")
    return 0


def store(out: Path, result: RecommendationResult) -> tuple[Path | None, bool]:
    """Write the recommendation; where there is none, an earlier one, which must not be taken for it, is removed.

    Returns
    -------
    tuple of (Path or None, bool)
        The file written, and whether one was removed.
    """
    from stickslip.core.config import read_toml

    if result.chosen is not None or result.recommendation.instead is not None:
        return result.save(out), False
    if out.is_file() and out.suffix == ".toml" and read_toml(out).has("recommended"):
        out.unlink()
        return None, True
    return None, False


def writable(out: Path, model: Path, option: str) -> None:
    """Refuse before the simulations what cannot be written after them.

    Raises
    ------
    InputError
    """
    from stickslip.core.errors import InputError
    from stickslip.core.whole_files import prepared_folder

    name = RECOMMENDED if option == "--out" else "recommendation.html"
    if os.path.realpath(out) == os.path.realpath(model):
        raise InputError(f"{option} {out} is the model itself; give another name, such as {name}")
    if out.is_dir():
        raise InputError(f"{option} {out} is a folder; give the name of a file, such as {out / name}")
    prepared_folder(out.parent)
