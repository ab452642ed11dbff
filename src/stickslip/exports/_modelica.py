"""Functions of the scalar subset in Modelica 3.4.

Structured arguments are records. A function's inputs cannot be assigned in Modelica: one that changes a structure takes
it as ``z_in`` and hands it back as ``z``.
"""

from __future__ import annotations

import ast
import math
from collections.abc import Iterator, Mapping, Sequence
from typing import ClassVar

from stickslip.exports._analysis import Facts, analyse
from stickslip.exports._hoist import hoisted
from stickslip.exports._language import ATOM, CONDITION, Language
from stickslip.exports._text import first_line, text_in

RECORDS = {"z": "State", "p": "Parameters", "u": "Surroundings"}
KEYWORDS = {
    "algorithm", "and", "annotation", "assert", "block", "break", "class", "connect", "connector", "constant",
    "constrainedby", "der", "discrete", "each", "else", "elseif", "elsewhen", "encapsulated", "end", "enumeration",
    "equation", "expandable", "extends", "external", "false", "final", "flow", "for", "function", "if", "import",
    "impure", "in", "initial", "inner", "input", "loop", "model", "not", "operator", "or", "outer", "output", "package",
    "parameter", "partial", "protected", "public", "pure", "record", "redeclare", "replaceable", "return", "stream",
    "then", "true", "type", "when", "while", "within", "abs", "sign", "sqrt", "div", "mod", "rem", "ceil", "floor",
    "integer", "sin", "cos", "tan", "asin", "acos", "atan", "atan2", "sinh", "cosh", "tanh", "exp", "log", "log10",
    "delay", "cardinality", "homotopy", "semiLinear", "sample", "pre", "edge", "change", "reinit", "terminal",
    "noEvent", "smooth", "time", "min", "max", "sum", "product", "size", "fill", "zeros", "ones", "scalar", "vector",
    "matrix", "Real", "Integer", "Boolean", "String",
}  # fmt: skip
MATH = {"fabs": "abs"} | {
    n: n
    for n in (
        "exp",
        "log",
        "sqrt",
        "sin",
        "cos",
        "tan",
        "atan",
        "atan2",
        "tanh",
        "sinh",
        "cosh",
        "floor",
        "ceil",
    )
}
HELPERS = {
    "expm1": (("x",), ("u := exp(x);", "if u == 1.0 then", "  y := x;", "elseif u - 1.0 == -1.0 then", "  y := -1.0;",
                       "else", "  y := (u - 1.0)*x/log(u);", "end if;")),
    "log1p": (("x",), ("u := 1.0 + x;", "if u == 1.0 then", "  y := x;", "else", "  y := log(u)*x/(u - 1.0);",
                       "end if;")),
    "hypot": (("a", "b"), ("u := a*a + b*b;", "y := sqrt(u);")),
    "copysign": (("x", "s"), ("u := abs(x);", "if s < 0.0 then", "  y := -u;", "else", "  y := u;", "end if;")),
}  # fmt: skip
"""Kahan's expm1 and log1p, and what else Modelica lacks."""
TYPES = {"real": "Real", "int": "Integer", "bool": "Boolean"}


def safe(name: str) -> str:
    """A name that the language does not reserve; two names stay two."""
    return f"{name}_" if name.rstrip("_") in KEYWORDS else name


