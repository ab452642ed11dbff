"""A controller made of control laws, with its limit and its sample time."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from types import SimpleNamespace
from typing import Any, cast

from stickslip.control.block import ControlBlock, fields_in, state_fields_in, within
from stickslip.control.calls import calls_of, deviations_of
from stickslip.control.composition import MEMORY, Settings, functions_with
from stickslip.control.continuous import Continuous, continuous_form, refuse_windup
from stickslip.control_spec import PLACES, ControlLaw
from stickslip.errors import ParameterError, suggestion
from stickslip.model import Model
from stickslip.spec import Field, Kept, Learned, Surroundings, fields_of, packed
from stickslip.subset import Layout

__all__ = ["FADE", "SampledController"]

FADE = 0.1
"""s, over which a torque that was taken over fades."""
SLOW = 2.0 * math.pi * 20.0
"""rad/s, corner of the low-pass of the slow velocity."""

Blocks = ControlBlock | Sequence[ControlBlock] | None


@dataclass(frozen=True)
class SampledController:
    """A controller that acts every sample time and holds its torque in between, or in continuous time.

    Attributes
    ----------
    loop : ControlBlock or sequence of ControlBlock
        The control loop: PD, PID, ...
    sample_time : float
        s; 0 acts in continuous time, where all its laws have a continuous form.
    feedforward, observer : ControlBlock or sequence of ControlBlock, optional
        What acts on the reference alone, and on the measurement.
    estimator : ControlBlock, optional
        How the velocity is found from measured positions; the backward difference, if none is given.
    torque_limit : float
        The size of the torque never exceeds it, N·m; infinite for none.
    encoder_counts : float
        Counts per revolution of the encoder; 0 measures exactly.
    alone : bool
        Whether a law that adapts may stand without an integral or an observer, as in a comparison; no file says so.

    Raises
    ------
    ParameterError
        If a law does not belong where it is given, or a number is out of bounds.
    """

    loop: Blocks
    sample_time: float
    feedforward: Blocks = None
    observer: Blocks = None
    estimator: ControlBlock | None = None
    torque_limit: float = math.inf
    encoder_counts: float = 0.0
    alone: bool = False

    def __post_init__(self) -> None:
        if not (math.isfinite(self.sample_time) and self.sample_time >= 0.0):
            raise ParameterError(f"controller: sample_time = {self.sample_time:g} s must be at least 0")
        if not self.torque_limit > 0.0:
            raise ParameterError(
                f"controller: torque_limit = {self.torque_limit:g} N·m must be greater than 0"
            )
        if not (math.isfinite(self.encoder_counts) and self.encoder_counts >= 0.0):
            raise ParameterError(f"controller: encoder_counts = {self.encoder_counts:g} must be at least 0")
        for place in PLACES:
            for block in _listed(getattr(self, place)):
                if block.law.place != place:
                    raise ParameterError(
                        f"controller: {place} = {block.law.name!r} cannot be used as {place}; "
                        f"give it as {block.law.place}"
                    )
        if not self.blocks.keys() - {"estimator"}:
            raise ParameterError("controller: no control law; give a loop, a feedforward or an observer")
        laws = [block.law for block in self.blocks.values()]
        adapting = next((law.name for law in laws if law.adapts), "")
        if adapting and not self.alone and not any(law.integrates for law in laws):
            raise ParameterError(
                f"controller: {adapting} cannot adapt while the axis sticks, and no other law moves the axis then; "
                "add a loop with an integral (pid) or an observer (disturbance_observer)"
            )
        if self.sample_time == 0.0:
            if self.encoder_counts > 0.0:
                raise ParameterError(
                    "controller: encoder_counts needs a sampled controller; give a sample_time greater than 0"
                )
            _ = self.continuous  # refuses laws that act on samples

    # ---- its laws ----------------------------------------------------------------------------------------

    @functools.cached_property
    def blocks(self) -> dict[str, ControlBlock]:
        """Its laws by the names of their parts, in the order in which a sample runs them."""
        out: dict[str, ControlBlock] = {}
        for place in PLACES:
            found = _listed(getattr(self, place))
            if place == "estimator" and not found:
                found = [ControlBlock("backward_difference")]
            for i, block in enumerate(found, 1):
                out[place if i == 1 else f"{place}_{i}"] = block
        return out

    @functools.cached_property
    def laws(self) -> tuple[Any, ...]:
        """What its functions are made of: controllers for which this is equal have the same functions."""
        return tuple((part, b.law, b.friction and b.friction.law) for part, b in self.blocks.items())

    @functools.cached_property
    def fields(self) -> tuple[Field, ...]:
        """The parameters of all its laws, under their whole names."""
        return _fields_of(self.laws)

    @functools.cached_property
    def state_fields(self) -> tuple[Field, ...]:
        """As `fields`, of the states."""
        return _state_fields_of(self.laws)

    @property
    def learned_fields(self) -> tuple[Field, ...]:
        """Of the states, those that its laws learn, without what they keep for that alone."""
        return tuple(
            f for f in self.state_fields if isinstance(f.par, Learned) and not isinstance(f.par, Kept)
        )

    @functools.cached_property
    def layouts(self) -> dict[str, Layout]:
        """The layouts of the arguments of `functions`."""
        parts = [f"{part}_" for part in self.blocks]
        parts += [f"{part}_{inner}" for part, block in self.blocks.items() for inner in block.parts]
        return {
            "n": Layout.of(fields_of(Settings), counted=False),
            "m": Layout.of(MEMORY, counted=False),
            "z": Layout.of(self.state_fields, counted=False, parts=tuple(parts)),
            "p": Layout.of(self.fields, counted=True, parts=tuple(parts)),
            "u": Layout(Surroundings._fields),
        }

    @functools.cached_property
    def functions(self) -> dict[str, Callable[..., float]]:
        """The functions of `stickslip.control.composition` with its laws in their places."""
        return functions_with(calls_of(self.blocks))

    @functools.cached_property
    def deviations(self) -> dict[str, Callable[..., float]]:
        """Functions ``(n, z, p)`` by the whole names of what its laws learn: its standard deviation, -1: not told."""
        return deviations_of(self.blocks)

    @functools.cached_property
    def continuous(self) -> Continuous:
        """Its laws in continuous time.

        Raises
        ------
        ParameterError
            If one of its laws acts on samples only.
        """
        found = continuous_form(self.blocks)
        refuse_windup(found, self.torque_limit)
        return found

    @functools.cached_property
    def answers_to_acceleration(self) -> bool:
        """Whether the torque depends on the reference's acceleration alone."""
        torques: list[float] = []
        for acceleration in (0.0, 1.0):
            n, u = self.settings._replace(torque_limit=math.inf), SimpleNamespace(**Surroundings()._asdict())
            torques.append(
                self.functions["sample"](
                    0.0, 0.0, 0.0, acceleration, n, self.memory(), self.state(), self.parameters, u
                )
            )
        return torques[0] != torques[1]

    # ---- its numbers -------------------------------------------------------------------------------------

    @property
    def settings(self) -> Settings:
        """The numbers of the composition."""
        return Settings(
            self.torque_limit, self.sample_time, 1.0 - math.exp(-SLOW * self.sample_time), FADE, 0.0
        )

    @property
    def parameters(self) -> SimpleNamespace:
        """Parameters of the laws, each law's a part: ``p.loop.kp``."""
        return SimpleNamespace(**{part: block.parameters for part, block in self.blocks.items()})

    def state(self, learned: Mapping[str, Any] | None = None) -> SimpleNamespace:
        """The state of the laws at the start, with what they have `learned` before (as the method `learned` gives it).

        Raises
        ------
        ParameterError
            If a learned value is no finite number, or belongs to no law of this controller.
        """
        z = SimpleNamespace(**{part: block.state() for part, block in self.blocks.items()})
        places = self._learned()
        for name, value in (learned or {}).items():
            if name not in places:
                raise ParameterError(
                    f"controller: nothing learned is called {name!r}; {suggestion(name, places)}"
                )
            *whole, last = places[name]
            owner = _at(z, whole)
            numbers = cast("list[Any]", value) if isinstance(value, list) else [value]
            before = getattr(owner, last)
            if not all(isinstance(x, (int, float)) and math.isfinite(x) for x in numbers) or (
                isinstance(before, list) != isinstance(value, list)
                or (isinstance(before, list) and len(numbers) != len(cast("list[Any]", before)))
            ):
                raise ParameterError(
                    f"controller: learned {name} = {value!r} does not fit its law; save it again from one like this"
                )
            setattr(owner, last, [float(x) for x in numbers] if isinstance(value, list) else float(value))
        return z

    def learned(self, z: SimpleNamespace) -> dict[str, Any]:
        """What its laws have learned in the state `z`, by whole names: to be kept with the power off; plain data."""
        found = {name: _at(z, path) for name, path in self._learned().items()}
        return {k: list(cast("list[Any]", v)) if isinstance(v, list) else v for k, v in found.items()}

    def _learned(self) -> dict[str, tuple[str, ...]]:
        """Where what is learned lies in the state, by whole names."""
        fields = zip(self.state_fields, self._paths("state_fields"))
        return {f.name: path for f, path in fields if isinstance(f.par, Learned)}

    @staticmethod
    def memory() -> SimpleNamespace:
        """The memory of the composition at the start."""
        return SimpleNamespace(**{f.name: 0.0 for f in MEMORY})

    @functools.cached_property
    def frictions(self) -> dict[str, Model]:
        """The friction laws that its laws hold, by the names of their parts."""
        return {part: block.friction for part, block in self.blocks.items() if block.friction}

    @property
    def control_laws(self) -> tuple[ControlLaw, ...]:
        """The control laws that it is made of."""
        return tuple(block.law for block in self.blocks.values())

    @property
    def feeds_back(self) -> bool:
        """Whether a friction law in it acts on what is measured."""
        return any(b.law.place == "observer" and b.friction for b in self.blocks.values())

    def holding(self, change: Callable[[Model], Model]) -> SampledController:
        """The controller whose friction laws are what `change` makes of them."""
        places: dict[str, list[ControlBlock]] = {place: [] for place in PLACES}
        for block in self.blocks.values():
            places[block.law.place].append(
                ControlBlock(block.law, change(block.friction), **block.own) if block.friction else block
            )
        return replace(self, estimator=places.pop("estimator")[0], **places)

    def values(self) -> dict[str, Any]:
        """The parameters of all its laws by their whole names."""
        return {f.name: _at(self.parameters, path) for f, path in zip(self.fields, self._paths("fields"))}

    def with_values(self, values: Mapping[str, Any]) -> SampledController:
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
        places: dict[str, list[ControlBlock]] = {place: [] for place in PLACES}
        for part, block in self.blocks.items():
            places[block.law.place].append(block.with_values(own[part], held[part]))
        estimator = places.pop("estimator")[0]
        return replace(self, estimator=estimator, **places)

    def packed(self) -> list[float]:
        """The parameters as the flat list that compiled functions read."""
        return packed(self.fields, SimpleNamespace(**self.values()))

    def packed_state(self, z: SimpleNamespace | None = None) -> list[float]:
        """The state `z` (that at the start, if none is given) as the flat list that compiled functions read."""
        z = self.state() if z is None else z
        values = [(f, _at(z, name)) for f, name in zip(self.state_fields, self._paths("state_fields"))]
        flat = [value for f, value in values if not f.per_element]
        for f, value in values:
            if f.per_element:
                flat.extend(value)
        return flat

    def unpacked_state(self, flat: Sequence[float]) -> SimpleNamespace:
        """The state of the laws that `packed_state` made this flat list of."""
        z, numbers = self.state(), iter(flat)
        fields = [*zip(self.state_fields, self._paths("state_fields"))]
        for f, path in sorted(fields, key=lambda pair: pair[0].per_element):
            owner = _at(z, path[:-1])
            before = getattr(owner, path[-1])
            value = [float(next(numbers)) for _ in before] if f.per_element else float(next(numbers))
            setattr(owner, path[-1], value)
        return z

    def _paths(self, kind: str) -> list[tuple[str, ...]]:
        """Where each field lies among the parts: ``("feedforward", "friction", "sigma0")``."""
        paths: list[tuple[str, ...]] = []
        for part, block in self.blocks.items():
            own = len(getattr(block.law, kind))
            for i, f in enumerate(getattr(block, kind)):
                held = f.name.removeprefix("friction_")
                paths.append((part, f.name) if i < own else (part, "friction", held))
        return paths

    # ---- for people --------------------------------------------------------------------------------------

    def as_dict(self) -> dict[str, Any]:
        """Plain data that says everything about it."""
        return {
            **{part: block.as_dict() for part, block in self.blocks.items()},
            "sample_time": self.sample_time,
            "torque_limit": self.torque_limit,
            "encoder_counts": self.encoder_counts,
        }

    def described(self) -> dict[str, Any]:
        """What a record says of it."""
        return {"controller": self.as_dict()}


def _listed(blocks: Blocks) -> list[ControlBlock]:
    """None, one or several as a list."""
    if blocks is None:
        return []
    return [blocks] if isinstance(blocks, ControlBlock) else list(blocks)


@functools.lru_cache(maxsize=256)
def _fields_of(laws: tuple[Any, ...]) -> tuple[Field, ...]:
    """The parameters of these laws, under their whole names."""
    return _distinct(f for part, law, held in laws for f in within(part, fields_in(law, held)))


@functools.lru_cache(maxsize=256)
def _state_fields_of(laws: tuple[Any, ...]) -> tuple[Field, ...]:
    """As `_fields_of`, of the states."""
    return _distinct(f for part, law, held in laws for f in within(part, state_fields_in(law, held)))


def _distinct(fields: Iterable[Field]) -> tuple[Field, ...]:
    """The fields; two of one name would be one number."""
    out = tuple(fields)
    names = [f.name for f in out]
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise ParameterError(f"controller: two control laws have a field {twice[0]!r}; rename one of them")
    return out


def _at(whole: Any, path: Sequence[str]) -> Any:
    """The value that lies there."""
    for name in path:
        whole = getattr(whole, name)
    return whole
