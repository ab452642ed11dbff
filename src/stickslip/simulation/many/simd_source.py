"""The text that lanes run: `many.simd_step` and `many.simd_run` with sizes, numbers and the laws' sliding curves
filled in.

Numbers that all cases share are elements of a tuple, those that vary are rows of ``z``; equal shared numbers are the
same element, so that the compiler computes once what two laws have in common. A branch on a shared number is
decided here.
"""

from __future__ import annotations

import ast
import functools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from stickslip.laws.sliding_curve import decay
from stickslip.spec import Law
from stickslip.subset import law_layouts, lower

Array = np.ndarray[Any, np.dtype[np.float64]]
DECAY = f"_{decay.__name__}"
"""Name that `lower` gives the exponential of the sliding curves."""
INLINED = frozenset(
    {
        "trial", "over_step", "reached", "give", "held_by", "gap_ahead", "accept", "swap", "finish", "first_event",
        "gap_of", "go_to", "between", "switch", "stick", "weighted", "measure", "measure_all", "highest", "torque",
    }
)  # fmt: skip
"""Functions that run for all lanes at once."""


class Refused(Exception):
    """A law that lanes cannot run; its text says why."""


class Numbers:
    """The numbers of n cases, split into those that all share and those that vary.

    Attributes
    ----------
    shared : list of float
        The tuple ``c``.
    varied : list of array, shape (n,)
        The rows of ``z`` behind the state.
    """

    def __init__(self) -> None:
        self.shared: list[float] = []
        self.varied: list[Array] = []

    def place(self, values: Array) -> str:
        """Keep a number of all cases; returns the expression that reads it."""
        first = float(values[0])
        if not np.all(values == first):
            self.varied.append(values)
            return f"z[(NUMBERS + {len(self.varied) - 1}) * LANES + lane]"
        if first not in self.shared:
            self.shared.append(first)
        return f"c[{self.shared.index(first)}]"

    def is_shared(self, expression: str) -> bool:
        """Whether an expression of `place` reads a number that all cases share."""
        return expression.startswith("c[")

    def value(self, expression: str) -> float:
        """The shared number that an expression reads."""
        return self.shared[int(expression[2:-1])]


@dataclass(frozen=True)
class Curve:
    """A sliding curve: a law and its function, or None for a constant one; `numbers` are the expressions of its
    parameters in the order of `Law.pack`, of a constant one its value."""

    law: Law | None
    function: Callable[..., float] | None
    numbers: Sequence[str]


def source(
    sizes: Mapping[str, Any],
    scalars: Mapping[str, str],
    sides: Mapping[str, Sequence[str]],
    elements: Mapping[str, Sequence[str]],
    curves: Sequence[Curve],
    numbers: Numbers,
) -> str:
    """The specialised text.

    Parameters
    ----------
    sizes : mapping
        The constants of `many.simd_names`.
    scalars, sides, elements : mapping
        Its functions by name: one expression, one for each law, one for each element.
    curves : sequence of Curve
        One for each law.

    Raises
    ------
    Refused
    """
    lines = [
        "import math",
        "import numpy as np",
        "from stickslip.jit import compile_inlined, compile_lanes, exponential, pointer, select",
    ]
    lines += [f"{name} = {value!r}" for name, value in sizes.items()]
    constants, functions = body(("many/simd_step", "many/simd_run"), INLINED)
    lines += constants
    for name, expression in scalars.items():
        lines += function(name, "", [f"    return {expression}"])
    for name, each in (*sides.items(), *elements.items()):
        lines += function(name, ", which", chosen(each))
    for side, curve in enumerate(curves):
        lines += curve_lines(side, curve, numbers)
    lines += ["@compile_inlined", "def curve(v, c, z, lane, which):"]
    lines += chosen([f"curve_{side}(v, c, z, lane)" for side in range(len(curves))])
    return "\n".join([*lines, *functions]) + "\n"


@functools.cache
def body(files: tuple[str, ...], inlined: frozenset[str]) -> tuple[list[str], list[str]]:
    """The constants and the functions of files of the engine; those `inlined` run for all lanes at once."""
    texts = [(Path(__file__).parents[1] / f"{name}.py").read_text(encoding="utf-8") for name in files]
    tree = ast.parse("\n".join(text.partition("from __future__ import annotations")[2] for text in texts))
    constants = [ast.unparse(node) for node in tree.body if isinstance(node, ast.Assign)]
    functions: list[str] = []
    for node in tree.body:
        if isinstance(node, ast.FunctionDef):
            functions.append("@compile_inlined" if node.name in inlined else "@compile_lanes")
            functions.append(ast.unparse(bare(node)))
    return constants, functions


def function(name: str, more: str, body: Sequence[str]) -> list[str]:
    """The lines of a function that reads numbers."""
    return ["@compile_inlined", f"def {name}(c, z, lane{more}):", *body]


