"""The one description of a law: its parameters, its state and its functions.

Everything that reads a law (the engines, the command line, the documentation, identification, export) reads
this description, so that a law is written once, in one file.

Argument order, everywhere: velocity, time step, state ``z``, parameters ``p``, surroundings ``u``.

=====================================  =============================================================
``step(v0, v1, dt, z, p, u)``          torque at the end of a step; advances ``z`` in place. The velocity
                                       runs from ``v0`` to ``v1`` (linearly). Stable for any ``dt``; with
                                       ``dt = 0`` the torque now, the state as it was
``sampled(v0, v1, dt, z, p, u)``       `step` as controllers take it, where that differs: their velocity may jump
                                       from one sample to the next (``v0 = v1``, held)
``rate(v, z, p, u, dz)``               torque now; writes the time derivative of every state but the modes
``guards(v, z, p, u, g)``              writes one value per mode; a mode is left when its value rises to zero
``switch(v, z, p, u, g)``              changes the modes whose value in ``g`` is not negative
``steady(v, p)``                       torque at constant velocity; 0 at rest unless declared otherwise
``holding(direction, z, p, u)``        the largest torque a contact at rest withstands in that direction
                                       (laws whose torque jumps at zero velocity)
``rest_band(p)``                       velocity below which a contact that withstands torque counts as at rest
                                       (Karnopp)
``check(p)``                           a sentence that says what is wrong with the parameters, or ""
``modes(p)``                           the law as `Elements` that stick as springs and slip along one curve, or as
                                       a `Bristle` (what the located flows run on), or None
``growth(y, limit, p)``                dy/dx of a bristle's deflection in the direction of motion, whose steady value
                                       is ``limit``, where it is not 1 - y/limit (see `Bristle`)
``stored(z, p)``                       energy that the contact could give back, J, where it is defined: the
                                       work done on it less the rise of this is dissipated, never negative
                                       where the law is passive
=====================================  =============================================================

All but `check` and `modes` are written in the scalar subset (see `stickslip.subset`): they run as plain Python, are
compiled by numba and exported to C, from the same lines. Friction torque is positive when it opposes positive
velocity, as in J dv/dt = T_m - T_f (thesis eq. 3.1).
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from dataclasses import fields as dataclass_fields
from typing import Any, ClassVar

from stickslip.core.arguments import constructor_named, insist_on_own
from stickslip.core.configurable import Configurable, Described
from stickslip.core.description import (
    Bristle,
    Choice,
    Elements,
    Field,
    Kept,
    Learned,
    Memory,
    Mode,
    Option,
    Par,
    Surroundings,
    fields_of,
    packed,
)
from stickslip.core.rebinding import bound, distinct, first_complaint, least, wrapped

__all__ = [
    "Bristle",
    "Choice",
    "Configurable",
    "Described",
    "Elements",
    "Field",
    "Kept",
    "Law",
    "Learned",
    "Memory",
    "Mode",
    "Option",
    "Par",
    "ReferenceKind",
    "Surroundings",
    "fields_of",
    "packed",
]


COMPILED = ("step", "sampled", "rate", "guards", "switch", "steady", "holding", "growth", "stored")
"""A law's functions that are written in the scalar subset, but for those that its options replace."""
FUNCTIONS = (*COMPILED, "check", "modes", "velocity_scale", "rest_band", "is_passive")
"""All of them; they may call the chosen options."""


@dataclass(frozen=True, eq=False)
class ReferenceKind(Described):
    """A kind of reference motion.

    Attributes
    ----------
    profile : callable
        ``profile(t, p, out)`` writes ``out.position``, ``out.velocity`` and ``out.acceleration`` at time t,
        in the scalar subset. At a jump it writes what comes behind: a sampled controller reads the motion at its
        samples' times exactly, as ``Reference.sample`` gives it.
    breaks : callable
        ``breaks(p, duration)``: times inside (0, duration) where the motion is not smooth or its velocity
        passes through zero; integrators step onto them.
    """

    name: str
    Params: type
    profile: Callable[..., None]
    breaks: Callable[[Any, float], Sequence[float]]
    title: str
    equation: str
    check: Callable[[Any], str] | None = None
    fields: tuple[Field, ...] = field(init=False)
    Parameters: Any = field(init=False)

    def __post_init__(self) -> None:
        insist_on_own(self, "reference")
        object.__setattr__(self, "fields", fields_of(self.Params))
        object.__setattr__(self, "Parameters", self.Params)


