"""Dependence on position, load, temperature and time (thesis 2.1.5, 2.1.6), for any law.

The torque of the law is multiplied by a factor of its surroundings, as a normal load on the contact would
(Amontons): stiffness, levels and damping rise together, and the states keep their meaning. The factors of several
dependences multiply. ``steady`` stays the law's own, at a factor of 1.
"""

from __future__ import annotations

import math
from typing import Annotated, Any, NamedTuple

from stickslip.core.spec import Choice, Option, Par


class Spectrum(NamedTuple):
    """Torque ripple over one revolution, thesis 2.1.6."""

    ripple: Annotated[
        tuple[float, ...],
        Par("-", "a_k", "relative amplitude of harmonic k", lower=0.0, upper=1.0, per="harmonic"),
    ]
    order: Annotated[
        tuple[float, ...],
        Par("1/rad", "n_k", "periods of harmonic k per radian (n per revolution: n)", per="harmonic"),
    ]
    ripple_phase: Annotated[tuple[float, ...], Par("rad", "phi_k", "phase of harmonic k", per="harmonic")]


def spectrum(p: Any, u: Any) -> float:
    """1 + sum of a_k cos(n_k theta + phi_k)."""
    factor = 1.0
    for i in range(len(p.ripple)):
        factor += p.ripple[i] * math.cos(p.order[i] * u.position + p.ripple_phase[i])
    return factor


def check_spectrum(p: Any) -> str:
    """Friction does not change its sign."""
    total = math.fsum(p.ripple)
    return f"ripple adds up to {total:g}; more than 1 turns friction round" if total > 1.0 else ""


class LoadExponent(NamedTuple):
    """How friction follows the normal load."""

    load_exponent: Annotated[
        float, Par("-", "n_N", "power of the relative load", lower=0.0, upper=10.0, default=1.0)
    ]


def load_power(p: Any, u: Any) -> float:
    """(N / N_0)^n."""
    return u.load**p.load_exponent


class Thermal(NamedTuple):
    """How friction follows the temperature."""

    temperature_coefficient: Annotated[
        float, Par("1/K", "kappa", "relative change per kelvin", lower=-0.1, upper=0.1)
    ]
    reference_temperature: Annotated[
        float,
        Par(
            "°C", "T_0", "temperature at which the parameters hold", lower=-273.15, upper=1000.0, default=20.0
        ),
    ]


def exponential(p: Any, u: Any) -> float:
    """exp(kappa (T - T_0))."""
    return math.exp(p.temperature_coefficient * (u.temperature - p.reference_temperature))


class Drift(NamedTuple):
    """Slow change after the start of a run, thesis 2.1.5."""

    drift: Annotated[float, Par("-", "d", "relative change in the long run", lower=-1.0, upper=10.0)]
    drift_time: Annotated[float, Par("s", "tau_d", "time constant of the change", positive=True)]


def settling(p: Any, u: Any) -> float:
    """1 + d (1 - exp(-t / tau))."""
    return 1.0 - p.drift * math.expm1(-u.time / p.drift_time)


def unchanged(p: Any, u: Any) -> float:
    """No dependence."""
    return 1.0


# What stands in the functions below, bound when an option is chosen.
position_factor = unchanged
load_factor = unchanged
temperature_factor = unchanged
time_factor = unchanged
inner_step: Any = None
inner_rate: Any = None
inner_holding: Any = None


def factor_of(p: Any, u: Any) -> float:
    """The product of all dependences."""
    return position_factor(p, u) * load_factor(p, u) * temperature_factor(p, u) * time_factor(p, u)


def step(v0: float, v1: float, dt: float, z: Any, p: Any, u: Any) -> float:
    """Torque at the end of the step, N·m."""
    return factor_of(p, u) * inner_step(v0, v1, dt, z, p, u)


def rate(v: float, z: Any, p: Any, u: Any, dz: Any) -> float:
    """Torque now, N·m; writes the rates of the states."""
    return factor_of(p, u) * inner_rate(v, z, p, u, dz)


def holding(direction: float, z: Any, p: Any, u: Any) -> float:
    """Largest torque withstood at rest, N·m."""
    return factor_of(p, u) * inner_holding(direction, z, p, u)


MODULATED = {"step": step, "rate": rate, "holding": holding}


def dependence(
    name: str, function: Any, params: type, example: dict[str, Any], meaning: str, **more: Any
) -> Choice:
    """A choice between no dependence and one form of it."""
    form = Option(
        function,
        params,
        example=example,
        wraps=MODULATED,
        keeps_elements=False,
        reads_surroundings=True,
        **more,
    )
    return Choice(
        f"{name}_dependence",
        replaces=f"{name}_factor",
        options={"none": Option(unchanged), function.__name__: form},
        default="none",
        meaning=meaning,
    )


POSITION = dependence(
    "position", spectrum, Spectrum, {"ripple": [0.1, 0.05], "order": [1.0, 3.0], "ripple_phase": [0.0, 1.0]},
    "torque ripple over the position: thesis 2.1.6", check=check_spectrum, passive=False,
)  # fmt: skip
LOAD = dependence("load", load_power, LoadExponent, {"load_exponent": 1.0}, "torque over the normal load")
TEMPERATURE = dependence(
    "temperature", exponential, Thermal, {"temperature_coefficient": -0.01}, "torque over the temperature"
)
TIME = dependence(
    "time", settling, Drift, {"drift": -0.1, "drift_time": 60.0},
    "slow change after the start: thesis 2.1.5", passive=False,
)  # fmt: skip
