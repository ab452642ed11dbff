"""The option that lets a verb of the command line replace files that are not stickslip's own."""

from __future__ import annotations

import argparse

from stickslip.verbs.own_files import LEDGER, listed, ours, refuse_foreign, written

__all__ = ["LEDGER", "force_argument", "listed", "ours", "refuse_foreign", "written"]


def force_argument(parser: argparse.ArgumentParser) -> None:
    """The option that lets a verb replace what is not its own."""
    parser.add_argument(
        "--force", action="store_true",
        help="overwrite existing files, even edited ones",
    )  # fmt: skip
