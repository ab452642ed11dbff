"""Describe a machine: its inertia, friction, and imperfections; print its file or a template.

    stickslip machine                                 lists the machines of the package
    stickslip machine thesis-dry                      its description, with units
    stickslip machine thesis-dry --print > mine.toml  its file, for editing
    stickslip machine --template > mine.toml          a file with every key, its unit, meaning and default
    stickslip machine mine.toml                       checks a file of your own
    stickslip machine model.toml --print > axis.toml  the axis that was identified, as a machine

A machine's file runs in `stickslip simulate`, studies and sweeps (a table [machine] or [machines.NAME] with
`machine = "mine.toml"`), on a virtual rig (`stickslip rig run NAME --rig mine.toml`), and in Python
(`stickslip.load_machine("mine.toml")`; `Machine.write` writes one).
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from stickslip.machines.keys import Part
    from stickslip.machines.machine import Machine

SUMMARY = "describe a machine, print its file or a template"


def arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments: the name, and what to print."""
    parser.add_argument(
        "name", nargs="?", default="", metavar="MACHINE",
        help="machine of the package, or the path of a machine's TOML file or of an identified model.toml (default: "
        "list those of the package)",
    )  # fmt: skip
    shown = parser.add_mutually_exclusive_group()
    shown.add_argument("--print", action="store_true", help="print the machine's TOML file, for editing")
    shown.add_argument(
        "--template", action="store_true",
        help="print a file with every key, its unit, meaning and default, and exit",
    )  # fmt: skip
    shown.add_argument("--json", action="store_true", help="print the machine's tables as JSON")


def run(args: argparse.Namespace) -> int:
    """Print the list, the machine, its file, or a template."""
    from stickslip.cli import _output
    from stickslip.core.config import read_toml
    from stickslip.core.errors import InputError
    from stickslip.machines import written
    from stickslip.machines.files import file_of, library, machine
    from stickslip.machines.identified import is_identified

    if args.template:
        print(written.template(), end="")
        return 0
    if not args.name:
        if args.print or args.json:
            raise InputError(f"name a machine: {', '.join(library())}, or the path of a machine's file")
        for name in library():
            print(f"{name:14} {machine(name).title}")
        return 0
    found = machine(args.name)
    if args.print:
        path = file_of(args.name)
        own = (
            written.machine_text(found)
            if is_identified(read_toml(path))
            else path.read_text(encoding="utf-8")
        )
        print(own, end="")
    elif args.json:
        _output.print_json({"name": found.name, **written.tables_of(found)})
    else:
        print(*lines(found), sep="\n")
    return 0


def lines(machine: Machine) -> Iterator[str]:
    """Return the description: the tables of its file with units and meanings, and derived numbers."""
    from stickslip.machines.keys import BY_NAME
    from stickslip.machines.written import tables_of

    tables = tables_of(machine)
    yield f"{machine.name}: {machine.title or 'a machine'}"
    yield from rows(BY_NAME[""], tables)
    for name, values in tables.items():
        if name == "models":
            yield f"\nmodels: {', '.join(values)}"
        elif name == "friction":
            yield f"\nfriction: {machine.friction!r}"
        elif name and name in BY_NAME:
            yield f"\n{name}: {BY_NAME[name].title}"
            yield from rows(BY_NAME[name], values)
            if name == "two_mass":
                yield f"  {'encoder':19} {values['encoder']:28}  {BY_NAME[name].more['encoder']}"
    yield ""
    if machine.flexible:
        yield f"free modes: {', '.join(f'{mode:.4g}' for mode in machine.flexible.modes)} Hz"
    if machine.visible_stiffness > 0.0:  # a law without springs has none
        yield f"stiffness of the contact at the encoder: {machine.visible_stiffness:.4g} N·m/rad"
    yield from (f"- {note}" for note in machine.notes)


def rows(part: Part, values: Mapping[str, Any]) -> Iterator[str]:
    """Return one line per number."""
    for key in part.keys:
        if key.name in values:
            value = values[key.name]
            shown = ", ".join(f"{v:.5g}" for v in value) if key.listed else f"{value:.8g}"
            unit = "" if key.par.unit == "-" else key.par.unit
            yield f"  {key.name:19} {f'{shown} {unit}'.rstrip():28}  {key.par.meaning}"
