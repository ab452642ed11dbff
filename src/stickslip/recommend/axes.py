"""Axes on which a setting is tried: the best estimate, and others that the record allows.

Drawn are the identified numbers (friction, inertia, offset) from their intervals, and what no model holds but every
machine has: a torque over the position of up to the misfit of the model, a current loop, a delay below one sample, and
friction that comes later than the contact's own springs bring it (an elastic drivetrain, backlash), and a reference
velocity of the instant or of the sample before. Where the record told motor and load behind a spring, they are drawn
from its intervals, with friction at the load. On the best estimate the reference velocity is formed as the measured one
is, the mean over the sample before: half a sample of difference between them acts as inertia that is fed forward.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from stickslip.binding import NEGATIVE
from stickslip.control.own_loop import ReferenceVelocity
from stickslip.errors import ParameterError
from stickslip.friction_levels import static_level
from stickslip.identify.estimate import Estimate, missing_fall
from stickslip.identify.identified_file import Identified
from stickslip.identify.monte_carlo import draw_models
from stickslip.machines.machine import Machine
from stickslip.machines.two_inertias import TwoInertias
from stickslip.machines.two_mass import TwoMassAxis
from stickslip.model import Model
from stickslip.recommend.plant import Plant

CURRENT_LOOP = (200.0, 2000.0)
"""Hz, bandwidths drawn."""
PROMPT = 0.3
"""Chance of a drive that follows at once."""
ORDERS = (1.0, 50.0)
"""Per revolution (rotary), of torques over the position."""
WAVELENGTHS = (1e-3, 5e-2)
"""m (linear)"""
WAVES = 3
"""At most so many at once."""
LEFT = ("sliding_rms_Nm", "sliding_rms_N")
"""What an identification leaves of the torque in gross sliding: as large they are at most (RMS)."""
BREAKAWAY = (3e-5, 3e-3)
"""rad (a tenth of it in m), displacement at which a contact without springs in its law is taken to break away."""
LOST = 0.5
"""Chance of a drawn axis that friction comes later than the contact's own springs bring it."""
LOST_MOTION = (1e-4, 1e-2)
"""rad (a tenth of it in m), displacement over which it then comes."""
MOST_STATIC = 2.0
"""Static over Coulomb torque at most, where the record does not tell it: contacts of machines have 1 to 2."""
HIDDEN = (0.1, 0.6)
"""Of the slowest gross sliding: velocities of a fall of which a tenth at most is left there (exp(-1/0.6²) = 6 %)."""
MOST_VISCOUS = 9.0
"""Times the viscous friction found, where the record does not tell it."""
GIVEN = 0.1
"""Part of an inertia to which a user knows it."""
DAMPING = 0.3
"""Of the bristles, part of critical."""
DAMPED = (0.01, 0.1)
"""Of the spring between motor and load, part of critical, drawn."""


def plants_of(
    found: Identified,
    inertia: float,
    count: int,
    seed: int,
    start: float = 0.0,
    given: bool = False,
    machine: Machine | None = None,
    delay: float | None = None,
    reference_velocity: ReferenceVelocity | None = None,
) -> Iterator[Plant]:
    """The best estimate, and `count` axes drawn; about another inertia as wide in proportion.

    Parameters
    ----------
    found : Identified
    inertia : float
        kg·m²
    count : int
    seed : int
    start : float
        Position at which the motion begins, rad: where a pendulum hangs.
    given : bool
        Whether the inertia is one that the user knows: then to `GIVEN`, where the record does not tell it.
    machine : Machine, optional
        The machine at hand: its delay, current loop, springs and torques over the position are not drawn then, but the
        angle at which the motion begins, and the noise.
    delay : float, optional
        By which the drive's commands act late, samples; drawn, up to one, where neither this nor a machine says it.
    reference_velocity : {"difference", "instant"}, optional
        How the drive forms its reference velocity; drawn, and the difference on the best estimate, unless given.
    """
    known = {name: float(found.axis.get(name, 0.0) or 0.0) for name in ("offset", "gravity", "gravity_angle")}
    yield Plant(
        inertia,
        found.model,
        offset=known["offset"],
        waves=_hanging(known["gravity"], known["gravity_angle"], start),
        backward=reference_velocity != "instant",
        flexible=found.train.axis(inertia) if found.train else None,
        machine=machine,
        delay=delay or 0.0,
    )
    told = next((e for e in found.estimates if e.name == "inertia"), None)
    identified = told.value if told else inertia
    known_to = GIVEN if given and told and not told.identified else math.inf
    rng, unseen, swings = (np.random.default_rng(s) for s in (seed, [seed, 2], [seed, 3]))
    misfit = next((found.misfit[k] for k in LEFT if math.isfinite(found.misfit.get(k, math.nan))), 0.0)
    most = found.misfit.get("friction_rebuilt_within", math.inf)
    drawn = draw_models(
        found.model, found.estimates, found.correlation, count, seed, plausible(found.estimates, seed)
    )
    for model, named in drawn:
        here = {name: named.get(name, value) for name, value in known.items()}
        part = named.get("inertia", identified) / identified
        own = inertia * min(max(part, 1.0 / (1.0 + known_to)), 1.0 + known_to)
        friction = _with_springs(_falling(model, found, unseen), own, found.motion, rng, most)
        rms = 0.0 if told_of(machine) else misfit * float(rng.uniform())
        waves = _unmodelled(rms, found.motion, rng) if not told_of(machine) else ()
        train = _swinging(found.train, own, swings)
        drive = _late(rng, delay) if machine is None else _turned(machine, rng)
        if reference_velocity is not None:
            drive["backward"] = reference_velocity == "difference"
        yield Plant(
            own, friction, offset=here["offset"],
            waves=(*_hanging(here["gravity"], here["gravity_angle"], start), *waves),
            flexible=train, sampled={k: v for k, v in named.items() if k != "inertia"}, unmodelled=rms, **drive,
        )  # fmt: skip


