"""The one description of a control law: its parameters, its state and its functions.

Everything that reads a control law (the composition of a controller, the engines, exports, the contract suite)
reads this description, so that a control law is written once, in one file.

Argument order, everywhere: signals of the loop ``y``, state ``z``, parameters ``p``, surroundings ``u``.

=======================================  ===========================================================
``sample(y, z, p, u)``                   torque of this sample, N·m; advances ``z`` (an estimator: the velocity, rad/s)
``take_over(missing, y, z, p, u)``       changes ``z`` so that the torque would be ``missing`` N·m higher; returns
                                         what it could not take over, N·m
``accelerating(y, z, p, u)``             of a feedforward: the part of its torque that accelerates the nominal
                                         inertia, N·m; an observer's residual keeps it
``check(p)``                             a sentence that says what is wrong with the parameters, or ""
``delay(p, sample_time)``                of an estimator: its delay at low frequency, s
``continuous(p)``                        the law in continuous time: of a loop `stickslip.control.linear.Gains`, of one
                                         that holds a friction law `stickslip.control.linear.Compensation`, of an
                                         estimator the corner of its low-pass, rad/s; a sentence where these
                                         parameters have none
``placed(inertia, bandwidth, damping)``  parameters that place the poles of the loop without friction, by name
``deviations[name](z, p, sample_time)``  standard deviation of what was learned in the state of that name; -1 where
                                         the state does not tell it
=======================================  ===========================================================

``sample``, ``take_over``, ``accelerating`` and ``deviations`` are written in the scalar subset (`stickslip.subset`).
``y`` has the fields of `Signals`, ``u`` those of `stickslip.core.spec.Surroundings`. A law that holds a friction law
calls ``friction(v0, v1, dt, z.friction, p.friction, u)``, and ``friction_steady(v, p.friction)`` for its torque at
constant velocity.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from dataclasses import fields as dataclass_fields
from typing import Annotated, Any, ClassVar, NamedTuple

from stickslip.core.arguments import constructor_named, insist_on_own
from stickslip.core.errors import LawError
from stickslip.core.rebinding import bound, first_complaint
from stickslip.core.spec import Choice, Configurable, Field, Law, Par, fields_of

PLACES = ("estimator", "feedforward", "observer", "loop")
"""Where a law stands in a controller, in the order in which a sample runs them."""

REST = 10.0
"""Samples for which the reference has stood still where an axis counts as at rest: a reversal is none."""


class Signals(NamedTuple):
    """What a control law sees in one sample."""

    position: Annotated[float, Par("rad", "theta", "measured position, minus the turns split off")]
    moved: Annotated[float, Par("rad", "", "change of the measured position since the last usable sample")]
    velocity: Annotated[float, Par("rad/s", "v", "velocity by the controller's estimator")]
    slow_velocity: Annotated[float, Par("rad/s", "v_f", "the same through a slow low-pass, for gates")]
    reference: Annotated[float, Par("rad", "theta_d", "reference position, minus its own turns split off")]
    reference_velocity: Annotated[float, Par("rad/s", "v_d", "reference velocity")]
    reference_acceleration: Annotated[float, Par("rad/s²", "a_d", "reference acceleration")]
    error: Annotated[float, Par("rad", "e", "reference minus measured position")]
    applied: Annotated[float, Par("N·m", "T_m", "torque applied since the last sample, after the limit")]
    commanded: Annotated[float, Par("N·m", "", "the same before the limit")]
    residual: Annotated[
        float, Par("N·m", "", "torque applied since the last sample minus the compensation fed forward in it")
    ]
    feedforward: Annotated[
        float, Par("N·m", "T_ff", "compensation fed forward in this sample; 0 while it is computed")
    ]
    others: Annotated[float, Par("N·m", "T_hat", "torque of the places that ran before in this sample")]
    torque_limit: Annotated[float, Par("N·m", "T_max", "largest torque")]
    elapsed: Annotated[
        float, Par("s", "T", "time since the last usable sample; the sample time at the first")
    ]
    started: Annotated[float, Par("-", "", "1 after the first sample")]
    rest: Annotated[float, Par("-", "", "samples for which the reference velocity has been 0")]
    turns: Annotated[
        float,
        Par("-", "", "measured position: turns split off; 0 where they are not counted, may have parts"),
    ]


def friction(v0: float, v1: float, dt: float, z: Any, p: Any, u: Any) -> float:
    """The friction law that a control law holds; a controller puts its ``sampled`` or ``step`` here. N·m."""
    return 0.0


def friction_steady(v: float, p: Any) -> float:
    """The friction law's torque at constant velocity; a controller puts its ``steady`` here. N·m."""
    return 0.0


