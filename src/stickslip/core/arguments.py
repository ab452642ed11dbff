"""Arguments of a wild kind are refused where they are given: one line with function, argument, value and remedy.

Annotations say what an argument must be (`stickslip.core.type_rules`): what is no number, text such as "0.1" above all,
no text, path, function, list or mapping, no `Model`, or none of the words of a ``Literal`` does not get in.
"""

from __future__ import annotations

import dataclasses
import functools
import inspect
import reprlib
import sys
from collections.abc import Callable, Mapping, Sequence
from itertools import chain, repeat
from typing import Any, ParamSpec, TypeVar, cast

from stickslip.core.errors import (
    BEYOND,
    InputError,
    ParameterError,
    StickslipError,
    UnknownName,
    beyond,
    one_line,
)
from stickslip.core.messages import SIGNALS, render
from stickslip.core.type_rules import Rule, Wrong, rule_of

EXAMPLES = {
    "initial": "(0.0, 0.0), position (rad) and velocity (rad/s)",
    "leave_out": "[(1, 500), 'spikes']", "loop": "{'kp': 8.0, 'kd': 0.08}", "map": "{'position': 'q_deg:deg'}",
    "rows": "(2001, 8000)", "units": "{'position': 'deg', 'torque': 'mNm'}", "values": "{'fc': 0.3}",
}  # fmt: skip
"""How arguments of several parts are written."""
SIGNAL = "ArrayLike"
"""Annotation of what readers look at themselves."""

P = ParamSpec("P")
R = TypeVar("R")
T = TypeVar("T")


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
    return refusal(owner, name, Wrong("", value, f"a number{f' in {unit}' if unit else ''}"))


def refusal(owner: str, name: str, wrong: Wrong, lists: bool = False) -> ParameterError:
    """As `no_number`, of anything; `lists`: a list of names would do."""
    place, value, words = wrong
    shown = shown_value(value)
    said = f"{owner}: {name}{place} = {shown} must be {words}"
    if isinstance(value, str) and says_number(value) and words.startswith(("a number", "a whole number")):
        said += f"; write it without quotes, {value.strip()}"
    elif type(value) is int and words.startswith(("a number", "a whole number")):
        said += "; it is too large"
    elif isinstance(value, str) and lists and not place:
        # Each of its letters would be taken for a name.
        said += f"; write [{shown}]"
    elif name in EXAMPLES and not place:
        said += f", such as {EXAMPLES[name]}"
    return ParameterError(said)


def shown_value(value: object) -> str:
    """Return a value as messages show it: in one line of at most 60 characters, whatever it contains."""
    try:
        shown = " ".join(repr(value).split())
    except Exception:  # nested too deeply, too many digits, or a class whose repr fails
        shown = " ".join(reprlib.repr(value).split())
    return shown if len(shown) <= 60 else f"{shown[:57]}..."


def says_number(text: str) -> bool:
    """Whether a text says a number, of a file or in a number's place."""
    try:
        float(text)
    except ValueError:
        return False
    return True


def insist_on(owner: str, rules: Mapping[str, Rule], given: Mapping[str, Any]) -> None:
    """Refuse what is not what it must be.

    Parameters
    ----------
    owner : str
        As messages call it.
    rules : mapping of str to Rule
        By name (`rules_in`); what has none is left alone.
    given : mapping of str to object

    Raises
    ------
    ParameterError
    """
    for name, value in given.items():
        rule = rules.get(name)
        if rule is not None and type(value) not in rule.quick:
            insist(owner, name, rule, value)


def insist(owner: str, name: str, rule: Rule, value: Any) -> None:
    """As `insist_on`, of one."""
    try:
        wrong = rule.wrong(value)
    except BEYOND:
        raise
    except Exception:  # the object's own methods fail
        wrong = Wrong("", value, rule.words)
    if wrong is not None:
        raise refusal(owner, name, wrong, rule.lists)


