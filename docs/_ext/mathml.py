"""Equations as MathML, which browsers draw without a script from the network; by docutils' own translator."""

from __future__ import annotations

import re
from typing import Any

from docutils import nodes
from docutils.utils.math.latex2mathml import tex2mathml
from sphinx.application import Sphinx

# An accented letter with an index: docutils sets the index below the letter where it belongs beside it.
ACCENTED = re.compile(
    r"<munderover>\s*(<mi[^>]*>[^<]*</mi>)\s*(<m(\w+)[^>]*>(?:(?!munder).)*?</m\3>)\s*"
    r"(<mo[^>]*>[˙ˆ˜¨¯~^]</mo>)\s*</munderover>",
    re.DOTALL,
)


def drawn(equation: str, block: bool) -> str:
    """MathML of an equation."""
    return ACCENTED.sub(r"<msub><mover>\1\4</mover>\2</msub>", tex2mathml(equation, as_block=block))


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
