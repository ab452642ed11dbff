"""What a target is: a name, a function that writes files, and a check that runs where its tool is installed."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

from stickslip.core.errors import InputError, UnknownName
from stickslip.core.messages import name_option, name_setting
from stickslip.exports.job import Check, Export, Job
from stickslip.exports.nearest import Form

ANY_LAW = "any law, as it is"


@dataclass(frozen=True)
class Setting:
    """What only one target asks for: a joint's name, a drive's rated torque.

    Attributes
    ----------
    default : str or float or None
        Text where the value is text. None: a number that must be given.
    meaning : str
        With the unit of a number.
    lower, upper : float
        Bounds of a number, included.
    """

    name: str
    default: str | float | None
    meaning: str
    lower: float = -math.inf
    upper: float = math.inf

    def checked(self, value: str | float) -> str | float:
        """The value as the target reads it.

        Raises
        ------
        InputError
        """
        if isinstance(self.default, str):
            if not str(value).isprintable() or not str(value):
                raise InputError(
                    f"{name_setting(self.name, f'{value!r}')}: give printable text ({self.meaning})"
                )
            return str(value)
        try:
            number = float(value)
        except ValueError:
            raise InputError(f"{name_setting(self.name, value)}: give a number ({self.meaning})") from None
        if not (math.isfinite(number) and self.lower <= number <= self.upper):
            raise InputError(
                f"{name_setting(self.name, value)}: give a number from {self.lower:g} to {self.upper:g} "
                f"({self.meaning})"
            )
        return number


@dataclass(frozen=True)
class Target:
    """A language or tool to which a law can be exported.

    Attributes
    ----------
    name, title : str
    write : callable
        ``write(job) -> Export``; raises `CannotCarry` where it has no room for a part of the model.
    check : callable or None
        ``check(job, export) -> Check``: run the export in its tool against the golden vectors.
    precision : bool
        Whether it heeds ``Job.single``.
    forms : tuple of Form
        The laws that it has room for, the simplest first; empty where it carries any.
    settings : tuple of Setting
        What it asks for besides the model (``--set NAME=VALUE``).
    around : str
        Where a law that depends on its surroundings finds them; what stands still is named.
    tried : str
        In what its output was tried.
    reserved : frozenset of str
        Words that no export may have as its name: those of the language, and files that its own would hide.
    """

    name: str
    title: str
    write: Callable[[Job], Export]
    check: Callable[[Job, Export], Check] | None = None
    precision: bool = False
    forms: tuple[Form, ...] = ()
    settings: tuple[Setting, ...] = ()
    around: str = ""
    tried: str = ""
    reserved: frozenset[str] = frozenset()

    def insist_on_name(self, name: str) -> None:
        """Refuse a name that stands for something else in the target's language.

        Raises
        ------
        InputError
        """
        if name in self.reserved:
            raise InputError(
                f"{name_option('name', name)}: the word, or a file of that name, is taken in {self.name}; give "
                "another name, such as "
                f"{name}_friction"
            )

    def name_like(self, name: str) -> tuple[str, tuple[str, ...]]:
        """A name that nobody gave, made free where it is taken in the target's language; and the note that says so."""
        if name not in self.reserved:
            return name, ()
        free = f"{name}_friction"
        return free, (
            f"the name is {free}, since {name} is taken in {self.name}; {name_option('name', 'NAME')} "
            "gives another",
        )

    @property
    def carries(self) -> str:
        """What of a model it holds, for people."""
        any_law = f"{ANY_LAW}; {self.around}" if self.around else ANY_LAW
        return " or ".join(form.words for form in self.forms) or any_law


def settings_of(target: Target, given: Mapping[str, str | float]) -> dict[str, str | float]:
    """Every setting of a target, checked.

    Raises
    ------
    UnknownName, InputError
    """
    known = {s.name: s for s in target.settings}
    out: dict[str, str | float] = {}
    for name in given:
        if name not in known:
            raise UnknownName(f"setting of {target.name}", name, known)
    for name, setting in known.items():
        value = given.get(name, setting.default)
        if value is None:
            raise InputError(
                f"{target.name} needs the {setting.meaning}; give it with {name_setting(name, 'VALUE')}"
            )
        out[name] = setting.checked(value)
    return out