def plausible(estimates: Sequence[Estimate], seed: int) -> Callable[[dict[str, float]], None]:
    """Brings what no record told to what machines have.

    Static torque lies between Coulomb's and `MOST_STATIC` times it; viscous friction anywhere from none to the upper
    end of its interval: what one record puts on it may be another's Coulomb torque.
    """
    untold = {e.name: e for e in estimates if not e.identified}
    rng = np.random.default_rng([seed, 1])

    def change(named: dict[str, float]) -> None:
        for name, e in untold.items():
            level = named.get(name.replace("fs", "fc"), 0.0)
            if name.startswith("fs") and level > 0.0:
                named[name] = min(max(named[name], level), MOST_STATIC * level)
            elif name.startswith("sigma2"):
                named[name] = float(rng.uniform()) * min(e.upper, MOST_VISCOUS * e.value)

    return change


def _between(rng: np.random.Generator, low: float, high: float) -> float:
    """Log-uniform."""
    return math.exp(float(rng.uniform(math.log(low), math.log(high))))


def _late(rng: np.random.Generator, known: float | None) -> dict[str, Any]:
    """Delay (samples; that which is known) and current loop of a drive; of some, none."""
    prompt, delay, bandwidth = float(rng.uniform()), float(rng.uniform()), _between(rng, *CURRENT_LOOP)
    late = {} if prompt < PROMPT else {"delay": delay, "bandwidth": bandwidth}
    if known is not None:
        late["delay"] = known
    return {**late, "backward": bool(rng.uniform() < 0.5)}


def _swinging(train: TwoInertias | None, inertia: float, rng: np.random.Generator) -> TwoMassAxis | None:
    """Motor and load of these intervals; none where the record told none."""
    if train is None:
        return None
    frequency, share = (
        float(rng.uniform(*i)) for i in (train.antiresonance_interval, train.motor_share_interval)
    )
    return train.axis(inertia, _between(rng, *DAMPED), frequency, share)


def told_of(machine: Machine | None) -> bool:
    """Whether the torques over the position are the machine's own."""
    return machine is not None and bool(machine.cogging.order or machine.contact.ripple.order)


def _turned(machine: Machine, rng: np.random.Generator) -> dict[str, Any]:
    """The machine at hand, begun at another angle, with other noise."""
    angle, seed = float(rng.uniform(0.0, 2.0 * math.pi)), int(rng.integers(1 << 31))
    return {
        "machine": replace(machine, start_angle=angle, seed=seed), "backward": bool(rng.uniform() < 0.5),
    }  # fmt: skip


def _hanging(gravity: float, angle: float, start: float) -> tuple[tuple[float, float, float], ...]:
    """- gravity sin(q - angle) as a wave of the position from where the motion begins."""
    return ((1.0, gravity, 0.5 * math.pi + start - angle),) if gravity else ()


