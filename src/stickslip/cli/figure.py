"""Draw a figure of the thesis that needs no record: phenomena of friction, fits of the sliding curve.

    stickslip figure                     lists them by the number of the thesis's figure or section
    stickslip figure 2.1                 draws figure-2.1.png
    stickslip figure 3.8 --plot fit.svg

The other figures come from `study thesis` (chapter 3), and from `rig`, `identify`, `analyse` and `study thesis-rig`
(chapter 4).
"""

from __future__ import annotations

import argparse
from pathlib import Path

from stickslip.cli import _files
from stickslip.core.errors import InputError

SUMMARY = "draw a figure of the thesis: phenomena of friction, fits of the sliding curve"


def arguments(parser: argparse.ArgumentParser) -> None:
    """Number and file."""
    parser.add_argument(
        "number", nargs="?", default="", metavar="NUMBER", help="figure, such as 2.1; none: list them"
    )
    parser.add_argument(
        "--plot",
        type=Path,
        metavar="FILE",
        help="draw into FILE.png, .svg or .pdf (default: figure-NUMBER.png)",
    )
    _files.force_argument(parser)


def run(args: argparse.Namespace) -> int:
    """List the figures, or draw one and print its title and message."""
    from stickslip.gallery import FIGURES, picture_of
    from stickslip.report.analysis_pictures import draw_analysis
    from stickslip.report.plots import FORMATS

    if not args.number:
        for number, figure in FIGURES.items():
            print(f"{number:<6} {figure.title}")
        return 0
    target: Path = args.plot or Path(f"figure-{args.number}.png")
    if target.suffix not in FORMATS:
        raise InputError(f"--plot {target} must end in one of {', '.join(FORMATS)}")
    _files.refuse_foreign([target], args.force)
    drawn = picture_of(args.number)
    draw_analysis(drawn, target)
    _files.written([target])
    print(f"{drawn[0]}\n{drawn[1]}\npicture: {target}")
    return 0
