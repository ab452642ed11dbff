"""The parts of a description: parameters and states with unit and bounds, choices, elements, surroundings.

`stickslip.core.spec` makes laws, control laws and references of them; it has all of these names too.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Annotated, Any, NamedTuple, get_args, get_origin, get_type_hints

from stickslip.core.arguments import constructor_named, insist_on_own
from stickslip.core.errors import LawError


@constructor_named
@dataclass(frozen=True, slots=True)
class Par:
    """What a number means: its unit, symbol, meaning and bounds (``lower``, ``upper``, included).

    ``positive`` makes the lower bound 0, excluded. A parameter without ``default`` must be given. ``shares`` says
    that the values of all elements add up to 1, ``directional`` that the two directions of motion may have
    different values. A parameter with several values has one per element, or one per whatever else ``per`` names;
    parameters with the same ``per`` have equally many. ``whole`` says that only whole numbers mean anything.
    """

    unit: str
    symbol: str
    meaning: str
    lower: float = -math.inf
    upper: float = math.inf
    positive: bool = False
    default: float | None = None
    shares: bool = False
    directional: bool = False
    per: str = "element"
    whole: bool = False

    def __post_init__(self) -> None:
        insist_on_own(self, "Par")

    def complaint(self, value: float) -> str:
        """Say what is wrong with `value`, or return the empty string."""
        if not math.isfinite(value):
            return "must be a finite number"
        if self.positive and value <= 0.0:
            return "must be greater than 0"
        if value < self.lower:
            return f"must be at least {self.lower:g}"
        if value > self.upper:
            return f"must be at most {self.upper:g}"
        if self.whole and not value.is_integer():
            return "must be a whole number"
        return ""

    @property
    def bounds(self) -> str:
        """The bounds as an interval, for people."""
        low = "(0" if self.positive else (f"[{self.lower:g}" if self.lower > -math.inf else "(-inf")
        high = f"{self.upper:g}]" if self.upper < math.inf else "inf)"
        return f"{low}, {high}"


class Mode(Par):
    """A state that only switches: 0 sticks, +1 or -1 slips in that direction. Its arguments are those of `Par`."""


class Memory(Mode):
    """A record of the past that only steps write: it has no rate, and no integrator corrects it."""


class Learned(Par):
    """A state that was learnt: it outlives a power cycle. Its arguments are those of `Par`."""


class Kept(Learned):
    """A learnt state that says nothing of the machine by itself. Its arguments are those of `Par`."""


class Surroundings(NamedTuple):
    """What a contact depends on besides its velocity (2.1.5 to 2.1.7 of the thesis)."""

    position: float = 0.0
    """rad (or m)"""
    load: float = 1.0
    """normal load over the load at which the parameters hold"""
    temperature: float = 20.0
    """degrees Celsius"""
    time: float = 0.0
    """s, since the start of the run"""
    applied: float = 0.0
    """torque applied to the contact from outside, N·m: what a contact at rest balances (thesis eq. 2.5)"""


@dataclass(frozen=True, slots=True)
class Field:
    """One parameter or state: its name in code, what it means, and whether each element has its own."""

    name: str
    par: Par
    per_element: bool
    like: str = ""
    """The parameter whose value it takes where it is not given."""

    def twin(self, ending: str) -> Field:
        """The same parameter for the other direction of motion."""
        per = self.par.per + (ending if self.par.per != "element" else "")
        par = replace(
            self.par, symbol=f"{self.par.symbol}^-", meaning=f"{self.par.meaning}, for v < 0", per=per
        )
        return Field(self.name + ending, par, self.per_element, self.name)


@dataclass(frozen=True, slots=True)
class Option:
    """One way to fill a `Choice`.

    Attributes
    ----------
    function : callable
        In the scalar subset; takes the place of the name that the choice replaces.
    params : type
        The parameters it brings along, as a law's ``Params``; ``example`` gives values of them.
    check, velocity_scale : callable
        As a law's: a complaint about the parameters, the velocity over which the torque changes much.
    remark : callable
        ``remark(p)``: a sentence on parameters that are allowed but seldom meant, or "".
    passive : bool
        False where the law can give energy back with it.
    doubles : str
        Ending of the names under which every directional parameter is there once more.
    wraps : mapping
        Functions that take the place of the law's own of that name, and call those as ``inner_step`` and so on.
    keeps_elements : bool
        Whether the law still is what its ``modes`` say.
    reads_surroundings : bool
        Whether the torque depends on position, load, temperature or time.
    linear : bool
        False where a control law is not linear with it.
    """

    function: Callable[..., float] | None = None
    params: type | None = None
    passive: bool = True
    example: Mapping[str, Any] = field(default_factory=dict[str, Any])
    check: Callable[[Any], str] | None = None
    remark: Callable[[Any], str] | None = None
    velocity_scale: Callable[[Any], float] | None = None
    doubles: str = ""
    wraps: Mapping[str, Callable[..., Any]] = field(default_factory=dict[str, Any])
    keeps_elements: bool = True
    reads_surroundings: bool = False
    linear: bool = True


@dataclass(frozen=True, slots=True)
class Choice:
    """A part of a law that can be exchanged by name: its sliding curve, its rule from stick to slip.

    ``replaces`` is the name by which the law's functions call it; with ``_scale`` after it, its velocity scale.
    """

    name: str
    replaces: str
    options: Mapping[str, Option]
    default: str
    meaning: str = ""


@dataclass(frozen=True, slots=True)
class Elements:
    """A law as parallel elements: springs while they stick, one common curve s(v) while they slip.

    Element i sticks with dF_i/dt = k_i v up to share_i s(v), and slips with
    dF_i/dt = attraction (share_i sign(v) - F_i / s(v)); thesis eqs. 2.16 to 2.18.

    ``stiffness`` may be infinite (the element holds rigidly: Coulomb, Stribeck), and ``attraction`` may be
    infinite (the slipping force is share_i s(v) at once: Maxwell-slip). ``curve`` tells whether s depends on
    the velocity; where it does not, ``breakaway`` is its value. With a finite ``slope`` rigid elements do not hold at
    rest: the torque is slope v as far as its magnitude stays below that of sliding.
    """

    stiffness: tuple[float, ...]
    share: tuple[float, ...]
    attraction: float
    viscous: float
    breakaway: float
    velocity_scale: float
    constant_curve: bool = False
    slope: float = math.inf


@dataclass(frozen=True, slots=True)
class Bristle:
    """A law as one bristle that bends as a spring and gives way in proportion to the distance slid.

    dF/dt = stiffness (v - |v| F / s(v)); the torque is F + (damping / stiffness) dF/dt + viscous v: LuGre (thesis eqs.
    2.8 and 2.9 with F = sigma_0 z). The other fields are those of `Elements`.

    With ``own_growth`` it gives way by the law's `growth` instead: dF/dt = stiffness v growth(y, limit) with
    y = F sign(v)/stiffness and limit = s(v)/stiffness (Dahl). Up to ``elastic``, N·m, and while F and v differ in sign,
    it only bends (elasto-plastic).
    """

    stiffness: float
    damping: float
    viscous: float
    breakaway: float
    velocity_scale: float
    constant_curve: bool = False
    own_growth: bool = False
    elastic: float = 0.0

    def __post_init__(self) -> None:
        if self.elastic > 0.0 and not self.own_growth:
            raise LawError(
                f"a bristle that only bends up to elastic = {self.elastic:g} N·m gives way by a growth of its own; say "
                "own_growth=True, and give the law's `growth`"
            )


def fields_of(description: type | None) -> tuple[Field, ...]:
    """Read the annotations of a ``Params`` or ``State`` class."""
    if description is None:
        return ()
    out: list[Field] = []
    for name, hint in get_type_hints(description, include_extras=True).items():
        if get_origin(hint) is not Annotated:
            raise LawError(f"{description.__name__}.{name} needs Annotated[float, Par(...)]")
        kind, par = get_args(hint)[:2]
        out.append(Field(name, par, get_origin(kind) is tuple))
    return tuple(out)


def packed(fields: Sequence[Field], p: Any) -> list[float]:
    """Return parameters as the flat list that compiled functions read.

    Scalars in order, then the number of elements (and of whatever else parameters have values per), then one block per
    field with several values.
    """
    flat = [getattr(p, f.name) for f in fields if not f.per_element]
    if not (blocks := [f for f in fields if f.per_element]):
        return flat
    sizes = {f.par.per: len(getattr(p, f.name)) for f in reversed(blocks)}
    flat += [float(sizes[per]) for per in dict.fromkeys(f.par.per for f in blocks)]
    for f in blocks:
        flat.extend(getattr(p, f.name))
    return flat
