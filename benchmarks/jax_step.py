"""A trapezoid with a fixed step in JAX: `vmap` over the cases of a `lax.scan` over time, in double precision.

The loop of Table 6 on the low reference, with GMS feedback or without. For `benchmarks/batch.py`; pip install jax.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

import closed_loop

Column = np.ndarray[Any, np.dtype[np.float64]]


def runner(name: str, fs: Column, fc: Column, duration: float, h: float) -> Callable[[], Column]:
    """A compiled function that runs all loops and returns where they end, rad.

    Raises
    ------
    ImportError
        Without JAX.
    """
    import jax

    jax.config.update("jax_enable_x64", True)
    import jax.numpy as jnp

    plant, gms, gains = closed_loop.PLANT.parameters, closed_loop.GMS.parameters, closed_loop.GAINS
    inertia, curve = closed_loop.INERTIA, closed_loop.CURVE
    fed_back = name == "GMS feedback"
    weight = jnp.array([1.0] * 4 + [-1.0] * 3 * fed_back)
    stiffness = jnp.array([*plant.k, *(gms.k if fed_back else ())])
    share = jnp.array([*plant.alpha, *(gms.alpha if fed_back else ())])
    of_plant = weight > 0.0
    damping = gains.kd + curve["sigma2"] * (0.0 if fed_back else 1.0)
    mass = inertia / h
    steps = round(duration / h)
    t = np.arange(steps + 1) * h
    omega = 2.0 * np.pi * closed_loop.FREQUENCY
    goal = closed_loop.AMPLITUDE * (1.0 - np.cos(omega * t))
    command = gains.kp * goal + gains.kd * closed_loop.AMPLITUDE * omega * np.sin(omega * t)
    means = jnp.array(0.5 * (command[1:] + command[:-1]))

    def one(fs: Any, fc: Any) -> Any:
        def sliding(bump: Any) -> Any:
            return jnp.where(
                of_plant, fc + (fs - fc) * bump, curve["fc"] + (curve["fs"] - curve["fc"]) * bump
            )

        def step(state: Any, mean: Any) -> Any:
            x, v, sigma, q, q_before, bump, force, slips = state
            middle = jnp.where(of_plant, 1.5 * q - 0.5 * q_before, 1.0 / sliding(bump)[-1])
            pull = jnp.where(of_plant, plant.c, gms.c)
            half = 0.5 * h * pull * middle
            slides = (force * (1.0 - half) + h * pull * share * sigma) / (1.0 + half)
            stuck = jnp.sum(jnp.where(slips, 0.0, weight * stiffness))
            held = jnp.sum(weight * jnp.where(slips, 0.5 * (force + slides), force))
            slope = 0.5 * damping + 0.25 * h * (gains.kp + stuck)
            v1 = ((mass - slope) * v + mean - gains.kp * x - held) / (mass + slope)
            d = 0.5 * h * (v + v1)
            bump1 = jnp.exp(-((v1 / curve["vs"]) ** 2))
            ahead = jnp.where(slips, slides, force + stiffness * d)
            side = jnp.where(v1 >= 0.0, 1.0, -1.0)
            turns = jnp.any(slips) & (sigma * v1 <= 0.0)
            at = jnp.where(turns, v / (v - v1), 0.0)
            rest = 1.0 - at
            begin = side * force - share * sliding(bump)
            end = side * ahead - share * sliding(bump1)
            breaks = ~turns & ~slips & (end >= 0.0)
            reverses = turns & slips
            to_break = jnp.where(breaks & (begin < 0.0), -begin / (end - begin), 0.0)
            turned = force + at * (ahead - force) + stiffness * 0.5 * rest * h * v1
            broken = force + to_break * (ahead - force)
            after = jnp.where(reverses, turned, jnp.where(breaks, broken, ahead))
            lever = jnp.where(reverses, rest / 3.0, jnp.where(breaks, 0.5 * (1.0 - to_break), 0.0))
            push = jnp.sum(weight * (ahead - after) * lever)
            slips = jnp.where(reverses, False, slips | breaks)
            sigma = jnp.where(jnp.any(breaks), side, sigma)
            x1 = x + d + push * h * h / inertia / 3.0
            now = x1, v1 + push * h / inertia, sigma, 1.0 / (fc + (fs - fc) * bump1), q, bump1, after, slips
            return now, None

        none = jnp.zeros(weight.size)
        start = (0.0, 0.0, 1.0, 1.0 / fs, 1.0 / fs, 1.0, none, none > 0.0)
        return jax.lax.scan(step, start, means)[0][0]

    compiled = jax.jit(jax.vmap(one)).lower(fs, fc).compile()
    return lambda: np.asarray(compiled(fs, fc))