def chosen(expressions: Sequence[str]) -> list[str]:
    """Lines that return the expression with the number `which`; it is a constant where they are used."""
    if not expressions:
        return ["    return 0.0"]
    tests = [f"    if which == {i}:\n        return {e}" for i, e in enumerate(expressions[:-1])]
    return [*tests, f"    return {expressions[-1]}"]


def bare(node: ast.FunctionDef) -> ast.FunctionDef:
    """A function without its docstring and annotations."""
    for argument in node.args.args:
        argument.annotation = None
    node.returns = None
    if isinstance(node.body[0], ast.Expr):
        node.body = node.body[1:]
    return node


# ---- curves ----------------------------------------------------------------------------------------------------


def curve_lines(side: int, curve: Curve, numbers: Numbers) -> list[str]:
    """The functions of one sliding curve, from the law's own text."""
    if curve.law is None or curve.function is None:
        return ["@compile_inlined", f"def curve_{side}(v, c, z, lane):", f"    return {curve.numbers[0]}"]
    functions = lower({f"curve_{side}": curve.function}, law_layouts(curve.law))
    names = {name: name if name == f"curve_{side}" else f"{name}_{side}" for name in functions}
    lines: list[str] = []
    for name, tree in functions.items():
        if name == DECAY:
            tree.body = tree.body[-1:]  # all lanes take both branches: nothing is spared by the first
        rewritten = _Reader(curve, names, numbers).visit(tree)
        rewritten.name = names[name]
        lines += ["@compile_inlined", ast.unparse(ast.fix_missing_locations(rewritten))]
    return lines


class _Reader(ast.NodeTransformer):
    """Parameters read through ``c, z, lane``; branches on shared ones decided; exp that runs on lanes."""

    def __init__(self, curve: Curve, names: Mapping[str, str], numbers: Numbers) -> None:
        self.curve, self.names, self.numbers = curve, names, numbers
        self.law = curve.law.name if curve.law else ""

    def visit_FunctionDef(self, node: ast.FunctionDef) -> Any:
        node.args.args = [
            ast.arg(name)
            for a in node.args.args
            for name in (("c", "z", "lane") if a.arg == "p" else (a.arg,))
        ]
        node.body = self.block(node.body)
        return node

    def block(self, statements: Sequence[ast.stmt]) -> list[ast.stmt]:
        """Statements, cut after the first that returns for sure."""
        out: list[ast.stmt] = []
        for statement in statements:
            if isinstance(statement, ast.If) and (taken := self.decided(statement.test)) is not None:
                out += self.block(statement.body if taken else statement.orelse)
            else:
                out.append(self.visit(statement))
            if out and isinstance(out[-1], ast.Return):
                break
        return out

    def decided(self, test: ast.expr) -> bool | None:
        """What a comparison of a shared parameter with a constant says; None where cases differ."""
        if not (
            isinstance(test, ast.Compare) and isinstance(test.left, ast.Subscript) and len(test.ops) == 1
        ):
            return None
        expression = self.expression(test.left)
        right = test.comparators[0]
        if not (isinstance(right, ast.Constant) and self.numbers.is_shared(expression)):
            return None
        made = ast.Expression(ast.Compare(ast.Constant(self.numbers.value(expression)), test.ops, [right]))
        return bool(eval(compile(ast.fix_missing_locations(made), "<lanes>", "eval")))

    def expression(self, node: ast.Subscript) -> str:
        if not isinstance(node.slice, ast.Constant):
            raise Refused(f"the sliding curve of law {self.law!r} has a list of parameters")
        return self.curve.numbers[int(str(node.slice.value))]

    def visit_If(self, node: ast.If) -> Any:
        raise Refused(f"the sliding curve of law {self.law!r} branches on what differs between cases")

    def visit_For(self, node: ast.For) -> Any:
        raise Refused(f"the sliding curve of law {self.law!r} has a loop")

    def visit_BinOp(self, node: ast.BinOp) -> Any:
        if isinstance(node.op, ast.Pow):
            raise Refused(f"the sliding curve of law {self.law!r} has a power")
        return self.generic_visit(node)

    def visit_Subscript(self, node: ast.Subscript) -> Any:
        return ast.parse(self.expression(node), mode="eval").body

    def visit_Call(self, node: ast.Call) -> Any:
        self.generic_visit(node)
        if isinstance(node.func, ast.Attribute):
            if node.func.attr not in ("exp", "fabs"):
                raise Refused(f"the sliding curve of law {self.law!r} has math.{node.func.attr}")
            node.func = ast.Name("exponential" if node.func.attr == "exp" else "abs", ast.Load())
        elif isinstance(node.func, ast.Name) and node.func.id in self.names:
            node.func.id = self.names[node.func.id]
        node.args = _spread(node.args)
        return node


def _spread(arguments: Sequence[ast.expr]) -> list[ast.expr]:
    """Arguments with ``p`` replaced by what reads it."""
    out: list[ast.expr] = []
    for a in arguments:
        if isinstance(a, ast.Name) and a.id == "p":
            out += [ast.Name(name, ast.Load()) for name in ("c", "z", "lane")]
        else:
            out.append(a)
    return out
