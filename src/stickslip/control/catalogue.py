"""Compensators by name, each made for an axis from what is believed of it: what the bench compares.

A compensator's numbers follow from the belief and the loop's bandwidth w: the corner of an observer is 2 w, the pace of
what adapts that of an integral action, the width of a boundary layer what a sample of delay leaves stable.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from stickslip.control import registry
from stickslip.control.belief import Belief
from stickslip.control.block import ControlBlock
from stickslip.control.controller import Controller
from stickslip.core.errors import ParameterError, UnknownName
from stickslip.models.model import Model

LOOPS = ("PD", "PID")
DAMPING = 1.0


@dataclass(frozen=True)
class Compensator:
    """A compensator of the catalogue.

    Attributes
    ----------
    title : str
    needs : str
        What one has to know of the axis.
    made : callable
        ``made(belief)``: the blocks by their places.
    loops : sequence of str
        The loops that it may stand in; empty where it is the loop.
    against : str
        Why it is not recommended, or "".
    """

    title: str
    needs: str
    made: Callable[[Belief], Mapping[str, Any]]
    loops: tuple[str, ...] = LOOPS
    against: str = ""


# ---- blocks --------------------------------------------------------------------------------------------------------


def loop_of(name: str, belief: Belief, **choices: str) -> ControlBlock:
    """A PD or PID placed at the bandwidth."""
    law = registry.control_law(name.lower())
    assert law.placed is not None
    more: dict[str, Any] = {"dead_band": 2e-4} if choices.get("at_rest") == "dead_band" else {}
    return ControlBlock(law, None, choices, **law.placed(belief.inertia, belief.bandwidth, DAMPING), **more)


def observer(belief: Belief, share: float = 2.0, **choices: str) -> ControlBlock:
    """A disturbance observer."""
    return ControlBlock(
        "disturbance_observer", None, choices, inertia=belief.inertia, corner=share * belief.pace
    )


def feedforward(belief: Belief, model: Model | None = None) -> ControlBlock:
    """Nine tenths of the friction law on the reference."""
    return ControlBlock("friction_feedforward", model or belief.friction, {"velocity": "held"}, gain=0.9)


def elements(belief: Belief) -> Model:
    """The GMS law."""
    if belief.elements is None:
        raise ParameterError("belief: no GMS law is known; identify one, or leave the compensator out")
    return belief.elements


def scaled(belief: Belief, model: Model) -> ControlBlock:
    """A feedforward with adapted scale."""
    return ControlBlock(
        "scaled_feedforward", model, inertia=belief.inertia, gain=0.9, sigma2=belief.number("sigma2"),
        corner=2.0 * belief.pace, rate=5.0, slowest=belief.gate,
    )  # fmt: skip


def least_squares(belief: Belief) -> ControlBlock:
    """A feedforward with recursive least squares."""
    return ControlBlock(
        "least_squares_feedforward", belief.friction, inertia=belief.inertia, fc=belief.number("fc"),
        sigma2=belief.number("sigma2"), gain=0.9, corner=2.0 * belief.pace, speed=10.0 * belief.number("vs"),
        slowest=belief.gate,
    )  # fmt: skip


def integral_pace(belief: Belief) -> float:
    """N·m/rad: how fast a torque may follow s = de/dt + w e / 2, as the integral of a PID does."""
    return 2.0 * belief.inertia * belief.pace**2


def gradient(belief: Belief) -> ControlBlock:
    """A feedforward with gradient gain."""
    rate = integral_pace(belief) / belief.number("fs") ** 2
    return ControlBlock("gradient_feedforward", belief.friction, gain=0.9, rate=rate, slope=0.5 * belief.pace)


def adaptive(belief: Belief, functions: str, leak: float = 0.05) -> ControlBlock:
    """Friction learnt as a sum of functions."""
    vs = belief.number("vs")
    law = registry.control_law("adaptive_friction").having(functions=functions)
    scales = {"steep": 10.0 / vs, "wide": 1.0 / vs, "speed": 10.0 * vs, "corner": 2.0 * vs, "smooth": 0.1 * vs,
              "fine": 0.1 * vs, "top": 1.0}  # fmt: skip
    known = {f.name for f in law.fields}
    values: dict[str, Any] = {k: v for k, v in law.example.items() if k not in scales}
    values |= {k: v for k, v in scales.items() if k in known}
    values |= {
        "rate": [integral_pace(belief)] * len(values["rate"]), "slope": 0.5 * belief.pace, "leak": leak,
        "largest": 3.0 * belief.number("fs"),
    }  # fmt: skip
    return ControlBlock(law, None, **values)


def powers(belief: Belief) -> list[float]:
    """N·m: the GMS law's sliding curve up to twice the Stribeck velocity as a polynomial of the third degree."""
    model = elements(belief)
    steady, p = model.law.steady, model.parameters
    assert steady is not None
    share = np.linspace(0.01, 1.0, 100)
    speeds = 2.0 * belief.number("vs") * share
    levels = [0.5 * (steady(v, p) - steady(-v, p)) - belief.number("sigma2") * v for v in speeds.tolist()]
    return np.polynomial.polynomial.polyfit(share, levels, 3).tolist()


