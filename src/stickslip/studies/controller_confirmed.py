"""The stability of a controller made of control laws held against the virtual rig, with its loop softer and stiffer.

The poles are linear, about rest. The rig has the laws themselves, quantisation, noise, ripple, cogging, a torque limit.
A push too small to make the contact slip starts the motion; what is left of it in the end, over what the machine leaves
without any torque, is the verdict (`stickslip.studies.stability_map`).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

from stickslip.analyse.controller_margins import about, straight_to
from stickslip.analyse.machine_axis import axis_of
from stickslip.analyse.presliding_loop import Loop
from stickslip.analyse.wording import quantity
from stickslip.control.controller import Controller
from stickslip.control.linear import Gains
from stickslip.machines.machine import Machine
from stickslip.rigs.virtual import VirtualRig
from stickslip.studies.stability_map import RESTLESS, Judged, moved

FACTORS = (0.25, 0.5, 1.0, 1.5, 2.0, 3.0, 5.0, 8.0)
"""By which the gains of the loop are multiplied."""


@dataclass(frozen=True)
class Scaled(Judged):
    """The controller with its loop's gains times a factor.

    Attributes
    ----------
    factor : float
    growth, frequency : float
        Of the least stable pole for motion as large as counts for unrest, 1/s and Hz.
    moved : float
        What the encoder shows in the end: RMS about its mean, or its way from where it stood before the push, rad;
        infinite where the rig stopped it.
    calm : bool
        Whether that is rest.
    linear_to : float
        Motion up to which the controller is linear, rad: poles for a larger one are of another loop.
    is_linear : bool
        Whether it is over the motion that its poles are said of.
    """

    factor: float
    growth: float
    frequency: float
    moved: float
    calm: bool
    linear_to: float
    is_linear: bool


@dataclass(frozen=True)
class ConfirmedController:
    """Poles and simulations over the gains of the loop.

    Attributes
    ----------
    machine : str
    alone : float
        Motion of the machine without torque, rad.
    amplitude : float
        Of the motion that the poles are said of, rad: that from which a loop is restless.
    points : tuple of Scaled
    """

    machine: str
    alone: float
    amplitude: float
    points: tuple[Scaled, ...]

    def as_dict(self) -> dict[str, Any]:
        """Plain data."""
        return {
            "machine": self.machine,
            "alone": self.alone,
            "amplitude": self.amplitude,
            "points": [vars(p) for p in self.points],
        }

    def lines(self) -> Iterator[str]:
        """What people read."""
        told = [p for p in self.points if p.is_linear]
        agreed = sum(p.agrees for p in told)
        yield ""
        yield (
            f"on the virtual {self.machine}, pushed at rest; without torque it moves {1e6 * self.alone:.1f} µrad, from "
            f"{RESTLESS:g} times that, or that many counts, a loop is restless; poles of motion of "
            f"{quantity(self.amplitude, 'rad')}:"
        )
        yield f"{'loop times':>13}  {'poles':<10}{'rig':<10}{'motion left':>12}"
        for p in self.points:
            left = f"{1e6 * p.moved:.1f} µrad" if math.isfinite(p.moved) else "stopped"
            poles, rig = "stable" if p.stable else "unstable", "calm" if p.calm else "restless"
            apart = "  (apart)" if p.is_linear and not p.agrees else ""
            yield f"{p.factor:>13g}  {poles if p.is_linear else 'none':<10}{rig:<10}{left:>12}{apart}"
        if told:
            yield f"{agreed} of {len(told)} loops do what the poles say"
        if bent := [p.linear_to for p in self.points if not p.is_linear]:
            yield (
                f"{len(bent)} of {len(self.points)} loops have no poles for such motion: the controller is linear "
                f"about rest only up to {quantity(min(bent), 'rad')}; the rig alone says what they do"
            )


def scaled(controller: Controller, factor: float) -> Controller | None:
    """The controller with its loop's gains times a factor; None where its loops are not gains alone."""
    values: dict[str, float] = {}
    for part, block in controller.blocks.items():
        if block.law.place == "loop":
            form = block.law.continuous(block.parameters) if block.law.continuous else None
            if not isinstance(form, Gains):
                return None
            values |= {f"{part}_{k}": factor * v for k, v in block.own.items() if k in Gains._fields}
    return controller.with_values(values) if values else None


def confirmed_controller(
    machine: Machine, controller: Controller, factors: Sequence[float] = FACTORS
) -> ConfirmedController:
    """Simulate a controller as it is, and with its loop softer and stiffer where that is made of gains.

    Parameters
    ----------
    machine : Machine
        With the imperfections that it has.
    controller : Controller
        At the machine's sample time.
    factors : sequence of float
        On the gains of the loop.

    Raises
    ------
    InputError
        If the controller has another sample time, or a law is not smooth about rest.
    """
    limit = min(controller.torque_limit, VirtualRig(machine).limits.torque)
    alone = moved(machine, None)
    most = restless_from(machine, alone) / math.sqrt(2.0)
    axis = axis_of(machine, restless_from(machine, alone))
    points: list[Scaled] = []
    for factor in factors:
        tried = controller if factor == 1.0 else scaled(controller, factor)
        if tried is not None:
            poles = Loop(*about(axis, tried, machine.delay, axis.amplitude)).poles()
            found = moved(machine, replace(tried, torque_limit=limit))
            straight = straight_to(axis, tried, axis.amplitude, poles)
            points.append(
                Scaled(
                    factor,
                    poles.growth,
                    poles.frequency,
                    found,
                    found < most,
                    straight,
                    straight >= axis.amplitude,
                )
            )
    return ConfirmedController(machine.name, alone, axis.amplitude, tuple(points))


def restless_from(machine: Machine, alone: float) -> float:
    """Amplitude from which motion is unrest on a machine that moves so much without torque (RMS), rad."""
    count = 2.0 * math.pi / machine.encoder.counts if machine.encoder.counts > 0.0 else 0.0
    return math.sqrt(2.0) * RESTLESS * max(alone, count)
