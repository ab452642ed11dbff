"""What the elasticity of a drive drivetrain does: static twist, modes, and what modes are possible at all; thesis 4.5.

A drivetrain is a chain of inertias joined by springs: motor rotor, coupling, shaft, friction disk (thesis figure 4.57).

Lowest possible first mode
--------------------------
For a free chain of n inertias with total J, whose spring i has J_left before it and J_right behind it, the modes obey

    sum over modes of 1/w^2 = sum over springs of J_left J_right / (J k_i)

(the trace of the flexibility matrix with the rigid motion taken out). A product of two parts of J is at most J^2/4 and
1/w_1^2 is at most the whole sum, so

    w_1^2 >= 4 / (J sum of 1/k_i),

reached with J/2 at each end and nothing between. No choice of inertias gives a lower first mode.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

from stickslip.errors import ParameterError
from stickslip.machines.drivetrain import Chain, Modes, all_positive


def twist(torque: float, stiffness: float) -> float:
    """Static twist of a spring under a torque (N·m), rad; thesis 4.5."""
    all_positive("flexibility", "stiffness", (stiffness,), "N·m/rad")
    return torque / stiffness


def lowest_first_mode(stiffness: Sequence[float], total: float) -> float:
    """The lowest first elastic mode that any inertias adding up to `total` (kg·m²) can have, Hz."""
    all_positive("flexibility", "stiffness", stiffness, "N·m/rad")
    all_positive("flexibility", "inertia", (total,), "kg·m²")
    return math.sqrt(4.0 / (total * math.fsum(1.0 / k for k in stiffness))) / (2.0 * math.pi)


def far_inertia(stiffness: float, frequency: float) -> float:
    """The inertia that rings at `frequency` (Hz) on a spring whose other end is held, kg·m²."""
    all_positive("flexibility", "stiffness", (stiffness,), "N·m/rad")
    all_positive("flexibility", "frequency", (frequency,), "Hz")
    return stiffness / (2.0 * math.pi * frequency) ** 2


@dataclass(frozen=True, eq=False)
class Flexibility:
    """What is known of a drivetrain: `flexibility` fills it.

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
        Lowest first mode that any inertias can have, Hz.
    chain, modes : Chain and Modes, or None
        Where the inertias were given.
    claimed : tuple of float
        First modes that someone states, Hz.
    far : tuple of float
        For every claimed one: the last inertia if it is that inertia's frequency with the rest held, kg·m².
    true_first : tuple of float
        The first mode of the free drivetrain with that last inertia, the rest undivided, Hz; NaN where it exceeds the
        total.
    """

    stiffness: tuple[float, ...]
    inertia: float
    torques: dict[str, float]
    twists: dict[str, tuple[float, ...]]
    floor: float
    chain: Chain | None
    modes: Modes | None
    claimed: tuple[float, ...]
    far: tuple[float, ...]
    true_first: tuple[float, ...]

    def as_dict(self) -> dict[str, Any]:
        """Plain data."""
        out: dict[str, Any] = {k: v for k, v in vars(self).items() if k not in ("chain", "modes")}
        out["chain"] = asdict(self.chain) if self.chain else None
        out["frequencies"] = self.modes.frequencies.tolist() if self.modes else None
        out["shapes"] = self.modes.shapes.tolist() if self.modes else None
        return out

    def lines(self) -> list[str]:
        """What people read."""
        springs = ", ".join(f"{k:g}" for k in self.stiffness)
        out = [f"springs {springs} N·m/rad, inertia {self.inertia:.5g} kg·m²"]
        for name, torque in self.torques.items():
            values = ", ".join(f"{x:.3g}" for x in self.twists[name])
            out.append(f"twist under {torque:.4g} N·m{f' ({name})' if name else ''}: {values} rad")
        out.append(f"lowest first mode that any inertias of this total can have: {self.floor:.1f} Hz")
        if self.chain and self.modes:
            parts = ", ".join(f"{x:.4g}" for x in self.chain.inertias)
            listed = ", ".join(f"{f:.4g}" for f in self.modes.frequencies)
            out.append(f"inertias {parts} kg·m²: modes at {listed} Hz")
        for claim, far, true in zip(self.claimed, self.far, self.true_first, strict=True):
            out.append(self._verdict(claim, far, true))
        return out

    def _verdict(self, claim: float, far: float, true: float) -> str:
        if claim >= self.floor:
            return f"a first mode at {claim:g} Hz is possible"
        held = f"{far:.4g} kg·m² behind the last spring oscillates at {claim:g} Hz with the rest held"
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
    """Twists, modes and the bound on the first mode of a drivetrain; thesis 4.5.

    Parameters
    ----------
    stiffness : sequence of float
        N·m/rad, motor side first.
    inertia : float
        Of the whole drivetrain, kg·m²; given `inertias` add up to it within 1 %.
    torques : dict of str to float, optional
        Torques by name, N·m; the static twist of every spring is reported for each.
    inertias : sequence of float, optional
        How the total is divided, kg·m².
    claimed : sequence of float, optional
        First modes to judge, Hz.

    Raises
    ------
    ParameterError
    """
    all_positive("flexibility", "inertia", (inertia,), "kg·m²")
    all_positive("flexibility", "first mode", claimed, "Hz")
    chain = Chain(tuple(inertias), tuple(stiffness)) if inertias else None
    if chain and abs(chain.total - inertia) > 0.01 * inertia:
        raise ParameterError(
            f"flexibility: the inertias add up to {chain.total:.5g} kg·m², the whole is {inertia:.5g}; give parts of it"
        )
    given = torques or {}
    far = tuple(far_inertia(stiffness[-1], f) for f in claimed)
    return Flexibility(
        tuple(stiffness), inertia, dict(given),
        {name: tuple(twist(t, k) for k in stiffness) for name, t in given.items()},
        lowest_first_mode(stiffness, inertia), chain, chain.modes() if chain else None,
        tuple(claimed), far, tuple(_free_first(stiffness[-1], inertia, last) for last in far),
    )  # fmt: skip


def _free_first(stiffness: float, total: float, last: float) -> float:
    """First mode of the drivetrain when only its last spring gives, Hz."""
    if last >= total:
        return math.nan
    return float(Chain((total - last, last), (stiffness,)).modes().frequencies[1])