def insist_on_own(thing: object, owner: str) -> None:
    """As `insist_on`, of the fields of a dataclass, inherited ones too; NumPy's numbers become Python's."""
    for name, rule in _fields(type(thing)):
        value = getattr(thing, name)
        if type(value) in rule.quick:
            continue
        insist(owner, name, rule, value)
        if rule.make is float and not isinstance(value, (int, float)):
            # Of less precision, it would make everything that is computed with it so.
            object.__setattr__(thing, name, float(value))
        elif rule.make is int and value is not None:
            object.__setattr__(thing, name, int(value))


def constructor_checked(kind: type[T]) -> type[T]:
    """A class, a named tuple's too, whose constructor is `arguments_checked`."""
    name = "__new__" if tuple in kind.__mro__ else "__init__"
    setattr(kind, name, arguments_checked(getattr(kind, name), kind.__module__))
    return kind


def constructor_named(kind: type[T]) -> type[T]:
    """A class whose constructor says in a line what is missing or unknown; kinds of its values it looks at itself."""
    inner: Any = vars(kind)["__init__"]
    signature = inspect.signature(inner)
    names = [name for name in signature.parameters if name != "self"]

    @functools.wraps(inner)
    def checked(self: Any, *args: Any, **kwargs: Any) -> None:
        try:
            inner(self, *args, **kwargs)
        except TypeError:
            refuse_call(kind.__name__, names, signature, (self, *args), kwargs)
            raise

    name = "__init__"
    setattr(kind, name, checked)
    return kind


def refuse_call(
    owner: str, names: Sequence[str], signature: inspect.Signature, args: Sequence[Any], kwargs: Mapping[str, Any],
) -> None:  # fmt: skip
    """Refuse a call without what must be given, with too much, or with what there is none of; else return.

    Raises
    ------
    UnknownName, ParameterError
    """
    try:
        signature.bind(*args, **kwargs)
    except TypeError as error:
        for name in kwargs:
            if name not in signature.parameters:
                raise unknown_argument(owner, name, names) from None
        ordered = sorted(names, key=[*signature.parameters, *names].index)
        raise ParameterError(f"{owner}: {error}; its arguments are {', '.join(ordered)}") from None


def unknown_argument(owner: str, name: str, names: Sequence[str]) -> UnknownName:
    """The error that names what is meant: a channel's name stands for the argument of its signal."""
    return UnknownName(f"argument of {owner}", name, names, meant=SIGNALS.get(name, ""))


def arguments_checked(function: Callable[P, R], module: str = "") -> Callable[P, R]:
    """A function that refuses what its annotations do not allow.

    Where a whole number is annotated, 2.0 becomes 2. `module` has the names of the annotations; the function's own, if
    none is given.
    """
    signature = inspect.signature(function)
    parameters = signature.parameters.values()
    positional = [p.name for p in parameters if p.kind in (p.POSITIONAL_ONLY, p.POSITIONAL_OR_KEYWORD)]
    several = next((p.name for p in parameters if p.kind is p.VAR_POSITIONAL), "")
    owner = getattr(function, "__qualname__", "").removesuffix(".__init__").removesuffix(".__new__")
    accepted = functools.cache(lambda: Accepted.by(function, signature, owner, module))

    @functools.wraps(function)
    def checked(*args: P.args, **kwargs: P.kwargs) -> R:
        takes = accepted()
        rules = takes.rules
        made: dict[str | int, int] = {}
        try:
            for i, (own, value) in enumerate(zip(chain(positional, repeat(several)), args)):
                rule = rules.get(own)
                if rule is not None and type(value) not in rule.quick:
                    insist(owner, own, rule, value)
                    if rule.make is int and value is not None:
                        made[i] = int(cast("Any", value))
            for own, value in kwargs.items():
                rule = rules.get(own, takes.others)
                if rule is not None and type(value) not in rule.quick:
                    insist(owner, own, rule, value)
                    if rule.make is int and value is not None:
                        made[own] = int(cast("Any", value))
                elif takes.closed and own not in takes.names:
                    raise unknown_argument(owner, own, takes.listed)
            if made:
                call: Any = function
                return call(
                    *(made.get(i, x) for i, x in enumerate(args)),
                    **{n: made.get(n, x) for n, x in kwargs.items()},
                )
            return function(*args, **kwargs)
        except TypeError:
            refuse_call(owner, takes.listed, signature, args, kwargs)
            raise
        except StickslipError as error:
            words = one_line(render(error.message, arrays=not takes.signals.isdisjoint(kwargs)))
            error.args = (words, *error.args[1:])
            raise
        except BEYOND as error:
            if isinstance(error, OSError) and error.filename is None:
                raise  # of a device or a pipe of the caller's, not of a path that was given
            raise InputError(f"{owner}: {beyond(error)}") from error

    return checked


