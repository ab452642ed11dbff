"""A drivetrain as a linear system about rest: the one place that gives its matrices.

Stability, the observers' limits, the response of a resonance run, the modes and the virtual machine's flow between two
samples all take them from here; `stickslip.machines.machine.Machine.linear` lays out a machine.
"""

from __future__ import annotations

import importlib
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from stickslip.core.errors import ParameterError

Array = np.ndarray[Any, np.dtype[np.float64]]
Complex = np.ndarray[Any, np.dtype[np.complex128]]

INPUTS = ("command", "motor", "encoder", "load")
"""Torques that act, N·m: what the amplifier is told, and those on the first inertia, the encoder's and the last."""


TERMS = 14
"""Of the series of exp(x): for |x| < 1/2 what is left out is below 1e-16."""

SWEEPS = 20
"""Of balancing a matrix: after so many the norm of a chain's falls no more."""


def all_positive(owner: str, name: str, values: Sequence[float], unit: str) -> None:
    """Refuse numbers of which one is not positive."""
    for value in values:
        if not (value > 0.0 and math.isfinite(value)):
            raise ParameterError(f"{owner}: {name} = {value:g} {unit} must be greater than 0 and finite")


@dataclass(frozen=True, eq=False)
class Modes:
    """Undamped modes of a chain.

    Attributes
    ----------
    frequencies : array, shape (n,)
        Hz, ascending; the first is the rigid motion.
    shapes : array, shape (n, n)
        Angles of the inertias (rows) in every mode (columns), the largest 1.
    """

    frequencies: Array
    shapes: Array


@dataclass(frozen=True)
class Chain:
    """Inertias in a row, joined by springs, free to turn as a whole.

    Attributes
    ----------
    inertias : tuple of float
        kg·m², motor first.
    stiffness : tuple of float
        N·m/rad, one fewer than the inertias.
    """

    inertias: tuple[float, ...]
    stiffness: tuple[float, ...]

    def __post_init__(self) -> None:
        all_positive("drivetrain", "inertias", self.inertias, "kg·m²")
        all_positive("drivetrain", "stiffness", self.stiffness, "N·m/rad")
        if len(self.inertias) != len(self.stiffness) + 1:
            raise ParameterError(
                f"chain: {len(self.inertias)} inertias and {len(self.stiffness)} springs; give one spring fewer"
            )

    @property
    def total(self) -> float:
        """kg·m²"""
        return math.fsum(self.inertias)

    def stiffness_matrix(self) -> Array:
        """K in J q'' + K q = T, N·m/rad, shape (n, n)."""
        k = np.zeros((len(self.inertias),) * 2)
        for i, spring in enumerate(self.stiffness):
            k[i : i + 2, i : i + 2] += spring * np.array([[1.0, -1.0], [-1.0, 1.0]])
        return k

    def modes(self) -> Modes:
        """Undamped modes."""
        linalg: Any = importlib.import_module("scipy.linalg")
        squares, shapes = linalg.eigh(self.stiffness_matrix(), np.diag(self.inertias))
        frequencies = np.sqrt(np.maximum(squares, 0.0)) / (2.0 * math.pi)
        frequencies[0] = 0.0  # the rigid motion, exactly
        largest = shapes[np.argmax(np.abs(shapes), axis=0), np.arange(shapes.shape[1])]
        return Modes(frequencies, shapes / largest)


@dataclass(frozen=True)
class LinearContact:
    """A friction law for small motion about rest: torque = stiffness x + damping v (N·m/rad, N·m·s/rad)."""

    stiffness: float
    damping: float = 0.0


FREE = LinearContact(0.0)
"""No contact, or one that slides at a constant torque."""


@dataclass(frozen=True, eq=False)
class Flow:
    """What a step makes of a linear system: x at its end = moved x + held u + rising (what u grows by within it).

    Attributes
    ----------
    moved : array, shape (n, n)
    held, rising : array, shape (n, m)
        Of inputs that stay as they are, and of inputs that rise evenly from 0 to 1.
    """

    moved: Array
    held: Array
    rising: Array

    def doubled(self) -> Flow:
        """The flow over twice as long a step."""
        return Flow(
            self.moved @ self.moved, self.moved @ self.held + self.held,
            0.5 * (self.moved @ self.rising + self.held + self.rising),
        )  # fmt: skip


