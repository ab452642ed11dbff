"""What a translation must know about a function of the scalar subset: types, locals, what it writes.

Functions come as `stickslip.subset.named` returns them. Everything is a real number but loop counters,
indices and conditions.
"""

from __future__ import annotations

import ast
from collections.abc import Container, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

from stickslip.core.errors import LawError

Kind = Literal["real", "int", "bool"]

INT_CALLS = {"int"}
Seen = dict[int, frozenset[str]]
"""Every name in a part of a function, by the part's id: where each name is declared asks for them again and again."""


@dataclass(frozen=True)
class Facts:
    """A function seen through.

    Attributes
    ----------
    arguments : tuple of str
    returns : bool
        Whether it returns a number.
    kinds : mapping
        Every local name (loop counters included), every count and every argument that is an index to its type.
    counts : frozenset of str
        Names that stand for the number of elements, of points, ... (``elements_``).
    declared : mapping
        id of a statement to the names that its assignment declares.
    opened : mapping
        id of a statement to the names that must be declared, as zero, before it.
    structures : frozenset of str
        Arguments whose fields it, or a function it calls, uses (or that it does not use at all).
    writes : frozenset of str
        Of these, the ones that are changed.
    uses : frozenset of str
        Every name that occurs.
    """

    arguments: tuple[str, ...]
    returns: bool
    kinds: Mapping[str, Kind]
    counts: frozenset[str]
    declared: Mapping[int, tuple[str, ...]]
    opened: Mapping[int, tuple[str, ...]]
    structures: frozenset[str]
    writes: frozenset[str]
    uses: frozenset[str]


def fields_read(trees: Iterable[ast.AST], owners: Container[str] = ("u",)) -> set[str]:
    """The fields of structures, of the surroundings unless others are named, that functions read or write."""
    return {
        node.attr
        for tree in trees
        for node in ast.walk(tree)
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and node.value.id in owners
    }


def analyse(functions: Mapping[str, ast.FunctionDef]) -> dict[str, Facts]:
    """Look through functions, callees first.

    Raises
    ------
    LawError
        If a name has letters that most languages do not have in names.
    """
    known: dict[str, Facts] = {}
    for name, tree in functions.items():
        insist_on_ascii(tree)
        known[name] = _facts(tree, known)
    return known


def insist_on_ascii(tree: ast.FunctionDef) -> None:
    """Refuse a function with a name in other letters than those of ASCII."""
    for node in ast.walk(tree):
        name = getattr(node, "id", None) or getattr(node, "attr", None) or getattr(node, "arg", None)
        if isinstance(name, str) and not name.isascii():
            raise LawError(
                f"{name!r} is no name in other languages; rename it in the law's file, with letters a to z and A to Z, "
                "digits and _"
            )


def merged(functions: Mapping[str, ast.FunctionDef]) -> dict[str, ast.FunctionDef]:
    """Functions of which none says the same as another (the controller's law is the law's own step)."""
    out: dict[str, ast.FunctionDef] = {}
    first: dict[str, str] = {}
    other: dict[str, str] = {}
    for name, tree in functions.items():
        for node in ast.walk(tree):
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
                node.func.id = other.get(node.func.id, node.func.id)
        text = ast.dump(tree.args) + "".join(map(ast.dump, tree.body))
        other[name] = first.setdefault(text, name)
        if other[name] == name:
            out[name] = tree
    return out


def kind_of(node: ast.expr, kinds: Mapping[str, Kind]) -> Kind:
    """The type of an expression."""
    if isinstance(node, ast.Constant):
        return "int" if isinstance(node.value, int) and not isinstance(node.value, bool) else "real"
    if isinstance(node, ast.Name):
        return kinds.get(node.id, "real")
    if isinstance(node, (ast.Compare, ast.BoolOp)):
        return "bool"
    if isinstance(node, ast.UnaryOp):
        return "bool" if isinstance(node.op, ast.Not) else kind_of(node.operand, kinds)
    if isinstance(node, ast.BinOp):
        both = {kind_of(node.left, kinds), kind_of(node.right, kinds)}
        whole = both == {"int"} and isinstance(node.op, (ast.Add, ast.Sub, ast.Mult, ast.Mod))
        return "int" if whole else "real"
    if isinstance(node, ast.IfExp):
        return "int" if {kind_of(node.body, kinds), kind_of(node.orelse, kinds)} == {"int"} else "real"
    if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id in INT_CALLS:
        return "int"
    return "real"


