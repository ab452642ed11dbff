"""Description of a method of identification: a name, its requirements, and a function of records and options."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence, Set
from dataclasses import dataclass, field, fields
from typing import Literal

from stickslip.core.errors import InputError
from stickslip.core.messages import name_option, name_parameter
from stickslip.core.rebinding import NEGATIVE
from stickslip.core.record import Record
from stickslip.core.spec import Law
from stickslip.identification.estimate import Identification, silent
from stickslip.identification.memo import EstimateSliding
from stickslip.identification.sliding import estimate_sliding
from stickslip.models import plugins
from stickslip.models.model import Model

LONGEST_DELAY = 1.0
"""Longest delay that can be stated, s."""
TorqueIs = Literal["commanded", "actual", "mean"]


@dataclass(frozen=True)
class Options:
    """Options of an identification; a method reads those that it uses.

    Attributes
    ----------
    laws : tuple of str or Law
        Names, paths of law files, or laws; empty: the method's own candidates.
    values, frozen, free, model, noise, elements, shares, threshold, inverse, per_direction, pendulum, drive_gain, \
    resistance, loop_output, extra_torque, torque_is, delay, harmonics, position_map, load, intervals, robust
        As in `stickslip.verbs.identify.identify`, which describes each with its unit.
    torque : str
        Channel of the torque; empty for the first known one. Not for the method `axis`.
    held_out : int
        Number of records, the last ones, that are not fitted but validate the result (axis).
    model_offset : float
        Constant torque in the file of the model, N·m.
    torque_constant, force_constant : float or None
        N·m/A of a rotary motor, N/A of a linear one.
    estimate : callable
        `stickslip.identification.sliding.estimate_sliding`, or a memo of it that avoids repeating the doctor's.
    progress : callable
        Called with a short description of each step as it starts.
    """

    laws: tuple[str | Law, ...] = ()
    values: Mapping[str, float] = field(default_factory=dict[str, float])
    frozen: tuple[str, ...] = ()
    free: tuple[str, ...] = ()
    model: Model | None = None
    noise: float | None = None
    torque: str = ""
    elements: int = 0
    threshold: float | None = None
    held_out: int = 0
    inverse: bool = False
    per_direction: bool = False
    pendulum: bool = False
    drive_gain: float | None = None
    torque_constant: float | None = None
    resistance: float | None = None
    loop_output: Literal["torque", "current", "voltage"] | None = None
    extra_torque: str = ""
    torque_is: TorqueIs | None = None
    delay: float | None = None
    harmonics: int = 0
    load: bool = False
    intervals: Literal["prediction", "covariance"] = "prediction"
    robust: bool = False
    estimate: EstimateSliding = estimate_sliding
    progress: Callable[[str], None] = silent
    position_map: bool = False
    force_constant: float | None = None
    shares: Literal["free", "equal"] = "free"
    model_offset: float = 0.0

    def __post_init__(self) -> None:
        for name, count in (("harmonics", self.harmonics), ("elements", self.elements)):
            if count < 0:
                raise InputError(f"{name_option(name, count)} must be 0 or more")
        if self.position_map and self.harmonics:
            raise InputError(
                f"{name_option('position_map')} chooses its orders by itself, "
                f"{name_option('harmonics', self.harmonics)} gives them; leave one out"
            )
        for name, value in (("noise", self.noise), ("threshold", self.threshold)):
            if value is not None and not (math.isfinite(value) and value > 0.0):
                raise InputError(f"{name_option(name, f'{value:g}')} must be greater than 0")
        if self.delay is not None and not (math.isfinite(self.delay) and abs(self.delay) < LONGEST_DELAY):
            raise InputError(
                f"{name_option('delay', f'{self.delay:g}')} s, the time until the torque acts (below 0 where "
                "its column lies behind it), "
                "must lie between -1 and 1 s; it is in s and not in samples: two at 1 kHz are 0.002"
            )


ARGUMENTS = {"laws": "law", "held_out": "hold_out", "torque": "torque_channel"}
"""Arguments whose names differ from the fields of `Options`."""
OF_EVERY_METHOD = ("torque_constant", "force_constant", "model_offset", "estimate", "progress")
"""Fields that every method accepts: the reading of a log, and the computation."""
AXIS = frozenset({"pendulum", "drive_gain", "resistance", "loop", "loop_output", "extra_torque"})
"""Options for converting a record to an experiment of an axis."""
TORQUE = frozenset({"torque", "extra_torque"})
"""Options of every method that reads a torque from records."""


def name_field(field_name: str) -> str:
    """Return the name of the option behind a field of `Options`."""
    return name_option(ARGUMENTS.get(field_name, field_name))


def given_in(options: Options, *, inertia: bool, loop: bool, hold_out: bool) -> tuple[str, ...]:
    """Return the names of the options that differ from their defaults.

    ``inertia``, ``loop`` and ``hold_out`` are passed separately, since `options` combine them with others.
    """
    neutral = Options()
    own = {f.name for f in fields(Options)} - {*OF_EVERY_METHOD, "held_out"}
    changed = [
        f.name
        for f in fields(Options)
        if f.name in own and getattr(options, f.name) != getattr(neutral, f.name)
    ]
    if inertia:
        # It is one of the values, and for an axis one of the frozen ones.
        alone = {"values": set(options.values) <= {"inertia"}, "frozen": set(options.frozen) <= {"inertia"}}
        changed = [name for name in changed if not alone.get(name, False)]
    apart = (("inertia", inertia), ("loop", loop), ("held_out", hold_out))
    return (*changed, *(name for name, given in apart if given))


@dataclass(frozen=True)
class Method:
    """One way to identify.

    Attributes
    ----------
    name, title : str
    identify : callable
        ``identify(records, options) -> Identification``.
    check : callable
        ``check(records, options)`` refuses, before any computation, records that lack what the method requires.
    uses : frozenset of str
        Names of the options that it uses: fields of `Options`, ``loop`` and ``inertia``. Others are refused.
    narrowed : mapping of str to frozenset of str
        For an option, by name: the options that the method uses if that one is given.
    takes_steady_points : bool
        Whether a table of velocities and torques without times is accepted.
    takes_current : bool
        Whether a current without a torque constant is accepted.
    values : tuple of str, or None
        Names for which a value may be set; none of them may be free or frozen. None: set, free and frozen names are
        parameters of a law, which the method checks itself.
    """

    name: str
    title: str
    identify: Callable[[Sequence[Record], Options], Identification]
    check: Callable[[Sequence[Record], Options], None]
    uses: frozenset[str] = frozenset()
    narrowed: Mapping[str, frozenset[str]] = field(default_factory=dict[str, frozenset[str]])
    takes_steady_points: bool = False
    takes_current: bool = False
    values: tuple[str, ...] | None = None

    def refuse_unused(self, given: Sequence[str], elsewhere: Mapping[str, Sequence[str]]) -> None:
        """Refuse options that would be ignored.

        Parameters
        ----------
        given : sequence of str
            Names of the options that were given.
        elsewhere : mapping of str to sequence of str
            By option: the methods that use it.

        Raises
        ------
        InputError
        """
        for name in given:
            if name not in self.uses:
                others = elsewhere.get(name, ())
                by = f" (methods that do: {', '.join(others)})" if others else ""
                raise InputError(
                    f"{name_option('method', self.name)} does not use {name_field(name)}{by}; leave it out"
                )
        for narrowing, uses in self.narrowed.items():
            unused = [name for name in given if name not in uses] if narrowing in given else []
            if unused:
                one, other = name_field(narrowing), name_field(unused[0])
                raise InputError(f"{one} does not use {other}; leave out one of them")

    def refuse_unknown(self, options: Options) -> None:
        """Refuse names of set, free or frozen parameters that would be ignored.

        Raises
        ------
        InputError
        """
        if self.values is None:
            return
        takes = f"; it takes {', '.join(self.values)}" if self.values else ""
        for option, names in (("values", options.values), ("free", options.free), ("frozen", options.frozen)):
            for name in names:
                if option != "values" or name not in self.values:
                    raise InputError(
                        f"{name_option('method', self.name)} has no {name!r} for {name_option(option)}{takes}; "
                        "leave it out"
                    )


def refuse_unsaid(options: Options, known: Set[str]) -> None:
    """Refuse to hold a parameter without a given value: it would be held at a search's starting value.

    Parameters
    ----------
    options : Options
    known : set of str
        Names of parameters that have values of their own.

    Raises
    ------
    InputError
    """
    given = {n for name in options.values for n in (name, name.partition("[")[0])} | known
    unsaid = [
        n for n in options.frozen if given.isdisjoint((n, n.partition("[")[0], n.removesuffix(NEGATIVE)))
    ]
    if unsaid:
        settings = " and ".join(name_parameter(name) for name in unsaid)
        raise InputError(f"{', '.join(unsaid)} cannot be held without a value; give {settings}")


def law_of(given: str | Law) -> Law:
    """Return the law of that name or file, or the given law completed with the choices that any law has."""
    return plugins.law(given) if isinstance(given, str) else plugins.completed(given)
