"""Functions of the scalar subset in IEC 61131-3 structured text.

Structured arguments are VAR_IN_OUT, so that functions change them in place as the definition does. What the
norm's library lacks (expm1, hypot, copysign, ...) comes along as functions of its own.
"""

from __future__ import annotations

import ast
import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar

from stickslip.core.errors import LawError
from stickslip.exports._analysis import Facts, analyse
from stickslip.exports._decided import decided
from stickslip.exports._language import ADDITIVE, AND, ATOM, CONDITION, MULTIPLICATIVE, NOT, OR, Language
from stickslip.exports._st_names import RESERVED, named_in_st

TYPES = ("parameters", "state", "surroundings", "settings", "memory")
IGNORED = {"BOOL": "done", "LREAL": "left_out"}
"""What takes a result that nobody wants."""

MATH = {
    "fabs": "ABS", "exp": "EXP", "log": "LN", "sqrt": "SQRT", "sin": "SIN", "cos": "COS", "tan": "TAN", "atan": "ATAN",
}  # fmt: skip
HELPERS: Mapping[str, tuple[Sequence[str], Sequence[str]]] = {
    # Name to arguments and body; the body sets the function's own name, written @.
    "expm1": (["x"], [
        "u := EXP(x);", "IF u = 1.0 THEN", "    @ := x;", "ELSIF u - 1.0 = -1.0 THEN", "    @ := -1.0;", "ELSE",
        "    @ := (u - 1.0) * x / LN(u);", "END_IF;"]),
    "log1p": (["x"], [
        "u := 1.0 + x;", "IF u = 1.0 THEN", "    @ := x;", "ELSE", "    @ := LN(u) * x / (u - 1.0);", "END_IF;"]),
    "tanh": (["x"], [
        "u := EXP(-2.0 * ABS(x));", "@ := (1.0 - u) / (1.0 + u);", "IF x < 0.0 THEN", "    @ := -@;", "END_IF;"]),
    "hypot": (["x", "y"], ["@ := SQRT(x * x + y * y);"]),
    "copysign": (["x", "y"], ["@ := ABS(x);", "IF y < 0.0 THEN", "    @ := -@;", "END_IF;"]),
    # Right whether the conversion rounds, as the norm has it, or truncates.
    "floor": (["x"], ["u := LINT_TO_LREAL(LREAL_TO_LINT(x));", "IF u > x THEN", "    u := u - 1.0;", "END_IF;",
                     "@ := u;"]),
}  # fmt: skip
"""Kahan's expm1 and log1p, and what else the norm's library lacks."""


@dataclass(frozen=True)
class Names:
    """How things are called in the structured text of one export.

    Attributes
    ----------
    prefix : str
        Of functions and types.
    words : mapping
        Arguments, locals and fields of the law to their names.
    functions : mapping
        Functions of the law to their names, with the prefix.
    """

    prefix: str
    words: Mapping[str, str]
    functions: Mapping[str, str]

    @classmethod
    def of(cls, trees: Mapping[str, ast.FunctionDef], prefix: str, fields: Iterable[str]) -> Names:
        """The names in hoisted functions, and of the fields of their structures."""
        known = analyse(trees)
        words = {name for facts in known.values() for name in (*facts.kinds, *facts.arguments)}
        inner = named_in_st(trees, {*HELPERS, *TYPES})
        functions = {name: f"{prefix}_{short}" for name, short in inner.items()}
        taken = {*RESERVED, prefix.lower(), *(f.lower() for f in functions.values()), *IGNORED.values()}
        return cls(prefix, named_in_st({*words, *fields}, taken), functions)


