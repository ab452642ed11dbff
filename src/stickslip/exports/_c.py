"""Functions of the scalar subset in C99.

Structured arguments become pointers to structures, fields keep their names, elements are arrays of fixed size.
Numbers are written with all their digits and every operation keeps its place, so that a compiler which neither
contracts nor reassociates gives the bits of plain Python.
"""

from __future__ import annotations

import ast
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar

from stickslip.exports._analysis import Facts
from stickslip.exports._language import ATOM, UNARY, Language

KEYWORDS = {
    "auto", "break", "case", "char", "const", "continue", "default", "do", "double", "else", "enum", "extern",
    "float", "for", "goto", "if", "inline", "int", "long", "register", "restrict", "return", "short", "signed",
    "sizeof", "static", "struct", "switch", "typedef", "union", "unsigned", "void", "volatile", "while", "bool",
    "class", "new", "this", "template", "exp", "log", "pow", "floor", "ceil", "sqrt", "sin", "cos", "tan",
    "fabs", "div", "abs", "y0", "y1", "j0", "j1", "gamma", "true", "false", "errno", "stdin", "stdout", "stderr",
    "assert", "signgam", "linux", "unix",
}  # fmt: skip
"""Words of C and C++, and names of the library, which a local name would hide."""
HEADERS = frozenset({
    "assert", "complex", "ctype", "errno", "fenv", "float", "inttypes", "iso646", "limits", "locale", "math", "setjmp",
    "signal", "stdarg", "stdbool", "stddef", "stdint", "stdio", "stdlib", "string", "tgmath", "time", "wchar", "wctype",
})  # fmt: skip
"""Headers of the library: a file of that name beside the others stands in their place."""
MATH = {"fabs", "exp", "expm1", "log", "log1p", "sqrt", "sin", "cos", "tan", "atan", "atan2", "tanh", "sinh", "cosh",
        "floor", "ceil", "copysign", "pow", "hypot"}  # fmt: skip


@dataclass(frozen=True)
class Dialect:
    """How the C of one export is spelt.

    Attributes
    ----------
    prefix : str
        Of every name.
    single : bool
        ``float`` instead of ``double``.
    structures : mapping
        Structured argument to its type's name, without the prefix.
    """

    prefix: str
    single: bool
    structures: Mapping[str, str]

    @property
    def real(self) -> str:
        """The type of a number."""
        return "float" if self.single else "double"

    def count(self, name: str) -> str:
        """The macro that holds a number of elements: ``elements_`` is ``PREFIX_ELEMENTS``."""
        return f"{self.prefix.upper()}_{name.strip('_').upper()}"

    def number(self, value: float) -> str:
        """A number with all its digits; a single one rounded by us, not by the compiler."""
        if math.isinf(value):
            # The macro is a float.
            infinity = "INFINITY" if self.single else "(double)INFINITY"
            return infinity if value > 0.0 else f"-{infinity}"
        if not self.single:
            return repr(value)
        import numpy as np

        text = str(np.float32(value))
        return (text if "." in text or "e" in text else text + ".0") + "f"


