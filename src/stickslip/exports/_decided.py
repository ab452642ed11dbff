"""Conditional expressions as if statements, for a language whose own form of them evaluates both sides."""

from __future__ import annotations

import ast
import copy
from collections.abc import Callable, Mapping, Sequence

from stickslip.exports._analysis import Facts


def decided(
    tree: ast.FunctionDef, known: Mapping[str, Facts], needed: Callable[[ast.IfExp], bool]
) -> ast.FunctionDef:
    """A function whose conditional expressions are if statements, each side of which is the whole statement.

    Parameters
    ----------
    tree : ast.FunctionDef
    known : mapping of str to Facts
        Of the functions that it calls.
    needed : callable
        Which conditional expressions must become statements; those inside them do too.
    """

    def block(statements: Sequence[ast.stmt]) -> list[ast.stmt]:
        return [new for statement in statements for new in made(statement)]

    def made(node: ast.stmt) -> list[ast.stmt]:
        found = next((e for e in _own_expressions(node) if isinstance(e, ast.IfExp) and needed(e)), None)
        if found and (_is_value(node, found) or not _changes(node, known)):
            sides = (copy.deepcopy(node, {id(found): side}) for side in (found.body, found.orelse))
            return made(ast.If(found.test, *([side] for side in sides)))
        if isinstance(node, (ast.If, ast.For)):
            node.body, node.orelse = block(node.body), block(node.orelse)
        return [node]

    tree = copy.deepcopy(tree)
    tree.body = block(tree.body)
    return ast.fix_missing_locations(tree)


def _own_expressions(node: ast.stmt) -> list[ast.AST]:
    """What a statement evaluates itself, once, the outermost first."""
    if isinstance(node, ast.If):
        return list(ast.walk(node.test))
    return [] if isinstance(node, ast.For) else list(ast.walk(node))


def _is_value(node: ast.stmt, found: ast.expr) -> bool:
    """Whether it is all that the statement evaluates, so that nothing comes before it."""
    return isinstance(node, (ast.Assign, ast.Return)) and node.value is found


def _changes(node: ast.stmt, known: Mapping[str, Facts]) -> bool:
    """Whether a call in it changes a structure, which its condition, evaluated first, might read."""
    calls = [e.func.id for e in ast.walk(node) if isinstance(e, ast.Call) and isinstance(e.func, ast.Name)]
    return any(known[name].writes for name in calls if name in known)
