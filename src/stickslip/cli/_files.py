"""The option for replacing files that stickslip did not write."""

from __future__ import annotations

import argparse

from stickslip.verbs.own_files import LEDGER, listed, ours, refuse_foreign, written

__all__ = ["LEDGER", "force_argument", "listed", "ours", "refuse_foreign", "written"]


def force_argument(parser: argparse.ArgumentParser) -> None:
    """Add the option for replacing files that stickslip did not write."""
    parser.add_argument(
        "--force", action="store_true",
        help="overwrite existing files, even edited ones",
    )  # fmt: skip