@dataclasses.dataclass(frozen=True)
class Accepted:
    """What a function takes.

    Attributes
    ----------
    owner : str
        Its name.
    rules : mapping of str to Rule
        By argument.
    others : Rule or None
        Of arguments under names of the caller's own.
    names, signals : frozenset of str
        Every argument; those of them that are signals in arrays.
    closed : bool
        Whether there are no others.
    """

    owner: str
    rules: Mapping[str, Rule]
    others: Rule | None
    names: frozenset[str]
    signals: frozenset[str]
    closed: bool

    @classmethod
    def by(
        cls, function: Callable[..., Any], signature: inspect.Signature, owner: str, module: str
    ) -> Accepted:
        """By a function's annotations; those of a ``**options: Unpack[Options]`` are its own."""
        said = {n: p.annotation for n, p in signature.parameters.items()}
        last = next((n for n, p in signature.parameters.items() if p.kind is p.VAR_KEYWORD), "")
        own: dict[str, Any] = getattr(inspect.unwrap(function), "__globals__", {})
        scope = vars(sys.modules[module]) if module else own
        more, rest = "", said.pop(last, "")
        if str(rest).startswith("Unpack["):
            options: Any = scope[str(rest)[len("Unpack[") : -1]]
            scope = {**scope, **vars(sys.modules[options.__module__])}
            said, last = {**said, **written(options)}, ""
        elif last:
            more = rest
        others = rules_in({last: more}, scope).get(last) if last else None
        signals = frozenset(n for n, a in said.items() if getattr(a, "__forward_arg__", a) == SIGNAL)
        return cls(owner, rules_in(said, scope), others, frozenset(said), signals, not last)

    @property
    def listed(self) -> list[str]:
        """Names of arguments, without what a method is called on."""
        return sorted(self.names - {"self", "cls", "_cls"})


def written(kind: Any) -> dict[str, Any]:
    """Annotations of a class itself, as they are written."""
    return dict(inspect.get_annotations(kind))


def rules_in(annotations: Mapping[str, Any], scope: Mapping[str, Any]) -> dict[str, Rule]:
    """Rules of annotations whose names `scope` has; what type checkers alone import has none."""
    out: dict[str, Rule] = {}
    for name, annotation in annotations.items():
        said: Any = getattr(annotation, "__forward_arg__", annotation)
        if said in (SIGNAL, inspect.Parameter.empty):
            continue
        try:
            hint = eval(said, dict(scope)) if isinstance(said, str) else said
        except NameError:
            continue
        if (rule := rule_of(hint)) is not None:
            out[name] = rule
    return out


@functools.cache
def _fields(kind: type[Any]) -> tuple[tuple[str, Rule], ...]:
    """Rules of a dataclass's fields that its constructor takes."""
    rules: dict[str, Rule] = {}
    for k in reversed(kind.__mro__):
        rules |= rules_in(written(k), vars(sys.modules[k.__module__]))
    return tuple((f.name, rules[f.name]) for f in dataclasses.fields(kind) if f.init and f.name in rules)
