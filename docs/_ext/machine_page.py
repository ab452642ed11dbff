"""The page of machines and of the keys of their files, made from the descriptions of their parts."""

from __future__ import annotations

from pages import GENERATED, prose, table, write

from stickslip.machines.files import library, machine
from stickslip.machines.keys import PARTS, Part
from stickslip.machines.written import template

TEXT = """# Machines

A machine is an axis with what spoils its response: flexible shaft, encoder, current loop, noise, ripple, cogging, drift
and temperature. It runs in [simulations](../howto/simulate.md#on-a-machine-with-imperfections), studies and sweeps, on
[virtual rigs](../howto/rig.md), and in Python ([`ss.load_machine`](api/stickslip.load_machine.md);
[`ss.Machine`](api/stickslip.Machine.md) builds one, and its `write` writes the file).

{machines}

`stickslip machine NAME` says what one is, `stickslip machine NAME --print > mine.toml` gives its file, to be changed,
and `stickslip machine mine.toml` checks a file. `stickslip machine --template` prints one with every key.

## Keys of a machine's file

In SI units. A table that is left out leaves out what it describes.
"""


def make() -> None:
    """Write the page."""
    machines = table(
        ["name", "what it is"], [(f"`{name}`", prose(machine(name).title)) for name in library()]
    )
    parts = [TEXT.format(machines=machines), *map(keys, PARTS)]
    parts.append(f"## A file to begin from\n\n```toml\n{template()}```")
    write(GENERATED / "machines.md", "\n\n".join(parts) + "\n")


def keys(part: Part) -> str:
    """A table of the file."""
    head = f"`[{part.name}]`: {prose(part.title)}." if part.name else "At the top of the file:"
    named = {"parameters": "parameters", "choices": "choices"}
    more = [(named.get(name, f"`{name}`"), "", prose(meaning), "") for name, meaning in part.more.items()]
    rows = [
        (f"`{k.name}`", "" if k.par.unit == "-" else k.par.unit, prose(k.par.meaning), k.usual)
        for k in part.keys
    ]
    return f"{head}\n\n{table(['key', 'unit', 'meaning', 'if not given'], [*more, *rows])}"
