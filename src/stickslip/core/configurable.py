"""What is described by parameters, and what has choices and a state besides: the bases of laws and references."""

from __future__ import annotations

import functools
import types
from collections import namedtuple
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import Any, ClassVar, Self, cast

from stickslip.core.arguments import arguments_checked, no_number
from stickslip.core.description import Choice, Field, Option, fields_of, packed
from stickslip.core.errors import LawError, ParameterError, UnknownName, suggestion
from stickslip.core.pickling import Findable
from stickslip.core.type_rules import is_number


class Described(Findable):
    """Something with a name and described parameters: a law, a reference."""

    name: str
    fields: tuple[Field, ...]
    Parameters: Any
    check: Callable[[Any], str] | None

    def parameters(self, values: Mapping[str, Any]) -> Any:
        """Check `values` and return them as this law's NamedTuple.

        Raises
        ------
        ParameterError
            One line that names the parameter, its value and the bound.
        """
        names = [f.name for f in self.fields]
        for name in values:
            if name not in names:
                raise ParameterError(f"{self.name}: no parameter {name!r}; {self.remedy_for(name)}")
        given = {f.name: values.get(f.name, values.get(f.like, f.par.default)) for f in self.fields}
        checked = {f.name: self._checked(f, given[f.name]) for f in self.fields}
        for per in dict.fromkeys(f.par.per for f in self.fields if f.per_element):
            sizes = {f.name: len(checked[f.name]) for f in self.fields if f.per_element and f.par.per == per}
            if len(set(sizes.values())) > 1:
                listing = ", ".join(f"{name} has {size}" for name, size in sizes.items())
                raise ParameterError(f"{self.name}: every {per} needs a value of each: {listing}")
        p = self.Parameters(**checked)
        complaint = self.check(p) if self.check else ""
        if complaint:
            raise ParameterError(f"{self.name}: {complaint}")
        return p

    def remedy_for(self, name: str, others: Iterable[str] = ()) -> str:
        """Return what to write in place of a parameter that this does not have; `others` are allowed in its place."""
        return suggestion(name, [*(f.name for f in self.fields), *others])

    def _checked(self, f: Field, value: Any) -> Any:
        if value is None:
            raise ParameterError(
                f"{self.name}: parameter {f.name!r} ({f.par.meaning}, {f.par.unit}) is missing"
            )
        if f.per_element:
            # Of an array, or of a data frame's column
            shape = getattr(value, "shape", None)
            if shape is not None and not (len(shape) == 1 and shape[0]):
                raise ParameterError(
                    f"{self.name}: {f.name} has the shape {tuple(shape)}; give one number per {f.par.per}, shape (n,)"
                )
            if shape is not None:
                value = value.tolist() if hasattr(value, "tolist") else list(value)
            if isinstance(value, str) or not isinstance(value, Sequence):
                raise ParameterError(
                    f"{self.name}: {f.name} = {value!r} must be a list, one number per {f.par.per}"
                )
            if not value:
                raise ParameterError(f"{self.name}: {f.name} is empty; give at least one {f.par.per}")
            numbers = cast(Sequence[Any], value)
            return tuple(self._number(f, v, f"{f.name}[{i}]") for i, v in enumerate(numbers))
        return self._number(f, value, f.name)

    def _number(self, f: Field, value: Any, label: str) -> float:
        if not is_number(value):
            raise no_number(self.name, label, value, f.par.unit)
        complaint = f.par.complaint(float(value))
        if complaint:
            unit = "" if f.par.unit == "-" else f" {f.par.unit}"
            raise ParameterError(f"{self.name}: {label} = {value:g}{unit} {complaint}")
        return float(value)

    def elements_in(self, p: Any) -> int:
        """The number of elements in `p` (0 for a law without)."""
        return self.count_in(p, "element")

    def count_in(self, p: Any, per: str) -> int:
        """How many values the parameters with that ``per`` have in `p`."""
        return next((len(getattr(p, f.name)) for f in self.fields if f.per_element and f.par.per == per), 0)

    def pack(self, p: Any) -> list[float]:
        """Return `p` as the flat list that compiled functions read (`packed`)."""
        return packed(self.fields, p)


