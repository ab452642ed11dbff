"""List the friction laws: built in, installed by other packages, and in files named in STICKSLIP_LAWS."""

from __future__ import annotations

import argparse

SUMMARY = "list the friction laws"


def arguments(parser: argparse.ArgumentParser) -> None:
    """None."""


def run(args: argparse.Namespace) -> int:
    """Print one line per law: name, title, source."""
    from stickslip.models import plugins

    rows = [(law.name, law.title, "; ".join(law.source)) for law in map(plugins.law, plugins.law_names())]
    widths = [max(len(row[i]) for row in rows) for i in range(2)]
    for name, title, source in rows:
        print(f"{name:<{widths[0]}}  {title:<{widths[1]}}  {source}")
    return 0
