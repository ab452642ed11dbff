"""The sampled attribute that best separates the axes on which a setting is refused from those on which it is safe.

Every sampled axis has attributes: the sampled values of the estimates (friction, inertia, offset), and properties of
drive and machine (delay, current loop, reference velocity, torque over the position). For every attribute the distance
between its distributions on both groups of axes is computed (Kolmogorov and Smirnov); it is the best that one
threshold can do. The largest distance names the attribute, if chance alone does not explain it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from stickslip.core.messages import name_option
from stickslip.identification.identified_file import Identified
from stickslip.identification.needed_motions import motion_for
from stickslip.machines.rigid import RigidAxis
from stickslip.machines.two_mass import TwoMassAxis
from stickslip.models.friction_levels import static_level
from stickslip.recommendation.plant import Plant

LEVEL = 0.05
"""Significance level: probability that chance alone separates some attribute as well (Bonferroni over all of them)."""
REFERENCE_VELOCITY = "reference velocity"


@dataclass(frozen=True)
class Attribute:
    """A sampled attribute of an axis or its drive.

    Attributes
    ----------
    name, unit : str
        As text; the unit is that of the axis.
    remedy : str
        Action that the user can take.
    """

    name: str
    unit: str
    remedy: str


@dataclass(frozen=True)
class Separation:
    """How well a threshold on an attribute separates refused axes from the others.

    Attributes
    ----------
    attribute : Attribute
    bound : float
        The threshold.
    above : bool
        Whether the refused axes are above it.
    refused : tuple of (int, int)
        Number of refused axes on that side of the threshold, and on the other side.
    axes : tuple of (int, int)
        Number of axes on that side, and on the other side.
    """

    attribute: Attribute
    bound: float
    above: bool
    refused: tuple[int, int]
    axes: tuple[int, int]

    def side(self, above: bool) -> str:
        """Return the axes on one side of the threshold, as text."""
        a = self.attribute
        if a.name == REFERENCE_VELOCITY:
            return f"whose drive forms its reference velocity {self._formed(above)}"
        unit = f" {a.unit}" if a.unit else ""
        return f"with {a.name} {'above' if above else 'below'} {self.bound:.3g}{unit}"

    @property
    def remedy(self) -> str:
        """Return the remedy for the user."""
        if self.attribute.name != REFERENCE_VELOCITY:
            return self.attribute.remedy
        good = "instant" if self.above else "difference"
        return (
            f"if your drive forms it {self._formed(not self.above)}, state {name_option('reference_velocity', good)}; "
            "else set the drive to it"
        )

    def _formed(self, difference: bool) -> str:
        """Return how a drive forms its reference velocity, as text."""
        return (
            "as the difference of two reference positions" if difference else "at the instant of the sample"
        )

    @property
    def words(self) -> str:
        """Return which axes are refused, in a clause."""
        (here, there), (n, m) = self.refused, self.axes
        return f"they are {here} of the {n} axes {self.side(self.above)}, and {there} of the {m} others"


def attributes_of(found: Identified) -> Callable[[Plant], dict[str, tuple[Attribute, float]]]:
    """Return the function that gives the attributes of a sampled axis of this model, with their values."""
    torque, angle = found.unit("N·m"), found.unit("rad")
    units = {e.name: e.unit for e in found.estimates}
    resonance = f"record faster motion, or give the machine with {name_option('machine')}"

    def named(name: str) -> Attribute:
        return Attribute(name, units.get(name, ""), f"record {motion_for(name)}, which determines {name}")

    def of(plant: Plant) -> dict[str, tuple[Attribute, float]]:
        own: Any = plant.friction.parameters
        out = {name: (named(name), value) for name, value in plant.sampled.items()}
        further = [
            ("inertia", found.unit("kg·m²"), plant.inertia,
             f"give the axis's own with {name_option('inertia')}, or identify a record with stronger accelerations"),
            ("delay", "samples", plant.delay, f"give the drive's command delay with {name_option('delay')}"),
            ("current loop bandwidth", "Hz", plant.bandwidth,
             f"describe the drive with {name_option('machine')}, whose amplifier has the bandwidth"),
            (REFERENCE_VELOCITY, "", float(plant.backward),
             ""),
            ("torque over the position", f"{torque} RMS", plant.unmodelled,
             "identify and compensate the torque over the position first (`stickslip identify --position`)"),
        ]  # fmt: skip
        if plant.friction.law.steady and math.isfinite(level := static_level(plant.friction)):
            further.append(("friction at rest", torque, level, f"record {motion_for('fs')}"))
            if hasattr(own, "sigma0") and own.sigma0 > 0.0:
                further.append((
                    "break-away displacement", angle, level / own.sigma0, f"record {motion_for('sigma0')}",
                ))  # fmt: skip
        if isinstance(plant.flexible, TwoMassAxis):
            flexible = plant.flexible
            further.append(("load inertia over the whole", "", flexible.load / plant.inertia, resonance))
            further.append(
                ("stiffness of the drivetrain", f"{torque}/{angle}", flexible.stiffness, resonance)
            )
        if plant.machine is not None:
            further.append(
                ("start angle", angle, plant.machine.start_angle, "start the motion at another angle")
            )
        return {**out, **{name: (Attribute(name, unit, remedy), x) for name, unit, x, remedy in further}}

    return of


def separate(found: Identified, plants: Sequence[RigidAxis], refused: Sequence[bool]) -> Separation | None:
    """Return the attribute that best separates the refused axes from the others; None if chance explains them all."""
    values = attributes_of(found)
    pairs = [(values(p), bad) for p, bad in zip(plants, refused, strict=True) if isinstance(p, Plant)]
    bad = np.array([b for _, b in pairs], dtype=np.bool_)
    n, m = int(np.sum(bad)), int(np.sum(~bad))
    if not n or not m:
        return None
    common = [name for name in pairs[0][0] if all(name in own for own, _ in pairs)]
    columns = {name: np.array([own[name][1] for own, _ in pairs]) for name in common}
    columns = {name: x for name, x in columns.items() if np.unique(x).size > 1}
    found_by = {name: _best_threshold(x, bad) for name, x in columns.items()}
    if not found_by:
        return None
    best = max(found_by, key=lambda name: found_by[name][0])
    distance, bound, above = found_by[best]
    chance = 2.0 * math.exp(-2.0 * distance**2 * n * m / (n + m))
    if distance == 1.0:  # exact: with few axes one threshold often separates them by chance
        chance = min(chance, 2.0 / math.comb(n + m, n))
    if len(columns) * chance > LEVEL:
        return None
    side = (columns[best] > bound) == above
    here, there = int(np.sum(bad & side)), int(np.sum(bad & ~side))
    return Separation(
        pairs[0][0][best][0], bound, above, (here, there), (int(np.sum(side)), int(np.sum(~side)))
    )


def _best_threshold(x: Any, bad: Any) -> tuple[float, float, bool]:
    """Return the largest distance of both distribution functions, its threshold, and whether the failed ones are above
    it."""
    places = np.unique(x)
    low, high = places[:-1], places[1:]
    below = x[None, :] <= low[:, None]
    gap = np.mean(below[:, ~bad], axis=1) - np.mean(below[:, bad], axis=1)
    k = int(np.argmax(np.abs(gap)))
    bound = 0.5 * (low[k] + high[k]) if math.isfinite(high[k]) else low[k]
    return float(abs(gap[k])), float(bound), bool(gap[k] > 0.0)


def dependence(
    found: Identified, plants: Sequence[RigidAxis], errors: Sequence[float], factor: float
) -> tuple[Separation, float, float] | None:
    """Return the attribute on which the remaining error depends most, with the median errors on its worse and better
    side.

    None if the ratio of both medians is at most `factor`.

    Parameters
    ----------
    found : Identified
    plants : sequence of RigidAxis
        Sampled axes.
    errors : sequence of float
        Remaining error on each.
    factor : float
    """
    if not errors:
        return None
    left = np.array(errors)
    middle = np.median(left)
    larger = left >= middle if np.any(left < middle) else left > middle
    split = separate(found, plants, larger.tolist())
    if split is None:
        return None
    values = attributes_of(found)
    x = np.array([values(p)[split.attribute.name][1] for p in plants if isinstance(p, Plant)])
    side = (x > split.bound) == split.above
    worse, better = float(np.median(left[side])), float(np.median(left[~side]))
    return (split, worse, better) if worse > factor * better else None
