"""Elasticity of a drivetrain: static twist, modes, and bounds of the modes; thesis 4.5.

A drivetrain is a chain of inertias connected by springs: motor rotor, coupling, shaft, friction disk (thesis figure
4.57).

Lowest possible first mode
--------------------------
For a free chain of n inertias with total J, whose spring i has J_left before it and J_right behind it, the modes obey

    sum over modes of 1/w^2 = sum over springs of J_left J_right / (J k_i)

(the trace of the flexibility matrix with the rigid motion taken out). A product of two parts of J is at most J^2/4 and
1/w_1^2 is at most the whole sum, so

    w_1^2 >= 4 / (J sum of 1/k_i),

reached with J/2 at each end and nothing in between. No distribution of inertias gives a lower first mode. The first n
modes are at most w_n, so n/w_n^2 is at most the sum as well: mode n is at least sqrt(n) times this bound.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

from stickslip.core.errors import ParameterError
from stickslip.machines.drivetrain import Chain, Modes, all_positive


def twist(torque: float, stiffness: float) -> float:
    """Return the static twist of a spring under a torque (N·m), rad; thesis 4.5."""
    all_positive("flexibility", "stiffness", (stiffness,), "N·m/rad")
    return torque / stiffness


def shaft_stiffness(diameter: float, length: float, shear_modulus: float, bore: float = 0.0) -> float:
    """Return the torsional stiffness of a round shaft, G pi (d^4 - b^4) / (32 L), N·m/rad.

    Parameters
    ----------
    diameter, length, bore : float
        m; the bore of a hollow shaft.
    shear_modulus : float
        Pa: 77e9 for stainless steel, 79e9 for steel, 26e9 for aluminium.

    Raises
    ------
    ParameterError
        If a number is not positive, or the bore is not smaller than the diameter.
    """
    all_positive("shaft", "diameter and length", (diameter, length), "m")
    all_positive("shaft", "shear modulus", (shear_modulus,), "Pa")
    if not 0.0 <= bore < diameter:
        raise ParameterError(
            f"shaft: bore = {bore:g} m must be 0 or more and below the diameter, {diameter:g} m"
        )
    return shear_modulus * math.pi * (diameter**4 - bore**4) / (32.0 * length)


def lowest_first_mode(stiffness: Sequence[float], total: float) -> float:
    """Return the lowest possible first elastic mode for inertias that add up to `total` (kg·m²), Hz."""
    all_positive("flexibility", "stiffness", stiffness, "N·m/rad")
    all_positive("flexibility", "inertia", (total,), "kg·m²")
    return math.sqrt(4.0 / (total * math.fsum(1.0 / k for k in stiffness))) / (2.0 * math.pi)


def far_inertia(stiffness: float, frequency: float) -> float:
    """Return the inertia that oscillates at `frequency` (Hz) on a spring with the other end fixed, kg·m²."""
    all_positive("flexibility", "stiffness", (stiffness,), "N·m/rad")
    all_positive("flexibility", "frequency", (frequency,), "Hz")
    return stiffness / (2.0 * math.pi * frequency) ** 2


@dataclass(frozen=True, eq=False)
class Flexibility:
    """Results of `flexibility` for a drivetrain.

    Attributes
    ----------
    stiffness : tuple of float
        N·m/rad
    inertia : float
        Of the whole drivetrain, kg·m².
    twists : mapping of str to tuple of float
        Static twist of every spring, rad, by the name of the torque.
    torques : mapping of str to float
        N·m
    floor : float
        Lowest possible first mode, Hz.
    chain, modes : Chain and Modes, or None
        If the inertias were given.
    claimed : tuple of float
        Claimed elastic modes, first, second and so on, Hz.
    far : float or None
        The last inertia, if the first claimed mode is its frequency with the rest fixed, kg·m².
    true_first : float or None
        The first mode of the free drivetrain with that last inertia and the rest in one piece, Hz; NaN if it exceeds
        the total.
    """

    stiffness: tuple[float, ...]
    inertia: float
    torques: dict[str, float]
    twists: dict[str, tuple[float, ...]]
    floor: float
    chain: Chain | None
    modes: Modes | None
    claimed: tuple[float, ...]
    far: float | None
    true_first: float | None

    def as_dict(self) -> dict[str, Any]:
        """Return plain data."""
        out: dict[str, Any] = {k: v for k, v in vars(self).items() if k not in ("chain", "modes")}
        out["chain"] = asdict(self.chain) if self.chain else None
        out["frequencies"] = self.modes.frequencies.tolist() if self.modes else None
        out["shapes"] = self.modes.shapes.tolist() if self.modes else None
        return out

    def lines(self) -> list[str]:
        """Return the lines of the report."""
        springs = ", ".join(f"{k:g}" for k in self.stiffness)
        out = [f"springs {springs} N·m/rad, inertia {self.inertia:.5g} kg·m²"]
        for name, torque in self.torques.items():
            values = ", ".join(f"{x:.3g}" for x in self.twists[name])
            out.append(f"twist under {torque:.4g} N·m{f' ({name})' if name else ''}: {values} rad")
        out.append(f"lowest possible first mode for this total inertia: {self.floor:.1f} Hz")
        if self.chain and self.modes:
            parts = ", ".join(f"{x:.4g}" for x in self.chain.inertias)
            listed = ", ".join(f"{f:.4g}" for f in self.modes.frequencies)
            out.append(f"inertias {parts} kg·m²: modes at {listed} Hz")
        for order, claim in enumerate(self.claimed, 1):
            out.append(self._verdict(order, claim))
        return out

    def lowest(self, order: int) -> float:
        """Return the lowest possible frequency of an elastic mode (1: the first) for this total inertia, Hz."""
        return math.sqrt(order) * self.floor

    def _verdict(self, order: int, claim: float) -> str:
        word = ("first", "second", "third", "fourth")[order - 1] if order < 5 else f"{order}th"
        if claim >= self.lowest(order):
            return f"a {word} mode at {claim:g} Hz is possible"
        if order > 1 or self.far is None or self.true_first is None:
            return f"a {word} mode at {claim:g} Hz is impossible: it is at least {self.lowest(order):.1f} Hz"
        far, true = self.far, self.true_first
        held = f"{far:.4g} kg·m² after the last spring oscillates at {claim:g} Hz with the rest fixed"
        if math.isnan(true):
            return (
                f"a first mode at {claim:g} Hz is impossible; {held}, but that is more than the whole inertia"
            )
        return (
            f"a first mode at {claim:g} Hz is impossible; {held}, and at {true:.4g} Hz in the free drivetrain"
        )


def flexibility(
    stiffness: Sequence[float],
    inertia: float,
    *,
    torques: dict[str, float] | None = None,
    inertias: Sequence[float] = (),
    claimed: Sequence[float] = (),
) -> Flexibility:
    """Return twists, modes and the bound of the first mode of a drivetrain; thesis 4.5.

    Parameters
    ----------
    stiffness : sequence of float
        N·m/rad, motor side first.
    inertia : float
        Of the whole drivetrain, kg·m²; `inertias` must add up to it within 1 %.
    torques : dict of str to float, optional
        Torques by name, N·m; the static twist of every spring is reported for each.
    inertias : sequence of float, optional
        Parts of the total, kg·m².
    claimed : sequence of float, optional
        Claimed elastic modes of one drivetrain, Hz: the first, the second, and so on, at most one for each spring.

    Raises
    ------
    ParameterError
    """
    all_positive("flexibility", "inertia", (inertia,), "kg·m²")
    all_positive("flexibility", "mode", claimed, "Hz")
    if list(claimed) != sorted(claimed) or len(claimed) > len(stiffness):
        raise ParameterError(
            f"flexibility: modes {', '.join(f'{f:g}' for f in claimed)} Hz must be increasing, at most one for each of "
            f"{len(stiffness)} springs; test alternatives one at a time"
        )
    chain = Chain(tuple(inertias), tuple(stiffness)) if inertias else None
    if chain and abs(chain.total - inertia) > 0.01 * inertia:
        raise ParameterError(
            f"flexibility: the inertias add up to {chain.total:.5g} kg·m², the whole is {inertia:.5g}; give parts of it"
        )
    given = torques or {}
    far = far_inertia(stiffness[-1], claimed[0]) if claimed else None
    return Flexibility(
        tuple(stiffness), inertia, dict(given),
        {name: tuple(twist(t, k) for k in stiffness) for name, t in given.items()},
        lowest_first_mode(stiffness, inertia), chain, chain.modes() if chain else None,
        tuple(claimed), far, None if far is None else _free_first(stiffness[-1], inertia, far),
    )  # fmt: skip


def _free_first(stiffness: float, total: float, last: float) -> float:
    """Return the first mode of the drivetrain if only its last spring is elastic, Hz."""
    if last >= total:
        return math.nan
    return float(Chain((total - last, last), (stiffness,)).modes().frequencies[1])
