"""Functions of the scalar subset in MATLAB, as Octave reads it too.

Structures are passed by value: a function returns those that it changes after its own value.
"""

from __future__ import annotations

import ast
import math
from collections.abc import Mapping, Sequence
from typing import ClassVar

from stickslip.exports._analysis import analyse
from stickslip.exports._hoist import hoisted
from stickslip.exports._language import ATOM, Language

MATH = {"fabs": "abs", "pow": "power"} | {
    n: n for n in ("exp", "expm1", "log", "log1p", "sqrt", "sin", "cos", "tan", "atan", "atan2", "tanh", "sinh", "cosh",
                   "floor", "ceil", "hypot")
}  # fmt: skip
KEYWORDS = {
    "break", "case", "catch", "classdef", "continue", "else", "elseif", "end", "for", "function", "global",
    "if", "otherwise", "parfor", "persistent", "return", "spmd", "switch", "try", "while", "do", "until",
    "unwind_protect",
}  # fmt: skip
HELPERS = {
    "copysign_": """\
function y = copysign_(x, s)
    y = abs(x);
    if s < 0
        y = -y;
    end
end
""",
    "choose_": """\
function y = choose_(c, a, b)
    if c
        y = a;
    else
        y = b;
    end
end
""",
}
"""Functions that MATLAB lacks."""


class _Matlab(Language):
    operators: ClassVar[dict[type[ast.AST], str]] = {
        **Language.operators, ast.And: "&&", ast.Or: "||", ast.Not: "~", ast.NotEq: "~="
    }  # fmt: skip
    branches: ClassVar[tuple[str, str, str, str]] = ("if {}", "elseif {}", "else", "end")
    counting: ClassVar[tuple[str, str]] = ("for {i} = {first}:({last} - 1)", "end")

    # ---- expressions ---------------------------------------------------------------------------------

    def name(self, name: str) -> str:
        return f"p.{name.strip('_')}" if name in self.facts.counts else safe(name)

    def number(self, value: float) -> str:
        if math.isinf(value):
            return "Inf" if value > 0.0 else "-Inf"
        return repr(value)

    def as_real(self, node: ast.expr) -> str:
        return self.expression(node, ATOM)

    def word(self, name: str) -> str:
        return safe(name)

    def field(self, node: ast.Attribute) -> str:
        return "pi" if ast.unparse(node) == "math.pi" else super().field(node)

    def element(self, node: ast.Subscript) -> str:
        assert isinstance(node.value, ast.Attribute)
        return f"{self.field(node.value)}({self.expression(node.slice, ATOM)} + 1)"

    def named_call(self, name: str, arguments: Sequence[ast.expr]) -> str:
        given = [self.expression(a) for a in arguments]
        if name in ("abs", "min", "max"):
            return f"{name}({', '.join(given)})"
        if name == "float":
            return given[0]
        if name == "int":
            return f"fix({given[0]})"
        return f"{local(name)}({', '.join(given)})"

    def library(self, name: str, arguments: Sequence[ast.expr]) -> str:
        """A mathematical function."""
        if name == "copysign":
            return f"copysign_({', '.join(self.expression(a) for a in arguments)})"
        if name not in MATH:
            raise self.refused(ast.Name(name))
        return f"{MATH[name]}({', '.join(self.expression(a) for a in arguments)})"

    def power(self, node: ast.BinOp) -> str:
        return f"power({self.expression(node.left)}, {self.expression(node.right)})"

    def remainder(self, left: str, right: str) -> tuple[str, int]:
        return f"mod({left}, {right})", ATOM

    def choice(self, node: ast.IfExp) -> str:
        return f"choose_({self.expression(node.test)}, {self.expression(node.body)}, {self.expression(node.orelse)})"

    # ---- statements ----------------------------------------------------------------------------------

    def declaration(self, name: str) -> list[str]:
        return []

    def assignment(self, node: ast.Assign) -> list[str]:
        target, callee = self.expression(node.targets[0]), self.callee(node.value)
        if callee and callee.writes:
            assert isinstance(node.value, ast.Call)
            return [f"[{', '.join([target, *self.changed(node.value, callee)])}] = {self.call(node.value)};"]
        return [f"{target} = {self.expression(node.value)};"]

    def returning(self, node: ast.Return) -> list[str]:
        if node.value is None:
            return ["return;"]
        return [f"torque_ = {self.expression(node.value)};", "return;"]

    def call_statement(self, node: ast.Call) -> list[str]:
        callee = self.callee(node)
        if callee is None or not callee.writes:
            return []
        outputs = [*(["~"] if callee.returns else []), *self.changed(node, callee)]
        return [f"[{', '.join(outputs)}] = {self.call(node)};"]


def safe(name: str) -> str:
    """A name that the language does not reserve; two names stay two."""
    return f"{name}_" if name.rstrip("_") in KEYWORDS else name


def local(name: str) -> str:
    """A name that MATLAB allows: none begins with an underscore."""
    return name.strip("_") + "_"


def with_helpers(lines: Sequence[str]) -> list[str]:
    """The lines of a file with those functions that it uses and MATLAB lacks."""
    used = "\n".join(lines)
    return [*lines, *(code for name, code in HELPERS.items() if f"{name}(" in used)]


def functions(trees: Mapping[str, ast.FunctionDef]) -> list[tuple[str, str, list[str]]]:
    """Name, docstring and lines of every function, callees first."""
    trees = hoisted(trees)
    known = analyse(trees)
    out: list[tuple[str, str, list[str]]] = []
    for name, tree in trees.items():
        facts = known[name]
        changed = [safe(a) for a in facts.arguments if a in facts.writes]
        outputs = [*(["torque_"] if facts.returns else []), *changed]
        head = f"function [{', '.join(outputs)}] = {local(name)}({', '.join(map(safe, facts.arguments))})"
        lines = [head, *_Matlab(facts, known).block(tree.body, 1), "end"]
        out.append((name, ast.get_docstring(tree) or "", lines))
    return out
