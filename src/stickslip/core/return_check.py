"""Which paths through a function of the scalar subset return a number.

Plain Python lets a path end without `return` and goes on with None; compiled, that is no number at all. So every path
of a function that returns one has to.
"""

from __future__ import annotations

import ast
from collections.abc import Sequence

MUST = frozenset(
    {"step", "sampled", "rate", "steady", "holding", "growth", "stored", "sliding", "sample", "guarded"}
)
"""Functions whose number is the answer; what others write, they write into their arguments."""


def gives(tree: ast.FunctionDef) -> bool:
    """Whether the function returns a number anywhere."""
    return any(map(_has_value, _returns(tree)))


def _returns(node: ast.stmt) -> list[ast.Return]:
    if isinstance(node, ast.Return):
        return [node]
    # Expressions hold none, and are most of a tree.
    parts = (*getattr(node, "body", ()), *getattr(node, "orelse", ()))
    return [found for part in parts for found in _returns(part)]


def missing_return(tree: ast.FunctionDef, *, must: bool = False) -> ast.stmt | None:
    """The statement behind which a path goes on without a number, or None where every path returns one.

    Parameters
    ----------
    tree : ast.FunctionDef
    must : bool
        Whether a function that returns nothing at all misses it too.
    """
    returns = _returns(tree)
    if not (must or any(map(_has_value, returns))):
        return None
    return next((node for node in returns if not _has_value(node)), None) or _open_end(tree.body)


def _has_value(node: ast.Return) -> bool:
    return node.value is not None and not (isinstance(node.value, ast.Constant) and node.value.value is None)


def _open_end(body: Sequence[ast.stmt]) -> ast.stmt | None:
    """The last statement of a path through `body` that does not return; None where there is no such path."""
    for statement in body:
        if isinstance(statement, ast.Return):
            return None
        if isinstance(statement, ast.If) and statement.orelse:
            ends = [_open_end(part) for part in (statement.body, statement.orelse)]
            if ends == [None, None]:
                return None
    last = body[-1]
    if isinstance(last, ast.If) and (inside := _open_end(last.body)):
        return inside
    if isinstance(last, ast.If) and last.orelse:
        return _open_end(last.orelse)
    return last
