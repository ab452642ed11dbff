"""Print the versions of stickslip, Python and the numerical libraries."""

from __future__ import annotations

import argparse

SUMMARY = "print the versions of stickslip and its libraries"


def arguments(parser: argparse.ArgumentParser) -> None:
    """None."""


def run(args: argparse.Namespace) -> int:
    """Print one line per package."""
    from stickslip.studies.provenance import versions

    for name, version in versions().items():
        print(f"{name} {version}")
    return 0
