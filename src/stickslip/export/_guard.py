"""The step of an exported law refuses inputs that are no numbers, as the controllers do: none reaches the state.

Laws are written without such a test: in this package nothing calls them with such inputs. On a drive one bad sample
would stay in the state for ever.
"""

from __future__ import annotations

import ast
from collections.abc import Mapping

from stickslip.control.composition import LARGEST
from stickslip.export._analysis import fields_read
from stickslip.export._text import first_line

REFUSES = "An input that is no finite number gives 0 and leaves the state as it is."
CLOCK = 1e-6
"""Factor on the time: clocks that count from 1970 are beyond `LARGEST` seconds."""


def guarded(functions: Mapping[str, ast.FunctionDef], entry: str = "_step") -> dict[str, ast.FunctionDef]:
    """Functions of a law, callees first, whose step leaves the state as it is at an input that is no number.

    The torque of such a step is 0. An infinite number, or one that no machine has (`LARGEST`), is none either.

    Parameters
    ----------
    functions : mapping of str to ast.FunctionDef
        As `stickslip.subset.named` returns them.
    entry : str
        The step among them. It comes last in the result.
    """
    inner = f"{entry}_within"
    while inner in functions:
        inner += "_"
    out: dict[str, ast.FunctionDef] = {}
    for name, tree in functions.items():
        for node in ast.walk(tree):
            if isinstance(node, ast.Name) and node.id == entry:
                node.id = inner
        out[inner if name == entry else name] = tree
    step = out[inner]
    step.name = inner
    return {**out, entry: _guard(step, entry, inner, sorted(fields_read(functions.values())))}


def _guard(step: ast.FunctionDef, entry: str, inner: str, read: list[str]) -> ast.FunctionDef:
    """A function of the same arguments that calls the step where all of its inputs are numbers."""
    arguments = [a.arg for a in step.args.args]
    around = arguments[5]
    sizes = [f"abs({name})" for name in arguments[:3]]
    sizes += [
        f"{CLOCK} * abs({around}.{name})" if name == "time" else f"abs({around}.{name})" for name in read
    ]
    text = (
        f"def {entry}({', '.join(arguments)}):\n"
        f"    if not {' + '.join(sizes)} < {LARGEST!r}:\n"
        f"        return 0.0\n"
        f"    return {inner}({', '.join(arguments)})\n"
    )
    made = ast.parse(text).body[0]
    assert isinstance(made, ast.FunctionDef)
    about = first_line(ast.get_docstring(step) or "") or "Torque at the end of the step, N·m."
    made.body.insert(0, ast.Expr(ast.Constant(f"{about.rstrip('.')}. {REFUSES}")))
    return made
