"""A law whose texts try to end the comments and strings of every export, and what a file must not do with them."""

SAFE = "law with hostile texts"
ENDS = (
    "*/", "*)", "/*", "(*", "-->", "--", '"""', "'''", '"', "'", "]]>", "%}", "}", "{", "??/", "|", "`", "<script>",
    "#", "\\",
)  # fmt: skip
LINES = ("\n", "\r", "\r\n", "\v", "\f", "\x85", "\u2028", "\u2029", "\x1c")
CONTROLS = ("\x00", "\x07", "\x1b[31m", "\x7f", "\u202e", "\u2066", "\u200f", "\ufeff", "\ud800")
BREAKS = "".join(
    (*(f"{end} " for end in ENDS), *(f"{line}PWNED{line}" for line in LINES), *CONTROLS, *ENDS[::-1])
)
"""Whatever ends a comment or a string, and a statement on a line of its own behind every kind of line break."""
LAW = '''
import math
from typing import Annotated, NamedTuple

from stickslip.core.spec import Law, Par

T = {text!r}


class Params(NamedTuple):
    fc: Annotated[float, Par("N·m" + T, "F_C", "level" + T, positive=True)]
    sigma2: Annotated[float, Par("N·m·s/rad" + T, "s", T + "viscous" + T, lower=0.0)]


class State(NamedTuple):
    force: Annotated[float, Par("N·m" + T, "F", "torque" + T)]


def slope(v, p):
    """Docstring {doc}"""
    return p.sigma2 * v


def step(v0, v1, dt, z, p, u):
    """Docstring {doc}"""
    goal = math.copysign(p.fc, v1)
    z.force = goal + (z.force - goal) * math.exp(-abs(v1) * dt * 1e3)
    return z.force + slope(v1, p)


def steady(v, p):
    """Docstring {doc}"""
    if v == 0.0:
        return 0.0
    return math.copysign(p.fc, v) + p.sigma2 * v


LAW = Law(
    "hostile_texts", Params, step, title=T + {safe!r} + T, equation=T + r"F = F_C \\dot q" + T, source=(T, "b" + T),
    example={{"fc": 0.3, "sigma2": 0.01}}, State=State, steady=steady,
)
'''


def law_file(folder):
    """The law's file in a folder."""
    doc = BREAKS.replace("\ud800", "").encode("unicode_escape").decode().replace('"', '\\"')
    file = folder / "hostile_texts.py"
    file.write_text(LAW.format(text=BREAKS, doc=doc, safe=SAFE), encoding="utf-8")
    return file


def visible(text):
    """Whether every character of a file is printable or a line break of its own."""
    return all(c.isprintable() or c == "\n" for c in text)


def own_lines(text):
    """Whether no line break of the texts begins a line."""
    return not any(line.startswith("PWNED") for line in text.splitlines())
