"""The tracking experiments of thesis chapter 4, as cases for a rig: controllers over references, dry and greased."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from stickslip.control.compensator import Feedback, Feedforward
from stickslip.control.controller import Controller
from stickslip.control.linear import place
from stickslip.model import Model, Reference

__all__ = ["DESIGN_INERTIA", "GROUPS", "LAWS", "Case", "Group", "cases_of"]

DESIGN_INERTIA = 3.8623e-4
"""kg·m²: chapter 4 keeps the gains of chapter 3, which were placed with this (4.3.1.2, 3.2.2.2)."""
FILTER = 10.0
"""Hz, of the Butterworth low-pass before the GMS law (4.3.1.2.1)."""
LAWS = ("coulomb", "stribeck", "lugre", "gms")
REFERENCES: Mapping[str, tuple[Reference, float]] = {
    "low": (Reference("sine", amplitude=0.01, frequency=0.4), 5.0),
    "high": (Reference("sine", amplitude=0.5, frequency=0.1), 20.0),
    # The thesis gives its step as a picture; smoothed as in the simulation study.
    "step": (Reference("step", amplitude=0.01, tau=0.02), 3.0),
}


@dataclass(frozen=True)
class Group:
    """One figure of the thesis: a friction, a reference, and the controllers that it compares.

    Attributes
    ----------
    friction : {"dry", "grease"}
    reference : {"low", "high", "step"}
    linear : {"PD", "PID"}
        What the compensators are added to.
    bandwidth, damping : float
        Of its poles, Hz and -.
    rival : bool
        Whether a PID of the same bandwidth runs beside it.
    figures : tuple of str
        The thesis's, feedforward and feedback.
    """

    friction: str
    reference: str
    linear: str
    bandwidth: float
    damping: float
    rival: bool
    figures: tuple[str, ...]

    @property
    def name(self) -> str:
        """``dry-low-PD36``"""
        return f"{self.friction}-{self.reference}-{self.linear}{self.bandwidth:g}"


GROUPS = (
    Group("dry", "low", "PD", 36.0, 1.0, True, ("4.15", "4.16")),
    Group("dry", "high", "PD", 10.0, 0.85, True, ("4.17", "4.18")),
    Group("dry", "high", "PID", 10.0, 0.85, False, ("4.19", "4.21")),
    Group("dry", "step", "PD", 35.0, 0.9, True, ("4.23", "4.24")),
    Group("dry", "step", "PID", 10.0, 0.85, False, ("4.25", "4.26")),
    Group("grease", "low", "PD", 36.0, 1.0, True, ("7.2", "7.3")),
    Group("grease", "low", "PD", 25.0, 1.0, True, ("4.39", "4.40")),
    Group("grease", "low", "PID", 10.0, 0.85, False, ("4.41", "4.42")),
    Group("grease", "high", "PD", 10.0, 0.85, True, ("4.43", "4.44")),
    Group("grease", "high", "PID", 10.0, 0.85, False, ("4.45", "4.47")),
    Group("grease", "step", "PD", 35.0, 0.9, True, ("7.4", "7.5")),
    Group("grease", "step", "PD", 25.0, 0.9, True, ("4.48", "4.49")),
    Group("grease", "step", "PID", 10.0, 0.85, False, ("4.50", "4.51")),
)  # fmt: skip


@dataclass(frozen=True)
class Case:
    """One run: ``dry-low-PD36/FF-lugre``."""

    group: Group
    controller: str
    control: Controller
    reference: Reference
    duration: float

    @property
    def key(self) -> str:
        """``GROUP/CONTROLLER``"""
        return f"{self.group.name}/{self.controller}"


def cases_of(group: Group, models: Mapping[str, Model], sample_time: float, torque: float) -> Iterator[Case]:
    """Every run of a group: the linear controllers alone, each law both ways, GMS feedback with filter.

    Parameters
    ----------
    group : Group
    models : mapping of str to Model
        What the thesis identified on that friction (Tables 9 and 10).
    sample_time : float
        s
    torque : float
        Limit of the command, N·m.
    """
    reference, duration = REFERENCES[group.reference]
    gains = place(group.linear, DESIGN_INERTIA, group.bandwidth, group.damping)
    plain = {group.linear: Controller(gains, None, torque, sample_time)}
    if group.rival:
        pid = place("PID", DESIGN_INERTIA, group.bandwidth, group.damping)
        plain["PID"] = Controller(pid, None, torque, sample_time)
    helped = {f"FF-{law}": Feedforward(models[law]) for law in LAWS}
    helped |= {f"FB-{law}": Feedback(models[law]) for law in LAWS}
    helped["FB-gms10"] = Feedback(models["gms"], filter_hz=FILTER)
    for name, controller in plain.items():
        yield Case(group, name, controller, reference, duration)
    for name, compensator in helped.items():
        yield Case(group, name, Controller(gains, compensator, torque, sample_time), reference, duration)