def _facts(tree: ast.FunctionDef, known: Mapping[str, Facts]) -> Facts:
    arguments = tuple(a.arg for a in tree.args.args)
    nodes = list(ast.walk(tree))
    names = [n for n in nodes if isinstance(n, ast.Name)]
    counts = _counts(nodes, names, arguments)
    whole = counts | _indices(nodes, arguments, known)
    kinds: dict[str, Kind] = {**_kinds(nodes, whole), **dict.fromkeys(whole, "int")}
    declared: dict[int, tuple[str, ...]] = {}
    opened: dict[int, tuple[str, ...]] = {}
    seen: Seen = {}
    for name in kinds:
        if name not in arguments and name not in counts:
            _place(name, tree.body, declared, opened, seen)
    returns = any(isinstance(n, ast.Return) and n.value is not None for n in nodes)
    structures = frozenset(arguments) - _plain(nodes, names, known)
    uses = frozenset(n.id for n in names)
    return Facts(arguments, returns, kinds, counts, declared, opened, structures, _writes(nodes, known), uses)


# ---- types --------------------------------------------------------------------------------------------------


def _counts(nodes: Sequence[ast.AST], names: Sequence[ast.Name], arguments: Sequence[str]) -> frozenset[str]:
    """Names that are neither arguments nor locals nor called."""
    called = {id(n.func) for n in nodes if isinstance(n, ast.Call)}
    local = {n.id for n in names if isinstance(n.ctx, ast.Store)}
    free = {n.id for n in names if id(n) not in called} - local - {"math", *arguments}
    return frozenset(free)


def _indices(
    nodes: Sequence[ast.AST], arguments: Sequence[str], known: Mapping[str, Facts]
) -> frozenset[str]:
    """Arguments that are an index here, or in a function that is called with them."""
    out: set[str] = set()
    for node in nodes:
        if isinstance(node, ast.Subscript):
            out |= {n.id for n in ast.walk(node.slice) if isinstance(n, ast.Name)}
        elif isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id in known:
            callee = known[node.func.id]
            passed = zip(node.args, callee.arguments)
            out |= {g.id for g, a in passed if isinstance(g, ast.Name) and callee.kinds.get(a) == "int"}
    return frozenset(out & set(arguments))


def _kinds(nodes: Sequence[ast.AST], counts: Iterable[str]) -> dict[str, Kind]:
    """The type of every local name: whole only where every value it gets is whole."""
    kinds: dict[str, Kind] = dict.fromkeys(counts, "int")
    for node in nodes:
        if isinstance(node, ast.For) and isinstance(node.target, ast.Name):
            kinds[node.target.id] = "int"
    assigned = [given for node in nodes for given in _assigned(node)]
    for _ in range(3):  # a name may take its type from another
        for name, value in assigned:
            got = kind_of(value, kinds)
            kinds[name] = got if kinds.get(name, got) == got else "real"
    return kinds


def _assigned(node: ast.AST) -> Iterator[tuple[str, ast.expr]]:
    if isinstance(node, ast.Assign):
        for target in node.targets:
            if isinstance(target, ast.Name):
                yield target.id, node.value
    elif isinstance(node, ast.AugAssign) and isinstance(node.target, ast.Name):
        yield node.target.id, ast.BinOp(ast.Name(node.target.id), node.op, node.value)


# ---- where names are declared ---------------------------------------------------------------------------------


def _place(
    name: str,
    block: Sequence[ast.stmt],
    declared: dict[int, tuple[str, ...]],
    opened: dict[int, tuple[str, ...]],
    seen: Seen,
) -> None:
    """Declare `name` in the innermost block that holds all of its uses."""
    users = [s for s in block if _mentions(s, name, seen)]
    first = users[0]
    if isinstance(first, ast.For) and len(users) == 1 and _own_counter(first, name):
        return  # the loop declares its own counter
    inner = [b for s in users for b in _blocks(s) if any(_mentions(i, name, seen) for i in b)]
    passed_down = (
        len(users) == len(inner) == 1 and isinstance(first, ast.If) and not _mentions(first.test, name, seen)
    )
    if passed_down or all(_is_apart(s, name, seen) for s in users):
        for each in inner:
            _place(name, each, declared, opened, seen)
        return
    if _is_assignment(first, name, seen):
        declared[id(first)] = (*declared.get(id(first), ()), name)
    elif not all(_own_counter(s, name) for s in users):
        opened[id(first)] = (*opened.get(id(first), ()), name)