class _Modelica(Language):
    indent: ClassVar[str] = "  "
    operators: ClassVar[dict[type[ast.AST], str]] = {
        **Language.operators, ast.And: "and", ast.Or: "or", ast.Not: "not ", ast.NotEq: "<>"
    }  # fmt: skip
    branches: ClassVar[tuple[str, str, str, str]] = ("if {} then", "elseif {} then", "else", "end if;")
    counting: ClassVar[tuple[str, str]] = ("for {i} in {first}:{last} - 1 loop", "end for;")
    counting_at: ClassVar[int] = ATOM

    def __init__(
        self, facts: Facts, known: Mapping[str, Facts], counts: Mapping[str, int], last: set[int]
    ) -> None:
        super().__init__(facts, known)
        self.counts = counts
        self.last = last
        self.helpers: set[str] = set()

    # ---- expressions ---------------------------------------------------------------------------------

    def name(self, name: str) -> str:
        return str(self.counts[name]) if name in self.facts.counts else safe(name)

    def number(self, value: float) -> str:
        if math.isinf(value):
            return "1.7976931348623157e308" if value > 0.0 else "-1.7976931348623157e308"
        return repr(value)

    def as_real(self, node: ast.expr) -> str:
        return self.expression(node, ATOM)

    def word(self, name: str) -> str:
        return safe(name)

    def element(self, node: ast.Subscript) -> str:
        assert isinstance(node.value, ast.Attribute)
        return f"{self.field(node.value)}[{self.expression(node.slice, ATOM)} + 1]"

    def named_call(self, name: str, arguments: Sequence[ast.expr]) -> str:
        if name in ("abs", "min", "max"):
            first, *rest = [self.real(a) for a in arguments]
            for other in rest:
                first = f"{name}({first}, {other})"
            return f"{name}({first})" if not rest else first
        if name == "float":
            return self.real(arguments[0])
        if name == "int":
            return f"integer({self.real(arguments[0])})"
        callee = self.known[name]
        kept = [(g, a) for g, a in zip(arguments, callee.arguments) if a in callee.uses]
        return f"{own_name(name)}({', '.join(self.given(g, a, callee) for g, a in kept)})"

    def library(self, name: str, arguments: Sequence[ast.expr]) -> str:
        """A mathematical function."""
        if name == "pow":
            return self.power(ast.BinOp(arguments[0], ast.Pow(), arguments[1]))
        given = ", ".join(self.real(a) for a in arguments)
        if name in HELPERS:
            self.helpers.add(name)
            return f"{own_name(name)}({given})"
        if name not in MATH:
            raise self.refused(ast.Name(name))
        return f"{MATH[name]}({given})"

    def power(self, node: ast.BinOp) -> str:
        return f"({self.real(node.left)})^({self.real(node.right)})"

    def remainder(self, left: str, right: str) -> tuple[str, int]:
        return f"mod({left}, {right})", ATOM

    def choice(self, node: ast.IfExp) -> str:
        return f"if {self.expression(node.test)} then {self.real(node.body)} else {self.real(node.orelse)}"

    def written(self, node: ast.expr) -> tuple[str, int]:
        # Modelica has a sign only at the beginning of a sum.
        text, binds = super().written(node)
        return text, CONDITION if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub) else binds

    # ---- statements ----------------------------------------------------------------------------------

    def declaration(self, name: str) -> list[str]:
        return [f"{safe(name)} := {'0' if self.facts.kinds[name] == 'int' else '0.0'};"]

    def assignment(self, node: ast.Assign) -> list[str]:
        target = node.targets[0]
        callee = self.callee(node.value)
        if callee and callee.writes:
            assert isinstance(node.value, ast.Call)
            outputs = [self.expression(target), *self.changed(node.value, callee)]
            return [f"({', '.join(outputs)}) := {self.call(node.value)};"]
        whole = isinstance(target, ast.Name) and self.facts.kinds.get(target.id, "real") != "real"
        return [f"{self.expression(target)} := {(self.expression if whole else self.real)(node.value)};"]

    def returning(self, node: ast.Return) -> list[str]:
        out = [] if node.value is None else [f"torque_ := {self.real(node.value)};"]
        return out if id(node) in self.last else [*out, "return;"]

    def call_statement(self, node: ast.Call) -> list[str]:
        callee = self.callee(node)
        if callee is None or not callee.writes:
            return []
        outputs = [*([""] if callee.returns else []), *self.changed(node, callee)]
        return [f"({', '.join(outputs)}) := {self.call(node)};"]


def own_name(name: str) -> str:
    """A function's name: none begins with an underscore, none is a word of the language or the record's."""
    return name if name in PUBLIC else f"{name.strip('_')}_"


PUBLIC = ("step", "steady", "holding")