def adaptive_elements(belief: Belief) -> ControlBlock:
    """The GMS law with a sliding curve that is learned."""
    p, curve = elements(belief).parameters, powers(belief)
    return ControlBlock(
        "adaptive_gms", None, k=p.k, alpha=p.alpha, level=curve, rate=[integral_pace(belief)] * len(curve),
        top=2.0 * belief.number("vs"), sigma2=belief.number("sigma2"), slope=0.5 * belief.pace,
        largest=3.0 * belief.number("fs"),
    )  # fmt: skip


def level(belief: Belief, direction: str) -> ControlBlock:
    """A Coulomb observer."""
    smooth = 0.1 * belief.number("vs") if direction == "reference" else belief.number("vs")
    return ControlBlock(
        "coulomb_observer", None, {"direction": direction}, inertia=belief.inertia, sigma2=belief.number("sigma2"),
        corner=2.0 * belief.pace, deadband=max(belief.number("vs"), 0.1 * belief.flicker), smooth=smooth,
        largest=2.0 * belief.number("fs"),
    )  # fmt: skip


def bristle(belief: Belief) -> ControlBlock:
    """The LuGre observer of 1995."""
    names = ("sigma0", "sigma2", "fs", "fc", "vs", "delta_s")
    values: dict[str, Any] = {name: belief.number(name) for name in names}
    return ControlBlock("lugre_observer", correction=1.0, **values)


def dual(belief: Belief) -> ControlBlock:
    """The dual observer, which learns the scale."""
    names = ("sigma0", "sigma2", "fs", "fc", "vs", "delta_s")
    values: dict[str, Any] = {name: belief.number(name) for name in names}
    rate = integral_pace(belief) / belief.number("fs") ** 2
    return ControlBlock("dual_observer", slope=0.5 * belief.pace, rate0=rate, **values)


def layer(belief: Belief, torque: float) -> float:
    """rad/s: half width of a boundary layer in which that torque is a gain that a sample of delay leaves stable."""
    return torque * belief.sample_time / (0.5 * belief.inertia)


def robust(belief: Belief) -> ControlBlock:
    """Lee and Kim's."""
    fs = belief.number("fs")
    return ControlBlock(
        "robust_adaptive", inertia=belief.inertia, slope=0.5 * belief.pace, damping=2.0 * belief.inertia * belief.pace,
        layer=layer(belief, fs), level_rate=20.0, speed_rate=20.0, most_level=1.5 * fs, most_speed=1.5 * fs,
    )  # fmt: skip


def sliding(belief: Belief) -> ControlBlock:
    """A sliding mode with a boundary layer."""
    torque = 1.5 * belief.number("fs")
    return ControlBlock(
        "boundary_layer", inertia=belief.inertia, slope=0.5 * belief.pace, torque=torque, layer=layer(belief, torque),
    )  # fmt: skip


def twisting(belief: Belief, form: str) -> ControlBlock:
    """Super-twisting."""
    rate = 23.0 * belief.number("fs") / belief.inertia
    return ControlBlock(
        "super_twisting", None, {"form": form}, inertia=belief.inertia, slope=0.5 * belief.pace, rate=rate
    )


def stands_below(belief: Belief) -> float:
    """rad/s: the speed from which an axis does not stand."""
    return max(2.0 * belief.number("vs"), 0.2 * belief.flicker)


def push(belief: Belief) -> ControlBlock:
    """An error-sign push."""
    return ControlBlock(
        "stiction_push", torque=0.9 * belief.number("fs"), error=2e-3, speed=stands_below(belief)
    )


def stiffness(belief: Belief) -> float:
    """N·m/rad, of the PD."""
    return belief.inertia * belief.pace**2


def filled_up(belief: Belief) -> ControlBlock:
    """Nonlinear Coulomb: a fifth above break-away, by a layer nine times as stiff as the PD."""
    torque, gain = 1.2 * belief.number("fs"), stiffness(belief)
    return ControlBlock("nonlinear_coulomb", torque=torque, gain=gain, layer=torque / (8.0 * gain))


