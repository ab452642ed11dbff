"""The constant torque of levels in both directions: half of what the torques at one speed add up to."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np

from stickslip.identify.estimate import Estimate, Identification
from stickslip.identify.fit.student import student_quantile
from stickslip.identify.fit.uncertainty import too_wide
from stickslip.identify.sliding.points import SlidingPoints

Array = np.ndarray[Any, np.dtype[np.float64]]

FEWEST = 3
"""Speeds in both directions without which nothing is said."""


def constant_torque(points: SlidingPoints) -> Estimate | None:
    """The constant torque that acts against positive motion, N·m; None where both directions do not show one.

    At constant velocities it is half of the sum of the torques in both directions, whatever friction is; friction that
    differs by direction looks alike. Its interval is Student's over the speeds, no narrower than the points' own.
    """
    halves, variances = _halves(points)
    if halves.size < FEWEST:
        return None
    weights = 1.0 / variances if points.absolute else np.ones(halves.size)
    weights /= np.sum(weights)
    value = float(weights @ halves)
    spread = math.sqrt(float(weights @ (halves - value) ** 2) / (halves.size - 1))
    own = math.sqrt(float(weights**2 @ variances)) if points.absolute else 0.0
    std = max(spread, own)
    half = student_quantile(halves.size - 1) * std
    if abs(value) <= half:
        return None
    scale, unit = float(np.median(np.abs(points.torque))), points.unit[1]
    verdict = too_wide(half, unit, scale)
    return Estimate("offset", unit, "T_0", value, std, value - half, value + half, not verdict, verdict)


def _halves(points: SlidingPoints) -> tuple[Array, Array]:
    """Half of the sum of the mean torques in both directions by speed, and its variance; shape (speeds,)."""
    labels, side = points.speeds(), points.side
    std = np.zeros(len(points)) if points.std is None else points.std
    found: list[tuple[float, float]] = []
    for label in np.unique(labels[points.velocity != 0.0]):
        both = [
            np.flatnonzero((labels == label) & (side == way) & (points.velocity != 0.0))
            for way in (1.0, -1.0)
        ]
        if all(rows.size for rows in both):
            mean = sum(float(np.mean(points.torque[rows])) for rows in both)
            variance = sum(float(np.sum(std[rows] ** 2)) / rows.size**2 for rows in both)
            found.append((0.5 * mean, 0.25 * variance))
    halves, variances = np.array(found).reshape(-1, 2).T
    return halves, variances


def without(points: SlidingPoints, constant: Estimate | None) -> SlidingPoints:
    """The points less a constant torque."""
    return points if constant is None else replace(points, torque=points.torque - constant.value)


def beside(found: Identification, constant: Estimate | None) -> Identification:
    """A curve with the constant torque that was taken off its points."""
    if constant is None:
        return found
    size = len(found.estimates)
    correlation = np.eye(size + 1)
    correlation[:size, :size] = found.correlation
    note = (
        f"A constant torque of {constant.value:.3g} {constant.unit} was taken off: half of what both directions add up "
        "to. Friction that differs by direction looks alike."
    )
    return replace(
        found, estimates=(*found.estimates, constant), correlation=correlation, notes=(note, *found.notes),
        details={**found.details, "constant_torque": constant.value},
    )  # fmt: skip
