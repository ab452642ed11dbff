"""A function of the scalar subset as straight lines: every branch computed, one result selected, loops unrolled.

What runs for many motions side by side must not branch on what differs between them. `traced` follows the lowered text
of a law (`stickslip.subset.lower`) with names in place of numbers, writes down every operation once, and decides what
the numbers at hand decide: how many elements there are, and comparisons of a parameter with a constant.
"""

from __future__ import annotations

import ast
import math
import operator
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

LONGEST = 2000
"""Operations beyond which a function is refused."""
BINARY: dict[type[ast.operator], tuple[str, Callable[[Any, Any], Any]]] = {
    ast.Add: ("+", operator.add), ast.Sub: ("-", operator.sub), ast.Mult: ("*", operator.mul),
    ast.Div: ("/", lambda a, b: a / b), ast.Pow: ("**", lambda a, b: a**b),
}  # fmt: skip
COMPARED: dict[type[ast.cmpop], tuple[str, Callable[[Any, Any], Any]]] = {
    ast.Lt: ("<", operator.lt), ast.LtE: ("<=", operator.le), ast.Gt: (">", operator.gt),
    ast.GtE: (">=", operator.ge), ast.Eq: ("==", operator.eq), ast.NotEq: ("!=", operator.ne),
}  # fmt: skip
ALIKE = {"<": False, "<=": True, ">": False, ">=": True, "==": True, "!=": False}
CALLS = {
    "exp": "exponential",
    "expm1": "exponential_less_one",
    "sqrt": "math.sqrt",
    "fabs": "abs",
    "abs": "abs",
}


class NotStraight(Exception):
    """What cannot be written so; its text says why."""


class Name(str):
    """The name of a number that is not known yet."""


Value = Any  # a Name, or a number that is known
Environment = dict[Any, Value]  # names, and (array, place)


@dataclass(frozen=True)
class Assumption:
    """How a parameter compares with a constant, which the text takes for granted."""

    place: int
    sign: str
    constant: float
    holds: bool

    def fits(self, parameters: Sequence[float]) -> bool:
        """Whether it is so for other parameters."""
        compare = next(f for text, f in COMPARED.values() if text == self.sign)
        return bool(compare(parameters[self.place], self.constant)) == self.holds


@dataclass
class Trace:
    """What was written down so far, and what it takes for granted.

    Attributes
    ----------
    parameters : sequence of float
        The numbers at hand, as `Law.pack` lays them out.
    lines : list of str
    assumptions : set of Assumption
    """

    parameters: Sequence[float]
    lines: list[str] = field(default_factory=list[str])
    assumptions: set[Assumption] = field(default_factory=set[Assumption])
    known: dict[str, Name] = field(default_factory=dict[str, Name])
    made: dict[str, str] = field(default_factory=dict[str, str])

    def keep(self, text: str) -> Name:
        """The name of an operation: that of an earlier one where it is the same."""
        if text not in self.known:
            if len(self.lines) >= LONGEST:
                raise NotStraight("it is too long")
            name = Name(f"t{len(self.lines)}")
            self.known[text], self.made[name] = name, text
            self.lines.append(f"{name} = {text}")
        return self.known[text]

    def binary(self, sign: str, compute: Callable[[Any, Any], Any], a: Value, b: Value) -> Value:
        """a sign b; known operands, and what has but one result, take no operation."""
        if not isinstance(a, Name) and not isinstance(b, Name):
            return compute(a, b)
        if sign == "**":
            raise NotStraight("it has a power")
        if sign == "-" and a == b:
            return 0.0
        if sign == "*" and (is_zero(a) or is_zero(b)):
            return 0.0
        if sign in "+-" and is_zero(b):
            return a
        if sign == "+" and is_zero(a):
            return b
        if sign == "*" and a == 0.5 and (half := self.doubled(b)) is not None:
            return half
        return self.keep(f"{text_of(a)} {sign} {text_of(b)}")

    def doubled(self, name: Value) -> Name | None:
        """x where the name stands for x + x."""
        first, _, second = self.made.get(name, "").partition(" + ")
        return Name(first) if first and first == second else None

    def compare(self, sign: str, compute: Callable[[Any, Any], Any], a: Value, b: Value) -> Value:
        """a sign b, decided where it can be."""
        if not isinstance(a, Name) and not isinstance(b, Name):
            return bool(compute(a, b))
        if a == b:
            return ALIKE[sign]
        if self.is_square(a) and is_zero(b) and sign in ("<", ">="):
            return sign == ">="
        if isinstance(a, Name) and a.startswith("p[") and not isinstance(b, Name):
            place = int(a[2:-1])
            holds = bool(compute(self.parameters[place], b))
            self.assumptions.add(Assumption(place, sign, float(b), holds))
            return holds
        return self.keep(f"{text_of(a)} {sign} {text_of(b)}")

    def is_square(self, name: Value) -> bool:
        """Whether a name stands for x * x."""
        first, _, second = self.made.get(name, "").partition(" * ")
        return bool(first) and first == second

    def select(self, test: Value, a: Value, b: Value) -> Value:
        """a where the test holds, else b."""
        if not isinstance(test, Name):
            return a if test else b
        return a if same(a, b) else self.keep(f"select({test}, {text_of(a)}, {text_of(b)})")

    def whole(self, value: Value) -> int:
        """A whole number, which a parameter holds."""
        if not isinstance(value, Name):
            return int(value)
        if not value.startswith("p["):
            raise NotStraight("it rounds to whole numbers")
        place = int(value[2:-1])
        self.assumptions.add(Assumption(place, "==", float(self.parameters[place]), True))
        return int(self.parameters[place])


