"""Learn a feedforward by repeating the motion of a simulation's file.

    stickslip learn my.toml --over angle

The file is that of `stickslip simulate` with a sampled controller; its duration is one repetition. A table over time is
valid for this motion; one over angle and direction for every motion in its range.

Before the first run the condition of convergence is checked on the machine's response: |Q (1 - L T)| < 1, with L the
rate, Q the low-pass and T the response of the loop's torque to a torque at the motor. If it is not met, nothing is
learned. Writes the controller with the learned table. `stickslip export FILE --controller` exports it,
`stickslip rig run track --set controller=FILE` runs it on a rig; `stickslip rig run learn` learns on the rig itself.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from stickslip.cli import _files

SUMMARY = "learn a feedforward over repetitions of a motion"


def arguments(parser: argparse.ArgumentParser) -> None:
    """File, settings, output."""
    parser.add_argument("file", type=Path, metavar="FILE.toml", help="as for `stickslip simulate`")
    parser.add_argument(
        "--over", choices=("time", "angle"), default="time", help="domain of the learned table"
    )
    parser.add_argument("--repetitions", type=int, default=10, metavar="N", help="repetitions (default: 10)")
    parser.add_argument(
        "--rate", type=float, default=0.8, metavar="L", help="share learned per repetition (default: 0.8)"
    )
    parser.add_argument("--corner", type=float, metavar="HZ", help="corner of Q over time (default: chosen)")
    parser.add_argument("--advance", type=int, metavar="SAMPLES", help="advance over time (default: chosen)")
    parser.add_argument("--bins", type=int, default=64, metavar="N", help="bins of the angle (default: 64)")
    parser.add_argument(
        "--out", type=Path, metavar="FILE.toml", help="controller to write (default: FILE-learned.toml)"
    )
    _files.force_argument(parser)
    parser.add_argument("--json", action="store_true", help="print the result as JSON")


def run(args: argparse.Namespace) -> int:
    """Learn, print the errors, write the controller."""
    from stickslip.cli import _output
    from stickslip.core.whole_files import prepared_folder
    from stickslip.studies.study import load_run
    from stickslip.verbs.learn import learn

    planned = load_run(args.file)
    out: Path = args.out or Path(f"{args.file.stem}-learned.toml")
    _files.refuse_foreign([out], args.force)
    prepared_folder(out.parent)
    with _output.progress_bar("repetitions") as progress:
        found = learn(
            planned.axis, planned.control, planned.motion, planned.duration, over=args.over,
            repetitions=args.repetitions, rate=args.rate, corner=args.corner, advance=args.advance, bins=args.bins,
            progress=progress,
        )  # fmt: skip
    found.write(out)
    _files.written([out])
    if args.json:
        _output.print_json({**found.as_dict(), "controller": str(out)})
    else:
        print(found)
        print(f"controller: {out}")
    return 0
