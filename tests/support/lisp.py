"""The part of LispBM that an exported table needs, from its reference manual: read and run independently of the export.

Lists, whole numbers, decimals, names, byte arrays in brackets, comments; def, defun, let with bindings seen by those
after them, + - * mod, to-i (towards zero) and bufget-i16 (two bytes, high byte first).
"""

from __future__ import annotations

import re
from typing import Any

TOKEN = re.compile(r"\s*(?:;[^\n]*\n?|([()\[\]])|([^\s()\[\];]+))")


def read(text: str) -> list[Any]:
    """All expressions of a program."""
    stack: list[tuple[str, list[Any]]] = [("", [])]
    at = 0
    while at < len(text.rstrip()):
        found = TOKEN.match(text, at)
        assert found, text[at : at + 20]
        at, (mark, word) = found.end(), found.groups()
        if mark in ("(", "["):
            stack.append((mark, []))
        elif mark in (")", "]"):
            opened, own = stack.pop()
            assert (opened, mark) in (("(", ")"), ("[", "]")), f"{opened} closed by {mark}"
            stack[-1][1].append(bytes(own) if mark == "]" else own)
        elif word:
            stack[-1][1].append(atom(word))
    assert len(stack) == 1, "an expression is not closed"
    return stack[0][1]


def atom(word: str) -> Any:
    """A number or a name."""
    if re.fullmatch(r"-?\d+", word):
        return int(word)
    return float(word) if re.fullmatch(r"-?\d+\.\d+(e-?\d+)?", word) else word


class Lisp:
    """A program's definitions, to be called."""

    def __init__(self, text: str) -> None:
        self.world: dict[str, Any] = {}
        for one in read(text):
            self.value(one, self.world)

    def __call__(self, name: str, *values: float) -> Any:
        """Call a function of the program."""
        return self.value([name, *values], self.world)

    def value(self, x: Any, names: dict[str, Any]) -> Any:
        """Of an expression."""
        if isinstance(x, str):
            return names[x] if x in names else self.world[x]
        if not isinstance(x, list):
            return x
        head, *rest = x
        if head == "def":
            self.world[rest[0]] = self.value(rest[1], names)
        elif head == "defun":
            self.world[rest[0]] = (rest[1], rest[2])
        elif head == "let":
            own = dict(names)
            for name, bound in rest[0]:
                own[name] = self.value(bound, own)
            return self.value(rest[1], own)
        else:
            return self.applied(head, [self.value(y, names) for y in rest])
        return None

    def applied(self, head: str, values: list[Any]) -> Any:
        """A built-in function, or one of the program's."""
        if head in self.world:
            arguments, body = self.world[head]
            assert len(arguments) == len(values), head
            return self.value(body, dict(zip(arguments, values, strict=True)))
        a, *more = values
        match head, more:
            case "+", [b]:
                return a + b
            case "-", [b]:
                return a - b
            case "*", [b]:
                return a * b
            case "mod", [b] if isinstance(a, int) and isinstance(b, int):
                return a % b
            case "to-i", []:
                return int(a)
            case "bufget-i16", [b]:
                assert 0 <= b <= len(a) - 2
                return int.from_bytes(a[b : b + 2], "big", signed=True)
        raise AssertionError(f"LispBM has no ({head} ...) of {len(values)} values here")
