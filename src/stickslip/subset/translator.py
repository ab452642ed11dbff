"""The translation of one function of the scalar subset: what is allowed in it, and what its fields become."""

from __future__ import annotations

import ast
import math
import types
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

from stickslip.core.errors import LawError, suggestion
from stickslip.core.rebinding import NEGATIVE, negative
from stickslip.subset.layout import Layout
from stickslip.subset.remedies import REMEDY, instead_of
from stickslip.subset.source import Place, arguments_of

BUILTINS = {"abs", "min", "max", "range", "len", "float", "int"}
MATH = {
    "exp", "expm1", "log", "log1p", "sqrt", "sin", "cos", "tan", "atan", "atan2", "tanh", "sinh", "cosh",
    "floor", "ceil", "fabs", "copysign", "pi", "inf", "pow", "hypot",
}  # fmt: skip
STATEMENTS = (
    ast.Assign,
    ast.AugAssign,
    ast.AnnAssign,
    ast.If,
    ast.For,
    ast.Return,
    ast.Expr,
    ast.Pass,
    ast.Break,
)
EXPRESSIONS = (
    ast.BinOp, ast.UnaryOp, ast.BoolOp, ast.Compare, ast.IfExp, ast.Constant, ast.Name, ast.Attribute,
    ast.Subscript, ast.Call, ast.operator, ast.unaryop, ast.boolop, ast.cmpop, ast.expr_context,
)  # fmt: skip
ALLOWED = (*STATEMENTS, *EXPRESSIONS)


@dataclass(frozen=True, slots=True)
class View:
    """What an argument stands for: the fields of the structure `base` whose names begin with `prefix`."""

    base: str
    prefix: str
    layout: Layout


@dataclass(frozen=True, eq=False)
class Target:
    """A function to translate; one for v < 0 reads the parameters that hold there.

    ``views`` are the arguments that stand for another structure than their name says, or for a part of one;
    ``part`` is the part for which the function, and what it calls, is translated. ``numbers`` are the
    arguments that are called as a structure is, and are numbers.
    """

    function: Callable[..., Any]
    negative: bool = False
    views: tuple[tuple[str, View], ...] = ()
    part: str = ""
    numbers: tuple[str, ...] = ()


@dataclass
class Names:
    """One name per function translated: files may use the same name for different functions. Those of functions that
    are given are not translated."""

    given: frozenset[str]
    taken: dict[str, Any] = field(default_factory=dict[str, Any])

    def of(self, wanted: str, target: Target) -> str:
        name, count = wanted + (NEGATIVE if target.negative else ""), 1
        views = tuple((name, view.base, view.prefix) for name, view in target.views)
        code = getattr(target.function, "__code__", target.function)
        key = (code, target.negative, views, target.part, target.numbers)
        while self.taken.setdefault(name, key) != key:
            count += 1
            name = f"{wanted}_{count}"
        return name


