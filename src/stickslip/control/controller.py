"""A controller: a composition of control laws, with its limit and its sample time."""

from __future__ import annotations

import functools
import math
import warnings
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any, cast

from stickslip.control.block import ControlBlock
from stickslip.control.compensator import Compensator
from stickslip.control.composed import Composed
from stickslip.control.continuous import Continuous, continuous_form, refuse_windup
from stickslip.control.linear import Cascade, Gains
from stickslip.control.own_loop import ReferenceVelocity
from stickslip.control.short_form import laws_meant, refuse_continuous, refuse_short
from stickslip.core.arguments import arguments_checked, constructor_named, insist_on_own
from stickslip.core.control_spec import PLACES, ControlLaw
from stickslip.core.errors import ModelRemark, ParameterError
from stickslip.core.reprs import making
from stickslip.models.model import Model, level_of_caller

Blocks = ControlBlock | Sequence[ControlBlock] | None
STANDARD = {
    "gains": None, "compensator": None, "torque_limit": math.inf, "sample_time": 0.0, "encoder_counts": 0.0,
    "velocity_filter": 0.0, "loop": (), "feedforward": (), "observer": (), "estimator": None, "alone": False,
    "reference_velocity": None,
}  # fmt: skip
"""What a controller's fields are where nobody gives them"""
SLOW_SAMPLE = 0.1
"""s, from which on a sample time was probably given in ms."""
MANY = ("feedforward", "observer", "loop")
"""Places in which several laws may stand; their torques are summed."""


