"""How far a controller is from oscillating on a machine: the verb `stability`."""

from __future__ import annotations

import math
import os
from dataclasses import replace

from stickslip.analyse.controller_margins import ControllerStability, controller_stability
from stickslip.analyse.machine_axis import axis_of
from stickslip.control.controller import Controller
from stickslip.control.files import read_controller
from stickslip.control.own_loop import USUAL_TIME
from stickslip.core.arguments import arguments_checked
from stickslip.core.errors import InputError
from stickslip.machines.files import load_machine
from stickslip.machines.machine import Machine
from stickslip.machines.rigid import RigidAxis
from stickslip.models.model import Model
from stickslip.recommendation.plant import Plant


@arguments_checked
def stability(
    machine: Machine | RigidAxis | str | os.PathLike[str],
    controller: Controller | str | os.PathLike[str],
    *,
    amplitude: float | None = None,
    delay: float | None = None,
) -> ControllerStability:
    """Poles, and the gain and delay that the loop still bears, while the contact sticks and while it slides.

    The sampled loop about rest (thesis 5.2): the contact is a spring while it sticks, and friction laws that the
    controller holds enter by their describing functions for a motion of `amplitude`; so does the limit cycle that a
    loop ends in.

    What is judged is small motion about rest. Whether an integral action against static friction sticks and slips for
    ever (hunts) no poles tell: the result says where that may be (`held`), and a long `simulate` at rest decides it,
    by its metric `limit_cycle_amplitude_rad`.

    Parameters
    ----------
    machine : Machine, RigidAxis or path
        A rigid axis has no delay, and the controller's encoder; a path is that of a machine's file, or its name in the
        library.
    controller : Controller or path
        Sampled, at the machine's sample time where it has none; another one is taken as it is. A path is that of a file
        with a table [controller].
    amplitude : float, optional
        Of the motion at the encoder, rad; one count of it, or 1e-6, unless given.
    delay : float, optional
        Of the torque, samples; the machine's unless given.

    Returns
    -------
    ControllerStability
        Prints as `stickslip analyse stability --controller` does; `loops` has poles of both, and their margins
        in gain (dB), phase (degrees, with the crossover in Hz), torque and delay.

    Raises
    ------
    InputError
        If the controller acts in continuous time and the axis has no sample time, a law is not smooth about rest, or a
        number is out of bounds.
    """
    if amplitude is not None and not 0.0 < amplitude < math.inf:
        raise InputError(f"stability: amplitude = {amplitude:g} rad must be greater than 0 and finite")
    at_hand = load_machine(machine) if isinstance(machine, (str, os.PathLike)) else machine
    models = dict(at_hand.models) if isinstance(at_hand, Machine) else dict[str, Model]()
    sample_time = at_hand.sample_time if isinstance(at_hand, Machine) else 0.0
    held = (
        controller
        if isinstance(controller, Controller)
        else read_controller(controller, at_hand.inertia, models, sample_time)
    )
    held = replace(held, sample_time=held.sample_time or sample_time)
    plant = at_hand
    if isinstance(plant, RigidAxis):
        plant = Plant(plant.inertia, plant.friction).built(
            held.sample_time or USUAL_TIME, held.encoder_counts
        )
    late = plant.delay if delay is None else delay
    return controller_stability(axis_of(plant, amplitude or 0.0), held, late)
