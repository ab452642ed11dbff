"""Control laws that act together, as engines, rigs and exports read them: functions, parameters and state."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from types import SimpleNamespace
from typing import Any, cast

from stickslip.control.block import ControlBlock, fields_in, state_fields_in, within
from stickslip.control.calls import calls_of, deviations_of
from stickslip.control.composition import MEMORY, Settings, functions_with
from stickslip.control.own_loop import ReferenceVelocity
from stickslip.control.plain import plain_sample
from stickslip.core.arguments import arguments_checked
from stickslip.core.errors import ParameterError, suggestion
from stickslip.core.spec import Field, Kept, Learned, Surroundings, fields_of, packed
from stickslip.subset import Layout
from stickslip.subset.layout import PARAMETER

FADE = 0.1
"""s, over which a torque that was taken over fades."""
SLOW = 2.0 * math.pi * 20.0
"""rad/s, corner of the low-pass of the slow velocity."""


class Composed:
    """Control laws that act together; `stickslip.control.controller.Controller` says which."""

    torque_limit: float
    sample_time: float
    reference_velocity: ReferenceVelocity | None

    @functools.cached_property
    def blocks(self) -> dict[str, ControlBlock]:
        """Its laws by the names of their parts, in the order in which a sample runs them."""
        raise NotImplementedError

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
            "p": Layout.of(self.fields, counted=True, parts=tuple(parts), fixed=PARAMETER),
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
    def answers_to_acceleration(self) -> bool:
        """Whether the torque depends on the reference's acceleration alone."""
        torques: list[float] = []
        for acceleration in (0.0, 1.0):
            n = self.settings._replace(torque_limit=math.inf, sample_time=self.sample_time or 1.0)
            u = SimpleNamespace(**Surroundings()._asdict())
            torques.append(
                plain_sample(
                    self.functions["sample"],
                    0.0,
                    0.0,
                    0.0,
                    acceleration,
                    n,
                    self.memory(),
                    self.state(),
                    self.parameters,
                    u,
                )
            )
        return torques[0] != torques[1]

    # ---- its numbers --------------------------------------------------------------------------------------

    @property
    def settings(self) -> Settings:
        """The numbers of the composition."""
        return Settings(
            self.torque_limit, self.sample_time, 1.0 - math.exp(-SLOW * self.sample_time), FADE, 0.0,
            float(self.reference_velocity == "difference"),
        )  # fmt: skip

    @property
    def parameters(self) -> SimpleNamespace:
        """Parameters of the laws, each law's a part: ``p.loop.kp``."""
        return SimpleNamespace(**{part: block.parameters for part, block in self.blocks.items()})

    @arguments_checked
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

    @arguments_checked
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

    def values(self) -> dict[str, Any]:
        """The parameters of all its laws by their whole names."""
        return {f.name: _at(self.parameters, path) for f, path in zip(self.fields, self._paths("fields"))}

    def packed(self) -> list[float]:
        """The parameters as the flat list that compiled functions read."""
        return packed(self.fields, SimpleNamespace(**self.values()))

    @arguments_checked
    def packed_state(self, z: SimpleNamespace | None = None) -> list[float]:
        """The state `z` (that at the start, if none is given) as the flat list that compiled functions read."""
        z = self.state() if z is None else z
        values = [(f, _at(z, name)) for f, name in zip(self.state_fields, self._paths("state_fields"))]
        flat = [value for f, value in values if not f.per_element]
        for f, value in values:
            if f.per_element:
                flat.extend(value)
        return flat

    def state_names(self) -> list[str]:
        """The name of every number of `packed_state`; of lists with their places, ``observer_z[0]``."""
        z, plain, listed = self.state(), list[str](), list[str]()
        for f, path in zip(self.state_fields, self._paths("state_fields")):
            if f.per_element:
                listed += [f"{f.name}[{i}]" for i in range(len(_at(z, path)))]
            else:
                plain.append(f.name)
        return plain + listed

    @arguments_checked
    def unpacked_state(self, flat: Sequence[float]) -> SimpleNamespace:
        """The state of the laws that `packed_state` made this flat list of."""
        z, numbers = self.state(), iter(flat)
        fields = [*zip(self.state_fields, self._paths("state_fields"))]
        for f, path in sorted(fields, key=lambda pair: pair[0].per_element):
            owner = _at(z, path[:-1])
            before = getattr(owner, path[-1])
            try:
                value = [float(next(numbers)) for _ in before] if f.per_element else float(next(numbers))
            except (StopIteration, TypeError):
                raise ParameterError(
                    f"Controller: flat has {len(flat)} values, which are no state; give what packed_state made"
                ) from None
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