@constructor_named
@dataclass(frozen=True, init=False, repr=False)
class Controller(Composed):
    """A controller that acts every sample time and holds its torque in between, or in continuous time.

    It is a composition of control laws: each is given at its place, ``loop``, ``feedforward``, ``observer``,
    ``estimator``. Gains and a compensator are the short form of the usual ones (`stickslip.control.short_form`); the
    two may be given together.

    Parameters
    ----------
    gains : Gains or Cascade, optional
        Of the linear part (`stickslip.control.linear`). A cascade acts on samples: without a sample time it runs on a
        machine, at the machine's.
    compensator : Compensator, optional
        A friction law on the reference (`Feedforward`) or on the measurement (`Feedback`).
    torque_limit : float
        The size of the torque never exceeds it, N·m; infinite for none.
    sample_time : float
        s; 0 acts in continuous time, where all its laws have a continuous form.
    encoder_counts : float
        Counts per revolution of the encoder that a sampled controller reads; 0 measures exactly. Of a linear axis the
        counts in 2π m: 2π over the scale's step in m.
    velocity_filter : float
        Corner of a first-order low-pass on the velocity that the linear part sees, Hz; 0 for none. It acts on
        samples, as a cascade does.
    loop : ControlBlock or sequence of ControlBlock, optional
        The control loop instead of gains: PD, PID, ...
    feedforward, observer : ControlBlock or sequence of ControlBlock, optional
        What acts on the reference alone, and on the measurement, behind what the compensator gives.
    estimator : ControlBlock, optional
        How the velocity is found from measured positions; the backward difference, if none is given.
    alone : bool
        Whether a law that adapts may stand without an integral or an observer, as in a comparison; no file says so.
    reference_velocity : {"difference", "instant"}, optional
        "difference": the controller forms its reference velocity from the last two reference positions, as many drives
        do; only with a sample time. "instant": it takes the velocity that comes with the reference. Not stated it does
        the latter, and `recommend` tries both.

    Raises
    ------
    ParameterError
        If a law does not belong where it is given, or a number is out of bounds.

    Warns
    -----
    ModelRemark
        Where its numbers are allowed but seldom meant (`remark`).
    """

    gains: Gains | Cascade | None
    compensator: Compensator | None
    torque_limit: float
    sample_time: float
    encoder_counts: float
    velocity_filter: float
    loop: tuple[ControlBlock, ...]
    feedforward: tuple[ControlBlock, ...]
    observer: tuple[ControlBlock, ...]
    estimator: ControlBlock | None
    alone: bool
    reference_velocity: ReferenceVelocity | None

    def __init__(
        self,
        gains: Gains | Cascade | None = None,
        compensator: Compensator | None = None,
        torque_limit: float = math.inf,
        sample_time: float = 0.0,
        encoder_counts: float = 0.0,
        velocity_filter: float = 0.0,
        *,
        loop: Blocks = None,
        feedforward: Blocks = None,
        observer: Blocks = None,
        estimator: ControlBlock | None = None,
        alone: bool = False,
        reference_velocity: ReferenceVelocity | None = None,
    ) -> None:
        own = {"loop": _listed(loop), "feedforward": _listed(feedforward), "observer": _listed(observer)}
        vars(self).update(
            gains=gains, compensator=compensator, torque_limit=torque_limit, sample_time=sample_time,
            encoder_counts=encoder_counts, velocity_filter=velocity_filter, estimator=estimator, alone=alone,
            reference_velocity=reference_velocity, **own,
        )  # fmt: skip
        self._refuse_numbers()
        refuse_short(gains, compensator, velocity_filter, sample_time)
        if not self.is_short:
            self._refuse_laws()
        if (words := self.remark) and (level := level_of_caller()):
            warnings.warn(f"controller: {words}", ModelRemark, stacklevel=level)

    def _refuse_numbers(self) -> None:
        insist_on_own(self, "controller")
        if not self.torque_limit > 0.0:
            raise ParameterError(
                f"controller: torque_limit = {self.torque_limit:g} N·m must be greater than 0"
            )
        if not (math.isfinite(self.sample_time) and self.sample_time >= 0.0):
            raise ParameterError(f"controller: sample_time = {self.sample_time:g} s must be at least 0")
        if not (math.isfinite(self.encoder_counts) and self.encoder_counts >= 0.0):
            raise ParameterError(f"controller: encoder_counts = {self.encoder_counts:g} must be at least 0")
        if 0.0 < self.encoder_counts < 1.0:
            raise ParameterError(
                f"controller: encoder_counts = {self.encoder_counts:g} must be at least 1; 0 measures exactly"
            )
        if self.encoder_counts > 0.0 and self.sample_time == 0.0:
            raise ParameterError(
                "controller: encoder_counts needs a sampled controller; give a sample_time greater than 0"
            )
        if self.reference_velocity == "difference" and self.sample_time == 0.0:
            raise ParameterError(
                "controller: reference_velocity = 'difference' needs a sampled controller; give a sample_time greater "
                "than 0"
            )

    @property
    def remark(self) -> str:
        """What is allowed in its numbers but seldom meant, in a sentence; "" where there is nothing."""
        said: list[str] = []
        if self.sample_time >= SLOW_SAMPLE:
            said.append(f"sample_time = {self.sample_time:g} s is slow for a drive; a millisecond is 0.001 s")
        nyquist = 0.5 / self.sample_time if self.sample_time > 0.0 else math.inf
        if self.velocity_filter > nyquist:
            said.append(
                f"velocity_filter = {self.velocity_filter:g} Hz hardly filters, as it lies above half the sample rate, "
                f"{nyquist:g} Hz; give a lower corner, or 0 for none"
            )
        return "; ".join(said)

    def _refuse_laws(self) -> None:
        for place in PLACES:
            for block in self._given(place):
                if block.law.place != place:
                    raise ParameterError(
                        f"controller: {place} = {block.law.name!r} cannot be used as {place}; "
                        f"give it as {block.law.place}"
                    )
        for one, other in (("gains", "loop"), ("velocity_filter", "estimator")):
            if getattr(self, one) and getattr(self, other):
                raise ParameterError(f"controller: {one} and {other} exclude each other; give one of them")
        if not self.blocks.keys() - {"estimator"}:
            raise ParameterError(
                "controller: no control law; give gains, a loop, a feedforward or an observer"
            )
        laws = [block.law for place in PLACES for block in self._given(place)]
        adapting = next((law.name for law in laws if law.adapts), "")
        integrates = self.linear.ki > 0.0 or any(law.integrates for law in laws)
        if adapting and not self.alone and not integrates:
            raise ParameterError(
                f"controller: {adapting} cannot adapt while the axis sticks, and no other law moves the axis then; "
                "add a loop with an integral (pid) or an observer (disturbance_observer)"
            )
        if self.sample_time == 0.0:
            _ = self.continuous  # refuses laws that act on samples

    def __getstate__(self) -> dict[str, Any]:
        """What it was given, without what was found of that."""
        return {f.name: getattr(self, f.name) for f in fields(self)}

    # ---- its laws ----------------------------------------------------------------------------------------

    @property
    def is_short(self) -> bool:
        """Whether it is gains and a compensator alone: files, records and studies name its numbers shortly then."""
        return self.gains is not None and not (
            self.loop or self.feedforward or self.observer or self.estimator
        )

    @property
    def linear(self) -> Gains:
        """The gains as those of one sum: a cascade's PID (`Cascade.pid`); zeros where there are none."""
        return self.gains.pid if isinstance(self.gains, Cascade) else self.gains or Gains(0.0)

    def _given(self, place: str) -> tuple[ControlBlock, ...]:
        """The laws given at a place."""
        return _listed(getattr(self, place))

    @functools.cached_property
    def blocks(self) -> dict[str, ControlBlock]:
        """Its laws by the names of their parts, in the order in which a sample runs them."""
        out: dict[str, ControlBlock] = {}
        meant = laws_meant(self.gains, self.compensator, self.velocity_filter)
        for place in PLACES:
            found = (*meant[place], *self._given(place))
            if place == "estimator" and not found:
                found = (ControlBlock("backward_difference"),)
            for i, block in enumerate(found, 1):
                out[place if i == 1 else f"{place}_{i}"] = block
        return out

    @arguments_checked
    def with_blocks(self, blocks: Iterable[ControlBlock]) -> Controller:
        """The controller that is made of the laws `blocks`, each at its own place."""
        own = [*blocks]
        places = {place: [b for b in own if b.law.place == place] for place in MANY}
        estimator = next((b for b in own if b.law.place == "estimator"), None)
        return replace(self, gains=None, compensator=None, velocity_filter=0.0, estimator=estimator, **places)

    @functools.cached_property
    def continuous(self) -> Continuous:
        """Its laws in continuous time.

        The integral of the short form goes on where the torque limit holds; that of a control law is refused there.

        Raises
        ------
        ParameterError
            If one of its laws acts on samples only.
        """
        refuse_continuous(self.gains, self.velocity_filter)
        found = continuous_form(self.blocks)
        if not self.is_short:
            refuse_windup(found, self.torque_limit)
        return found

    @property
    def frictions(self) -> dict[str, Model]:
        """The friction laws that it holds, by what a record calls them: their parts, or the compensator."""
        if self.is_short:
            return {"compensator": self.compensator.model} if self.compensator else {}
        return {part: block.friction for part, block in self.blocks.items() if block.friction}

    @property
    def control_laws(self) -> tuple[ControlLaw, ...]:
        """The control laws that its user chose: none in the short form."""
        return () if self.is_short else tuple(block.law for block in self.blocks.values())

    @property
    def feeds_back(self) -> bool:
        """Whether a friction law in it acts on what is measured."""
        return any(b.law.place == "observer" and b.friction for b in self.blocks.values())

    @arguments_checked
    def holding(self, change: Callable[[Model], Model]) -> Controller:
        """The controller whose friction laws are what `change` makes of them."""
        own = {place: [b.holding(change) for b in self._given(place)] for place in MANY}
        meant = self.compensator and replace(self.compensator, model=change(self.compensator.model))
        estimator = self.estimator and self.estimator.holding(change)
        return replace(self, compensator=meant, estimator=estimator, **own)

    def numbers(self) -> dict[str, Any]:
        """Its numbers by the names that studies and records know: of the short form its gains, else `values`."""
        return dict(self.gains._asdict()) if self.is_short and self.gains else self.values()

    @arguments_checked
    def with_values(self, values: Mapping[str, Any]) -> Controller:
        """The controller with other `values` of parameters, by whole names (``loop_kp``, ``feedforward_friction_fc``).

        Raises
        ------
        ParameterError
            If a value is out of bounds.
        """
        own: dict[str, dict[str, Any]] = {part: {} for part in self.blocks}
        held: dict[str, dict[str, Any]] = {part: {} for part in self.blocks}
        for f, path in zip(self.fields, self._paths("fields")):
            if f.name in values:
                (own if len(path) == 2 else held)[path[0]][path[-1]] = values[f.name]
        return self.with_blocks(b.with_values(own[part], held[part]) for part, b in self.blocks.items())

    @arguments_checked
    def with_numbers(self, numbers: Mapping[str, Any]) -> Controller:
        """The controller with others of its `numbers`."""
        if not (self.is_short and self.gains):
            return self.with_values(numbers)
        own = {name: float(numbers[name]) for name in self.gains._fields if name in numbers}
        return replace(self, gains=self.gains._replace(**own))

    # ---- for people --------------------------------------------------------------------------------------

    def __repr__(self) -> str:
        return making(self, STANDARD)

    def as_dict(self) -> dict[str, Any]:
        """Plain data that says everything about it."""
        own = self.described() if self.is_short else {p: block.as_dict() for p, block in self.blocks.items()}
        names = ("sample_time", "torque_limit", "encoder_counts", *(["velocity_filter"] * self.is_short))
        own |= {"reference_velocity": self.reference_velocity or "instant"}
        return {**own, **{name: getattr(self, name) for name in names}}

    def described(self) -> dict[str, Any]:
        """What a record says of it."""
        if not self.is_short:
            return {"controller": self.as_dict()}
        helper = self.compensator
        stated = {"reference_velocity": self.reference_velocity or "instant"} if self.sample_time else {}
        return {"gains": self.numbers(), **({"compensator": helper.as_dict()} if helper else {}), **stated}


def _listed(blocks: Blocks) -> tuple[ControlBlock, ...]:
    """None, one or several; what is neither counts as one."""
    if blocks is None:
        return ()
    return tuple(blocks) if isinstance(blocks, (list, tuple)) else (cast("ControlBlock", blocks),)
