"""The command line's page, made from its parsers."""

from __future__ import annotations

import importlib

from pages import GENERATED, write

from stickslip.cli import VERBS, parser_of

SHOWN = {"laws": ["laws"], "version": ["version"]}
"""Verbs whose output is short and always there."""


def make() -> None:
    """Write one section a verb: what it does, its arguments."""
    parser = parser_of(VERBS)
    parts = [
        "# Command line\n\n`stickslip VERB --help` prints the same. Exit codes: 0 done; 1 a simulation ended early or "
        "a check failed; 2 bad input, said in one line; 130 interrupted."
    ]
    for name in VERBS:
        module = importlib.import_module(f"stickslip.cli.{name.replace('-', '_')}")
        verb = next(a for a in parser._actions if a.dest == "verb").choices[name]
        parts.append(
            f"## stickslip {name}\n\n{module.SUMMARY[0].upper()}{module.SUMMARY[1:]}.\n\n"
            f"```text\n{verb.format_help().strip()}\n```"
        )
    write(GENERATED / "commands.md", "\n\n".join(parts) + "\n")