class Configurable(Described):
    """Something described that has choices and a state: a friction law, a control law."""

    Params: type
    kind: ClassVar[str] = ""
    """What it is called in messages."""
    choices: tuple[Choice, ...]
    chosen: Mapping[str, str]
    variants: dict[tuple[tuple[str, str], ...], Any]
    written: Mapping[str, Any]
    state_fields: tuple[Field, ...]
    example: Mapping[str, Any]

    def __reduce__(self) -> tuple[Callable[..., Any], tuple[Any, ...]]:
        plain = self.variants.get((), self)
        return super().__reduce__() if plain is self else (_with_options, (plain, dict(self.chosen)))

    @property
    def called(self) -> str:
        """What finds it: its name, or the path of its file."""
        plain = self.variants.get((), self)
        return plain.path or plain.name

    def __repr__(self) -> str:
        chosen = "".join(f", {k}={v!r}" for k, v in self.chosen.items())
        return f"{type(self).__name__}({self.name!r}{chosen})"

    def option_fields(self, own: type) -> dict[str, Field]:
        """The fields of a ``Params`` class and of the chosen options, by name; the first of a name holds."""
        fields: dict[str, Field] = {}
        for part in (own, *(self.option(choice).params for choice in self.choices)):
            for f in fields_of(part):
                fields.setdefault(f.name, f)
        return fields

    def parameters_kind(self, names: Iterable[str]) -> Any:
        """The type of this law's parameters; a pickle finds it by the law."""
        make: Any = namedtuple  # whose fields are not known to a type checker
        kind = make(self.Params.__name__, list(names))

        def reduced(p: tuple[Any, ...]) -> tuple[Callable[..., Any], tuple[Any, ...]]:
            return _parameters, (self, tuple(p))

        kind.__reduce__ = reduced
        return kind

    def try_example(self) -> None:
        """Refuse parameters of the example that cannot be.

        Raises
        ------
        ParameterError
        """
        try:
            self.parameters(dict(self.example))
        except ParameterError as error:
            raise ParameterError(f"{error}, in its example") from None

    def insist_on_lists(self) -> None:
        """Refuse a state with a value per element of which no parameter has a list: it would be of no length.

        Raises
        ------
        LawError
        """
        counted = {f.par.per for f in self.fields if f.per_element}
        for f in self.state_fields:
            if f.per_element and f.par.per not in counted:
                raise LawError(
                    f"{self.kind} {self.name!r}: the state {f.name!r} has a value per {f.par.per}, and no parameter "
                    f"tells how many there are; give Params a field Annotated[tuple[float, ...], Par(...)], with "
                    f"one value per {f.par.per}, or write {f.name}_1, {f.name}_2, ... of one value each"
                )

    def option_scope(self) -> dict[str, Any]:
        """What the names that choices replace stand for under the chosen options."""
        scope: dict[str, Any] = {}
        for choice in self.choices:
            option = self.option(choice)
            if option.function:
                scope |= {choice.replaces: option.function, f"{choice.replaces}_scale": option.velocity_scale}
        return scope

    def option_examples(self, own: Mapping[str, Any], fields: Mapping[str, Field]) -> dict[str, Any]:
        """The example of the file with those of the chosen options, as far as they have such a field."""
        examples: dict[str, Any] = {}
        for choice in self.choices:
            examples |= self.option(choice).example
        return {k: v for k, v in {**examples, **own}.items() if k in fields}

    # ---- choices -------------------------------------------------------------------------------------

    def option(self, choice: Choice) -> Option:
        """The option in force for `choice`."""
        return choice.options[self.chosen.get(choice.name, choice.default)]

    def option_of(self, choice: str) -> str:
        """The name of the option in force for a choice; "" where the law has no choice of that name."""
        return self.chosen.get(choice, self._defaults.get(choice, ""))

    def added_fields(self) -> Iterator[tuple[str, str, tuple[Field, ...]]]:
        """Yield every option that is not in force and adds or changes parameters: choice, option, these parameters."""
        for choice in self.choices:
            for name in choice.options:
                fields = tuple(f for f in self.having(**{choice.name: name}).fields if f not in self.fields)
                if fields:
                    yield choice.name, name, fields

    def remedy_for(self, name: str, others: Iterable[str] = ()) -> str:
        """Return what to write in place of a parameter that this does not have: one of an option needs that option."""
        for choice, option, fields in self.added_fields():
            if name in {f.name for f in fields}:
                return f'it needs the choice {choice} = "{option}"'
        return super().remedy_for(name, others)

    @functools.cached_property
    def _defaults(self) -> dict[str, str]:
        """The default options by the names of the choices."""
        return {choice.name: choice.default for choice in self.choices}

    @arguments_checked
    def having(self, **names: str) -> Self:
        """Return this with other options, ``law.having(slip_rule="literal")``; equal options give the same object.

        Parameters
        ----------
        **names : str
            Options by the names of the choices.

        Raises
        ------
        UnknownName
            If it has no such choice, or the choice no such option.
        """
        known = {choice.name: choice for choice in self.choices}
        for name, option in names.items():
            if name not in known:
                all_of = f"Its choices are {', '.join(known)}." if known else ""
                raise UnknownName(f"choice of {self.kind} {self.name!r}:", name, known, further=all_of)
            if option not in known[name].options:
                raise UnknownName(name.replace("_", " "), option, known[name].options)
        wanted = {**self.chosen, **names}.items()
        key = tuple(sorted((name, option) for name, option in wanted if option != self._defaults[name]))
        if not self.chosen:
            self.variants.setdefault((), self)
        if key not in self.variants:
            self.variants.setdefault(key, self._rewritten(chosen=dict(key)))
        return self.variants[key]

    def offering(self, choices: Sequence[Choice]) -> Self:
        """Return this with further choices; those that it has by name stay as they are."""
        own = {choice.name for choice in self.choices}
        more = tuple(choice for choice in choices if choice.name not in own)
        return self._rewritten(choices=self.choices + more, variants={}) if more else self

    def _rewritten(self, **changes: Any) -> Self:
        """This as its file has it, but for `changes`."""
        written: dict[str, Any] = {**self.written, **changes}
        return type(self)(**written)

    # ---- state ---------------------------------------------------------------------------------------

    def state(self, p: Any) -> types.SimpleNamespace:
        """Return the state at rest, everything zero and sticking, for the plain Python functions."""
        sizes = {f.name: self.count_in(p, f.par.per) for f in self.state_fields if f.per_element}
        return types.SimpleNamespace(
            **{f.name: [0.0] * sizes[f.name] if f.per_element else 0.0 for f in self.state_fields}
        )

    def state_size(self, p: Any) -> int:
        """The length of the flat state."""
        return sum(self.count_in(p, f.par.per) if f.per_element else 1 for f in self.state_fields)

    def pack_state(self, z: types.SimpleNamespace) -> list[float]:
        """Return a state `z` as the flat list that compiled functions read."""
        flat = [getattr(z, f.name) for f in self.state_fields if not f.per_element]
        for f in self.state_fields:
            if f.per_element:
                flat.extend(getattr(z, f.name))
        return flat


def _with_options(plain: Configurable, chosen: Mapping[str, str]) -> Configurable:
    """A law with its options, as a pickle says it."""
    return plain.having(**chosen)


def _parameters(law: Configurable, values: tuple[Any, ...]) -> Any:
    """Parameters of a law, as a pickle says them."""
    return law.Parameters(*values)
