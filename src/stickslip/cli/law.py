"""Explain a friction law: its equation, its parameters with units and bounds, its choices, its source.

    stickslip law gms
    stickslip law lugre --plot                        draws law-lugre.png
    stickslip law gms --plot gms.svg --set slip_rule=literal --set k=[1e4,5e3] --set alpha=[0.5,0.5]
    stickslip law my_law.py --plot
    stickslip law my_law.py --check                   tests a law of your own

The picture shows the torque along a slow sine, in pre-sliding, and after steps in velocity.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from stickslip.cli import _files
from stickslip.errors import InputError

if TYPE_CHECKING:
    from stickslip.model import Model
    from stickslip.spec import Field, Law

SUMMARY = "explain a friction law: equation, parameters, source, plot"
DEFAULT = Path()


def arguments(parser: argparse.ArgumentParser) -> None:
    """The name, the picture, parameters."""
    parser.add_argument("name", help="law listed by `stickslip laws`, or path of a law file")
    parser.add_argument(
        "--plot", type=Path, nargs="?", const=DEFAULT, metavar="FILE",
        help="draw the law into FILE.png, .svg or .pdf (default: law-NAME.png)",
    )  # fmt: skip
    parser.add_argument(
        "--set", action="append", default=[], metavar="NAME=VALUE",
        help="value of a parameter or option of a choice; repeatable",
    )  # fmt: skip
    _files.force_argument(parser)
    parser.add_argument(
        "--check", action="store_true",
        help="try what engines, identification and exports rely on: subset, units, dissipation, step against rate, "
        "modes, derivatives, single precision, every export (a minute)",
    )  # fmt: skip


def run(args: argparse.Namespace) -> int:
    """Print the description of the law; draw it; or check it."""
    from stickslip import plugins

    law = plugins.law(args.name)
    if args.check:
        if args.plot is not None or args.set:
            raise InputError(
                "--check tests the law as written in its file; use --plot and --set in a separate call"
            )
        return check(law)
    model = with_values(law, args.set).warn()
    picture = Path(f"law-{model.law.name}.png") if args.plot == DEFAULT else args.plot
    if picture:
        _files.refuse_foreign([picture], args.force)
    print(f"{law.name}: {law.title}\n\n  {law.equation}\n")
    table("parameters", model.law.fields)
    table("state", law.state_fields)
    for choice in law.choices:
        options = ", ".join(
            f"{name} (default)" if name == choice.default else name for name in choice.options
        )
        print(f"{choice.name}: {options}")
    if law.choices:
        print()
        for option, fields in brought(law):
            table(f"with {option}", fields)
    print(f"passive: {law.passive}\nsource: {'; '.join(law.source)}\n\nas a study's file has it:")
    written = args.name if args.name.endswith(".py") else law.name
    print(f"  law = {json.dumps(written, ensure_ascii=False)}")
    for name, option in model.law.chosen.items():
        print(f'  {name} = "{option}"')
    for name, value in shown_values(model, args.set).items():
        print(f"  {name} = {value}")
    if picture:
        from stickslip.report.law_pictures import draw_law

        draw_law(model, picture)
        _files.written([picture])
        print(f"\npicture: {picture}")
    return 0


def check(law: Law) -> int:
    """Hold the law to its contract, a line a check; 1 where it fails one."""
    from stickslip.contract import examine

    failures = 0
    for verdict in examine(law):
        word = {True: "ok", False: "FAILED", None: "-"}[verdict.passed]
        failures += verdict.passed is False
        print(f"{word:<7} {verdict.name:<18} {verdict.text}", flush=True)
    print(f"{law.name}: " + (f"{failures} checks failed" if failures else "passes what could be tried"))
    return 1 if failures else 0


def brought(law: Law) -> Iterator[tuple[str, tuple[Field, ...]]]:
    """The parameters that an option adds to those of the default."""
    from stickslip.spec import fields_of

    for choice in law.choices:
        for name, option in choice.options.items():
            fields = fields_of(option.params)
            if fields and name != choice.default:
                yield f"{choice.name} = {name}", fields


def with_values(law: Law, settings: Sequence[str]) -> Model:
    """The law with its example's parameters and the values that were set."""
    from stickslip.model import Model

    given = dict(setting(text) for text in settings)
    names = {choice.name for choice in law.choices}
    choices = {k: v for k, v in given.items() if k in names and isinstance(v, str)}
    chosen = law.having(**choices) if choices else law
    return Model(chosen, **{**chosen.example, **{k: v for k, v in given.items() if k not in choices}})


def setting(text: str) -> tuple[str, Any]:
    """Name and value of NAME=VALUE; the value is as in a TOML file, a word needs no quotes."""
    import tomllib

    name, equals, value = text.partition("=")
    if not equals or not name.strip() or not value.strip():
        raise InputError(f"--set {text!r} must be NAME=VALUE, such as fs=0.3 or k=[1e4,5e3]")
    try:
        return name.strip(), tomllib.loads(f"value = {value}")["value"]
    except tomllib.TOMLDecodeError:
        return name.strip(), value.strip()


def shown_values(model: Model, settings: Sequence[str]) -> dict[str, Any]:
    """The example's parameters and those that were set, as plain data."""
    named = {*model.law.example, *(text.partition("=")[0].strip() for text in settings)}
    values: dict[str, Any] = model.parameters._asdict()
    return {
        f.name: list(values[f.name]) if f.per_element else values[f.name]
        for f in model.law.fields
        if f.name in named
    }


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
