"""Explain a friction law: its equation, its parameters with units and bounds, its choices, its source."""

from __future__ import annotations

import argparse
import json
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from stickslip.spec import Field

SUMMARY = "explain a friction law: equation, parameters with units and bounds, source"


def arguments(parser: argparse.ArgumentParser) -> None:
    """The name."""
    parser.add_argument("name", help="a law that `stickslip laws` lists, or the path of a law's file")


def run(args: argparse.Namespace) -> int:
    """Print the description of the law."""
    from stickslip import plugins

    law = plugins.law(args.name)
    print(f"{law.name}: {law.title}\n\n  {law.equation}\n")
    table("parameters", law.fields)
    table("state", law.state_fields)
    for choice in law.choices:
        options = ", ".join(
            f"{name} (default)" if name == choice.default else name for name in choice.options
        )
        print(f"{choice.name}: {options}")
    print(f"passive: {law.passive}\nsource: {'; '.join(law.source)}\n\nas a study's file has it:")
    written = args.name if args.name.endswith(".py") else law.name
    print(f"  law = {json.dumps(written, ensure_ascii=False)}")
    for f in law.fields:
        if f.name in law.example:
            value = law.example[f.name]
            print(f"  {f.name} = {list(value) if f.per_element else value}")
    return 0


def table(title: str, fields: tuple[Field, ...]) -> None:
    """Print one line a parameter or state."""
    if not fields:
        return
    print(f"{title}:")
    rows = [
        (
            f.name + ("[i]" if f.per_element else ""),
            f.par.symbol,
            f.par.unit,
            f.par.bounds,
            "" if f.par.default is None else f"default {f.par.default:g}",
            f.par.meaning,
        )
        for f in fields
    ]
    widths = [max(len(row[i]) for row in rows) for i in range(5)]
    for row in rows:
        print("  " + "  ".join(f"{cell:<{w}}" for cell, w in zip(row, widths)) + f"  {row[5]}")
    print()