@constructor_named
@dataclass(frozen=True, eq=False, repr=False)
class ControlLaw(Configurable):
    """A control law (``help("stickslip.core.control_spec")`` has its functions and their arguments).

    ``stickslip law --template control`` prints a complete file of one, ``help(stickslip.ControlBlock)`` a short one.

    Attributes
    ----------
    name, title : str
        The name by which people and files call it; its name in words.
    Params : type
        A NamedTuple with ``Annotated[float, Par(...)]`` fields. Fields of the chosen options are added to them.
    sample : callable
    place : str
        One of `PLACES`.
    equation, source : str
        Its equation in LaTeX; thesis equation numbers and keys of ``references.bib``.
    example : mapping
        Parameters for an axis of 3.8623e-4 kg·m² at 1 kHz, for documentation and the contract tests.
    State : type or None
        As ``Params``, for the internal state. Everything is 0 at the start.
    take_over, accelerating, check, delay, continuous, placed : callable or None
    deviations : mapping of str to callable
    linear : bool
        Superposition holds while the torque is within its limit. A declaration: the contract tests try it.
    holds_friction : bool
        Whether it needs a friction law.
    integrates : bool
        It holds a constant torque against a constant error: no standing error is left.
    adapts : bool
        It learns while the axis moves, and stands over a law that integrates.
    choices : tuple of Choice
    chosen : mapping
        The options in force, by the names of the choices.
    variants : dict
        Laws that `having` has made of it; not for callers.
    """

    kind: ClassVar[str] = "control law"
    name: str
    Params: type
    sample: Callable[..., float]
    place: str
    title: str
    equation: str
    source: tuple[str, ...]
    example: Mapping[str, Any]
    State: type | None = None
    take_over: Callable[..., float] | None = None
    accelerating: Callable[..., float] | None = None
    check: Callable[[Any], str] | None = None
    delay: Callable[[Any, float], float] | None = None
    continuous: Callable[[Any], Any] | None = None
    placed: Callable[[float, float, float], Mapping[str, float]] | None = None
    deviations: Mapping[str, Callable[[Any, Any, float], float]] = field(
        default_factory=dict[str, Callable[[Any, Any, float], float]]
    )
    linear: bool = False
    holds_friction: bool = False
    integrates: bool = False
    adapts: bool = False
    choices: tuple[Choice, ...] = ()
    chosen: Mapping[str, str] = field(default_factory=dict[str, str])
    variants: dict[tuple[tuple[str, str], ...], Any] = field(default_factory=dict[Any, Any], repr=False)
    written: Mapping[str, Any] = field(init=False, repr=False)
    fields: tuple[Field, ...] = field(init=False)
    state_fields: tuple[Field, ...] = field(init=False)
    Parameters: Any = field(init=False)

    def __post_init__(self) -> None:
        insist_on_own(self, "control law")
        if self.place not in PLACES:
            raise LawError(
                f"control law {self.name!r}: place = {self.place!r} must be one of {', '.join(PLACES)}"
            )
        written = {f.name: getattr(self, f.name) for f in dataclass_fields(self) if f.init}
        chosen = [self.option(choice) for choice in self.choices]
        fields, scope = self.option_fields(self.Params), self.option_scope()
        checks = [f for f in (self.check, *(o.check for o in chosen)) if f]
        parts: dict[str, Any] = {
            "written": written,
            "fields": tuple(fields.values()),
            "state_fields": fields_of(self.State),
            "Parameters": self.parameters_kind(fields),
            "example": self.option_examples(self.example, fields),
            "check": first_complaint(checks),
            **{
                name: bound(getattr(self, name), scope)
                for name in ("sample", "take_over", "accelerating", "delay")
            },
        }
        for name, part in parts.items():
            object.__setattr__(self, name, part)
        self.insist_on_lists()
        self.try_example()

    def holding(self, name: str, law: Law) -> Callable[..., float]:
        """The function of that name with a friction law's functions in their places, in the chosen options too."""
        held = {"friction": law.sampled or law.step, "friction_steady": law.steady}
        options = {replaces: bound(function, held) for replaces, function in self.option_scope().items()}
        return bound(self.written[name], {**options, **held})

    @property
    def reads_steady(self) -> bool:
        """Whether it calls `friction_steady`."""
        return "friction_steady" in getattr(self.written["sample"], "__globals__", {})

    @property
    def is_linear(self) -> bool:
        """Whether superposition holds with the chosen options."""
        return self.linear and all(self.option(choice).linear for choice in self.choices)