@dataclass
class Translator(ast.NodeTransformer):
    where: Place
    layouts: Mapping[str, Layout]
    arguments: list[str]
    views: Mapping[str, View]
    scope: dict[str, Any]
    flat: bool
    names: Names
    target: Target
    calls: dict[str, Target] = field(default_factory=dict[str, Target])
    locals: set[str] = field(default_factory=set[str])
    counts: dict[str, None] = field(default_factory=dict[str, None])
    read: dict[str, ast.Call] = field(default_factory=dict[str, ast.Call])
    """Calls whose value is used, by callee."""
    renamed: dict[str, str] = field(default_factory=dict[str, str])
    """Numbers that are called as a structure is that the function reads under another name here."""

    @property
    def negative(self) -> bool:
        """Whether this is the function for v < 0."""
        return self.target.negative

    def rename(self, tree: ast.FunctionDef) -> None:
        """Find names for numbers that would hide a structure."""
        if not (bases := {view.base for view in self.views.values()} - self.views.keys()):
            return
        own = {n.id for n in ast.walk(tree) if isinstance(n, ast.Name)} | set(self.arguments)
        self.renamed = {name: f"{name}_number" for name in own & bases}

    def given_as(self, argument: str) -> str:
        """The name of an argument in the result; parts of one structure are one argument."""
        return self.views[argument].base if argument in self.views else self.renamed.get(argument, argument)

    def refuse(self, node: ast.AST, what: str, remedy: str) -> LawError:
        return LawError(f"{self.where.at(node)}: {what} is outside the scalar subset; {remedy}")

    # ---- statements ----------------------------------------------------------------------------------

    def visit(self, node: ast.AST) -> Any:
        if not isinstance(node, ALLOWED):
            kind = type(node).__name__
            raise self.refuse(
                node, f"`{kind}`", REMEDY.get(type(node), "use arithmetic, if/else and for loops")
            )
        return super().visit(node)

    def visit_Expr(self, node: ast.Expr) -> Any:
        if isinstance(node.value, ast.Constant):
            return None  # a docstring
        if isinstance(node.value, ast.Call):
            return ast.copy_location(ast.Expr(self.visit_Call(node.value, read=False)), node)
        return self.generic_visit(node)

    def visit_AnnAssign(self, node: ast.AnnAssign) -> Any:
        if node.value is None:
            return None
        return self.visit(ast.copy_location(ast.Assign([node.target], node.value), node))

    def visit_Assign(self, node: ast.Assign) -> Any:
        for target in node.targets:
            if isinstance(target, ast.Name):
                self.locals.add(target.id)
        return self.generic_visit(node)

    def visit_For(self, node: ast.For) -> Any:
        call = node.iter
        ranged = isinstance(call, ast.Call) and isinstance(call.func, ast.Name) and call.func.id == "range"
        if not ranged or not isinstance(node.target, ast.Name) or node.orelse:
            raise self.refuse(node, "this loop", "write `for i in range(n):`")
        self.locals.add(node.target.id)
        return self.generic_visit(node)

    # ---- expressions ---------------------------------------------------------------------------------

    def visit_Name(self, node: ast.Name) -> Any:
        if isinstance(node.ctx, ast.Store) and node.id in self.views:
            raise LawError(
                f"{self.where.at(node)}: `{node.id} = ...` hides the argument {node.id!r} and its fields; give the "
                "number another name"
            )
        if isinstance(node.ctx, ast.Store) or node.id in self.locals or node.id in self.arguments:
            node.id = self.renamed.get(node.id, node.id)
            return node
        value = self.scope.get(node.id)
        if isinstance(value, (int, float)) and not isinstance(value, bool):
            return ast.copy_location(ast.Constant(value), node)
        raise self.refuse(
            node, f"the name {node.id!r}", "use an argument, a local name or a numeric constant"
        )

    def visit_Attribute(self, node: ast.Attribute) -> Any:
        owner = node.value
        if isinstance(owner, ast.Name) and self.scope.get(owner.id) is math:
            if node.attr not in MATH:
                raise self.refuse(node, f"math.{node.attr}", suggestion(node.attr, MATH))
            return node
        view, name = self.structure(node)
        if name in view.layout.blocks:
            raise self.refuse(node, f"{ast.unparse(node)} as a whole", f"use {ast.unparse(node)}[i]")
        if name not in view.layout.scalars:
            here = len(view.prefix)
            fields = [f[here:] for f in view.layout.scalars + view.layout.blocks if f.startswith(view.prefix)]
            raise LawError(
                f"{self.where.at(node)}: {ast.unparse(owner)} has no field {node.attr!r}; "
                f"{suggestion(node.attr, fields)}"
            )
        self.insist_on_reading(node, node, view)
        if not self.flat:
            return ast.copy_location(ast.Attribute(ast.Name(view.base, ast.Load()), name, node.ctx), node)
        return self.element(view.base, ast.Constant(view.layout.scalars.index(name)), node)

    def visit_Subscript(self, node: ast.Subscript) -> Any:
        if not isinstance(node.value, ast.Attribute):
            raise self.refuse(node, "this index", "index a field of the state or parameters, z.force[i]")
        view, name = self.structure(node.value)
        layout = view.layout
        if name not in layout.blocks:
            raise self.refuse(
                node, f"{ast.unparse(node.value)}[...]", "it has one value, not one per element"
            )
        self.insist_on_reading(node, node.value, view)
        if not self.flat:
            value = ast.Attribute(ast.Name(view.base, ast.Load()), name, ast.Load())
            return ast.copy_location(ast.Subscript(value, self.visit(node.slice), node.ctx), node)
        first = len(layout.scalars) + (len(layout.counts) if layout.counted else 0)
        block = layout.blocks.index(name)
        index: ast.expr = self.visit(node.slice)
        before = [layout.per(i) for i in range(block)]
        for per in reversed(dict.fromkeys(before)):
            offset = ast.BinOp(ast.Constant(before.count(per)), ast.Mult(), self.count(node, per))
            index = ast.BinOp(offset, ast.Add(), index)
        if first:
            index = ast.BinOp(ast.Constant(first), ast.Add(), index)
        return self.element(view.base, index, node)

    def visit_Call(self, node: ast.Call, read: bool = True) -> Any:
        if node.keywords:
            raise self.refuse(node, "a keyword argument", "pass arguments by position")
        if isinstance(node.func, ast.Attribute):
            node.func = self.visit(node.func)
            node.args = [self.visit(a) for a in node.args]
            return node
        if not isinstance(node.func, ast.Name):
            raise self.refuse(node, "this call", "call a function by its name")
        name = node.func.id
        if name == "len":
            return self.length(node)
        if name in BUILTINS:
            node.args = [self.visit(a) for a in node.args]
            return node
        if name in self.names.given:
            return ast.copy_location(
                ast.Call(ast.Name(f"_{name}", ast.Load()), [self.whole(a) for a in node.args], []), node
            )
        function = self.scope.get(name)
        if not isinstance(function, types.FunctionType) or function is negative:
            known = [n for n, v in self.scope.items() if isinstance(v, types.FunctionType)]
            raise self.refuse(node, f"{name}()", suggestion(name, [*known, *BUILTINS]))
        takes = len(arguments_of(function))
        if len(node.args) != takes:
            raise self.refuse(node, f"{name}() with {len(node.args)} arguments", f"it takes {takes}")
        target = self.aimed(node, function)
        callee = self.names.of(f"_{target.part}{name}", target)
        self.calls[callee] = target
        if read:
            self.read[callee] = node
        node.func = ast.copy_location(ast.Name(callee, ast.Load()), node)
        node.args = self.passed(node, target)
        return node

    def aimed(self, node: ast.Call, function: Callable[..., Any]) -> Target:
        """The callee, for the parts of structures that it is called with."""
        views: list[tuple[str, View]] = []
        numbers: list[str] = []
        for formal, actual in zip(arguments_of(function), node.args):
            view = self.view(self.positive(actual))
            if view is None and formal in self.layouts:
                numbers.append(formal)
            elif view is not None and (view.prefix or self.layouts.get(formal) != view.layout):
                views.append((formal, view))
        negative = self.negative or any(map(self.is_negative, node.args))
        prefixes = [view.prefix for _, view in views if view.prefix]
        part = max(prefixes, key=len, default=self.target.part)
        return Target(function, negative, tuple(views), part, tuple(numbers))

    def passed(self, node: ast.Call, target: Target) -> list[ast.expr]:
        """The arguments of a call; a structure of which several parts are meant is passed once."""
        views, out, bases = dict(target.views), list[ast.expr](), dict[str, str]()
        for formal, actual in zip(arguments_of(target.function), node.args):
            view = self.view(self.positive(actual))
            if view is None:
                out.append(self.visit(actual))
                continue
            name = views[formal].base if formal in views else formal
            if name not in bases:
                out.append(ast.copy_location(ast.Name(view.base, ast.Load()), actual))
            elif bases[name] != view.base:
                raise self.refuse(node, "this call", f"give the argument {formal} another name")
            bases[name] = view.base
        return out

    def whole(self, node: ast.expr) -> ast.expr:
        """An argument of a function that is given: a structure as a whole, or a number."""
        view = self.view(node)
        return self.visit(node) if view is None else ast.copy_location(ast.Name(view.base, ast.Load()), node)

    def positive(self, node: ast.expr) -> ast.expr:
        """`p` of `negative(p)`: a callee of its own reads it."""
        return node.args[0] if isinstance(node, ast.Call) and self.is_negative(node) else node

    def is_negative(self, node: ast.expr) -> bool:
        """Whether this is `negative(p)`."""
        if not isinstance(node, ast.Call) or not isinstance(node.func, ast.Name) or len(node.args) != 1:
            return False
        return self.scope.get(node.func.id) is negative

    # ---- structured arguments --------------------------------------------------------------------------

    def view(self, node: ast.expr) -> View | None:
        """What an expression stands for as a whole: a structure or a part of one; None for a number."""
        if isinstance(node, ast.Name):
            return self.views.get(node.id)
        if not isinstance(node, ast.Attribute) or (owner := self.view(node.value)) is None:
            return None
        prefix = f"{owner.prefix}{node.attr}_"
        return View(owner.base, prefix, owner.layout) if prefix in owner.layout.parts else None

    def structure(self, node: ast.Attribute) -> tuple[View, str]:
        """What the field belongs to, and its whole name."""
        view = self.view(node.value)
        if view is None:
            raise self.refuse(node, *self.no_field(node))
        name, root = view.prefix + node.attr, ast.unparse(node.value).partition(".")[0]
        doubled = name + NEGATIVE in view.layout.scalars + view.layout.blocks
        return view, name + NEGATIVE if self.negative and root == "p" and doubled else name

    def no_field(self, node: ast.Attribute) -> tuple[str, str]:
        """What is no field of a structure, and what to write in its place."""
        owner = ast.unparse(node.value)
        if isinstance(self.scope.get(owner), types.ModuleType):
            return f"`{owner}.{node.attr}`", instead_of(node.attr, MATH)
        return f"`.{node.attr}` here", f"fields belong to {', '.join(self.views or self.layouts)}"

    def insist_on_reading(
        self, node: ast.Attribute | ast.Subscript, field: ast.Attribute, view: View
    ) -> None:
        """Refuse to write a field that a law may only read: the change would be in Python's simulation alone."""
        if not isinstance(node.ctx, ast.Store) or not view.layout.fixed:
            return
        raise LawError(
            f"{self.where.at(node)}: `{ast.unparse(node)} = ...` writes {view.layout.fixed}, which a law only reads; "
            f"write a local name ({field.attr} = ...), or a field of the state"
        )

    def element(self, name: str, index: ast.expr, like: ast.expr) -> ast.expr:
        return ast.copy_location(
            ast.Subscript(ast.Name(name, ast.Load()), index, getattr(like, "ctx", ast.Load())), like
        )

    def count(self, node: ast.AST, per: str) -> ast.expr:
        """The number of elements (or what else), which the parameters hold after their scalars."""
        if (view := self.counting()) is None:
            raise self.refuse(
                node, "a field per element without `p`", "pass the parameters `p` to this function"
            )
        if per not in view.layout.counts:
            raise self.refuse(
                node, f"a value per {per}, of which no parameter has a list,", "give Params such a field"
            )
        self.counts[per] = None
        return ast.Name(f"{per}s_", ast.Load())

    def counting(self) -> View | None:
        """The structure that holds the numbers of elements."""
        return next((view for view in self.views.values() if view.layout.counted), None)

    def counted(self, per: str) -> ast.stmt:
        """The statement that reads a number of elements."""
        view = self.counting()
        assert view is not None
        place = ast.Constant(len(view.layout.scalars) + view.layout.counts.index(per))
        read = ast.Subscript(ast.Name(view.base, ast.Load()), place, ast.Load())
        count = ast.Call(ast.Name("int", ast.Load()), [read], [])
        return ast.Assign([ast.Name(f"{per}s_", ast.Store())], count, lineno=1)

    def length(self, node: ast.Call) -> ast.expr:
        of = node.args[0] if len(node.args) == 1 else None
        if (
            not isinstance(of, ast.Attribute)
            or (found := self.structure(of))[1] not in found[0].layout.blocks
        ):
            raise self.refuse(node, "this len()", "use len(p.field) of a field that has a value per element")
        view, name = found
        return ast.copy_location(self.count(node, view.layout.per(view.layout.blocks.index(name))), node)
