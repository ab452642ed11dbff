"""The drawing of imports has no circle: what is imported late and by name (`importlib`) counts as well."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from functools import cache
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import stickslip

ROOT = Path(stickslip.__file__).parent


@cache
def tree_of(file: Path) -> ast.Module:
    return ast.parse(file.read_text(encoding="utf-8"))


def called(node: ast.expr) -> str:
    """What a name ends with: `import_module` of `importlib.import_module`."""
    return node.attr if isinstance(node, ast.Attribute) else getattr(node, "id", "")


def for_types_only(node: ast.AST) -> bool:
    return isinstance(node, ast.If) and called(node.test) == "TYPE_CHECKING"


def nodes(tree: ast.AST) -> Iterator[ast.AST]:
    """All nodes but those that only a type checker runs."""
    left = [tree]
    while left:
        children = [node for node in ast.iter_child_nodes(left.pop()) if not for_types_only(node)]
        left += children
        yield from children


def named(node: ast.AST) -> list[str]:
    """The modules that a node imports, as far as its text tells."""
    if isinstance(node, ast.ImportFrom) and node.module:
        whole = node.module == "stickslip"
        return [f"stickslip.{alias.name}" for alias in node.names] if whole else [node.module]
    if isinstance(node, ast.Import):
        return [alias.name for alias in node.names]
    if isinstance(node, ast.Call) and node.args and called(node.func) == "import_module":
        first = node.args[0]
        if isinstance(first, ast.JoinedStr):
            first = first.values[0]
        if isinstance(first, ast.Constant) and isinstance(first.value, str):
            return [first.value]
    return []


def part(module: str) -> str:
    """The room, or the file of the package, that a module belongs to."""
    return module.split(".")[1] if module.startswith("stickslip.") else ""


@cache
def imports() -> dict[str, set[str]]:
    parts: dict[str, set[str]] = {}
    for file in ROOT.rglob("*.py"):
        mine = part(".".join(("stickslip", *file.relative_to(ROOT).with_suffix("").parts)))
        if mine == "__init__" or file.name.startswith("template"):
            continue
        found = {part(name) for node in nodes(tree_of(file)) for name in named(node)}
        parts.setdefault(mine, set()).update(found - {mine, "", "__version__"})
    return parts


def private(module: str) -> str:
    """The room that keeps a module to itself; empty where the module is for everybody."""
    parts = module.split(".")
    hidden = [i for i, name in enumerate(parts) if name.startswith("_") and not name.startswith("__")]
    return ".".join(parts[: hidden[0]]) if hidden else ""


def taken_from_other_rooms() -> list[str]:
    """What imports a module of a leading underscore from outside the folder that it lies in."""
    found: list[str] = []
    for file in ROOT.rglob("*.py"):
        mine = ".".join(("stickslip", *file.relative_to(ROOT).parent.parts))
        for node in ast.walk(tree_of(file)):
            names = named(node)
            if isinstance(node, ast.ImportFrom) and node.module:
                names = [node.module, *(f"{node.module}.{alias.name}" for alias in node.names)]
            rooms = {
                private(name)
                for name in names
                if (ROOT / "/".join(name.split(".")[1:])).with_suffix(".py").is_file()
            }
            found += [f"{file}: {room}" for room in rooms - {""} if not f"{mine}.".startswith(f"{room}.")]
    return found


def circle(found: dict[str, set[str]]) -> str:
    """The parts that import each other in a circle; empty where there is none."""
    try:
        TopologicalSorter(found).prepare()
    except CycleError as error:
        return " <- ".join(error.args[1])
    return ""


def test_the_parts_of_the_package_have_an_order() -> None:
    assert circle(imports()) == ""
    assert circle({"laws": {"rigs"}, "rigs": {"laws"}}) != ""


def test_what_is_imported_by_name_is_seen() -> None:
    found = imports()
    assert {"laws", "references"} <= found["models"]
    assert "rigs" not in found["models"]
    assert named(ast.parse('import_module(f"stickslip.rigs.{x}")', mode="eval").body) == ["stickslip.rigs."]


def test_a_leading_underscore_means_private() -> None:
    assert taken_from_other_rooms() == []
    assert private("stickslip.laws._symmetry.SYMMETRY") == "stickslip.laws"
    assert private("stickslip.laws.gms") == private("stickslip.__main__") == ""