@dataclass(frozen=True, eq=False)
class StateSpace:
    """dx/dt = A x + B u, measured angle = C x; SI units.

    Attributes
    ----------
    a : array, shape (n, n)
    b : array, shape (n, 4)
        By torques, N·m, in the order of `INPUTS`.
    c : array, shape (1, n)
        rad
    states : tuple of str
        What each state is: ``angle[0]`` (rad), ``velocity[0]`` (rad/s), ... of every inertia, ``torque`` of the motor
        behind its current loop (N·m), ``mode`` and ``mode_velocity`` of the encoder's mounting.
    """

    a: Array
    b: Array
    c: Array
    states: tuple[str, ...]

    def over(self, step: float) -> Flow:
        """The exact flow over a step, s: matrix exponential with held and rising inputs, Van Loan 1978."""
        n, m = self.b.shape
        big = np.zeros((n + 2 * m, n + 2 * m))
        big[:n, :n], big[:n, n : n + m] = self.a * step, self.b * step
        big[n : n + m, n + m :] = np.eye(m)
        flow = exponential(big)[:n]
        return Flow(flow[:, :n], flow[:, n : n + m], flow[:, n + m :])

    def response(self, frequency: Array, source: str = "command") -> Complex:
        """Measured angle per torque at frequencies in Hz, rad/(N·m); ``source`` is one of `INPUTS`."""
        s = 2j * math.pi * np.asarray(frequency, dtype=np.float64)
        left = s[:, None, None] * np.eye(self.a.shape[0]) - self.a
        into = self.b[:, INPUTS.index(source)].astype(np.complex128)
        states = np.linalg.solve(left, np.broadcast_to(into[:, None], (s.size, into.size, 1)))
        return np.asarray((self.c @ states)[:, 0, 0], dtype=np.complex128)


