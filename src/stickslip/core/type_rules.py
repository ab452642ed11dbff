"""What an annotation allows: rules that tell whether a value fits, where in it something does not, and what would."""

from __future__ import annotations

import collections.abc as abc
import functools
import os
import re
import sys
import types
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Annotated, Any, Literal, NamedTuple, Union, cast, get_args, get_origin

NUMBERS = "one number a row"
"""Mark of what may be an array, a list, a data frame's column, ..., of numbers (`stickslip.core.reprs.Vector`)."""
KINDS = {
    "Cascade": "a Cascade (a control law is given by its place, loop=...)",
    "Compensator": "Feedforward(...) or Feedback(...)",
    "Controller": "a Controller: of gains, Controller(place('PD', ...)), or of control laws",
    "Gains": "Gains, such as place('PD', ...)",
    "IdentificationResult": "what `identify` returned",
    "Identified": "what `identify` returned",
    "Machine": "a Machine: load_machine('thesis-dry'), or built of its parts",
    "Model": "a Model, such as Model('coulomb', fc=0.3)",
    "Reference": "a Reference, of arrays Reference.table(time, position)",
    "ndarray": "a NumPy array",
    "type": "a class",
}
"""How to come by what is of a class, by its name."""
MANY = {"a number": "numbers", "a whole number": "whole numbers", "text": "names", "a path": "paths"}
FEW = 3
"""Kinds that are each told with how to come by one, at most."""
PATH = "a path"
PLAIN = {
    float: "a number", int: "a whole number", bool: "True or False", str: "text", types.NoneType: "None",
}  # fmt: skip
FUNCTION: Any = get_origin(Callable[..., Any])
SEQUENCES = (abc.Sequence, list)
ITERABLES = (abc.Iterable, abc.Collection, abc.Set, set, frozenset)


LARGEST = int(sys.float_info.max)
"""Whole numbers beyond this have no value as a float."""
LARGEST_WHOLE = 2**63
"""Whole numbers of this size and more do not fit into the counters of compiled code."""


class Wrong(NamedTuple):
    """A value that does not fit."""

    place: str
    """In the argument: "[1]", "['fc']"; empty where it is the argument itself."""
    value: Any
    words: str
    """What it must be."""


@dataclass(frozen=True, slots=True)
class Rule:
    """What an annotation allows.

    Attributes
    ----------
    words : str
        What fits, for messages.
    wrong : callable
        What does not fit in a value, or None.
    quick : frozenset of type
        Of these exact types every value fits.
    make : type or None
        int or float, where only such numbers fit.
    lists : bool
        Whether a list of names fits.
    """

    words: str
    wrong: Callable[[Any], Wrong | None]
    quick: frozenset[type] = frozenset()
    make: type | None = None
    lists: bool = False


def is_number(value: object) -> bool:
    """Whether it may stand for a number: what has a value as a float, but no text, no truth value and no array."""
    if isinstance(value, int):
        return not isinstance(value, bool) and abs(value) <= LARGEST
    if isinstance(value, float):
        return True
    if isinstance(value, (str, bytes)) or getattr(value, "ndim", 0) != 0:
        return False
    if getattr(getattr(value, "dtype", None), "kind", "f") not in "fiubO":
        return False  # a date or a text of NumPy
    try:
        float(cast("Any", value))
    except (TypeError, ValueError, OverflowError):
        return False
    return True


def is_whole(value: Any) -> bool:
    """Whether it may stand for a whole number: 2.0 may."""
    return is_number(value) and float(value).is_integer() and abs(value) < LARGEST_WHOLE


def is_truth(value: Any) -> bool:
    """Whether it is True or False, or NumPy's, or 0 or 1."""
    return isinstance(value, bool) or (
        getattr(value, "ndim", 0) == 0 and is_number(value) and value in (0, 1)
    )


def has_no_nul(path: str | bytes) -> bool:
    """Whether a path is without the NUL character, which no file system takes."""
    return "\0" not in path if isinstance(path, str) else b"\0" not in path


FITS: Mapping[type, Callable[[Any], bool]] = {float: is_number, int: is_whole, bool: is_truth}


@functools.cache
def rule_of(hint: Any) -> Rule | None:
    """The rule of a type as annotations write it; None where anything fits, or it is not known what does."""
    origin, inner = get_origin(hint), get_args(hint)
    if origin is Annotated:
        return _several(rule_of(float), iterable=False) if NUMBERS in inner[1:] else rule_of(inner[0])
    if origin in (Union, types.UnionType):
        return _union([rule_of(member) for member in inner])
    if hint is None or hint in PLAIN:
        kind = types.NoneType if hint is None else hint
        fits = FITS.get(kind, lambda value: isinstance(value, kind))
        quick = set[type]() if kind is int else {kind}
        return _plain(PLAIN[kind], fits, quick, kind if kind in (int, float) else None)
    if origin is Literal:
        listed = _joined([repr(word) for word in inner])
        return _plain(listed, lambda value: isinstance(value, (str, int)) and value in inner)
    if origin is FUNCTION:
        # A class makes an object of its own kind instead of what is computed.
        return _plain(
            "a function",
            lambda value: callable(value) and not isinstance(value, type),
            {types.FunctionType, types.MethodType},
        )
    kind: Any = origin or hint
    if kind is os.PathLike:
        return _plain(
            PATH,
            lambda value: (
                isinstance(value, os.PathLike) and has_no_nul(os.fspath(cast("os.PathLike[str]", value)))
            ),
        )
    if kind in (abc.Mapping, dict):
        return _mapping(*[rule_of(part) for part in inner] or (None, None))
    if kind is tuple and Ellipsis not in inner:
        return _fixed([rule_of(part) for part in inner])
    if kind in (*SEQUENCES, *ITERABLES, tuple):
        return _several(rule_of(inner[0]) if inner else None, kind in ITERABLES)
    if not isinstance(kind, type) or kind in (object, Any) or getattr(hint, "_is_protocol", False):
        return None
    return _of_class(cast("type[Any]", kind))


