"""One page a law, made from the law: equation, picture, parameters, choices, declarations, sources."""

from __future__ import annotations

import dataclasses
import json
import sys
from collections.abc import Iterator
from pathlib import Path

from pages import GENERATED, ROOT, latex, number, prose, table, write

from stickslip.control.controller import Controller
from stickslip.control.linear import place
from stickslip.core.errors import InputError
from stickslip.core.spec import Field, Law, fields_of
from stickslip.machines.rigid import RigidAxis
from stickslip.models import plugins
from stickslip.models.model import Model, Reference
from stickslip.report.law_pictures import draw_gallery, draw_law
from stickslip.simulation.closed_loop import prepare
from stickslip.simulation.integrators import INTEGRATORS, integrator_for

FOLDER = GENERATED / "laws"
KNOWN = {"name", "title", "equation", "passive", "odd", "rate_independent"}
CAPTION = "Along a slow sine; in pre-sliding (a small loop interrupts a larger one); after steps in velocity."


def make() -> None:
    """Write the pages, the pictures and the list of the laws."""
    laws = [plugins.law(name) for name in plugins.law_names()]
    for law in laws:
        draw_law(Model(law, **law.example), FOLDER / f"{law.name}.svg")
        write(FOLDER / f"{law.name}.md", page(law))
    draw_gallery([Model(law, **law.example) for law in laws], FOLDER / "gallery.svg")
    write(FOLDER / "index.md", index(laws))


def index(laws: list[Law]) -> str:
    """All laws in one table, and the page tree."""
    rows = [
        (f"[`{law.name}`]({law.name}.md)", law.title, passivity(law), "; ".join(map(cited, law.source)))
        for law in laws
    ]
    names = "\n".join(law.name for law in laws)
    return f"""# Friction laws

Every law is one file of the package, and these pages are made from those files. `stickslip law NAME --plot` shows
the same in a terminal, with your parameters, and for a law of your own ([how to write one](../../howto/own_law.md)).
The torque is positive when it opposes positive velocity.

```{{figure}} gallery.svg
:alt: Torque over velocity and over position for every law

Each law with the parameters of its example: above, torque over velocity along a slow sine; below, torque over
position in slow motion of the size of pre-sliding, with a smaller loop inside. Karnopp's law answers in its band
what is applied, here nothing.
```

{table(["name", "law", "passive", "sources"], rows)}

```{{toctree}}
:hidden:

{names}
```
"""


def page(law: Law) -> str:
    """The page of one law."""
    parts = [
        f"# {law.title}\n\n`{law.name}`. {docstring(law)}",
        f"$$\n{law.equation}\n$$",
        f"```{{figure}} {law.name}.svg\n:alt: {law.title}: three responses\n\n{CAPTION}\n```",
        "## Parameters\n\n" + parameters(law.fields),
    ]
    if law.state_fields:
        parts.append("## State\n\n" + states(law.state_fields))
    if law.choices:
        parts.append("## Choices\n\n" + choices(law))
    parts += [
        "## What it declares\n\nThe contract tests hold the law to this.\n\n" + declarations(law),
        "## In use\n\n" + use(law),
        "## Sources\n\n" + "\n".join(f"- {cited(source)}" for source in law.source),
        f"The law's file: {file_link(law)}.",
    ]
    return "\n\n".join(parts) + "\n"


def docstring(law: Law) -> str:
    """What the law's file says of itself, as Markdown."""
    text = sys.modules[law.Params.__module__].__doc__ or ""
    return prose(text.strip())


def parameters(fields: tuple[Field, ...]) -> str:
    """Symbol, name, unit, bounds, default, meaning."""
    rows = [
        (
            f"${latex(f.par.symbol)}$",
            f"`{f.name}`" + (", a list" if f.per_element else ""),
            f.par.unit,
            f.par.bounds.replace("inf", "∞"),
            "" if f.par.default is None else number(f.par.default),
            f.par.meaning,
        )
        for f in fields
    ]
    return table(["symbol", "name", "unit", "bounds", "default", "meaning"], rows)


