"""What the contract tries a law with: parameters near its example, random motions, compiled runs of many at once."""

from __future__ import annotations

import math
import zlib
from collections.abc import Iterator
from typing import Any

import numpy as np

from stickslip.core.errors import ParameterError
from stickslip.core.spec import Law, Surroundings
from stickslip.jit import call_step, compiled_step, flat, kernel, pointer
from stickslip.laws import COMMON_CHOICES

Array = np.ndarray[Any, np.dtype[np.float64]]

U = Surroundings()
STEPS = 40
"""Of a random motion."""


def variants(law: Law) -> Iterator[Law]:
    """The law, and the law under every single other option of its choices."""
    yield law
    for choice in law.choices:
        for option in choice.options:
            if option != choice.default:
                yield law.having(**{choice.name: option})


def tried(law: Law) -> Iterator[Law]:
    """The law, it under every other option of its own choices, and under the last ones of those that all laws have."""
    names = {name.split(".")[-1].lower() for name in COMMON_CHOICES}
    yield law
    last: dict[str, str] = {}
    for choice in law.choices:
        if choice.name == "symmetry" or choice.name.removesuffix("_dependence") in names:
            last[choice.name] = list(choice.options)[-1]
        else:
            yield from (law.having(**{choice.name: o}) for o in choice.options if o != choice.default)
    yield law.having(**last)


def name_of(law: Law) -> str:
    """The law and its options in one word."""
    return "-".join([law.name, *law.chosen.values()])


def example(law: Law) -> Any:
    """The parameters of the law's example."""
    return law.parameters(dict(law.example))


def seeded(law: Law, salt: int) -> np.random.Generator:
    """Random numbers that are the same for a law and its options every time."""
    return np.random.default_rng([zlib.crc32(name_of(law).encode()), salt])


def nearby(law: Law, rng: np.random.Generator) -> Any:
    """Admissible parameters: the example's, each multiplied by 0.01 to 100 where its bounds and the law allow."""
    base: dict[str, Any] = example(law)._asdict()
    for spread in (2.0, 1.0, 0.5, 0.2, 0.05, 0.0):
        values: dict[str, Any] = {}
        for f in law.fields:
            value = base[f.name]
            if f.per_element and f.par.shares:
                share = np.maximum(rng.dirichlet(np.ones(len(value))), 1e-3)
                values[f.name] = [float(x) for x in share / share.sum()]
            elif f.per_element and f.par.per != "element":
                values[f.name] = list(value)
            elif f.per_element:
                values[f.name] = [float(x * 10 ** rng.uniform(-spread, spread)) for x in value]
            else:
                values[f.name] = float(
                    np.clip(value * 10 ** rng.uniform(-spread, spread), f.par.lower, f.par.upper)
                )
        try:
            return law.parameters(values)
        except ParameterError:
            continue
    return law.parameters(base)


def motions(rng: np.random.Generator, count: int) -> tuple[Array, Array]:
    """Velocities at the ends of steps and the steps' lengths, shapes (count, STEPS).

    Speeds over nine decades, rests and reversals, steps from 1e-7 to 1 s.
    """
    size = (count, STEPS)
    speed = 10.0 ** rng.uniform(-8.0, 1.0, size)
    velocity = speed * rng.choice([-1.0, 0.0, 1.0, 1.0], size)
    calm = rng.random(count) < 0.3  # a third keeps its order of magnitude
    velocity[calm] = velocity[calm, :1] * rng.uniform(-1.0, 2.0, (int(calm.sum()), STEPS))
    return velocity, 10.0 ** rng.uniform(-7.0, 0.0, size)


def swings(rng: np.random.Generator, count: int, n: int = 600) -> tuple[Array, Array]:
    """Motions that the steps resolve: sums of two sines with pauses, shapes (count, n)."""
    time = np.linspace(0.0, 1.0, n + 1)[None, 1:]
    peak = 10.0 ** rng.uniform(-5.0, -1.5, (count, 1))
    turns = rng.uniform(0.5, 4.0, (count, 1))
    velocity = peak * (
        np.sin(2 * math.pi * turns * time)
        + rng.uniform(-1.0, 1.0, (count, 1)) * np.sin(2 * math.pi * 0.37 * turns * time)
    )
    velocity[np.abs(velocity) < 0.05 * peak] = 0.0
    return np.ascontiguousarray(velocity), np.full(velocity.shape, 1.0 / n)


@kernel()
def drive(address: Any, z0: Any, p: Any, u: Any, velocity: Any, dt: Any, torque: Any, end: Any) -> None:
    """Torque after every step of every motion, each from the state z0; ``end`` receives the last states."""
    z = z0.copy()
    for case in range(velocity.shape[0]):
        z[:] = z0
        v = 0.0
        for i in range(velocity.shape[1]):
            torque[case, i] = call_step(
                address, v, velocity[case, i], dt[case, i], pointer(z, 0), pointer(p, 0), pointer(u, 0)
            )
            v = velocity[case, i]
        end[case] = z


def batch(law: Law, p: Any, velocity: Array, dt: Array) -> tuple[Array, Array]:
    """Torques of the compiled law, N·m, shape (cases, steps), and the last states, shape (cases, states)."""
    z0 = flat(law.pack_state(law.state(p)))
    torque, end = np.zeros(velocity.shape), np.zeros((velocity.shape[0], z0.size))
    drive(compiled_step(law), z0, flat(law.pack(p)), flat(list(U)), velocity, dt, torque, end)
    return torque, end


def level_of(law: Law, p: Any) -> float:
    """A torque that the law's own part cannot exceed at the given parameters, from its parameters in N·m.

    A dependence on the surroundings multiplies it by its factor. Infinite for a law without a parameter in N·m.
    """
    held = [getattr(p, f.name) for f in law.fields if f.par.unit == "N·m"]
    if not held:
        return math.inf
    total = sum(math.fsum(map(abs, x)) if isinstance(x, tuple) else abs(x) for x in held)  # pyright: ignore
    dependences = [o for c in law.choices if (o := law.option(c)).reads_surroundings and o.function]
    return total * math.prod(o.function(p, U) for o in dependences if o.function)