def _of_class(kind: type[Any]) -> Rule:
    name = kind.__name__
    words = KINDS.get(name, with_article(name))
    return _plain(words, lambda value: isinstance(value, kind), {kind})


def with_article(word: str) -> str:
    """The indefinite one before it."""
    return f"{'an' if word[:1].lower() in 'aeio' else 'a'} {word}"


def _plain(
    words: str, fits: Callable[[Any], bool], quick: abc.Set[type] = frozenset(), make: type | None = None
) -> Rule:
    return Rule(words, lambda value: None if fits(value) else Wrong("", value, words), frozenset(quick), make)


def _union(members: list[Rule | None]) -> Rule | None:
    """Any of several; what is wrong inside a list or mapping is told rather than that the whole is none of them."""
    known = [m for m in members if m is not None]
    if len(known) < len(members):
        return None
    if any(m.words == PATH for m in known):
        text = _plain("text", lambda value: isinstance(value, str) and has_no_nul(value))
        known = [text if m.words == "text" else m for m in known]
    words = _any_of(list(dict.fromkeys(m.words for m in known if m.words != "None")))

    def wrong(value: Any) -> Wrong | None:
        found = [m.wrong(value) for m in known]
        if not all(found):
            return None
        return next((w for w in found if w and w.place), Wrong("", value, words))

    quick = frozenset[type]().union(*(m.quick for m in known))
    makes = {m.make for m in known if m.words != "None"}
    return Rule(words, wrong, quick, int if makes == {int} else None, any(m.lists for m in known))


def _any_of(words: list[str]) -> str:
    """What any of several are called together."""
    said = words if len(words) <= FEW else [re.split("[,:]", w)[0] for w in words]
    if {"text", "a path"} <= {*said}:
        said = ["a path", *(w for w in said if w not in ("text", "a path"))]
    lists = [w for w in said if w.startswith("a list")]
    others = [w for w in said if w not in lists]
    if others:
        both = {many(_joined(others)), many(_joined([w for w in words if w not in lists]))}
        lists = ["a list of these" if w.removeprefix("a list") in both else w for w in lists]
    return _joined([*others, *lists])


def _mapping(key: Rule | None, item: Rule | None) -> Rule:
    """Of names to what fits `item`."""
    words = f"a mapping of names to {item.words if item.make is None else 'numbers'}" if item else "a mapping"

    def wrong(value: Any) -> Wrong | None:
        if not isinstance(value, abc.Mapping):
            return Wrong("", value, words)
        for name, inside in cast("Mapping[Any, Any]", value).items():
            if key is not None and key.wrong(name):
                return Wrong("", value, words)
            if (found := _inside(item, inside)) is not None:
                return found._replace(place=f"[{name!r}]{found.place}")
        return None

    return Rule(words, wrong)


def _several(item: Rule | None, iterable: bool) -> Rule:
    """A list, tuple, array, ...; of what may only be gone through once nothing is looked at."""
    words = f"a list{many(item.words) if item else ''}"
    ordered = not iterable and item is not None and item.make is not None

    def wrong(value: Any) -> Wrong | None:
        given = value
        several = hasattr(given, "__iter__") and getattr(given, "ndim", 1) > 0
        if ordered and not (hasattr(given, "__getitem__") or hasattr(given, "__array__")):
            several = False  # a set or a view of a mapping, of which NumPy makes no array
        if isinstance(given, (str, bytes, abc.Mapping)) or not (
            several and (iterable or hasattr(given, "__len__"))
        ):
            return Wrong("", given, words)
        if hasattr(given, "dtype"):
            if item is not None and item.make is None:
                return _each(item, list(given))
            numbers = item is None or getattr(given.dtype, "kind", "f") in "fiubO"
            return None if numbers else Wrong("", given, words)
        return _each(item, given) if isinstance(given, (list, tuple, abc.Set)) else None

    return Rule(words, wrong, lists=item is not None and str in item.quick)


def _fixed(items: list[Rule | None]) -> Rule:
    """So many things, one after the other."""
    size, first = len(items), items[0] if items else None
    alike = first is not None and items.count(first) == size and first.words in MANY
    words = f"{size} {MANY[first.words]}" if first and alike else f"a tuple of {size}"

    def wrong(value: Any) -> Wrong | None:
        if not isinstance(value, (tuple, list)) and not (
            hasattr(value, "dtype") and getattr(value, "ndim", 0)
        ):
            return Wrong("", value, words)
        given = cast("tuple[Any, ...]", value)
        for i, (item, inside) in enumerate(zip(items, given)):
            if (found := _inside(item, inside)) is not None:
                return found._replace(place=f"[{i}]{found.place}")
        return None if len(given) == size else Wrong("", value, words)

    return Rule(words, wrong)


def _each(item: Rule | None, values: Any) -> Wrong | None:
    for i, inside in enumerate(values if item else ()):
        if (found := _inside(item, inside)) is not None:
            return found._replace(place=f"[{i}]{found.place}")
    return None


def _inside(rule: Rule | None, value: Any) -> Wrong | None:
    return None if rule is None or type(value) in rule.quick else rule.wrong(value)


def many(words: str) -> str:
    """Behind "a list": of what."""
    return f" of {MANY[words]}" if words in MANY else f", each {words}"


def _joined(words: list[str]) -> str:
    """One after the other, the last behind "or"."""
    *others, last = dict.fromkeys(words)
    return f"{', '.join(others)} or {last}" if others else last
