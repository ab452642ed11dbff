"""Run doctor, identify and recommend on a simulated record that ships with the package.

stickslip demo --out demo

The record is simulated (a servo axis with Stribeck friction in a 1 kHz position loop, with noise on the torque and a
16-bit encoder; `tools/make_demo.py` in the sources makes it), so the result can be compared with the true values.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from stickslip.cli import _files

SUMMARY = "run all steps, from log to recommendation, on a demo record"
LOOP = "kp=8,kd=0.08,kr=0.08,limit=3"
TRUTH = (
    "inertia 4e-4 kg·m², offset 0.03 N·m, fc 0.285 N·m, fs 0.335 N·m, vs 0.1 rad/s, sigma2 0.018 N·m·s/rad"
)


def arguments(parser: argparse.ArgumentParser) -> None:
    """Where to write."""
    parser.add_argument(
        "--out", type=Path, default=Path("stickslip-demo"), metavar="DIR", help="default stickslip-demo"
    )
    parser.add_argument(
        "--log", type=Path, metavar="FILE.csv", help="only write the log, to try the verbs on"
    )
    _files.force_argument(parser)


def run(args: argparse.Namespace) -> int:
    """Run the three verbs and print each command."""
    from stickslip.core.whole_files import prepared_folder

    log: Path = args.log or args.out / "demo.csv"
    prepared_folder(log.parent)
    copy_log(log, args.force)
    print("A simulated record: a servo axis with Stribeck friction, noise on its torque, a 16-bit encoder.")
    print(f"True values: {TRUTH}.")
    if args.log:
        print(log)
        return 0
    model = str(args.out / "model.toml")
    for words in (
        ["doctor", str(log)],
        [
            "identify",
            str(log),
            "--law",
            "coulomb",
            "--law",
            "stribeck",
            "--loop",
            LOOP,
            "--out",
            str(args.out),
            *(["--force"] if args.force else []),
        ],
        [
            *("recommend", model, "--bandwidth", "20", "--counts-per-rev", "65536", "--torque-limit", "3"),
            *("--out", str(args.out / "recommended.toml"), *(["--force"] if args.force else [])),
        ],
    ):
        print(f"\n$ stickslip {' '.join(words)}", flush=True)
        if code := step(words):
            return code
    return 0


def copy_log(log: Path, force: bool) -> None:
    """Write the log that ships with the package.

    Raises
    ------
    InputError
        If it cannot be written, or would replace a file that stickslip did not write.
    """
    from importlib.resources import files

    from stickslip.core.whole_files import write_whole

    _files.refuse_foreign([log], force)
    write_whole(log, (files("stickslip") / "demo.csv").read_bytes())
    _files.written([log])


def step(words: list[str]) -> int:
    """Run one verb and pass on its errors."""
    from stickslip.cli import parser_of

    args = parser_of(words[:1]).parse_args(words)
    code: int = args.run(args)
    return code
