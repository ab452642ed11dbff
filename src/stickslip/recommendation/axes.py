"""Sample the axes on which a setting is tested: the best estimate, and others within the intervals.

The identified numbers (friction, inertia, offset) are drawn from their intervals, and so are effects that every machine
has but no model contains: a torque over the position of up to the model's misfit, a current loop, a delay below one
sample, friction that builds up later than by the contact's own springs (elastic drivetrain, backlash), and a reference
velocity at the instant or averaged over the previous sample. If an elastically coupled load was identified, motor and
load are drawn from its intervals, with friction at the load. On the best estimate the reference velocity is formed like
the measured one, as the mean over the previous sample, because a difference of half a sample acts like an inertia
feedforward.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from stickslip.control.own_loop import ReferenceVelocity
from stickslip.core.errors import ParameterError
from stickslip.core.rebinding import NEGATIVE
from stickslip.identification.estimate import Estimate, missing_fall
from stickslip.identification.identified_file import Identified
from stickslip.identification.monte_carlo import draw_models
from stickslip.machines.machine import Machine
from stickslip.machines.two_inertias import TwoInertias
from stickslip.machines.two_mass import TwoMassAxis
from stickslip.models.friction_levels import static_level
from stickslip.models.model import Model
from stickslip.recommendation.plant import Plant

CURRENT_LOOP = (200.0, 2000.0)
"""Range of sampled current loop bandwidths, Hz."""
PROMPT = 0.3
"""Probability of a drive without lag."""
ORDERS = (1.0, 50.0)
"""Range of sampled orders of the torque over the position, per revolution (rotary)."""
WAVELENGTHS = (1e-3, 5e-2)
"""m (linear)"""
WAVES = 3
"""Largest number of simultaneous orders."""
LEFT = ("sliding_rms_Nm", "sliding_rms_N")
"""Misfit of the torque in gross sliding; upper limit of the sampled torque over the position (RMS)."""
BREAKAWAY = (3e-5, 3e-3)
"""Range of the break-away displacement of a contact without springs in its law, rad (a tenth of it in m)."""
LOST = 0.5
"""Probability that friction of a sampled axis builds up later than by the contact's own springs."""
LOST_MOTION = (1e-4, 1e-2)
"""Range of the displacement over which it then builds up, rad (a tenth of it in m)."""
MOST_STATIC = 2.0
"""Largest ratio of static to Coulomb torque if it is not identified: contacts of machines have 1 to 2."""
HIDDEN = (0.1, 0.6)
"""Stribeck velocities, relative to the slowest gross sliding, with which at most a tenth of the Stribeck effect remains
there (exp(-1/0.6²) = 6 %)."""
MOST_VISCOUS = 9.0
"""Range of the viscous friction relative to the estimate, if it is not identified."""
GIVEN = 0.1
"""Relative uncertainty of an inertia given by the user."""
DAMPING = 0.3
"""Damping ratio of the bristles."""
DAMPED = (0.01, 0.1)
"""Range of the damping ratio of the spring between motor and load."""


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
    """Return the best estimate and `count` sampled axes; another inertia keeps the relative width of its interval.

    Parameters
    ----------
    found : Identified
    inertia : float
        kg·m²
    count : int
    seed : int
    start : float
        Position at the start of the motion, rad, which matters for a pendulum.
    given : bool
        Whether the inertia is given by the user; if the record does not determine it, its uncertainty is `GIVEN`.
    machine : Machine, optional
        The user's machine: its delay, current loop, springs and torques over the position are then fixed; start angle
        and noise are sampled.
    delay : float, optional
        Command delay of the drive, samples; sampled up to one unless this or a machine gives it.
    reference_velocity : {"difference", "instant"}, optional
        How the drive forms its reference velocity; unless given it is sampled, with the difference on the best
        estimate.
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
    """Limit numbers that are not identified to the range of real machines.

    Static torque is between the Coulomb torque and `MOST_STATIC` times it; viscous friction from none to the upper
    bound of its interval, because one record may attribute to it what another attributes to Coulomb friction.
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
    """Draw from a log-uniform distribution."""
    return math.exp(float(rng.uniform(math.log(low), math.log(high))))