class _C(Language):
    operators: ClassVar[dict[type[ast.AST], str]] = {
        **Language.operators, ast.And: "&&", ast.Or: "||", ast.Not: "!"
    }  # fmt: skip

    access: ClassVar[str] = "->"
    branches: ClassVar[tuple[str, str, str, str]] = ("if ({}) {{", "}} else if ({}) {{", "} else {", "}")
    counting: ClassVar[tuple[str, str]] = ("for (int {i} = {first}; {i} < {last}; {i}++) {{", "}")

    def __init__(self, facts: Facts, dialect: Dialect, known: Mapping[str, Facts]) -> None:
        super().__init__(facts, known)
        self.dialect = dialect

    # ---- expressions ---------------------------------------------------------------------------------

    def name(self, name: str) -> str:
        return self.dialect.count(name) if name in self.facts.counts else safe(name)

    def number(self, value: float) -> str:
        return self.dialect.number(value)

    def as_real(self, node: ast.expr) -> str:
        return f"({self.dialect.real}){self.expression(node, ATOM)}"

    def word(self, name: str) -> str:
        return safe(name)

    def named_call(self, name: str, arguments: Sequence[ast.expr]) -> str:
        if name == "abs":
            return self.library("fabs", arguments)
        if name in ("min", "max"):
            return self.extreme(name, arguments)
        if name == "float":
            return f"({self.dialect.real}){self.expression(arguments[0], ATOM)}"
        if name == "int":
            return f"(int){self.expression(arguments[0], ATOM)}"
        callee = self.known[name]
        given = [self.given(a, argument, callee) for a, argument in zip(arguments, callee.arguments)]
        return f"{self.dialect.prefix}{name}({', '.join(given)})"

    def library(self, name: str, arguments: Sequence[ast.expr]) -> str:
        """A call of math.h, in the precision of this export."""
        if name not in MATH:
            raise self.refused(ast.Name(name))
        return f"{name}{'f' if self.dialect.single else ''}({', '.join(self.real(a) for a in arguments)})"

    def extreme(self, name: str, arguments: Sequence[ast.expr]) -> str:
        """min and max as Python has them: the first of equals (fmin and fmax differ for NaN)."""
        first, *rest = [self.real(a) for a in arguments]
        for other in rest:
            first = f"{self.dialect.prefix}_{name}({first}, {other})"
        return first

    def power(self, node: ast.BinOp) -> str:
        return self.library("pow", [node.left, node.right])

    def choice(self, node: ast.IfExp) -> str:
        test, yes, no = self.expression(node.test), self.real(node.body, UNARY), self.real(node.orelse, UNARY)
        return f"({test}) ? {yes} : {no}"

    # ---- statements ----------------------------------------------------------------------------------

    def type_of(self, name: str) -> str:
        return {"real": self.dialect.real, "int": "int", "bool": "int"}[self.facts.kinds[name]]

    def declaration(self, name: str) -> list[str]:
        zero = "0" if self.facts.kinds[name] != "real" else self.number(0.0)
        return [f"{self.type_of(name)} {safe(name)} = {zero};"]

    def assignment(self, node: ast.Assign) -> list[str]:
        target = node.targets[0]
        own = isinstance(target, ast.Name)
        whole = own and self.facts.kinds.get(target.id, "real") != "real"
        value = self.expression(node.value) if whole else self.real(node.value)
        if own and target.id in self.facts.declared.get(id(node), ()):
            return [f"{self.type_of(target.id)} {safe(target.id)} = {value};"]
        return [f"{self.expression(target)} = {value};"]

    def returning(self, node: ast.Return) -> list[str]:
        return ["return;" if node.value is None else f"return {self.real(node.value)};"]

    def call_statement(self, node: ast.Call) -> list[str]:
        callee = self.known.get(node.func.id) if isinstance(node.func, ast.Name) else None
        return [f"{'(void)' if callee and callee.returns else ''}{self.call(node)};"]


def safe(name: str) -> str:
    """A name that neither C nor its library uses; capitals may be macros (INFINITY, PI). Two names stay two."""
    stem = name.rstrip("_")
    return f"{name}_" if stem in KEYWORDS or (stem.isupper() and len(stem) > 1) else name


def head(name: str, facts: Facts, dialect: Dialect) -> str:
    """The head of a function, without its bracket."""
    given: list[str] = []
    for argument in facts.arguments:
        kind = dialect.structures.get(argument) if argument in facts.structures else None
        if kind is None:
            plain = "int" if facts.kinds.get(argument) == "int" else dialect.real
            given.append(f"{plain} {safe(argument)}")
        else:
            constant = "" if argument in facts.writes else "const "
            given.append(f"{constant}{dialect.prefix}_{kind} *{argument}")
    return f"{dialect.real if facts.returns else 'void'} {dialect.prefix}{name}({', '.join(given)})"


def function(
    name: str, tree: ast.FunctionDef, known: Mapping[str, Facts], dialect: Dialect, *, public: bool
) -> list[str]:
    """The lines of one function; ``public`` ones are not static."""
    facts = known[name]
    out = [f"{'' if public else 'static '}{head(name, facts, dialect)}", "{"]
    out += [f"    (void){safe(a)};" for a in facts.arguments if a not in facts.uses]
    out += _C(facts, dialect, known).block(tree.body, 1)
    return [*out, "}"]


def functions(
    trees: Mapping[str, ast.FunctionDef], known: Mapping[str, Facts], dialect: Dialect, public: Sequence[str]
) -> list[tuple[str, str, list[str]]]:
    """Name, docstring and lines of every function, callees first, with what `analyse` knows of each."""
    return [
        (name, ast.get_docstring(tree) or "", function(name, tree, known, dialect, public=name in public))
        for name, tree in trees.items()
    ]