def _own_counter(statement: ast.stmt, name: str) -> bool:
    """Whether the statement is a loop that counts by `name`."""
    return (
        isinstance(statement, ast.For)
        and isinstance(statement.target, ast.Name)
        and statement.target.id == name
    )


def _mentions(node: ast.AST, name: str, seen: Seen) -> bool:
    found = seen.get(id(node))
    if found is None:
        found = seen[id(node)] = frozenset(n.id for n in ast.walk(node) if isinstance(n, ast.Name))
    return name in found


def _blocks(statement: ast.stmt) -> list[list[ast.stmt]]:
    if isinstance(statement, ast.If):
        return [b for b in (statement.body, statement.orelse) if b]
    return [statement.body] if isinstance(statement, ast.For) else []


def _mentions_outside_blocks(statement: ast.stmt, name: str, seen: Seen) -> bool:
    if isinstance(statement, ast.If):
        return _mentions(statement.test, name, seen)
    if isinstance(statement, ast.For):
        return _mentions(statement.iter, name, seen) or _mentions(statement.target, name, seen)
    return True


def _is_assignment(statement: ast.stmt, name: str, seen: Seen) -> bool:
    """Whether the statement gives `name` its value without reading it."""
    return (
        isinstance(statement, ast.Assign)
        and len(statement.targets) == 1
        and isinstance(statement.targets[0], ast.Name)
        and statement.targets[0].id == name
        and not _mentions(statement.value, name, seen)
    )


def _is_apart(statement: ast.stmt, name: str, seen: Seen) -> bool:
    """Whether `name` occurs in blocks of the statement alone, each of which gives it the values that it reads."""
    if not isinstance(statement, (ast.If, ast.For)) or _mentions_outside_blocks(statement, name, seen):
        return False
    blocks = [b for b in _blocks(statement) if any(_mentions(s, name, seen) for s in b)]
    return all(
        _sets(b, name, seen) or all(_is_apart(s, name, seen) for s in b if _mentions(s, name, seen))
        for b in blocks
    )


def _sets(block: Sequence[ast.stmt], name: str, seen: Seen) -> bool:
    """Whether every passage through the block gives `name` a value before it is read."""
    first = next((s for s in block if _mentions(s, name, seen)), None)
    if first is None:
        return True
    if _is_assignment(first, name, seen):
        return True
    if not isinstance(first, ast.If) or _mentions(first.test, name, seen):
        return False
    inner = [b for b in _blocks(first) if any(_mentions(s, name, seen) for s in b)]
    alone = sum(_mentions(s, name, seen) for s in block) == 1
    return (alone or len(inner) == 2) and all(_sets(b, name, seen) for b in inner)


# ---- structured arguments ---------------------------------------------------------------------------------


def _plain(nodes: Sequence[ast.AST], names: Sequence[ast.Name], known: Mapping[str, Facts]) -> set[str]:
    """Names that occur as numbers: neither before a dot nor handed on as a structure."""
    owners: set[int] = set()
    for node in nodes:
        if isinstance(node, ast.Attribute):
            owners.add(id(node.value))
        elif isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id in known:
            callee = known[node.func.id]
            owners |= {id(g) for g, a in zip(node.args, callee.arguments) if a in callee.structures}
    return {n.id for n in names if id(n) not in owners}


# ---- what a function changes ---------------------------------------------------------------------------------


def _writes(nodes: Sequence[ast.AST], known: Mapping[str, Facts]) -> frozenset[str]:
    out: set[str] = set()
    for node in nodes:
        targets = node.targets if isinstance(node, ast.Assign) else []
        if isinstance(node, ast.AugAssign):
            targets = [node.target]
        out.update(owner for target in targets if (owner := _owner(target)))
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id in known:
            callee = known[node.func.id]
            for given, argument in zip(node.args, callee.arguments):
                if argument in callee.writes and isinstance(given, ast.Name):
                    out.add(given.id)
    return frozenset(out)


def _owner(target: ast.expr) -> str | None:
    """z of ``z.force[i]``; None for a local name."""
    while isinstance(target, (ast.Subscript, ast.Attribute)):
        target = target.value
        if isinstance(target, ast.Name):
            return target.id
    return None
