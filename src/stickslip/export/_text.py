"""Templates and text."""

from __future__ import annotations

import functools
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import jinja2

    from stickslip.control_spec import ControlLaw
    from stickslip.spec import Law

LETTERS = {
    "·": "*", "²": "^2", "³": "^3", "°": "deg", "µ": "u", "μ": "u", "−": "-", "–": "-", "×": "x", "≤": "<=",
    "≥": ">=",
}  # fmt: skip


@functools.cache
def _environment() -> jinja2.Environment:
    import jinja2

    made = jinja2.Environment(
        loader=jinja2.PackageLoader("stickslip.export"),
        undefined=jinja2.StrictUndefined,
        keep_trailing_newline=True,
        trim_blocks=False,
        autoescape=False,
    )
    made.filters["plain"] = ascii_only
    return made


def render(template: str, **values: Any) -> str:
    """Fill a template of this package."""
    from stickslip import __version__

    return _environment().get_template(template).render(version=__version__, **values)


def ascii_only(text: str) -> str:
    """Text for compilers and terminals that know no other letters."""
    for letter, plain in LETTERS.items():
        text = text.replace(letter, plain)
    return text.encode("ascii", "replace").decode().replace("*/", "* /")


def summary(name: str, text: str) -> str:
    """The summary of a function's docstring; its name where it has none, as a comment is never empty."""
    return ascii_only(first_line(text)) or f"{name.strip('_')}()"


def sources(law: Law | ControlLaw) -> str:
    """Where a law comes from, for people."""
    return "; ".join(law.source) or "none stated"


def first_line(text: str) -> str:
    """The summary of a docstring."""
    return text.strip().splitlines()[0] if text.strip() else ""