def is_zero(a: Value) -> bool:
    """Whether it is known to be 0."""
    return not isinstance(a, Name) and a == 0.0


def same(a: Value, b: Value) -> bool:
    """Whether two values are one."""
    return isinstance(a, Name) == isinstance(b, Name) and a == b


def text_of(value: Value) -> str:
    """A value as it is written."""
    if isinstance(value, Name):
        return value
    return repr(float(value)) if math.isfinite(value) else f"({'-' if value < 0 else ''}math.inf)"


def traced(
    functions: Mapping[str, ast.FunctionDef], name: str, arguments: Mapping[str, Value], arrays: Environment,
    trace: Trace,
) -> Value:  # fmt: skip
    """Write a function down; returns what it returns.

    Parameters
    ----------
    functions : mapping
        Lowered ones, by name.
    name : str
        Which.
    arguments : mapping
        Names or numbers by the names of its arguments; those of arrays their own names.
    arrays : mapping
        What their elements hold: (array, place) to name or number. It is changed where the function does.
    trace : Trace

    Raises
    ------
    NotStraight
    """
    return _Run(functions, arrays, trace).call(name, list(arguments.values()))


class _Run:
    """One walk through a function and those that it calls."""

    def __init__(self, functions: Mapping[str, ast.FunctionDef], arrays: Environment, trace: Trace) -> None:
        self.functions, self.arrays, self.trace = functions, arrays, trace

    def call(self, name: str, arguments: Sequence[Value]) -> Value:
        tree = self.functions[name]
        scope = dict(zip((a.arg for a in tree.args.args), arguments, strict=True))
        return self.block(tree.body, scope)[0]

    def block(self, statements: Sequence[ast.stmt], scope: Environment) -> tuple[Value, bool]:
        """What a block returns, and whether it does."""
        for place, statement in enumerate(statements):
            if isinstance(statement, ast.Return):
                return (None if statement.value is None else self.value(statement.value, scope)), True
            if isinstance(statement, ast.If):
                test = self.value(statement.test, scope)
                rest = statements[place + 1 :]
                if not isinstance(test, Name):
                    return self.block([*(statement.body if test else statement.orelse), *rest], scope)
                if any(isinstance(n, ast.Return) for n in ast.walk(statement)):
                    return self.either(test, [*statement.body, *rest], [*statement.orelse, *rest], scope)
                self.either(test, statement.body, statement.orelse, scope)
            elif isinstance(statement, ast.For):
                self.repeat(statement, scope)
            else:
                self.simple(statement, scope)
        return None, False

    def either(
        self, test: Name, one: Sequence[ast.stmt], other: Sequence[ast.stmt], scope: Environment
    ) -> tuple[Value, bool]:
        """Both blocks, and of all that they leave behind the one that the test selects."""
        before = dict(self.arrays)
        scope_1, scope_2 = dict(scope), dict(scope)
        value_1, returns = self.block(one, scope_1)
        after_1 = dict(self.arrays)
        self.arrays.update(before)
        value_2, _ = self.block(other, scope_2)
        for mine, first, second in ((self.arrays, after_1, dict(self.arrays)), (scope, scope_1, scope_2)):
            # In the order of the text, not of a set: it names the file that the compiled code is kept in.
            for key in (k for k in first if k in second):
                mine[key] = self.trace.select(test, first[key], second[key])
        value = None if value_1 is None else self.trace.select(test, value_1, value_2)
        return value, returns

    def repeat(self, statement: ast.For, scope: Environment) -> None:
        """A loop, unrolled."""
        target, count = statement.target, statement.iter
        if any(isinstance(n, ast.Break | ast.Return) for n in ast.walk(statement)):
            raise NotStraight("it has a loop that ends early")
        assert isinstance(target, ast.Name)
        assert isinstance(count, ast.Call)
        for i in range(*(self.trace.whole(self.value(a, scope)) for a in count.args)):
            scope[target.id] = i
            self.block(statement.body, scope)

    def simple(self, statement: ast.stmt, scope: Environment) -> None:
        """An assignment, or a call for what it does to an array."""
        if isinstance(statement, ast.Expr):
            self.value(statement.value, scope)
        elif isinstance(statement, ast.Assign):
            self.assign(statement.targets[0], self.value(statement.value, scope), scope)
        elif isinstance(statement, ast.AugAssign):
            sign, compute = self.operation(statement.op)
            old = self.value(statement.target, scope)
            new = self.value(statement.value, scope)
            self.assign(statement.target, self.trace.binary(sign, compute, old, new), scope)
        elif not isinstance(statement, ast.Pass):
            raise NotStraight(f"it has a statement {type(statement).__name__}")

    def assign(self, target: ast.expr, value: Value, scope: Environment) -> None:
        if isinstance(target, ast.Name):
            scope[target.id] = value
        else:
            self.arrays[self.element(target, scope)] = value

    def element(self, node: ast.expr, scope: Environment) -> tuple[str, int]:
        """Array and place of an element."""
        assert isinstance(node, ast.Subscript)
        assert isinstance(node.value, ast.Name)
        return str(scope[node.value.id]), self.trace.whole(self.value(node.slice, scope))

    def operation(self, sign: ast.operator) -> tuple[str, Callable[[Any, Any], Any]]:
        if type(sign) not in BINARY:
            raise NotStraight(f"it has the operation {type(sign).__name__}")
        return BINARY[type(sign)]

    # ---- expressions ----

    def value(self, node: ast.expr, scope: Environment) -> Value:
        """What an expression is."""
        match node:
            case ast.Constant():
                return node.value
            case ast.Name():
                return scope[node.id]
            case ast.Attribute():
                return getattr(math, node.attr)
            case ast.Subscript():
                return self.arrays[self.element(node, scope)]
            case ast.BinOp():
                left, right = self.value(node.left, scope), self.value(node.right, scope)
                return self.trace.binary(*self.operation(node.op), left, right)
            case ast.UnaryOp():
                return self.unary(node, scope)
            case ast.BoolOp():
                return self.joined(node, scope)
            case ast.Compare():
                return self.compared(node, scope)
            case ast.IfExp():
                test = self.value(node.test, scope)
                if not isinstance(test, Name):
                    return self.value(node.body if test else node.orelse, scope)
                return self.trace.select(test, self.value(node.body, scope), self.value(node.orelse, scope))
            case ast.Call():
                return self.called(node, scope)
            case _:
                raise NotStraight(f"it has an expression {type(node).__name__}")

    def unary(self, node: ast.UnaryOp, scope: Environment) -> Value:
        inner = self.value(node.operand, scope)
        if isinstance(node.op, ast.USub):
            return self.trace.keep(f"-{inner}") if isinstance(inner, Name) else -inner
        if isinstance(inner, Name):
            raise NotStraight("it negates a comparison")
        return not inner

    def joined(self, node: ast.BoolOp, scope: Environment) -> Value:
        """``and`` or ``or``, all of it computed."""
        sign, decides = ("&", False) if isinstance(node.op, ast.And) else ("|", True)
        total: Value = not decides
        for part in node.values:
            new = self.value(part, scope)
            if not isinstance(new, Name):
                if bool(new) == decides:
                    return decides
                continue
            total = self.trace.keep(f"{total} {sign} {new}") if isinstance(total, Name) else new
        return total

    def compared(self, node: ast.Compare, scope: Environment) -> Value:
        sides = [self.value(node.left, scope), *(self.value(c, scope) for c in node.comparators)]
        total: Value = True
        for sign, a, b in zip(node.ops, sides, sides[1:]):
            new = self.trace.compare(*COMPARED[type(sign)], a, b)
            if not isinstance(new, Name):
                if not new:
                    return False
            else:
                total = self.trace.keep(f"{total} & {new}") if isinstance(total, Name) else new
        return total

    def called(self, node: ast.Call, scope: Environment) -> Value:
        name = node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")
        arguments = [scope[a.id] if isinstance(a, ast.Name) else self.value(a, scope) for a in node.args]
        if name in self.functions:
            return self.call(name, arguments)
        if name == "int":
            return self.trace.whole(arguments[0])
        if name == "float":
            return arguments[0]
        if all(not isinstance(a, Name) for a in arguments):
            return (getattr(math, name, None) or {"abs": abs, "min": min, "max": max}[name])(*arguments)
        if name in ("min", "max"):
            return self.extreme("<" if name == "min" else ">", arguments)
        if name == "copysign":
            size = self.trace.keep(f"abs({text_of(arguments[0])})")
            opposite = self.trace.keep(f"-{size}")
            negative = self.trace.compare("<", operator.lt, arguments[1], 0.0)
            return self.trace.select(negative, opposite, size)
        if name not in CALLS:
            raise NotStraight(f"it has math.{name}")
        return self.trace.keep(f"{CALLS[name]}({text_of(arguments[0])})")

    def extreme(self, sign: str, arguments: Sequence[Value]) -> Value:
        """The smallest or largest, as Python chooses it."""
        best = arguments[0]
        for other in arguments[1:]:
            compute = operator.lt if sign == "<" else operator.gt
            best = self.trace.select(self.trace.compare(sign, compute, other, best), other, best)
        return best