@constructor_named
@dataclass(frozen=True, eq=False, repr=False)
class Law(Configurable):
    """A friction law (``help("stickslip.core.spec")`` has its functions and their arguments).

    ``stickslip law --template friction`` prints a complete file of one; ``Model("my_law.py", fc=0.3)`` takes it, and
    ``stickslip law my_law.py --check`` tries it. In short::

        from typing import Annotated, NamedTuple
        from stickslip import Law, Par

        class Params(NamedTuple):
            c: Annotated[float, Par("N·m·s/rad", "c", "viscous friction coefficient", positive=True)]

        def step(v0, v1, dt, z, p, u):
            return p.c * v1

        LAW = Law(
            "my_law", Params, step, title="Viscous friction", equation="F = c v", source=(), example={"c": 0.02}
        )

    More is in docs/howto/own_law.md and CONTRIBUTING.md in the source of the package.

    Attributes
    ----------
    name, title : str
        The name by which people and files call it; its name in words.
    Params : type
        A NamedTuple with ``Annotated[float, Par(...)]`` or, for a value per element,
        ``Annotated[tuple[float, ...], Par(...)]`` fields. Fields of the chosen options are added to them.
    State : type or None
        As ``Params``, for the internal state.
    step, sampled, rate, guards, switch, steady, holding, check, modes, growth, stored, rest_band : callable or None
        Its functions; only ``step`` must be there.
    variants : dict
        Laws that `having` has made of it; not for callers.
    equation, source : str
        Its equation in LaTeX; thesis equation numbers and keys of ``references.bib``.
    example : mapping
        Parameters of a real contact, for pictures, documentation and the contract tests.
    odd : bool
        The opposite motion gives the opposite torque. A declaration, as the five below: the contract tests hold
        the law to each, and show a counterexample where it declares otherwise.
    passive : str
        "always", "never", or the condition under which it only dissipates, tested by `is_passive` (and by the
        options of its choices, see `dissipates`); empty: not stated.
    rate_independent : bool
        Without its viscous part (sigma2 = 0) the torque depends on the path, not on the pace.
    non_local_memory : bool
        Inner loops of the pre-sliding hysteresis close, and the outer curve is resumed where it was left.
    continuous : bool
        The torque is continuous in time while the velocity is.
    velocity_scale : callable or None
        ``velocity_scale(p)``: a velocity over which the torque changes much; steps near rest stay below it.
    """

    kind: ClassVar[str] = "law"
    name: str
    Params: type
    step: Callable[..., float]
    title: str
    equation: str
    source: tuple[str, ...]
    example: Mapping[str, Any]
    State: type | None = None
    sampled: Callable[..., float] | None = None
    rate: Callable[..., float] | None = None
    guards: Callable[..., None] | None = None
    switch: Callable[..., None] | None = None
    steady: Callable[..., float] | None = None
    holding: Callable[..., float] | None = None
    check: Callable[[Any], str] | None = None
    modes: Callable[[Any], Elements | Bristle | None] | None = None
    growth: Callable[..., float] | None = None
    stored: Callable[..., float] | None = None
    velocity_scale: Callable[[Any], float] | None = None
    rest_band: Callable[[Any], float] | None = None
    choices: tuple[Choice, ...] = ()
    odd: bool = True
    passive: str = ""
    is_passive: Callable[[Any], bool] | None = None
    rate_independent: bool = False
    non_local_memory: bool = False
    continuous: bool = True
    chosen: Mapping[str, str] = field(default_factory=dict[str, str])
    variants: dict[tuple[tuple[str, str], ...], Any] = field(default_factory=dict[Any, Any], repr=False)
    """Laws made from this one by `having`; shared with them, so that each exists (and is compiled) once."""

    def __post_init__(self) -> None:
        insist_on_own(self, "law")
        written = {f.name: getattr(self, f.name) for f in dataclass_fields(self) if f.init}
        chosen = [self.option(choice) for choice in self.choices]
        fields = self.option_fields(self.Params)
        for ending in (o.doubles for o in chosen if o.doubles):
            fields.update(
                {(twin := f.twin(ending)).name: twin for f in [*fields.values()] if f.par.directional}
            )
        scope = self.option_scope()
        parts: dict[str, Any] = {
            "written": written,
            "fields": tuple(fields.values()),
            "state_fields": fields_of(self.State),
            "Parameters": self.parameters_kind(fields),
            "example": self.option_examples(self.example, fields),
            **{name: bound(getattr(self, name), scope) for name in FUNCTIONS},
        }
        for name, joined in (("check", first_complaint), ("velocity_scale", least)):
            parts[name] = joined([f for f in (parts[name], *(getattr(o, name) for o in chosen)) if f])
        for wraps in distinct([o.wraps for o in chosen]):
            if parts["sampled"] and "step" in wraps:
                parts["sampled"] = wrapped("step", parts["sampled"], wraps["step"], scope)
            parts.update({n: wrapped(n, parts[n], w, scope) for n, w in wraps.items() if parts.get(n)})
        if not all(o.keeps_elements for o in chosen):
            parts["modes"] = None
        if any(o.doubles for o in chosen):
            parts["odd"] = False
        for name, part in parts.items():
            object.__setattr__(self, name, part)
        self.insist_on_lists()
        self.try_example()

    written: Mapping[str, Any] = field(init=False, repr=False)
    """What the law's file says, before any option changed it."""
    fields: tuple[Field, ...] = field(init=False)
    state_fields: tuple[Field, ...] = field(init=False)
    Parameters: Any = field(init=False)

    # ---- declarations --------------------------------------------------------------------------------

    def remark(self, p: Any) -> str:
        """What is allowed in the parameters `p` but seldom meant, in a sentence; "" where there is nothing."""
        said = [found for c in self.choices if (o := self.option(c)).remark and (found := o.remark(p))]
        return f"{self.name}: {'; '.join(said)}" if said else ""

    @functools.cached_property
    def reads_surroundings(self) -> bool:
        """Whether the torque depends on position, load, temperature or time."""
        return any(self.option(choice).reads_surroundings for choice in self.choices)

    def dissipates(self, p: Any) -> bool:
        """Whether the law, with its chosen options, is declared passive with the parameters `p`."""
        if self.passive in ("", "never") or not all(self.option(c).passive for c in self.choices):
            return False
        return self.is_passive is None or self.is_passive(p)

    def mode_mask(self, p: Any) -> list[bool]:
        """Which entries of the flat state are modes."""
        n = self.elements_in(p)
        scalars = [isinstance(f.par, Mode) for f in self.state_fields if not f.per_element]
        blocks = [isinstance(f.par, Mode) for f in self.state_fields if f.per_element for _ in range(n)]
        return scalars + blocks
