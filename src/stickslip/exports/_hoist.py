"""For languages that pass structures by value: calls that change one stand alone in a statement of their own.

``x = a * f(z)`` with a function that writes z becomes ``called_1 = f(z)`` and ``x = a * called_1``.
"""

from __future__ import annotations

import ast
import copy
from collections.abc import Mapping, Sequence

from stickslip.core.errors import LawError
from stickslip.exports._analysis import Facts, analyse


def hoisted(functions: Mapping[str, ast.FunctionDef]) -> dict[str, ast.FunctionDef]:
    """Functions whose calls that change a structure stand alone, callees first.

    Raises
    ------
    LawError
        If the order in which Python evaluates an expression would be lost.
    """
    known = analyse(functions)
    out: dict[str, ast.FunctionDef] = {}
    for name, tree in functions.items():
        fresh = copy.deepcopy(tree)
        fresh.body = _Hoister(known).block(fresh.body)
        out[name] = ast.fix_missing_locations(fresh)
    return out


class _Hoister(ast.NodeTransformer):
    def __init__(self, known: Mapping[str, Facts]) -> None:
        self.known = known
        self.count = 0
        self.before: list[ast.stmt] = []

    def block(self, statements: Sequence[ast.stmt]) -> list[ast.stmt]:
        out: list[ast.stmt] = []
        for statement in statements:
            self.before = []
            if isinstance(statement, ast.If):
                statement.test = self.inner(statement.test)
                before = self.before
                statement.body = self.block(statement.body)
                statement.orelse = self.block(statement.orelse)
                self.before = before
            elif isinstance(statement, ast.For):
                statement.body = self.block(statement.body)
                self.before = []
            elif isinstance(statement, ast.Expr) and isinstance(statement.value, ast.Call):
                pass
            elif isinstance(statement, ast.Assign) and self.writer(statement.value):
                if not isinstance(statement.targets[0], ast.Name):
                    statement.value = self.inner(statement.value)
            elif (
                isinstance(statement, (ast.Assign, ast.AugAssign, ast.Return)) and statement.value is not None
            ):
                statement.value = self.inner(statement.value)
            out += [*self.before, statement]
        return out

    def writer(self, node: ast.AST) -> Facts | None:
        """The function called, if it changes a structure."""
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
            callee = self.known.get(node.func.id)
            return callee if callee and callee.writes else None
        return None

    def inner(self, expression: ast.expr) -> ast.expr:
        """The expression with its changing calls taken out."""
        calls = [n for n in ast.walk(expression) if self.writer(n)]
        if not calls:
            return expression
        changed = {n.id for call in calls for n in ast.walk(call) if isinstance(n, ast.Name)}
        inside = {id(n) for call in calls for n in ast.walk(call)}
        fields = [n for n in ast.walk(expression) if isinstance(n, ast.Attribute) and id(n) not in inside]
        read = {n.value.id for n in fields if isinstance(n.value, ast.Name)}
        writes = {w for call in calls if (callee := self.writer(call)) for w in callee.writes}
        if len(calls) > 1 or read & changed & writes:
            raise LawError(
                f"`{ast.unparse(expression)}` changes what it reads; put the call into a line of its own"
            )
        return self.visit(expression)

    def visit_Call(self, node: ast.Call) -> ast.expr:
        if not self.writer(node):
            self.generic_visit(node)
            return node
        self.count += 1
        name = f"called_{self.count}"
        self.before.append(ast.Assign([ast.Name(name, ast.Store())], node))
        return ast.Name(name, ast.Load())
