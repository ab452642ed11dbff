"""Explain a friction or control law: its equation, its parameters with units and bounds, its choices, its source.

    stickslip law gms
    stickslip law lugre --plot                        draws law-lugre.png
    stickslip law gms --plot gms.svg --set slip_rule=literal --set k=[1e4,5e3] --set alpha=[0.5,0.5]
    stickslip law my_law.py --plot
    stickslip law my_law.py --check                   tests a law of your own, for friction or control
    stickslip law --template friction > my_law.py     a complete small law as a template
    stickslip law --template control > my_loop.py     the same for a control law

Where it is documented: help("stickslip.core.spec") and help("stickslip.core.control_spec") in Python;
docs/howto/own_law.md and docs/howto/own_control_law.md in the source of the package.

The picture shows the torque along a slow sine, in pre-sliding, and after steps in velocity.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from stickslip.cli import _files
from stickslip.core.errors import InputError

if TYPE_CHECKING:
    from stickslip.core.control_spec import ControlLaw
    from stickslip.core.spec import Choice, Configurable, Field, Law
    from stickslip.models.model import Model

SUMMARY = "explain or check a friction or control law; print a template"
TEMPLATES = ("friction", "control")
"""Templates of laws, in the folder ``starters``."""
DEFAULT = Path()


def arguments(parser: argparse.ArgumentParser) -> None:
    """The name, the picture, parameters."""
    parser.add_argument(
        "name", nargs="?", default="",
        help="law listed by `stickslip laws`, control law, or path of the file of either",
    )  # fmt: skip
    parser.add_argument(
        "--template", choices=TEMPLATES, help="print a complete small law as a template, and exit"
    )
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
        help="test the requirements of engines, identification and exports: subset, units, dissipation, step "
        "against rate, modes, derivatives, single precision, every export (a minute); for a control law also "
        "limit, faults, take-over and rest",
    )  # fmt: skip


def run(args: argparse.Namespace) -> int:
    """Print the description of the law; draw it; check it; or print a template."""
    if args.template:
        print(template(args.template), end="")
        return 0
    if not args.name:
        raise InputError("name a law (`stickslip laws` lists them), or a file; or give --template friction")
    law = named(args.name)
    if args.check:
        if args.plot is not None or args.set:
            raise InputError(
                "--check tests the law as written in its file; use --plot and --set in a separate call"
            )
        return check(law)
    if law.kind == "control law":
        return describe_control(law, args)
    return describe(law, args)


def template(kind: str) -> str:
    """Return the text of a template."""
    return (Path(__file__).parent / "starters" / f"{kind}_law.py").read_text(encoding="utf-8")


def named(name: str) -> Any:
    """Return the friction or control law of a name or file; if it is neither, the error is that of a friction law."""
    from stickslip.control.registry import control_law, control_law_names, law_or_control_law
    from stickslip.models import plugins

    if name.endswith(".py"):
        return law_or_control_law(name)
    return control_law(name) if name in control_law_names() else plugins.law(name)


def describe(law: Law, args: argparse.Namespace) -> int:
    """Print the description of a friction law; draw it."""
    model = with_values(law, args.set).warn()
    picture = Path(f"law-{model.law.name}.png") if args.plot == DEFAULT else args.plot
    if picture:
        _files.refuse_foreign([picture], args.force)
    print(f"{law.name}: {law.title}\n\n  {law.equation}\n")
    table("parameters", model.law.fields)
    table("state", law.state_fields)
    print_choices(law)
    print(f"passive: {law.passive or 'not stated'}\n{source_line(law)}")
    written = args.name if args.name.endswith(".py") else law.name
    print_files(written, model, shown_values(model, law, args.set))
    if picture:
        from stickslip.report.law_pictures import draw_law

        draw_law(model, picture)
        _files.written([picture])
        print(f"\npicture: {picture}")
    return 0


def print_files(name: str, model: Model, values: Mapping[str, Any]) -> None:
    """Print the law as a table of a study and as a separate file."""
    named = f"law = {json.dumps(name, ensure_ascii=False)}"
    chosen = [f'{choice} = "{option}"' for choice, option in model.law.chosen.items()]
    numbers = [f"{key} = {value}" for key, value in values.items()]
    print("\nin the file of a study:")
    print("\n".join(f"  {line}" for line in (named, *chosen, *numbers)))
    print("\nin the file of a model (model.toml):")
    choices = ("", "[choices]", *chosen) if chosen else ()
    print("\n".join(f"  {line}".rstrip() for line in (named, *choices, "", "[parameters]", *numbers)))


def describe_control(law: ControlLaw, args: argparse.Namespace) -> int:
    """Print the description of a control law."""
    if args.plot is not None or args.set:
        raise InputError("--plot and --set belong to friction laws; leave them out for a control law")
    print(f"{law.name}: {law.title}\n\n  {law.equation}\n\nplace: {law.place}\n")
    table("parameters", law.fields)
    table("state", law.state_fields)
    print_choices(law)
    values = ", ".join(f"{f.name} = {law.example[f.name]}" for f in law.fields if f.name in law.example)
    held = ', friction = "LAW"' if law.holds_friction else ""
    written = args.name if args.name.endswith(".py") else law.name
    print(f"{source_line(law)}\n\nin the table [controller] of a file:")
    print(f"  {law.place} = {{law = {json.dumps(written, ensure_ascii=False)}, {values}{held}}}")
    return 0


def source_line(law: Configurable) -> str:
    """Return the line with its source."""
    source: Sequence[str] = getattr(law, "source", ())
    return f"source: {'; '.join(source) or 'none stated'}"


def print_choices(law: Configurable) -> None:
    """Print the choices, one line each, and the parameters of their options."""
    choices: Sequence[Choice] = law.choices
    for choice in choices:
        options = ", ".join(
            f"{name} (default)" if name == choice.default else name for name in choice.options
        )
        print(f"{choice.name}: {options}")
    if choices:
        print()
        for choice, option, fields in law.added_fields():
            table(f"with {choice} = {option}", fields)


def check(law: Any) -> int:
    """Test the law's contract, one line per check; return 1 if one fails."""
    from stickslip.contract import control_laws, examine

    verdicts = control_laws.examine(law) if law.kind == "control law" else examine(law)
    failures = 0
    for verdict in verdicts:
        word = {True: "ok", False: "FAILED", None: "-"}[verdict.passed]
        failures += verdict.passed is False
        print(f"{word:<7} {verdict.name:<18} {verdict.text}", flush=True)
    said = (
        f"{failures} check{'s' if failures > 1 else ''} failed" if failures else "passed all available checks"
    )
    print(f"{law.name}: {said}")
    return 1 if failures else 0