def _late(rng: np.random.Generator, known: float | None) -> dict[str, Any]:
    """Draw the delay (samples, unless known) and current loop of a drive; some have no lag."""
    prompt, delay, bandwidth = float(rng.uniform()), float(rng.uniform()), _between(rng, *CURRENT_LOOP)
    late = {} if prompt < PROMPT else {"delay": delay, "bandwidth": bandwidth}
    if known is not None:
        late["delay"] = known
    return {**late, "backward": bool(rng.uniform() < 0.5)}


def _swinging(train: TwoInertias | None, inertia: float, rng: np.random.Generator) -> TwoMassAxis | None:
    """Draw motor and load within their intervals; None if no load was identified."""
    if train is None:
        return None
    frequency, share = (
        float(rng.uniform(*i)) for i in (train.antiresonance_interval, train.motor_share_interval)
    )
    return train.axis(inertia, _between(rng, *DAMPED), frequency, share)


def told_of(machine: Machine | None) -> bool:
    """Whether the torques over the position are those of the machine."""
    return machine is not None and bool(machine.cogging.order or machine.contact.ripple.order)


def _turned(machine: Machine, rng: np.random.Generator) -> dict[str, Any]:
    """Return the user's machine with another start angle and other noise."""
    angle, seed = float(rng.uniform(0.0, 2.0 * math.pi)), int(rng.integers(1 << 31))
    return {
        "machine": replace(machine, start_angle=angle, seed=seed), "backward": bool(rng.uniform() < 0.5),
    }  # fmt: skip


def _hanging(gravity: float, angle: float, start: float) -> tuple[tuple[float, float, float], ...]:
    """Return - gravity sin(q - angle) as a wave of the position, relative to the start of the motion."""
    return ((1.0, gravity, 0.5 * math.pi + start - angle),) if gravity else ()


def _unmodelled(rms: float, motion: str, rng: np.random.Generator) -> tuple[tuple[float, float, float], ...]:
    """Draw a torque over the position, such as cogging, of this size, N·m RMS."""
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
    """Return LuGre with the law's own sliding curve and a sampled break-away displacement, if the law has no springs;
    else with probability `LOST`, for an elastic drivetrain or backlash between encoder and friction.

    The displacement is at most `most`, rad (m), over which the record shows that friction builds up again.
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
    """Return a Coulomb law with the Stribeck effect that the record shows, or with one below the slowest gross sliding,
    which no record excludes; other laws unchanged."""
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
    """Return Coulomb's law with additional friction at rest in each direction, N·m, and a Stribeck velocity, rad/s."""
    own: Any = model.parameters
    curve: dict[str, Any] = {}
    for way, fall in zip(_ways(model), falls, strict=True):
        level = float(getattr(own, f"fc{way}"))
        curve |= {f"fs{way}": level + fall, f"fc{way}": level, f"vs{way}": vs}
        curve[f"sigma2{way}"] = float(getattr(own, f"sigma2{way}"))
    # Its stiffness is replaced when springs are drawn.
    return Model("stribeck", _choices(model), k=float(own.fc) / 1e-3, **curve)


def _ways(model: Model) -> tuple[str, ...]:
    """Return the suffixes of the parameters of each direction; one if both are equal."""
    return ("",) if model.law.chosen.get("symmetry", "symmetric") == "symmetric" else ("", NEGATIVE)


def _choices(model: Model) -> dict[str, str]:
    """Return curve, viscous part and whether both directions are equal, if the law has these choices."""
    return {k: v for k, v in model.law.chosen.items() if k in ("curve", "viscous", "symmetry")}
