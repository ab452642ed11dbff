"""Print references in BibTeX: the package, the sources of the laws, the methods.

stickslip cite                                 the package itself
stickslip cite lugre gms                       laws
stickslip cite my.toml run.npz study-thesis    a file, a record, the folder of a study
"""

from __future__ import annotations

import argparse

SUMMARY = "print references in BibTeX"


def arguments(parser: argparse.ArgumentParser) -> None:
    """Add the argument: what was used."""
    parser.add_argument(
        "things", nargs="*", metavar="WHAT",
        help="laws, studies or TOML files, records (.npz), manifest.json or the folder of a study",
    )  # fmt: skip


def run(args: argparse.Namespace) -> int:
    """Print the entries."""
    from stickslip.report.citations import cited_by, citing

    print(citing(cited_by(args.things)))
    return 0
