"""Templates, and texts that cannot become code.

A law's title, equation, source, units, meanings and docstrings come from files of users. A template of a target prints
each of them as a text of the template's language: one line of printable characters without anything that ends a comment
or a string there (`text_in`). What is code of that language already is `Code`, and printed as it is.
"""

from __future__ import annotations

import functools
import json
import re
import textwrap
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from stickslip.core.messages import axis_unit

if TYPE_CHECKING:
    import jinja2

    from stickslip.core.control_spec import ControlLaw
    from stickslip.core.spec import Law

LETTERS = {
    "·": "*", "²": "^2", "³": "^3", "°": "deg", "µ": "u", "μ": "u", "−": "-", "–": "-", "×": "x", "≤": "<=",
    "≥": ">=",
}  # fmt: skip
C = (r"\*(?=/)", r"/(?=\*)", r"\?(?=\?)")
"""Ends and starts of a comment in C, and trigraphs: a space goes between their letters."""
ST = (r"\((?=\*)", r"\*(?=\))")
SPLIT: Mapping[str, tuple[str, ...]] = {
    "c": C, "h": C, "ino": C, "comp": C, "mo": C[:2], "st": ST, "TcPOU": (*ST, r"\](?=\])"),
}  # fmt: skip
"""By the ending of a file, pairs of letters that a text must not have."""
XML = {"&": "&amp;", "<": "&lt;", ">": "&gt;", '"': "&quot;", "--": "-&#45;"}
STRING = {'"': "'", "\\": "/"}
INSTEAD: Mapping[str, Mapping[str, str]] = {
    "comp": STRING, "mo": STRING, "py": {'"': "'"}, "md": {"<": "&lt;", "|": "\\|"}, "xml": XML, "urdf": XML,
}  # fmt: skip
"""By the ending of a file: text that would end a string, a cell or an attribute, and its replacement."""
UNICODE = ("md", "py", "xml", "urdf")
"""Endings of files that are read as UTF-8 everywhere; others have ASCII."""


class Code(str):
    """Code of a template's language, which the template prints as it is."""

    __slots__ = ()

    def __html__(self) -> str:
        return self


def folded(text: str) -> str:
    """Fold a text to one printable line, without characters that control a terminal or the writing direction."""
    return "".join(c if c.isprintable() else " " if c.isspace() else "" for c in text)


def text_in(language: str, text: str) -> str:
    """Return a text that is safe in a comment or a string of a language.

    Parameters
    ----------
    language : str
        The ending of its files: "c", "h", "m", "md", "mo", "py", "st", "xml", "yaml", ...
    text : str
    """
    text = folded(text)
    if language not in UNICODE:
        text = ascii_only(text)
    for letters, other in INSTEAD.get(language, {}).items():
        text = text.replace(letters, other)
    for pair in SPLIT.get(language, ()):
        text = re.sub(pair, lambda found: found[0] + " ", text)
    return text.rstrip("\\")  # at the end of a line it joins the next one


def ascii_only(text: str) -> str:
    """Return a text in ASCII, for compilers and terminals that need it."""
    for letter, plain in LETTERS.items():
        text = text.replace(letter, plain)
    return text.encode("ascii", "replace").decode()


def quoted(text: str | float) -> Code:
    """A text as a string of YAML and JSON."""
    return Code(json.dumps(text, ensure_ascii=False))


# ---- templates ---------------------------------------------------------------------------------------------------


@functools.cache
def _environment() -> jinja2.Environment:
    import jinja2

    @jinja2.pass_context
    def printed(context: jinja2.runtime.Context, value: Any) -> Any:
        if not isinstance(value, str) or hasattr(value, "__html__"):
            return value
        return Code(text_in(str(context.name).removesuffix(".j2").rpartition(".")[2], value))

    return jinja2.Environment(
        loader=jinja2.PackageLoader("stickslip.exports"),
        undefined=jinja2.StrictUndefined,
        keep_trailing_newline=True,
        trim_blocks=False,
        autoescape=True,  # of what `printed` returns nothing is escaped; macros and includes stay as they are
        finalize=printed,
    )


def render(template: str, **values: Any) -> str:
    """Fill a template of this package; a string is a text of the template's language unless it is `Code`."""
    from stickslip import __version__
    from stickslip.control.composition import LARGEST

    common: dict[str, Any] = {"version": __version__, "largest": LARGEST, "unit": axis_unit}
    return str(_environment().get_template(template).render({**common, **values}))


# ---- texts of a law ----------------------------------------------------------------------------------------------


def summary(name: str, text: str) -> str:
    """Return the summary of a function's docstring, or its name if it has none, as a comment is never empty."""
    return first_line(text) or f"{name.strip('_')}()"


def sources(law: Law | ControlLaw) -> str:
    """Where a law comes from, for people."""
    return "; ".join(law.source) or "none stated"


def in_lines(equation: str) -> list[str]:
    """An equation in lines of a comment."""
    return textwrap.wrap(folded(equation), 110, break_long_words=False)


STATED = re.compile(r"(?<=[,.] )(?:N·m(?:/s)?|rad(?:[/·]s²?)?|kg·m²)(?=[,.:;]|$)")
"""A unit as docstrings of laws state it: after a comma or a full stop, and before the next one."""


def first_line(text: str) -> str:
    """Return the summary of a docstring, its units those of the present axis."""
    return in_units_of_axis(text.strip().splitlines()[0]) if text.strip() else ""


def in_units_of_axis(text: str) -> str:
    """Return a docstring with the units that it states written for the present axis."""
    return STATED.sub(lambda found: axis_unit(found[0]), text)
