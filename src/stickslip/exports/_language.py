"""How functions of the scalar subset are written in another language: what the languages share.

A language is a subclass of `Language` that says how it writes a name, a number, a call and a statement. The
order of every arithmetic operation is kept, so that a target with IEEE arithmetic gives the same bits.
"""

from __future__ import annotations

import ast
import math
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from typing import ClassVar

from stickslip.core.errors import LawError
from stickslip.exports._analysis import Facts, Kind, kind_of

ADDITIVE, MULTIPLICATIVE, UNARY, POWER, ATOM = 6, 7, 8, 9, 10
OR, AND, NOT, COMPARISON, CONDITION = 1, 2, 3, 4, 0


class Language(ABC):
    """One function at a time: `lines` gives its body.

    Attributes
    ----------
    indent : str
    operators : mapping
        How an operator of Python is spelt.
    access : str
        What stands between a structure and its field.
    branches : (str, str, str, str)
        Lines of a condition ({} stands for it), of another where that does not hold, of neither, and of the end.
    counting : (str, str)
        Lines of a loop's head (``i`` counts from ``first`` and stays below ``last``) and of its end.
    counting_at : int
        How tightly `first` and `last` must bind in there.
    """

    indent: ClassVar[str] = "    "
    operators: ClassVar[dict[type[ast.AST], str]] = {
        ast.Add: "+", ast.Sub: "-", ast.Mult: "*", ast.Div: "/", ast.Eq: "==", ast.NotEq: "!=", ast.Lt: "<",
        ast.LtE: "<=", ast.Gt: ">", ast.GtE: ">=", ast.And: "and", ast.Or: "or", ast.Not: "not ",
        ast.USub: "-", ast.UAdd: "+",
    }  # fmt: skip

    access: ClassVar[str] = "."
    branches: ClassVar[tuple[str, str, str, str]]
    counting: ClassVar[tuple[str, str]]
    counting_at: ClassVar[int] = CONDITION

    def __init__(self, facts: Facts, known: Mapping[str, Facts]) -> None:
        self.facts, self.known = facts, known

    # ---- statements ----------------------------------------------------------------------------------

    def block(self, statements: Sequence[ast.stmt], depth: int) -> list[str]:
        """The lines of a block, indented `depth` times."""
        out: list[str] = []
        for statement in statements:
            for name in self.facts.opened.get(id(statement), ()):
                out += self.indented(self.declaration(name), depth)
            out += self.statement(statement, depth)
        return out

    def statement(self, node: ast.stmt, depth: int) -> list[str]:
        """The lines of one statement."""
        if isinstance(node, ast.Assign):
            return self.indented(self.assignment(node), depth)
        if isinstance(node, ast.AugAssign):
            value = ast.BinOp(node.target, node.op, node.value)
            return self.indented(self.assignment(ast.Assign([node.target], value)), depth)
        if isinstance(node, ast.Return):
            return self.indented(self.returning(node), depth)
        if isinstance(node, ast.If):
            return self.condition(node, depth)
        if isinstance(node, ast.For):
            return self.loop(node, depth)
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Call):
            return self.indented(self.call_statement(node.value), depth)
        if isinstance(node, ast.Break):
            return self.indented([self.leave()], depth)
        if isinstance(node, (ast.Pass, ast.Expr)):
            return []
        raise self.refused(node)

    def condition(self, node: ast.If, depth: int) -> list[str]:
        """The lines of a condition with all that is tried where it does not hold."""
        pad = self.indent * depth
        first, other, neither, end = self.branches
        out = [pad + first.format(self.expression(node.test)), *self.block(node.body, depth + 1)]
        while len(node.orelse) == 1 and isinstance(node.orelse[0], ast.If):
            if any(self.declaration(name) for name in self.facts.opened.get(id(node.orelse[0]), ())):
                break
            node = node.orelse[0]
            out += [pad + other.format(self.expression(node.test)), *self.block(node.body, depth + 1)]
        if node.orelse:
            out += [pad + neither, *self.block(node.orelse, depth + 1)]
        return [*out, pad + end]

    def loop(self, node: ast.For, depth: int) -> list[str]:
        """The lines of a loop over ``range``."""
        assert isinstance(node.target, ast.Name)
        assert isinstance(node.iter, ast.Call)
        pad, (head, end) = self.indent * depth, self.counting
        bounds = [self.expression(a, self.counting_at) for a in node.iter.args]
        first, last = (["0"] if len(bounds) == 1 else []) + bounds
        head = head.format(i=self.word(node.target.id), first=first, last=last)
        return [pad + head, *self.block(node.body, depth + 1), pad + end]

    def leave(self) -> str:
        """Out of the loop."""
        return "break;"

    def indented(self, lines: Sequence[str], depth: int) -> list[str]:
        """Lines set in."""
        return [self.indent * depth + line for line in lines]

    def refused(self, node: ast.AST) -> LawError:
        """The error for something this language has no words for."""
        return LawError(f"`{ast.unparse(node)}` has no translation; write it with + - * / and math functions")

    # ---- expressions ---------------------------------------------------------------------------------

    def kind(self, node: ast.expr) -> Kind:
        """The type of an expression here."""
        return kind_of(node, self.facts.kinds)

    def real(self, node: ast.expr, at: int = CONDITION) -> str:
        """An expression where a real number is wanted."""
        if self.kind(node) != "int":
            return self.expression(node, at)
        if isinstance(node, ast.Constant):
            return self.number(float(node.value))  # type: ignore[arg-type]
        return self.as_real(node)

    def expression(self, node: ast.expr, at: int = CONDITION) -> str:
        """An expression, in brackets where its surroundings bind more tightly than `at`."""
        text, binds = self.written(node)
        return f"({text})" if binds < at else text

    def written(self, node: ast.expr) -> tuple[str, int]:
        """An expression and how tightly it binds."""
        if isinstance(node, ast.Constant):
            return self.constant(node), ATOM
        if isinstance(node, ast.Name):
            return self.name(node.id), ATOM
        if isinstance(node, ast.Attribute):
            return self.field(node), ATOM
        if isinstance(node, ast.Subscript):
            return self.element(node), ATOM
        if isinstance(node, ast.Call):
            return self.call(node), ATOM
        if isinstance(node, ast.BinOp):
            return self.binary(node)
        if isinstance(node, ast.UnaryOp):
            if isinstance(node.op, ast.Not):
                return self.operators[ast.Not] + self.expression(node.operand, ATOM), NOT
            return self.operators[type(node.op)] + self.expression(node.operand, UNARY), UNARY
        if isinstance(node, ast.BoolOp):
            binds = AND if isinstance(node.op, ast.And) else OR
            joint = f" {self.operators[type(node.op)]} "
            return joint.join(self.expression(v, NOT) for v in node.values), binds
        if isinstance(node, ast.Compare):
            return self.comparison(node)
        if isinstance(node, ast.IfExp):
            return self.choice(node), CONDITION
        raise self.refused(node)

    def constant(self, node: ast.Constant) -> str:
        """A number as it stands."""
        if isinstance(node.value, bool) or not isinstance(node.value, (int, float)):
            raise self.refused(node)
        return str(node.value) if isinstance(node.value, int) else self.number(node.value)

    def binary(self, node: ast.BinOp) -> tuple[str, int]:
        """Arithmetic of two operands, in the order in which Python does it."""
        if isinstance(node.op, ast.Pow):
            return self.power(node), self.binds_power()
        if isinstance(node.op, ast.Mod) and self.kind(node) == "int":
            # Of counters, which are never negative: there all languages agree.
            return self.remainder(self.expression(node.left, UNARY), self.expression(node.right, UNARY))
        if type(node.op) not in (ast.Add, ast.Sub, ast.Mult, ast.Div):
            raise self.refused(node)
        binds = ADDITIVE if isinstance(node.op, (ast.Add, ast.Sub)) else MULTIPLICATIVE
        whole = self.kind(node) == "int"
        write = self.expression if whole else self.real
        return (
            f"{write(node.left, binds)} {self.operators[type(node.op)]} {write(node.right, binds + 1)}",
            binds,
        )

    def remainder(self, left: str, right: str) -> tuple[str, int]:
        """The remainder of two whole numbers."""
        return f"{left} % {right}", MULTIPLICATIVE

    def comparison(self, node: ast.Compare) -> tuple[str, int]:
        """A comparison; a chain is the conjunction of its links."""
        operands = [node.left, *node.comparators]
        whole = all(self.kind(o) == "int" for o in operands)
        write = self.expression if whole else self.real
        links = [
            f"{write(a, ADDITIVE)} {self.operators[type(op)]} {write(b, ADDITIVE)}"
            for a, op, b in zip(operands, node.ops, operands[1:])
        ]
        if len(links) == 1:
            return links[0], COMPARISON
        return f" {self.operators[ast.And]} ".join(self.bracketed(link) for link in links), AND

    def bracketed(self, text: str) -> str:
        """A comparison inside a conjunction."""
        return f"({text})"

    def binds_power(self) -> int:
        """How tightly a power binds here (an atom where it is a call)."""
        return ATOM

    def field(self, node: ast.Attribute) -> str:
        """A field of a structure, or a constant of mathematics."""
        assert isinstance(node.value, ast.Name)
        if node.value.id == "math":
            return self.number({"pi": math.pi, "inf": math.inf}[node.attr])
        return f"{self.word(node.value.id)}{self.access}{self.word(node.attr)}"

    def element(self, node: ast.Subscript) -> str:
        """An element of a field."""
        assert isinstance(node.value, ast.Attribute)
        return f"{self.field(node.value)}[{self.expression(node.slice)}]"

    # ---- calls ---------------------------------------------------------------------------------------

    def call(self, node: ast.Call) -> str:
        """A call: of a mathematical function, or of a named one."""
        if isinstance(node.func, ast.Attribute):
            return self.library(node.func.attr, node.args)
        assert isinstance(node.func, ast.Name)
        return self.named_call(node.func.id, node.args)

    def given(self, node: ast.expr, argument: str, callee: Facts) -> str:
        """What is passed for an argument: a structure, an index or a number."""
        if argument in callee.structures and isinstance(node, ast.Name):
            return self.word(node.id)
        return self.expression(node) if callee.kinds.get(argument) == "int" else self.real(node)

    def callee(self, node: ast.expr) -> Facts | None:
        """What is known of the function that is called."""
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
            return self.known.get(node.func.id)
        return None

    def changed(self, node: ast.Call, callee: Facts) -> list[str]:
        """The structures that a call hands back, in the callee's order."""
        return [self.expression(g) for g, a in zip(node.args, callee.arguments) if a in callee.writes]

    # ---- what a language must say --------------------------------------------------------------------

    @abstractmethod
    def word(self, name: str) -> str: ...
    @abstractmethod
    def name(self, name: str) -> str: ...
    @abstractmethod
    def number(self, value: float) -> str: ...
    @abstractmethod
    def as_real(self, node: ast.expr) -> str: ...
    @abstractmethod
    def library(self, name: str, arguments: Sequence[ast.expr]) -> str: ...
    @abstractmethod
    def named_call(self, name: str, arguments: Sequence[ast.expr]) -> str: ...
    @abstractmethod
    def power(self, node: ast.BinOp) -> str: ...
    @abstractmethod
    def choice(self, node: ast.IfExp) -> str: ...
    @abstractmethod
    def declaration(self, name: str) -> list[str]: ...
    @abstractmethod
    def assignment(self, node: ast.Assign) -> list[str]: ...
    @abstractmethod
    def returning(self, node: ast.Return) -> list[str]: ...
    @abstractmethod
    def call_statement(self, node: ast.Call) -> list[str]: ...