class _St(Language):
    operators: ClassVar[dict[type[ast.AST], str]] = {
        **Language.operators, ast.And: "AND", ast.Or: "OR", ast.Not: "NOT ", ast.NotEq: "<>", ast.Eq: "="
    }  # fmt: skip
    counting: ClassVar[tuple[str, str]] = ("FOR {i} := {first} TO {last} - 1 DO", "END_FOR;")
    counting_at: ClassVar[int] = ATOM

    def __init__(
        self, name: str, names: Names, facts: Facts, known: Mapping[str, Facts], counts: Mapping[str, int]
    ) -> None:
        super().__init__(facts, known)
        self.own = names.functions[name]
        self.names = names
        self.counts = counts
        self.helpers: set[str] = set()
        self.ignored: set[str] = set()

    # ---- expressions ---------------------------------------------------------------------------------

    def name(self, name: str) -> str:
        return str(self.counts[name]) if name in self.facts.counts else self.names.words[name]

    def number(self, value: float) -> str:
        return number(value)

    def as_real(self, node: ast.expr) -> str:
        return f"INT_TO_LREAL({self.expression(node)})"

    def word(self, name: str) -> str:
        return self.names.words[name]

    def named_call(self, name: str, arguments: Sequence[ast.expr]) -> str:
        if name == "abs":
            return self.library("fabs", arguments)
        if name in ("min", "max"):
            return f"{name.upper()}({', '.join(self.real(a) for a in arguments)})"
        if name == "float":
            return self.real(arguments[0])
        if name == "int":
            return f"LREAL_TO_INT({self.helper('floor', arguments)})"
        callee = self.known[name]
        given = [
            f"{self.names.words[a]} := {self.given(g, a, callee)}"
            for g, a in zip(arguments, callee.arguments)
        ]
        return f"{self.names.functions[name]}({', '.join(given)})"

    def library(self, name: str, arguments: Sequence[ast.expr]) -> str:
        """A mathematical function."""
        if name == "pow":
            return f"EXPT({', '.join(self.real(a) for a in arguments)})"
        if name in HELPERS:
            return self.helper(name, arguments)
        if name not in MATH:
            raise self.refused(ast.Name(name))
        return f"{MATH[name]}({', '.join(self.real(a) for a in arguments)})"

    def helper(self, name: str, arguments: Sequence[ast.expr]) -> str:
        """One of the functions that come along."""
        self.helpers.add(name)
        given = [f"{a} := {self.real(x)}" for a, x in zip(HELPERS[name][0], arguments)]
        return f"{self.names.prefix}_{name}({', '.join(given)})"

    def power(self, node: ast.BinOp) -> str:
        return self.library("pow", [node.left, node.right])

    def remainder(self, left: str, right: str) -> tuple[str, int]:
        return f"{left} MOD {right}", MULTIPLICATIVE

    def choice(self, node: ast.IfExp) -> str:
        if evaluates_too_much(node):
            raise LawError(f"`{ast.unparse(node)}` has no translation; write it as an if statement")
        return f"SEL({self.truth(node.test)}, {self.real(node.orelse)}, {self.real(node.body)})"

    def written(self, node: ast.expr) -> tuple[str, int]:
        # The norm has no numbers for conditions.
        if isinstance(node, ast.BoolOp):
            word = self.operators[type(node.op)]
            return f" {word} ".join(self.truth(v) for v in node.values), AND if word == "AND" else OR
        if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.Not):
            return f"NOT {self.truth(node.operand)}", NOT
        # Two signs in a row (a - -b) are no structured text.
        text, binds = super().written(node)
        return (
            (text, ADDITIVE)
            if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub)
            else (text, binds)
        )

    def truth(self, node: ast.expr) -> str:
        """A condition inside another: a number is one by being different from 0."""
        if self.kind(node) == "bool":
            return self.expression(node, ATOM)
        return f"({self.real(node, ADDITIVE)} <> 0.0)"

    def real(self, node: ast.expr, at: int = CONDITION) -> str:
        """An expression where a real number is wanted; a condition is 0 or 1."""
        if self.kind(node) == "bool":
            return f"SEL({self.expression(node)}, 0.0, 1.0)"
        return super().real(node, at)

    # ---- statements ----------------------------------------------------------------------------------

    def declaration(self, name: str) -> list[str]:
        zero = {"int": "0", "bool": "FALSE", "real": "0.0"}[self.facts.kinds[name]]
        return [f"{self.names.words[name]} := {zero};"]

    def assignment(self, node: ast.Assign) -> list[str]:
        target = node.targets[0]
        whole = isinstance(target, ast.Name) and self.facts.kinds.get(target.id, "real") != "real"
        value = self.expression(node.value) if whole else self.real(node.value)
        return [f"{self.expression(target)} := {value};"]

    def returning(self, node: ast.Return) -> list[str]:
        if node.value is None:
            return ["RETURN;"]
        return [f"{self.own} := {self.real(node.value)};", "RETURN;"]

    def call_statement(self, node: ast.Call) -> list[str]:
        # A function stands in an expression (edition 2), so that its result goes somewhere.
        callee = self.known.get(node.func.id) if isinstance(node.func, ast.Name) else None
        returns = callee is None or callee.returns
        self.ignored.add("LREAL" if returns else "BOOL")
        return [f"{IGNORED['LREAL' if returns else 'BOOL']} := {self.call(node)};"]

    def leave(self) -> str:
        return "EXIT;"

    def condition(self, node: ast.If, depth: int) -> list[str]:
        pad = self.indent * depth
        test = self.expression(node.test) if self.kind(node.test) == "bool" else self.truth(node.test)
        out = [f"{pad}IF {test} THEN", *self.block(node.body, depth + 1)]
        if node.orelse:
            out += [f"{pad}ELSE", *self.block(node.orelse, depth + 1)]
        return [*out, f"{pad}END_IF;"]


