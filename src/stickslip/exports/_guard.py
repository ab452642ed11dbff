"""Guard the step of an exported law against NaN and infinite inputs, as the controllers are guarded.

Laws contain no such test, as this package never calls them with such inputs. On a drive one bad sample would stay in
the state forever.
"""

from __future__ import annotations

import ast
from collections.abc import Mapping

from stickslip.control.composition import LARGEST
from stickslip.core.messages import axis_unit
from stickslip.exports._analysis import fields_read
from stickslip.exports._text import first_line

REFUSES = "At an input that is not finite the torque is 0 and the state does not change."
CLOCK = 1e-6
"""Factor on the time: clocks that count from 1970 are beyond `LARGEST` seconds."""


def guarded(functions: Mapping[str, ast.FunctionDef], entry: str = "_step") -> dict[str, ast.FunctionDef]:
    """Return the functions of a law, callees first, with a step that checks its inputs.

    If an input is NaN, infinite or beyond `LARGEST`, the torque of the step is 0 and the state does not change.

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
    """Return a function with the same arguments that calls the step if all of its inputs are finite."""
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
    about = first_line(ast.get_docstring(step) or "") or f"Torque at the end of the step, {axis_unit('N·m')}."
    made.body.insert(0, ast.Expr(ast.Constant(f"{about.rstrip('.')}. {REFUSES}")))
    return made