def states(fields: tuple[Field, ...]) -> str:
    """Symbol, name, unit, meaning of the internal states."""
    rows = [
        (
            f"${latex(f.par.symbol)}$",
            f"`{f.name}`" + (", a list" if f.per_element else ""),
            f.par.unit,
            f.par.meaning,
        )
        for f in fields
    ]
    return table(["symbol", "name", "unit", "meaning"], rows)


def choices(law: Law) -> str:
    """What can be exchanged, by what, and the parameters that this brings along."""
    rows, brought = [], []
    for choice in law.choices:
        for name, option in choice.options.items():
            said = (getattr(option.function, "__doc__", "") or choice.meaning).strip().splitlines()
            default = " (default)" if name == choice.default else ""
            words = said[0].rstrip(".") if said else ""
            rows.append((f"`{choice.name}`", f"`{name}`{default}", f"`{words}`" if "=" in words else words))
            own = fields_of(option.params)
            if own and name != choice.default:
                brought.append(f'With `{choice.name} = "{name}"`:\n\n{parameters(own)}')
            if option.doubles:
                doubled = ", ".join(
                    f"`{f.name}{option.doubles}`" for f in law.having(**{choice.name: name}).fields
                    if not f.name.endswith(option.doubles) and f"{f.name}{option.doubles}" in
                    {g.name for g in law.having(**{choice.name: name}).fields}
                )  # fmt: skip
                brought.append(f'With `{choice.name} = "{name}"`, for v < 0: {doubled}.')
    return "\n\n".join([table(["choice", "option", "what it is"], rows), *brought])


def passivity(law: Law) -> str:
    """Under which condition the law only dissipates."""
    words = {"": "not stated"}
    return words.get(
        law.passive, law.passive if law.passive in ("always", "never") else f"if {law.passive}"
    ).replace("*", r"\*")


def declarations(law: Law) -> str:
    """The declarations, with whatever a later description of laws adds to them."""
    rows = [
        ("[passive](../../explanation/passivity.md)", passivity(law)),
        ("odd: the mirrored motion gives the mirrored torque", "yes" if law.odd else "no"),
        ("rate-independent: the torque depends on the path, not on its speed", yes(law.rate_independent)),
        ("[integrators](../../howto/integrator.md) that take it as plant", ", ".join(integrators(law))),
    ]
    for f in dataclasses.fields(law):
        value = getattr(law, f.name)
        if f.name not in KNOWN and isinstance(value, (bool, str)):
            rows.append((f.name.replace("_", " "), yes(value) if isinstance(value, bool) else value))
    return table(["property", "value"], rows)


def integrators(law: Law) -> Iterator[str]:
    """Those that can run an axis with this friction."""
    axis = RigidAxis(1e-3, Model(law, **law.example))
    case = prepare(axis, Controller(place("PD", 1e-3, 10.0, 1.0)), Reference("ramp", velocity=1.0), 1.0)
    for name in INTEGRATORS:
        try:
            yield integrator_for(case, name)[0]
        except InputError:
            continue


def yes(value: bool) -> str:
    """Yes or no."""
    return "yes" if value else "no"


def use(law: Law) -> str:
    """The law in Python and in a file, with the parameters of the picture."""
    given = {f.name: law.example[f.name] for f in law.fields if f.name in law.example}
    arguments = ", ".join(f"{name}={value!r}" for name, value in given.items())
    lines = "\n".join(f"{name} = {json.dumps(value)}" for name, value in given.items())
    return f"""```python
import stickslip as ss

friction = ss.Model("{law.name}", {arguments})
```

```toml
[friction]
law = "{law.name}"
{lines}
```"""


def cited(source: str) -> str:
    """A source as a link to the bibliography, or the place in the thesis as it is."""
    return source if " " in source else f"{{cite:t}}`{source}`"


def file_link(law: Law) -> str:
    """The law's file inside the repository, or its path."""
    path = Path(sys.modules[law.Params.__module__].__file__ or "")
    return f"`{path.relative_to(ROOT).as_posix()}`" if path.is_relative_to(ROOT) else f"`{path.name}`"
