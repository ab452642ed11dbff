"""Arguments that are numbers: what is none, text such as "0.1" above all, is refused where it is given.

Annotations say which they are: ``float``, ``int``, either with ``| None``, ``tuple[float, float]``, and values of a
``Mapping[str, float]``. A name in place of a list of names (``Sequence[str]``) is refused too.
"""

from __future__ import annotations

import dataclasses
import functools
import inspect
from collections.abc import Callable, Mapping
from typing import Any, ParamSpec, TypeVar, cast

from stickslip.errors import ParameterError

NUMBERS = {"float", "int"}
NAMES = {"Iterable[str]", "Sequence[str]"}
PAIR, NAMED = "tuple[float, float]", "Mapping[str, float]"

P = ParamSpec("P")
R = TypeVar("R")


def no_number(owner: str, name: str, value: object, unit: str = "") -> ParameterError:
    """The error that names an argument, its value and the remedy.

    Parameters
    ----------
    owner : str
        The function, law or thing whose argument it is.
    name : str
    value : object
    unit : str
        Empty where it is not known.
    """
    shown = repr(value)
    shown = shown if len(shown) <= 60 else f"{shown[:57]}..."
    said = f"{owner}: {name} = {shown} must be a number{f' in {unit}' if unit else ''}"
    if isinstance(value, str) and says_number(value):
        said += f"; write it without quotes, {value.strip()}"
    return ParameterError(said)


def is_number(value: object) -> bool:
    """Whether it may stand for a number: what has a value as a float, but no text."""
    return hasattr(value, "__float__") and not isinstance(value, (str, bytes))


def says_number(text: str) -> bool:
    """Whether a text says a number, of a file or in a number's place."""
    try:
        float(text)
    except ValueError:
        return False
    return True


def insist_on_numbers(owner: str, annotations: Mapping[str, Any], given: Mapping[str, Any]) -> None:
    """Refuse what is no number where the annotation says one.

    Parameters
    ----------
    owner : str
        As messages call it.
    annotations : mapping of str to str
        By name; those that say no number are left alone.
    given : mapping of str to object

    Raises
    ------
    ParameterError
    """
    for name, value in given.items():
        annotation = annotations.get(name)
        if annotation is not None:
            _insist(owner, name, str(annotation), value)


def insist_on_own(thing: object, owner: str) -> None:
    """As `insist_on_numbers`, of the fields of a dataclass, inherited ones too; NumPy's numbers become Python's."""
    kind = type(thing)
    for name, annotation in _fields(kind):
        value = getattr(thing, name)
        if type(value) is float or type(value) is int:
            continue
        _insist(owner, name, annotation, value)
        if not isinstance(value, (int, float)) and _parts(annotation) <= NUMBERS:
            # Of less precision, it would make everything that is computed with it so.
            object.__setattr__(thing, name, float(value))


def numbers_checked(function: Callable[P, R]) -> Callable[P, R]:
    """A function that refuses what is no number where it is annotated as one, under the function's name."""
    parameters = inspect.signature(function).parameters.values()
    annotations = {p.name: p.annotation for p in parameters}
    others = next((p.annotation for p in parameters if p.kind is p.VAR_KEYWORD), None)
    positional = [p.name for p in parameters if p.kind is p.POSITIONAL_OR_KEYWORD]
    name = getattr(function, "__name__", "")

    @functools.wraps(function)
    def checked(*args: P.args, **kwargs: P.kwargs) -> R:
        for own, value in (*zip(positional, args), *kwargs.items()):
            annotation = annotations.get(own, others)
            if annotation is not None:
                _insist(name, own, str(annotation), value)
        return function(*args, **kwargs)

    return checked


def _insist(owner: str, name: str, annotation: str, value: Any) -> None:
    parts = _parts(annotation)
    if value is None and "None" in parts:
        return
    if parts & NUMBERS and (parts <= {"None", *NUMBERS} or (isinstance(value, str) and "str" not in parts)):
        if not is_number(value):
            raise no_number(owner, name, value)
    elif isinstance(value, str) and parts & NAMES and "str" not in parts:
        # Each of its letters would be taken for a name.
        raise ParameterError(f"{owner}: {name} = {value!r} must be a list of names; write [{value!r}]")
    elif NAMED in parts and isinstance(value, Mapping):
        for key, number in cast("Mapping[str, Any]", value).items():
            if not is_number(number):
                raise no_number(owner, f"{name}[{key!r}]", number)
    elif PAIR in parts and isinstance(value, (tuple, list)):
        for i, number in enumerate(cast("tuple[Any, ...]", value)):
            if not is_number(number):
                raise no_number(owner, f"{name}[{i}]", number)


@functools.cache
def _fields(kind: type[Any]) -> tuple[tuple[str, str], ...]:
    """Names and annotations of a dataclass's fields."""
    of = {
        name: str(said) for k in reversed(kind.__mro__) for name, said in inspect.get_annotations(k).items()
    }
    return tuple((f.name, of[f.name]) for f in dataclasses.fields(kind))


@functools.cache
def _parts(annotation: str) -> set[str]:
    """What an annotation allows, one by one."""
    return {part.strip() for part in annotation.split("|")}