def springs(belief: Belief) -> ControlBlock:
    """Nonlinear Maxwell-slip: together eight times as stiff as the PD, and just below break-away."""
    whole = 8.0 * stiffness(belief)
    return ControlBlock(
        "nonlinear_maxwell_slip", k=[x * whole / 7.0 for x in (4.0, 2.0, 1.0)], w=[0.3 * belief.number("fs")] * 3
    )  # fmt: skip


def knocker(belief: Belief) -> ControlBlock:
    """Pulses of half the break-away, two samples of ten."""
    fs = belief.number("fs")
    return ControlBlock("knocker", torque=0.5 * fs, samples=10.0, width=2.0, least=1e-3 * fs)


def dither(belief: Belief, given: str = "always") -> ControlBlock:
    """A square wave at a quarter of the sample rate."""
    more: dict[str, Any] = {"error": 2e-3, "speed": stands_below(belief)} if given == "stuck" else {}
    return ControlBlock(
        "dither", None, {"given": given}, torque=0.6 * belief.number("fs"), samples=4.0, **more
    )


# ---- the catalogue -------------------------------------------------------------------------------------------------

NOTHING, INERTIA = "nothing", "inertia"
LEVELS, CURVE, BRISTLE, ELEMENTS = (
    "inertia, largest friction", "inertia, friction's levels", "inertia, a LuGre law", "inertia, a GMS law",
)  # fmt: skip

