"""Test whether friction differs between two identified models, in parameters and sliding curve.

stickslip compare january.toml june.toml
stickslip compare january.toml june.toml --plot drift.png

Parameters are tested with the correlation of their estimates (joint chi-square; single parameters after Holm), curves
by a simultaneous confidence band. The overall significance level is 5 %.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from stickslip.cli import _files

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
    from stickslip.core.errors import InputError
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
    print(result)
    return 0
