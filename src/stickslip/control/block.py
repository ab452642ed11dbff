"""A control law with its parameters, and the friction law that it holds: what a controller is made of."""

from __future__ import annotations

import functools
from collections import namedtuple
from collections.abc import Callable, Mapping
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

from stickslip.control.read_law import read
from stickslip.control.registry import control_law
from stickslip.core.arguments import arguments_checked
from stickslip.core.control_spec import ControlLaw
from stickslip.core.errors import ParameterError
from stickslip.core.reprs import call_of
from stickslip.core.spec import Field, Law
from stickslip.models.model import Model

HELD = "friction"
"""The part of a block's state and parameters that is the friction law's."""


class ControlBlock:
    """A control law with its parameters.

    Parameters
    ----------
    law : str or ControlLaw
        A registered name, the path of a control law's file, or a control law.
    friction : Model, optional
        The friction law that it holds, where it needs one.
    choices : mapping, optional
        Options of the law by name, ``{"anti_windup": "back_calculation"}``.
    **parameters
        The law's parameters in SI units.

    Raises
    ------
    UnknownName, ParameterError, LawError
        One line that names the thing, its value and the remedy.

    Notes
    -----
    A control law of one's own is a file: ``stickslip law --template control > my_loop.py`` writes a complete one,
    ``ControlBlock("my_loop.py", kp=6.0, kd=0.1, corner=600.0)`` takes it, and ``stickslip law my_loop.py --check``
    tries it. In short::

        from typing import Annotated, NamedTuple
        from stickslip import ControlLaw, Par

        class Params(NamedTuple):
            kp: Annotated[float, Par("N·m/rad", "k_p", "gain", lower=0.0)]
            kd: Annotated[float, Par("N·m·s/rad", "k_d", "gain", lower=0.0)]

        def sample(y, z, p, u):
            return p.kp * y.error + p.kd * (y.reference_velocity - y.velocity)

        CONTROL_LAW = ControlLaw(
            "my_loop", Params, sample, "loop", title="PD", equation="T = k_p e + k_d e'", source=(),
            example={"kp": 6.0, "kd": 0.1},
        )

    The signals ``y``, and what else a law may have: ``help("stickslip.core.control_spec")``, and
    docs/howto/own_control_law.md in the source of the package.
    """

    __slots__ = ("friction", "law", "parameters")

    @arguments_checked
    def __init__(
        self,
        law: str | ControlLaw,
        friction: Model | None = None,
        choices: Mapping[str, str] | None = None,
        **parameters: Any,
    ) -> None:
        found = control_law(law) if isinstance(law, str) else law
        self.law: ControlLaw = read(found.having(**choices) if choices else found)
        if self.law.holds_friction and friction is None:
            raise ParameterError(f"{self.law.name}: needs a friction law; give friction=Model(...)")
        if friction is not None and not self.law.holds_friction:
            raise ParameterError(f"{self.law.name}: takes no friction law; leave friction out")
        if friction is not None and self.law.reads_steady and friction.law.steady is None:
            raise ParameterError(
                f"{self.law.name}: friction law {friction.law.name!r} has no torque at constant velocity; "
                "give one with `steady`"
            )
        self.friction = friction
        own = self.law.parameters(parameters)
        held = (friction.parameters,) if friction else ()
        self.parameters: Any = parameters_of((*own._fields, *(HELD for _ in held)))(*own, *held)

    # ---- what a composition reads ----------------------------------------------------------------------

    @property
    def fields(self) -> tuple[Field, ...]:
        """Parameters, those of the friction law under their whole names."""
        return fields_in(self.law, self.friction.law if self.friction else None)

    @property
    def state_fields(self) -> tuple[Field, ...]:
        """As `fields`, of the state."""
        return state_fields_in(self.law, self.friction.law if self.friction else None)

    @property
    def parts(self) -> tuple[str, ...]:
        """What the names of the fields of its parts begin with."""
        return (f"{HELD}_",) if self.friction else ()

    def state(self) -> SimpleNamespace:
        """The state at the start, everything zero."""
        z = self.law.state(self.law.Parameters(*self.parameters[: len(self.law.fields)]))
        if self.friction:
            setattr(z, HELD, self.friction.law.state(self.friction.parameters))
        return z

    @arguments_checked
    def function(self, name: str) -> Any:
        """The law's function of that name with the friction law in its place; None where it has none."""
        own = getattr(self.law, name, None)
        return self.law.holding(name, self.friction.law) if own and self.friction else own

    @property
    def own(self) -> dict[str, Any]:
        """The law's own parameters by name."""
        return {f.name: getattr(self.parameters, f.name) for f in self.law.fields}

    @arguments_checked
    def with_values(self, values: Mapping[str, Any], friction: Mapping[str, Any]) -> ControlBlock:
        """The block with other `values` of its own parameters, and of those of the `friction` law that it holds."""
        held = self.friction
        if held is not None and friction:
            held = Model(held.law, **{**held.parameters._asdict(), **friction})
        return ControlBlock(self.law, held, **{**self.own, **values})

    @arguments_checked
    def holding(self, change: Callable[[Model], Model]) -> ControlBlock:
        """The block whose friction law is what `change` makes of it."""
        return ControlBlock(self.law, change(self.friction), **self.own) if self.friction else self

    # ---- for people --------------------------------------------------------------------------------------

    def as_dict(self) -> dict[str, Any]:
        """Law, choices and parameters as plain data."""
        held = {HELD: self.friction.as_dict()} if self.friction else {}
        return {"law": self.law.name, **dict(self.law.chosen), **self.own, **held}

    def __repr__(self) -> str:
        held = [("friction", self.friction)] if self.friction else []
        chosen = [("choices", dict(self.law.chosen))] if self.law.chosen else []
        return call_of("ControlBlock", [self.law.called], [*held, *chosen, *self.own.items()])

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, ControlBlock):
            return NotImplemented
        return (self.law, self.friction, self.parameters) == (other.law, other.friction, other.parameters)

    def __hash__(self) -> int:
        return hash((self.law, self.friction, self.parameters))

    def __reduce__(self) -> tuple[Callable[..., Any], tuple[Any, ...]]:
        return _block, (self.law, self.friction, self.own)