def _unmodelled(rms: float, motion: str, rng: np.random.Generator) -> tuple[tuple[float, float, float], ...]:
    """A torque over the position, such as cogging, of this size, N·m RMS."""
    count = int(rng.integers(1, WAVES + 1))
    out: list[tuple[float, float, float]] = []
    for _ in range(count):
        order = _between(rng, *ORDERS)
        if motion == "linear":
            order = 2.0 * math.pi / _between(rng, *WAVELENGTHS)
        out.append((order, rms * math.sqrt(2.0 / count), float(rng.uniform(0.0, 2.0 * math.pi))))
    return tuple(out) if rms > 0.0 else ()


def _with_springs(
    model: Model, inertia: float, motion: str, rng: np.random.Generator, most: float = math.inf
) -> Model:
    """LuGre with the law's own sliding curve, that breaks away after a way that is drawn: where the law has no springs,
    and else with a chance of `LOST`, for an elastic drivetrain or backlash between the encoder and the friction.

    The way is `most`, rad (m), at most: within that the record has seen friction built up again.
    """
    if model.law.name not in ("coulomb", "stribeck", "lugre"):
        return model
    lost = float(rng.uniform()) < LOST
    springs = model.law.name == "lugre"
    if springs and not lost:
        return model
    size = 0.1 if motion == "linear" else 1.0
    low, high = LOST_MOTION if lost else BREAKAWAY
    way = _between(rng, size * low, max(min(size * high, most), size * low))
    own: Any = model.parameters
    names = [n + side for side in _ways(model) for n in ("fs", "fc", "vs", "delta_s", "sigma2")]
    curve = {n: getattr(own, n) for n in names if hasattr(own, n)}
    if model.law.name == "coulomb":
        scale = float(model.law.velocity_scale(own)) if model.law.velocity_scale else 0.0
        for side in _ways(model):
            curve |= {f"fs{side}": curve[f"fc{side}"], f"vs{side}": scale or 0.01 * size}
    level = static_level(model)
    if not level > 0.0:
        return model
    stiffness = level / way
    if springs:
        stiffness = 1.0 / (1.0 / stiffness + 1.0 / own.sigma0)
    damper = 2.0 * DAMPING * math.sqrt(stiffness * inertia)
    try:
        return Model("lugre", _choices(model), sigma0=stiffness, sigma1=damper, **curve)
    except (ParameterError, TypeError):
        return model


def _falling(model: Model, found: Identified, rng: np.random.Generator) -> Model:
    """Return a Coulomb law with the fall of friction that the record shows, or with one below the slowest gross
    sliding, which no record excludes; other laws as they are."""
    fall, slowest = missing_fall(found.misfit), found.misfit.get("slowest_sliding", 0.0)
    if model.law.name != "coulomb":
        return model
    own: Any = model.parameters
    levels = [float(getattr(own, f"fc{way}")) for way in _ways(model)]
    if fall > 0.0:
        return _with_fall(model, [fall] * len(levels), found.misfit["fall_missing_velocity"])
    if not slowest > 0.0:
        return model
    more = (MOST_STATIC - 1.0) * float(rng.uniform())
    return _with_fall(model, [more * level for level in levels], slowest * _between(rng, *HIDDEN))


def _with_fall(model: Model, falls: Sequence[float], vs: float) -> Model:
    """Coulomb's law with so much more friction at rest in each direction, N·m, that falls with a velocity, rad/s."""
    own: Any = model.parameters
    curve: dict[str, Any] = {}
    for way, fall in zip(_ways(model), falls, strict=True):
        level = float(getattr(own, f"fc{way}"))
        curve |= {f"fs{way}": level + fall, f"fc{way}": level, f"vs{way}": vs}
        curve[f"sigma2{way}"] = float(getattr(own, f"sigma2{way}"))
    # Of its stiffness nothing is left once springs are drawn.
    return Model("stribeck", _choices(model), k=float(own.fc) / 1e-3, **curve)


def _ways(model: Model) -> tuple[str, ...]:
    """How the parameters of each direction end: one ending where both are the same."""
    return ("",) if model.law.chosen.get("symmetry", "symmetric") == "symmetric" else ("", NEGATIVE)


def _choices(model: Model) -> dict[str, str]:
    """Curve, viscous part and whether both directions are the same, where the law has the choice."""
    return {k: v for k, v in model.law.chosen.items() if k in ("curve", "viscous", "symmetry")}