CATALOGUE: Mapping[str, Compensator] = {
    "none": Compensator("none", NOTHING, lambda b: {}),
    "reset": Compensator(
        "integral that is reset at rest", NOTHING,
        lambda b: {"loop": loop_of("PID", b, at_rest="reset")}, ("PID",),
    ),
    "dead-band": Compensator(
        "integral with a dead band at rest", NOTHING,
        lambda b: {"loop": loop_of("PID", b, at_rest="dead_band")}, ("PID",),
    ),
    "ff-lugre": Compensator("feedforward, LuGre", BRISTLE, lambda b: {"feedforward": feedforward(b)}),
    "ff-gms": Compensator("feedforward, GMS", ELEMENTS, lambda b: {"feedforward": feedforward(b, elements(b))}),
    "dob": Compensator("disturbance observer", INERTIA, lambda b: {"observer": observer(b)}, ("PD",)),
    "dob-second": Compensator(
        "disturbance observer of second order", INERTIA,
        lambda b: {"observer": observer(b, 4.0, order="second")}, ("PD",),
    ),
    "dob-reset": Compensator(
        "disturbance observer that is reset at rest", INERTIA,
        lambda b: {"observer": observer(b, at_rest="reset")}, ("PD",),
    ),
    "eso": Compensator(
        "extended state observer", INERTIA,
        lambda b: {"observer": ControlBlock("extended_state_observer", inertia=b.inertia, corner=6.0 * b.pace)},
        ("PD",),
    ),
    "ff-dob": Compensator(
        "feedforward, LuGre, and observer of the rest", BRISTLE,
        lambda b: {"feedforward": feedforward(b), "observer": observer(b)}, ("PD",),
    ),
    "ff-dob-reset": Compensator(
        "the same, reset at rest", BRISTLE,
        lambda b: {"feedforward": feedforward(b), "observer": observer(b, at_rest="reset")}, ("PD",),
    ),
    "ff-gms-dob": Compensator(
        "feedforward, GMS, and observer of the rest", ELEMENTS,
        lambda b: {"feedforward": feedforward(b, elements(b)), "observer": observer(b)}, ("PD",),
    ),
    "scale-dob": Compensator(
        "feedforward with adapted scale, and observer", BRISTLE,
        lambda b: {"feedforward": scaled(b, b.friction), "observer": observer(b)}, ("PD",),
    ),
    "scale-gms-dob": Compensator(
        "the same with a GMS law", ELEMENTS,
        lambda b: {"feedforward": scaled(b, elements(b)), "observer": observer(b)}, ("PD",),
    ),
    "scale": Compensator(
        "feedforward with adapted scale", BRISTLE, lambda b: {"feedforward": scaled(b, b.friction)}, ("PID",)
    ),
    "rls-dob": Compensator(
        "feedforward with least squares, and observer", BRISTLE,
        lambda b: {"feedforward": least_squares(b), "observer": observer(b)}, ("PD",),
    ),
    "gradient": Compensator(
        "feedforward with gradient gain", BRISTLE, lambda b: {"feedforward": gradient(b)},
        against="its gain is an integral action and no estimate of the friction: it leaves its value at every stop",
    ),
    "makkar": Compensator(
        "friction learnt, Makkar's functions", LEVELS, lambda b: {"observer": adaptive(b, "makkar")}
    ),
    "two-lines": Compensator("friction learnt, two lines", LEVELS, lambda b: {"observer": adaptive(b, "lines")}),
    "rbf": Compensator(
        "friction learnt, Gaussians", LEVELS, lambda b: {"observer": adaptive(b, "gaussians", 0.01)},
        against="21 weights do what Makkar's three do, and forget at one speed what they learn at another",
    ),
    "adaptive-gms": Compensator(
        "GMS with a learned sliding curve", ELEMENTS, lambda b: {"observer": adaptive_elements(b)}
    ),
    "friedland-park": Compensator(
        "Coulomb observer", CURVE, lambda b: {"observer": level(b, "reference")}, ("PD",),
        "it learns only while the axis slides, and alone it never moves one that sticks",
    ),
    "lugre-observer": Compensator(
        "LuGre observer", BRISTLE, lambda b: {"observer": bristle(b)}, ("PD",),
        "it needs friction known to 3 %, or a disturbance observer without a model is better",
    ),
    "dual": Compensator(
        "dual observer, LuGre with adapted scale", BRISTLE, lambda b: {"observer": dual(b)}, ("PID",)
    ),
    "gms-observer": Compensator(
        "GMS observer", ELEMENTS,
        lambda b: {
            "observer": ControlBlock(
                "friction_observer", elements(b), correction=1.0, sigma2=b.number("sigma2")
            )
        },
        ("PD",), "as the LuGre observer",
    ),
    "lee-kim": Compensator(
        "robust adaptive (Lee and Kim)", INERTIA, lambda b: {"loop": robust(b)}, (),
        "its levels only grow, and what delay leaves stable of its layer is an error larger than a PID's",
    ),
    "sliding-mode": Compensator(
        "sliding mode with a boundary layer", LEVELS, lambda b: {"loop": sliding(b)}, (),
        "with a layer that does not chatter it is a stiff PD",
    ),
    "twisting": Compensator("super-twisting", LEVELS, lambda b: {"loop": twisting(b, "explicit")}, ()),
    "twisting-implicit": Compensator(
        "super-twisting, implicit", LEVELS, lambda b: {"loop": twisting(b, "implicit")}, (),
        "inside its layer friction leaves a standing error of T F / (J lambda)",
    ),
    "push": Compensator("push along the error's sign", LEVELS, lambda b: {"observer": push(b)}, ("PD",)),
    "nonlinear-coulomb": Compensator(
        "torque filled up to break-away", LEVELS, lambda b: {"observer": filled_up(b)}, ("PD",)
    ),
    "nonlinear-maxwell": Compensator(
        "Maxwell-slip springs over the error", LEVELS, lambda b: {"observer": springs(b)}, ("PD",)
    ),
    "knocker": Compensator("pulses along the integral", LEVELS, lambda b: {"observer": knocker(b)}, ("PID",)),
    "dither-stuck": Compensator(
        "dither where the axis stands off", LEVELS, lambda b: {"feedforward": dither(b, "stuck")}, ("PID",)
    ),
    "dither": Compensator(
        "dither", LEVELS, lambda b: {"feedforward": dither(b)},
        against="it excites the axis at rest and heats the motor permanently",
    ),
}  # fmt: skip
"""By name; the order is that of tables."""


def compensated(name: str, loop: str, belief: Belief) -> Controller:
    """The controller with a compensator of the catalogue, for an axis.

    Parameters
    ----------
    name : str
        Of `CATALOGUE`.
    loop : str
        Of `LOOPS`.
    belief : Belief

    Raises
    ------
    UnknownName, ParameterError
        If there is none of that name, it has no place in that loop, or what it needs is not known.
    """
    if name not in CATALOGUE:
        raise UnknownName("compensator", name, CATALOGUE)
    found = CATALOGUE[name]
    if found.loops and loop not in found.loops:
        raise ParameterError(f"compensator {name!r} stands in a {' or '.join(found.loops)}, not in a {loop}")
    places = dict(found.made(belief))
    own = places.pop("loop", None) or loop_of(loop, belief)
    return Controller(
        loop=own, sample_time=belief.sample_time, torque_limit=belief.torque_limit, alone=True, **places
    )
