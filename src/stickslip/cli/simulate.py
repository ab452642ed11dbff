"""Simulate one closed loop from a TOML file with [axis], [friction], [reference] and [controller].

A compensator computes its torque with the law of a table [laws.NAME] that the controller names.

[axis]
inertia = 3.8623e-4            # kg·m²
[friction]                     # `stickslip law lugre` explains the parameters
law = "lugre"
sigma0 = 3.5e4
sigma1 = 0.1
sigma2 = 0.018
fs = 0.335
fc = 0.285
vs = 0.01
[reference]
kind = "sine"                  # A (1 - cos 2 pi f t), from rest; "plain_sine" is A sin 2 pi f t
amplitude = 0.01               # rad
frequency = 0.4                # Hz
duration = 5.0                 # s
[controller]
linear = "PD"
placement = {bandwidth_hz = 36.0, damping = 1.0}
compensator = "feedforward"    # or "feedback"; omit it and `law` for the linear controller alone
law = "lugre"                  # the NAME of a table [laws.NAME]
[laws.lugre]                   # the friction model of the compensator
law = "lugre"
sigma0 = 3.5e4
sigma1 = 0.1
sigma2 = 0.018
fs = 0.30
fc = 0.25
vs = 0.01
"""

from __future__ import annotations

import argparse
from pathlib import Path

from stickslip.cli import _files

SUMMARY = "simulate one closed loop from a TOML file"


def arguments(parser: argparse.ArgumentParser) -> None:
    """File and output."""
    parser.add_argument("file", type=Path, metavar="FILE.toml")
    parser.add_argument(
        "--out",
        type=Path,
        metavar="FILE.npz",
        help="record to write (default: FILE.npz in the current folder)",
    )
    _files.force_argument(parser)
    parser.add_argument(
        "--json", action="store_true", help="print the record's meta (metrics, energy, ...) as JSON"
    )


def run(args: argparse.Namespace) -> int:
    """Write the record and print the metrics."""
    from stickslip.cli import _output
    from stickslip.core.errors import InputError
    from stickslip.core.whole_files import prepared_folder
    from stickslip.studies.study import execute, load_run

    planned = load_run(args.file)
    out: Path = args.out or Path(f"{args.file.stem}.npz")
    if out.is_dir():
        raise InputError(f"--out {out} is a folder; give the name of a file")
    _files.refuse_foreign([out], args.force)
    planned.check()
    prepared_folder(out.parent)
    executed = execute(planned, check=True)
    executed.record.save(out)
    _files.written([out])
    if args.json:
        _output.print_json({**executed.record.meta, "record": str(out), "failure": executed.failure})
    else:
        _output.print_metrics(executed.metrics)
        _output.print_learned(executed.record.meta)
        _output.print_accuracy(executed.record.meta)
        _output.print_integrator(executed.record.meta)
        print(f"record: {out} ({len(executed.record)} rows)")
    return _output.report_failures([(planned.key, executed.failure, out)] if executed.failure else [])