def functions(
    trees: Mapping[str, ast.FunctionDef], counts: Mapping[str, int]
) -> list[tuple[str, str, list[str]]]:
    """Name, docstring and lines of every function, helpers and callees first."""
    trees = hoisted(trees)
    for tree in trees.values():
        tree.body = with_one_exit(tree.body)
    known = analyse(trees)
    out: list[tuple[str, str, list[str]]] = []
    helpers: set[str] = set()
    for name, tree in trees.items():
        facts = known[name]
        writer = _Modelica(facts, known, counts, set(last_returns(tree.body)))
        body = writer.block(tree.body, 1)
        helpers |= writer.helpers
        doc = ast.get_docstring(tree) or ""
        out.append((own_name(name), doc, [*head(name, tree, facts), *body, f"end {own_name(name)};"]))
    return [(own_name(n), "", helper(n)) for n in HELPERS if n in helpers] + out


def with_one_exit(block: Sequence[ast.stmt]) -> list[ast.stmt]:
    """A block in which what follows a condition that returns stands in its other branch.

    Tools compute such functions symbolically; a return in the midst of one they mostly refuse.
    """
    for i, statement in enumerate(block):
        if isinstance(statement, ast.If):
            statement.body, statement.orelse = with_one_exit(statement.body), with_one_exit(statement.orelse)
            rest = block[i + 1 :]
            if rest and returns_always(statement.body):
                statement.orelse = with_one_exit([*statement.orelse, *rest])
                return [*block[: i + 1]]
    return [*block]


def returns_always(block: Sequence[ast.stmt]) -> bool:
    """Whether every way through a block ends in a return."""
    final = block[-1] if block else None
    if isinstance(final, ast.If):
        return returns_always(final.body) and returns_always(final.orelse)
    return isinstance(final, ast.Return)


def last_returns(block: Sequence[ast.stmt]) -> Iterator[int]:
    """Identities of the returns after which nothing would follow."""
    final = block[-1] if block else None
    if isinstance(final, ast.If):
        yield from last_returns(final.body)
        yield from last_returns(final.orelse)
    elif isinstance(final, ast.Return):
        yield id(final)


def head(name: str, tree: ast.FunctionDef, facts: Facts) -> list[str]:
    """The declarations of a function, up to its algorithm."""
    about = text_in("mo", first_line(ast.get_docstring(tree) or ""))
    lines = [f"function {own_name(name)}" + (f' "{about}"' if about else "")]
    stored = {n.id for n in ast.walk(tree) if isinstance(n, ast.Name) and isinstance(n.ctx, ast.Store)}
    changed = [a for a in facts.arguments if a in facts.writes]
    copied = [a for a in facts.arguments if a in stored]
    for a in facts.arguments:
        if a in facts.uses:
            record = RECORDS.get(a) if a in facts.structures else None
            kind = record or TYPES[facts.kinds.get(a, "real")]
            lines.append(f"  input {kind} {safe(a)}{'_in' if a in (*changed, *copied) else ''};")
    lines += ["  output Real torque_;"] if facts.returns else []
    lines += [f"  output {RECORDS[a]} {a};" for a in changed]
    given = {n for n in facts.kinds if n in facts.arguments or n in facts.counts}
    own = [*copied, *(n for n in facts.kinds if n not in given and not only_counts(n, facts))]
    kinds = {n: TYPES[facts.kinds.get(n, "real")] for n in own}
    lines += ["protected", *(f"  {kinds[n]} {safe(n)};" for n in own)] if own else []
    return [*lines, "algorithm", *(f"  {safe(a)} := {safe(a)}_in;" for a in (*changed, *copied))]


def only_counts(name: str, facts: Facts) -> bool:
    """Whether a name is a loop's own counter, which Modelica declares by the loop."""
    declared = {n for names in (*facts.declared.values(), *facts.opened.values()) for n in names}
    return facts.kinds[name] == "int" and name not in declared


def helper(name: str) -> list[str]:
    """One of the functions that come along."""
    arguments, body = HELPERS[name]
    lines = [f'function {own_name(name)} "{name}, to full precision near 0"']
    lines += [f"  input Real {a};" for a in arguments]
    return [*lines, "  output Real y;", "protected", "  Real u;", "algorithm", *(f"  {line}" for line in body),
            f"end {own_name(name)};"]  # fmt: skip