def with_values(law: Law, settings: Sequence[str]) -> Model:
    """Return the law with its example's parameters and the values that were set."""
    from stickslip.core.config import named_values
    from stickslip.models.model import Model

    given = {name: value_in(text) for name, text in named_values(settings, "--set").items()}
    names = {choice.name for choice in law.choices}
    choices = {k: v for k, v in given.items() if k in names and isinstance(v, str)}
    chosen = law.having(**choices) if choices else law
    return Model(chosen, **{**chosen.example, **{k: v for k, v in given.items() if k not in choices}})


def value_in(text: str) -> Any:
    """Return a value as a TOML file would have it; a word needs no quotes."""
    import tomllib

    try:
        return tomllib.loads(f"value = {text}")["value"]
    except tomllib.TOMLDecodeError:
        return text


def shown_values(model: Model, plain: Law, settings: Sequence[str]) -> dict[str, Any]:
    """Return the parameters of the example, those that were set and those that the chosen options add."""
    named = {*model.law.example, *(text.partition("=")[0].strip() for text in settings)}
    named |= {f.name for f in model.law.fields if f not in plain.fields}
    values: dict[str, Any] = model.parameters._asdict()
    return {
        f.name: list(values[f.name]) if f.per_element else values[f.name]
        for f in model.law.fields
        if f.name in named
    }


def table(title: str, fields: tuple[Field, ...]) -> None:
    """Print one line per parameter or state."""
    if not fields:
        return
    print(f"{title}:")
    rows = [
        (
            f.name + ("[i]" if f.per_element else ""),
            f.par.symbol,
            f.par.unit,
            f.par.bounds,
            f"default {f.like}" if f.like else "" if f.par.default is None else f"default {f.par.default:g}",
            f.par.meaning,
        )
        for f in fields
    ]
    widths = [max(len(row[i]) for row in rows) for i in range(5)]
    for row in rows:
        print("  " + "  ".join(f"{cell:<{w}}" for cell, w in zip(row, widths)) + f"  {row[5]}")
    print()
