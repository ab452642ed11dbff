"""The scalar subset: the Python in which laws, references and filters are written, and its translation.

A function of the subset works on numbers: arithmetic, comparisons, ``if``/``else``, ``for i in range(n)``,
local names, ``math`` functions, other functions of the subset, and the fields of its structured arguments
(``p.fc``, ``z.force[i]``, ``len(p.k)``). It runs as it stands in Python. `lower` rewrites the fields into
elements of flat arrays (``p[3]``), which is what numba compiles and what C export will read.

A structure may hold parts (`Layout.parts`). A function that is called with one (``step(v, z.friction, p.friction)``) is
translated once more for that part: its fields are those of the whole with the part's name before theirs
(``z.friction_force``).

A construct outside the subset is refused with file, line and what to write instead.
"""

from __future__ import annotations

import ast
from collections.abc import Callable, Collection, Mapping
from typing import Any

from stickslip.core.errors import LawError
from stickslip.core.return_check import MUST, gives, missing_return
from stickslip.subset.layout import Layout, law_layouts
from stickslip.subset.source import parsed
from stickslip.subset.translator import Names, Target, Translator, View

__all__ = ["Layout", "law_layouts", "lower", "named"]


def lower(
    entries: Mapping[str, Callable[..., Any]], layouts: Mapping[str, Layout], given: Collection[str] = ()
) -> dict[str, ast.FunctionDef]:
    """Translate functions and everything they call into functions on flat arrays.

    Parameters
    ----------
    entries : mapping
        Name in the result to function.
    layouts : mapping
        Argument name to layout, for the structured arguments.
    given : collection of str
        Functions that whoever runs the text supplies; they are called by their name with an underscore before it.

    Returns
    -------
    dict of str to ast.FunctionDef
        Callees first. Names of callees start with an underscore.

    Raises
    ------
    LawError
        With file, line and what to write instead.
    """
    done: dict[str, ast.FunctionDef] = {}
    names = Names(frozenset(given))
    for name, function in entries.items():
        _translate(names.of(name, Target(function)), Target(function), layouts, done, names, (), flat=True)
    return done


def named(
    entries: Mapping[str, Callable[..., Any]], layouts: Mapping[str, Layout], given: Collection[str] = ()
) -> dict[str, ast.FunctionDef]:
    """Check functions and everything they call, and keep their fields by name (``p.k[i]``).

    Arguments, order and errors as in `lower`. Constants of the file are numbers in the result; the number of
    elements is the name ``elements_``, of points ``points_`` and so on. This is what export writes in other
    languages.
    """
    done: dict[str, ast.FunctionDef] = {}
    names = Names(frozenset(given))
    for name, function in entries.items():
        _translate(names.of(name, Target(function)), Target(function), layouts, done, names, (), flat=False)
    return done


def _translate(
    name: str,
    target: Target,
    layouts: Mapping[str, Layout],
    done: dict[str, ast.FunctionDef],
    names: Names,
    stack: tuple[str, ...],
    *,
    flat: bool,
) -> None:
    if name in done:
        return
    function = target.function
    tree, where = parsed(function)
    if name in stack:
        raise LawError(f"{where.at(tree)}: {function.__name__} calls itself; use a `for` loop instead")
    open_end = missing_return(tree, must=not stack and name.strip("_") in MUST)
    arguments = [a.arg for a in tree.args.args]
    structures = [a for a in arguments if a in layouts and a not in target.numbers]
    views = {a: View(a, "", layouts[a]) for a in structures} | dict(target.views)
    translator = Translator(where, layouts, arguments, views, function.__globals__, flat, names, target)
    translator.rename(tree)
    body = [s for s in (translator.visit(statement) for statement in tree.body) if s is not None]
    if open_end:  # said last: a `try` in which it returns is no missing return
        raise LawError(
            f"{where.at(open_end)}: {function.__name__}() goes on here without returning a number; end every path "
            "with `return` and a number"
        )
    if flat:
        # Once at the top: the compiler cannot know that writing to a state leaves the parameters alone.
        body[:0] = [translator.counted(per) for per in translator.counts]
    for callee, called in translator.calls.items():
        _translate(callee, called, layouts, done, names, (*stack, name), flat=flat)
    for callee, node in translator.read.items():
        if not gives(done[callee]):
            what = translator.calls[callee].function.__name__
            raise translator.refuse(
                node, f"the value of {what}(), which returns none,", "let it return a number"
            )
    given = [ast.arg(name) for name in dict.fromkeys(map(translator.given_as, arguments))]
    arguments = ast.arguments([], given, None, [], [], None, [])
    if not flat:
        body = [*_docstring(tree), *body]
    # Of places in a file only those of statements, which printing asks for: to give every node one takes as long as
    # to translate.
    done[name] = ast.FunctionDef(
        name=name, args=arguments, body=body or [ast.Pass()], decorator_list=[], lineno=1
    )


def _docstring(tree: ast.FunctionDef) -> list[ast.stmt]:
    text = ast.get_docstring(tree)
    return [ast.Expr(ast.Constant(text))] if text else []