@dataclass(frozen=True)
class Drivetrain:
    """What the drive moves.

    Attributes
    ----------
    inertias : tuple of float
        kg·m², motor first; one alone is the rigid axis.
    springs : tuple of float
        N·m/rad between them.
    dampers : tuple of float
        N·m·s/rad beside the springs; empty for none.
    contact : LinearContact
        On the last inertia; its stiffness is 0 while the contact slides.
    encoder : int
        The inertia whose angle is measured.
    encoder_mode, encoder_damping : float
        Resonance of the encoder's mounting, Hz, and its damping ratio; 0 Hz for none.
    encoder_share : float
        Part of the reading that goes through it: (1 - share) angle + share (angle of a mass that follows it).
    amplifier : float
        Bandwidth of the current loop, Hz (first order); infinite for none.
    bearings : LinearContact
        On the encoder's inertia.
    """

    inertias: tuple[float, ...]
    springs: tuple[float, ...] = ()
    contact: LinearContact = FREE
    dampers: tuple[float, ...] = ()
    encoder: int = 0
    encoder_mode: float = 0.0
    encoder_damping: float = 0.0
    encoder_share: float = 1.0
    amplifier: float = math.inf
    bearings: LinearContact = FREE

    def __post_init__(self) -> None:
        Chain(self.inertias, self.springs)
        if not 0 <= self.encoder < len(self.inertias):
            raise ParameterError(f"drivetrain: encoder = {self.encoder} is not the number of an inertia")
        if self.dampers and len(self.dampers) != len(self.springs):
            raise ParameterError(f"drivetrain: {len(self.dampers)} dampers for {len(self.springs)} springs")

    @property
    def chain(self) -> Chain:
        """Its inertias and springs alone, whose modes are those of the free, undamped drivetrain."""
        return Chain(self.inertias, self.springs)

    def softer(self, share: float) -> Drivetrain:
        """The same, but that the encoder sees only so much of the contact: some of its elements slip."""
        seen = share * (self.visible - self.bearings.stiffness)
        if seen <= 0.0:
            return replace(self, contact=replace(self.contact, stiffness=0.0))
        behind = 1.0 / seen - math.fsum(1.0 / k for k in self.springs[self.encoder :])
        return replace(self, contact=replace(self.contact, stiffness=1.0 / behind))

    @property
    def reach(self) -> float:
        """How much of a slow motion of the encoder arrives at the contact."""
        compliance = math.fsum(1.0 / k for k in self.springs[self.encoder :])
        return 1.0 / (1.0 + self.contact.stiffness * compliance)

    @property
    def visible(self) -> float:
        """Stiffness of the contact as the encoder sees it, shaft included, N·m/rad."""
        behind = self.springs[self.encoder :]
        beside = self.bearings.stiffness
        if self.contact.stiffness <= 0.0:
            return beside
        return beside + 1.0 / (1.0 / self.contact.stiffness + math.fsum(1.0 / k for k in behind))

    def state_space(self) -> StateSpace:
        """Its matrices: angle and velocity of every inertia in turn, then the motor's lagging torque, then the mode."""
        bodies = len(self.inertias)
        lag = 2 * bodies
        mode = lag + math.isfinite(self.amplifier)
        size = mode + 2 * (self.encoder_mode > 0.0)
        a, b, c = np.zeros((size, size)), np.zeros((size, len(INPUTS))), np.zeros((1, size))
        self._mechanics(a)
        measured, last = 2 * self.encoder, 2 * bodies - 2
        for column, place in enumerate((0, 0, measured, last)):
            b[place + 1, column] = 1.0 / self.inertias[place // 2]
        c[0, measured] = 1.0
        names = [f"{what}[{i}]" for i in range(bodies) for what in ("angle", "velocity")]
        if math.isfinite(self.amplifier):
            corner = 2.0 * math.pi * self.amplifier
            a[lag, lag], a[1, lag] = -corner, 1.0 / self.inertias[0]
            b[1, 0], b[lag, 0] = 0.0, corner
            names.append("torque")
        if self.encoder_mode > 0.0:
            w = 2.0 * math.pi * self.encoder_mode
            damped = 2.0 * self.encoder_damping * w
            a[mode, mode + 1] = 1.0
            a[mode + 1, mode], a[mode + 1, measured] = -(w**2), w**2
            a[mode + 1, mode + 1], a[mode + 1, measured + 1] = -damped, damped
            c[0, measured], c[0, mode] = 1.0 - self.encoder_share, self.encoder_share
            names += ["mode", "mode_velocity"]
        return StateSpace(a, b, c, tuple(names))

    def _mechanics(self, a: Array) -> None:
        """Write what inertias, springs, dampers and contacts do."""
        for i in range(len(self.inertias)):
            a[2 * i, 2 * i + 1] = 1.0
        dampers = self.dampers or (0.0,) * len(self.springs)
        for i, (k, d) in enumerate(zip(self.springs, dampers, strict=True)):
            for body, sign in ((i, -1.0), (i + 1, 1.0)):
                row, inertia = 2 * body + 1, self.inertias[body]
                a[row, 2 * i] += sign * k / inertia
                a[row, 2 * i + 2] -= sign * k / inertia
                a[row, 2 * i + 1] += sign * d / inertia
                a[row, 2 * i + 3] -= sign * d / inertia
        for body, own in ((self.encoder, self.bearings), (len(self.inertias) - 1, self.contact)):
            a[2 * body + 1, 2 * body] -= own.stiffness / self.inertias[body]
            a[2 * body + 1, 2 * body + 1] -= own.damping / self.inertias[body]


def exponential(x: Array) -> Array:
    """exp of a small matrix: the series of a part of it, squared.

    SciPy solves equations for it, at which OpenBLAS wakes a thread and, where other programs keep the cores busy, waits
    for it for milliseconds.
    """
    units = balanced_units(x)
    x = x * units / units[:, None]
    halvings = max(0, math.frexp(float(np.abs(x).sum(axis=1).max()))[1] + 1)
    part, unit = x * 0.5**halvings, np.eye(len(x))
    found = unit
    for order in range(TERMS, 0, -1):
        found = unit + part @ found / order
    for _ in range(halvings):
        found = found @ found
    return found * units[:, None] / units


def balanced_units(x: Array) -> Array:
    """Units of the states, powers of two, in which rows and columns of ``x`` weigh alike.

    In radians and rad/s a stiff contact's matrix has a norm a thousand times its frequencies: ten halvings more, each
    of which doubles what rounding leaves (Parlett and Reinsch 1969, doi:10.1007/BF02165404). SciPy's `matrix_balance`
    finds the like, and would be the first call of a run to load SciPy.
    """
    size = np.abs(x) * (1.0 - np.eye(len(x)))
    units = np.ones(len(x))
    for _ in range(SWEEPS):
        rows, columns = (size @ units) / units, (1.0 / units @ size) * units
        both = (rows > 0.0) & (columns > 0.0)
        # The fourth root, as the neighbours move at the same time.
        units[both] *= (rows[both] / columns[both]) ** 0.25
    return np.exp2(np.round(np.log2(units)))
