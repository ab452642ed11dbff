"""Equations as MathML, which browsers draw without a script from the network; by docutils' own translator."""

from __future__ import annotations

import re
from typing import Any

from docutils import nodes
from docutils.utils.math.latex2mathml import tex2mathml
from sphinx.application import Sphinx

# An accented letter with an index: docutils sets the index below the letter where it belongs beside it.
ACCENTED = re.compile(
    r"<munderover>\s*(<mi[^>]*>[^<]*</mi>|<mover>(?:(?!mover).)*</mover>)\s*(<m(\w+)[^>]*>(?:(?!munder).)*?</m\3>)\s*"
    r"(<mo[^>]*>[˙ˆ˜¨¯~^]</mo>)\s*</munderover>",
    re.DOTALL,
)
# Two digits without braces, as TeX takes them: docutils takes both for the numerator.
UNBRACED = re.compile(r"(\\[dt]?frac)(\d)(\d)")


def drawn(equation: str, block: bool) -> str:
    """MathML of an equation."""
    found = tex2mathml(UNBRACED.sub(r"\1{\2}{\3}", equation), as_block=block)
    # Without a mathematical font a browser sets what is marked as an accent into the letter: the dot of a rate is lost.
    found = found.replace('<mover accent="true">', "<mover>")
    return ACCENTED.sub(r"<msub><mover>\1\4</mover>\2</msub>", found)


def visit_inline(translator: Any, node: Any) -> None:
    """Draw an equation inside a line."""
    translator.body.append(drawn(node.astext(), block=False))
    raise nodes.SkipNode


def visit_block(translator: Any, node: Any) -> None:
    """Draw an equation on lines of its own."""
    translator.body.append(f'<div class="math">{drawn(node.astext(), block=True)}</div>\n')
    raise nodes.SkipNode


def setup(app: Sphinx) -> dict[str, Any]:
    """Register the renderer."""
    app.add_html_math_renderer("mathml", (visit_inline, None), (visit_block, None))
    return {"version": "1", "parallel_read_safe": True, "parallel_write_safe": True}
