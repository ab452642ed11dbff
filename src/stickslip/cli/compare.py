"""Test whether friction differs between two identified models, in parameters and sliding curve.

stickslip compare january.toml june.toml
stickslip compare january.toml june.toml --plot drift.png

Parameters are tested with the correlation of their estimates (joint chi-square; single parameters after Holm), curves
by a simultaneous confidence band. The overall significance level is 5 %.
"""

from __future__ import annotations

import argparse
import math
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from stickslip.identify.compare.levels import Change

from stickslip.cli import _files

LEAST = 1e-6
"""A chance below it depends on how normal the estimates are, far out."""
SUMMARY = "test whether friction changed between two models"


def arguments(parser: argparse.ArgumentParser) -> None:
    """Two models."""
    parser.add_argument("first", type=Path, metavar="A.toml")
    parser.add_argument("second", type=Path, metavar="B.toml")
    parser.add_argument("--top", type=float, metavar="RAD_PER_S", help="highest velocity of the curves")
    parser.add_argument("--plot", type=Path, metavar="FILE.png", help="draw both curves with their bands")
    _files.force_argument(parser)
    parser.add_argument("--json", action="store_true", help="print the result as JSON")


def run(args: argparse.Namespace) -> int:
    """Print the differences and the verdict."""
    from stickslip.cli import _output
    from stickslip.errors import InputError
    from stickslip.verbs.compare import compare

    if args.plot and args.plot.suffix not in (".png", ".svg"):
        raise InputError(f"--plot {args.plot} must end in .png or .svg")
    if args.plot:
        _files.refuse_foreign([args.plot], args.force)
    result = compare(args.first, args.second, top=args.top)
    if args.plot:
        from stickslip.report.identification import draw_picture_to

        draw_picture_to(result.picture, args.plot)
        _files.written([args.plot])
    if args.json:
        _output.print_json({**result.as_dict(), "plot": str(args.plot) if args.plot else None})
        return 0
    if result.changes:
        print(f"{head('parameter')} p (Holm)")
    for c in result.changes:
        print(f"{row(c)} {chance(c.p):<9}{'changed' if c.changed else ''}".rstrip())
    if result.levels:
        print(f"{'' if not result.changes else chr(10)}{head('torque')}")
    for c in result.levels:
        print(row(c))
    print()
    if not math.isnan(result.p):
        print(f"friction parameters together: p {equal_to(result.p)}")
    print(
        f"sliding curve: largest difference is {result.largest:.2g} times what the intervals explain "
        f"(p at most {result.curve_p:.1g})"
    )
    for note in result.notes:
        print(note)
    print(result.summary)
    return 0


def head(what: str) -> str:
    """Of a table of changes."""
    return f"{what:<26}{'first':>11}{'second':>11}  {'unit':<11} {'change, 95 % interval':<34}"


def row(c: Change) -> str:
    """Both values, and the change in per cent or, where that has no meaning, in the unit."""
    by = c.words()[len(c.name) + 1 :]
    return f"{c.name:<26}{c.first:>11.5g}{c.second:>11.5g}  {c.unit:<11} {by:<34}"


def chance(p: float) -> str:
    """A chance, or the bound below which its value tells nothing; "-" where there is none."""
    if math.isnan(p):
        return "-"
    return f"< {LEAST:g}" if p < LEAST else f"{p:.2g}"


def equal_to(p: float) -> str:
    """The same behind a letter."""
    return chance(p) if p < LEAST else f"= {chance(p)}"