def evaluates_too_much(node: ast.IfExp) -> bool:
    """Whether SEL, which evaluates both sides, may fail on the one that does not count: on a division or a function."""
    return any(isinstance(n, (ast.Div, ast.Call)) for n in ast.walk(node))


def number(value: float) -> str:
    """A number as the norm writes it: with a point, and digits on both its sides."""
    if math.isinf(value):
        return "1.0E308" if value > 0.0 else "-1.0E308"
    mantissa, _, exponent = repr(float(value)).partition("e")
    mantissa += "" if "." in mantissa else ".0"
    return f"{mantissa}E{int(exponent)}" if exponent else mantissa


def functions(
    trees: Mapping[str, ast.FunctionDef],
    names: Names,
    structures: Mapping[str, str],
    counts: Mapping[str, int],
) -> list[tuple[str, str, list[str]]]:
    """Name, docstring and lines of every hoisted function, helpers and callees first."""
    called = analyse(trees)
    trees = {name: decided(tree, called, evaluates_too_much) for name, tree in trees.items()}
    known = analyse(trees)
    out: list[tuple[str, str, list[str]]] = []
    helpers: set[str] = set()
    for name, tree in trees.items():
        facts = known[name]
        writer = _St(name, names, facts, known, counts)
        body = writer.block(tree.body, 1)
        if body and body[-1].strip() == "RETURN;" and len(body[-1]) - len(body[-1].lstrip()) == 4:
            body.pop()  # the end returns by itself
        if not facts.returns:
            body = [*body, f"    {writer.own} := TRUE;"]
        helpers |= writer.helpers
        head = declared(facts, names, structures, writer.ignored)
        first = f"FUNCTION {writer.own} : {'LREAL' if facts.returns else 'BOOL'}"
        out.append(
            (name, ast.get_docstring(tree) or "", [first, *head, *(body or ["    ;"]), "END_FUNCTION"])
        )
    return [(f"_{n}", n, helper_lines(names.prefix, n)) for n in HELPERS if n in helpers] + out


def declared(facts: Facts, names: Names, structures: Mapping[str, str], ignored: Iterable[str]) -> list[str]:
    """The VAR sections of a function."""
    word = names.words
    plain = [a for a in facts.arguments if structures.get(a) is None or a not in facts.structures]
    shared = [a for a in facts.arguments if a not in plain]
    own = [n for n in facts.kinds if n not in facts.arguments and n not in facts.counts]
    kinds = {"real": "LREAL", "int": "INT", "bool": "BOOL"}
    return [
        *section("VAR_INPUT", [f"{word[a]} : {kinds[facts.kinds.get(a, 'real')]};" for a in plain]),
        *section("VAR_IN_OUT", [f"{word[a]} : {names.prefix}_{structures[a]};" for a in shared]),
        *section("VAR", [*(f"{word[n]} : {kinds[facts.kinds[n]]};" for n in own),
                         *(f"{IGNORED[kind]} : {kind};" for kind in sorted(ignored))]),
    ]  # fmt: skip


def section(kind: str, lines: Sequence[str]) -> list[str]:
    """A VAR section, if it has anything."""
    return [kind, *(f"    {line}" for line in lines), "END_VAR"] if lines else []


def helper_lines(prefix: str, name: str) -> list[str]:
    """One of the functions that come along."""
    arguments, body = HELPERS[name]
    own = f"{prefix}_{name}"
    lines = [f"    {line.replace('@', own)}" for line in body]
    local = section("VAR", ["u : LREAL;"]) if any(re.search(r"\bu\b", line) for line in body) else []
    return [f"FUNCTION {own} : LREAL", *section("VAR_INPUT", [f"{a} : LREAL;" for a in arguments]), *local, *lines,
            "END_FUNCTION"]  # fmt: skip
