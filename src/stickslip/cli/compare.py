"""Has the friction changed? Tests the difference of two identified models, parameters and sliding curve.

stickslip compare january.toml june.toml
stickslip compare january.toml june.toml --plot drift.png

Differences of parameters are judged with the correlation of the estimates (joint chi-square; single ones after Holm),
the curves by a band that holds for the whole curve. The level of both together is 5 %.
"""

from __future__ import annotations

import argparse
import math
from pathlib import Path

LEAST = 1e-6
"""A chance below it depends on how normal the estimates are, far out."""
SUMMARY = "has the friction changed between two identified models?"


def arguments(parser: argparse.ArgumentParser) -> None:
    """Two models."""
    parser.add_argument("first", type=Path, metavar="A.toml")
    parser.add_argument("second", type=Path, metavar="B.toml")
    parser.add_argument("--top", type=float, metavar="RAD_PER_S", help="highest velocity of the curves")
    parser.add_argument("--plot", type=Path, metavar="FILE.png", help="draw both curves with their bands")
    parser.add_argument("--json", action="store_true", help="print the result as JSON")


def run(args: argparse.Namespace) -> int:
    """Print the differences and the verdict."""
    from stickslip.cli import _output
    from stickslip.errors import InputError
    from stickslip.identify.drift import compare_models
    from stickslip.identify.identified_file import read_identified

    if args.plot and args.plot.suffix not in (".png", ".svg"):
        raise InputError(f"--plot {args.plot} must end in .png or .svg")
    result = compare_models(read_identified(args.first), read_identified(args.second), top=args.top)
    if args.plot:
        from stickslip.report.identification import draw_picture_to

        draw_picture_to(result.picture, args.plot)
    if args.json:
        _output.print_json({**result.as_dict(), "plot": str(args.plot) if args.plot else None})
        return 0
    if result.changes:
        head = f"{'parameter':<14}{'first':>11}{'second':>11}{'change':>10}"
        print(f"{head}  {'difference, 95 %':<26} {'unit':<11} p (Holm)")
    for c in result.changes:
        span = f"[{c.lower:.4g}, {c.upper:.4g}]"
        change = "-" if math.isnan(c.percent) else f"{c.percent:+.3g} %"
        mark = "changed" if c.changed else ""
        line = f"{c.name:<14}{c.first:>11.5g}{c.second:>11.5g}{change:>10}"
        print(f"{line}  {span:<26} {c.unit:<11} {chance(c.p):<9}{mark}".rstrip())
    if result.changes:
        print()
    if not math.isnan(result.p):
        print(f"friction parameters together: p {equal_to(result.p)}")
    print(
        f"sliding curve: largest difference is {result.largest:.2g} times what the intervals explain "
        f"(p at most {result.curve_p:.1g})"
    )
    for note in result.notes:
        print(note)
    print("The friction has changed." if result.changed else "No change that the intervals do not explain.")
    return 0


def chance(p: float) -> str:
    """A chance, or the bound below which its value tells nothing; "-" where there is none."""
    if math.isnan(p):
        return "-"
    return f"< {LEAST:g}" if p < LEAST else f"{p:.2g}"


def equal_to(p: float) -> str:
    """The same behind a letter."""
    return chance(p) if p < LEAST else f"= {chance(p)}"