def _block(law: ControlLaw, friction: Model | None, values: Mapping[str, Any]) -> ControlBlock:
    """A block as a pickle says it."""
    return ControlBlock(law, friction, **values)


@functools.cache
def parameters_of(names: tuple[str, ...]) -> Any:
    """The type of a block's parameters: made once, as it takes longer than all the rest of a block."""
    kind: Any = namedtuple("Parameters", names)  # type: ignore[reportUntypedNamedTuple]

    def reduced(p: tuple[Any, ...]) -> tuple[Callable[..., Any], tuple[Any, ...]]:
        return _parameters, (names, tuple(p))

    kind.__reduce__ = reduced
    return kind


def _parameters(names: tuple[str, ...], values: tuple[Any, ...]) -> Any:
    """A block's parameters as a pickle says them."""
    return parameters_of(names)(*values)


@functools.lru_cache(maxsize=1024)
def fields_in(law: ControlLaw, held: Law | None) -> tuple[Field, ...]:
    """Parameters of a control law and of the friction law that it holds, these under their whole names."""
    return (*law.fields, *within(HELD, held.fields if held else ()))


@functools.lru_cache(maxsize=1024)
def state_fields_in(law: ControlLaw, held: Law | None) -> tuple[Field, ...]:
    """As `fields_in`, of the state."""
    return (*law.state_fields, *within(HELD, held.state_fields if held else ()))


def within(part: str, fields: tuple[Field, ...]) -> tuple[Field, ...]:
    """Fields of a part under their names in the whole; what they have a value per is told apart too."""
    return tuple(
        replace(
            f,
            name=f"{part}_{f.name}",
            par=replace(f.par, per=f"{part}_{f.par.per}"),
            like=f"{part}_{f.like}" if f.like else "",
        )
        for f in fields
    )
