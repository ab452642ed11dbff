"""One sample of a controller made of control laws: measure, feed forward, observe, control, limit.

Written in the scalar subset (`stickslip.subset`). Arguments: settings ``n``, memory ``m`` (which begins with
what the laws see: `stickslip.core.control_spec.Signals`), and the laws' states ``z`` and parameters ``p``, each law
a part of them; surroundings ``u``. The functions `estimate`, `feedforwards`, `accelerations`, `observers`,
`loops` and `left_over` call the laws of one controller; `stickslip.control.composed` writes them.

An input that is no number leaves the memory alone: the torque that is held fades to 0, ``fault`` counts the
samples, and the first usable one goes on from there. Positions may be split into whole turns and the rest
(`sample_turns`), so that their differences are as exact after a thousand turns as in the first one, in single
precision too.
"""

from __future__ import annotations

import math
import types
from collections.abc import Callable, Mapping
from typing import Annotated, Any, NamedTuple

from stickslip.core.control_spec import Signals
from stickslip.core.rebinding import rescoped
from stickslip.core.spec import Field, Par, fields_of

TURN = 2.0 * math.pi  # rad
LARGEST = 1e9  # rad, rad/s, N·m: an input beyond it is no measurement
STILL = 1e-6  # rad/s: a reference that moves slower stands still


class Settings(NamedTuple):
    """Numbers of the composition."""

    torque_limit: Annotated[float, Par("N·m", "T_max", "largest torque")]
    sample_time: Annotated[float, Par("s", "T", "sample time")]
    slow: Annotated[float, Par("-", "", "part of the difference by which the slow velocity moves a sample")]
    fade: Annotated[
        float, Par("s", "", "over which a torque that was taken over, or held in a fault, fades; 0: at once")
    ]
    clock: Annotated[float, Par("-", "", "1 where samples make the time, 0 where the caller gives it")]
    difference: Annotated[
        float,
        Par(
            "-",
            "",
            "1: reference velocity formed as the difference of reference positions; 0: as it is given",
        ),
    ]


class Memory(NamedTuple):
    """What the composition remembers besides what the laws see."""

    seconds: Annotated[float, Par("s", "", "time since the first sample, in whole seconds")]
    part: Annotated[float, Par("s", "", "the rest of that time")]
    waited: Annotated[float, Par("s", "", "time without a usable input since the last one")]
    fault: Annotated[
        float, Par("-", "", "samples in a row whose inputs, or torque, were no numbers; 0: none")
    ]
    taken: Annotated[float, Par("N·m", "", "difference of the torque that was taken over from its own")]
    share: Annotated[float, Par("-", "", "of that difference that is left")]
    open: Annotated[
        float,
        Par("-", "", "1 while another controls the axis, with `applied`: the next sample starts there"),
    ]


MEMORY: tuple[Field, ...] = (*fields_of(Signals), *fields_of(Memory))
"""The fields of ``m``."""


# ---- the laws of one controller: written for it -------------------------------------------------------------------


def estimate(m: Any, z: Any, p: Any, u: Any) -> float:
    """Velocity by the estimator, rad/s."""
    return 0.0


def feedforwards(m: Any, z: Any, p: Any, u: Any) -> float:
    """Torque of the feedforwards, N·m."""
    return 0.0


def accelerations(m: Any, z: Any, p: Any, u: Any) -> float:
    """The part of the feedforwards that accelerates the nominal inertia, N·m."""
    return 0.0


def observers(m: Any, z: Any, p: Any, u: Any) -> float:
    """Torque of the observers, N·m."""
    return 0.0


def loops(m: Any, z: Any, p: Any, u: Any) -> float:
    """Torque of the control loop, N·m."""
    return 0.0


def left_over(missing: float, m: Any, z: Any, p: Any, u: Any) -> float:
    """What the laws cannot take over of a missing torque, N·m."""
    return missing


# ---- a sample ------------------------------------------------------------------------------------------------------


def unusable(
    turns: float, position: float, reference_turns: float, reference: float, reference_velocity: float,
    reference_acceleration: float, u: Any,
) -> float:  # fmt: skip
    """1 where an input is no number, or one that no machine has; else 0."""
    where = abs(turns) + abs(position) + (abs(reference_turns) + abs(reference))
    moving = abs(reference_velocity) + abs(reference_acceleration)
    # Clocks that count from 1970 are beyond 1e9 s.
    around = abs(u.load) + abs(u.temperature) + (1e-6 * abs(u.time) + abs(u.applied))
    if where + moving + around < LARGEST:
        return 0.0
    return 1.0


def faulty(n: Any, m: Any) -> float:
    """A sample without a usable input: the torque that is held falls to 0 over the fade. Returns it, N·m."""
    before = m.share
    if m.fault == 0.0 or m.open != 0.0:
        m.taken = m.applied
        m.open = 0.0
        m.fault = 0.0
        before = 1.0
    m.fault += 1.0
    m.share = max(0.0, 1.0 - m.fault * n.sample_time / max(n.fade, n.sample_time))
    m.applied = m.share * m.taken
    m.commanded = m.applied
    m.others = 0.0
    if before > 0.0:
        m.feedforward *= m.share / before
    return m.applied


def keep_time(n: Any, m: Any, u: Any) -> None:
    """The time, s; whole seconds are kept apart, so that single precision loses no sample in years."""
    if n.clock != 0.0:
        u.time = m.seconds + m.part
        m.part += n.sample_time
        if m.part >= 1.0:  # a floor in every sample costs a tenth of an exported one
            whole = math.floor(m.part)
            m.seconds += whole
            m.part -= whole


def see(
    turns: float, position: float, reference_turns: float, reference: float, reference_velocity: float,
    reference_acceleration: float, n: Any, m: Any,
) -> None:  # fmt: skip
    """Write down what is measured and asked for."""
    before = m.error
    m.moved = 0.0
    m.elapsed = n.sample_time
    m.error = TURN * (reference_turns - turns) + (reference - position)
    if m.started != 0.0:
        m.moved = TURN * (turns - m.turns) + (position - m.position)
        m.elapsed = n.sample_time + m.waited
    else:
        before = m.error
    m.turns = turns
    m.position = position
    m.reference = reference
    m.reference_velocity = reference_velocity
    if n.difference != 0.0:
        # Of the errors, which stay small: the turns split off two references may differ.
        m.reference_velocity = (m.error - before + m.moved) / m.elapsed
    m.reference_acceleration = reference_acceleration
    m.torque_limit = n.torque_limit
    if abs(m.reference_velocity) < STILL:
        m.rest += 1.0
    else:
        m.rest = 0.0


def respond(n: Any, m: Any, z: Any, p: Any, u: Any) -> float:
    """Run the laws in the order of their places. Returns the torque before the limit, N·m."""
    u.position = TURN * m.turns + m.position
    m.velocity = estimate(m, z, p, u)
    m.slow_velocity += n.slow * (m.velocity - m.slow_velocity)
    m.residual = m.applied - m.feedforward
    m.feedforward = 0.0
    m.others = 0.0
    m.others = feedforwards(m, z, p, u)
    # What accelerates the nominal inertia compensates nothing: an observer finds it in the acceleration.
    m.feedforward = m.others - accelerations(m, z, p, u)
    m.others += observers(m, z, p, u)
    torque = m.others + loops(m, z, p, u)
    m.started = 1.0
    m.waited = 0.0
    return torque


def start_at(held: float, torque: float, n: Any, m: Any, z: Any, p: Any, u: Any) -> float:
    """The first sample after another controlled the axis: what the laws give of the torque held, N·m.

    What they cannot take over fades.
    """
    m.open = 0.0
    m.fault = 0.0
    m.share = 0.0
    left = left_over(held - torque, m, z, p, u)
    if left != 0.0 and n.fade > 0.0:
        m.taken = left
        m.share = 1.0
    return held - left


def taken_over(torque: float, n: Any, m: Any, z: Any, p: Any, u: Any) -> float:
    """The torque with what is left of the one that was taken over, or held in a fault, N·m."""
    whole = torque
    if m.open != 0.0:
        whole = start_at(m.applied, torque, n, m, z, p, u)
    elif m.fault > 0.0:
        m.fault = 0.0
        m.taken = m.applied - torque
        m.share = 1.0
    if m.share > 0.0:
        whole += m.share * m.taken
        m.share = max(0.0, m.share - n.sample_time / max(n.fade, n.sample_time))
    return whole


def sample_turns(
    turns: float, position: float, reference_turns: float, reference: float, reference_velocity: float,
    reference_acceleration: float, n: Any, m: Any, z: Any, p: Any, u: Any,
) -> float:  # fmt: skip
    """One sample with positions as whole turns and the rest, rad. Returns the torque to hold, N·m."""
    keep_time(n, m, u)
    if (
        unusable(turns, position, reference_turns, reference, reference_velocity, reference_acceleration, u)
        != 0.0
    ):
        m.waited += n.sample_time
        return faulty(n, m)
    see(turns, position, reference_turns, reference, reference_velocity, reference_acceleration, n, m)
    torque = respond(n, m, z, p, u)
    if not abs(torque) < math.inf:
        return faulty(n, m)
    m.commanded = taken_over(torque, n, m, z, p, u)
    m.applied = min(max(m.commanded, -n.torque_limit), n.torque_limit)
    return m.applied


def sample(
    position: float, reference: float, reference_velocity: float, reference_acceleration: float,
    n: Any, m: Any, z: Any, p: Any, u: Any,
) -> float:  # fmt: skip
    """One sample: measure, compensate, control, limit. Returns the torque to hold, N·m."""
    return sample_turns(
        0.0, position, 0.0, reference, reference_velocity, reference_acceleration, n, m, z, p, u
    )


def follow_turns(
    turns: float, position: float, reference_turns: float, reference: float, reference_velocity: float,
    reference_acceleration: float, torque: float, n: Any, m: Any, z: Any, p: Any, u: Any,
) -> float:  # fmt: skip
    """Watch one sample while another controls the axis with `torque`, N·m; the sample that takes over starts there.

    The laws run, so that an observer knows the disturbance when it takes over.
    """
    keep_time(n, m, u)
    m.share = 0.0
    m.fault = 0.0
    m.open = 1.0
    held = 0.0
    if abs(torque) < LARGEST:
        held = torque
    if (
        unusable(turns, position, reference_turns, reference, reference_velocity, reference_acceleration, u)
        != 0.0
    ):
        m.waited += n.sample_time
        m.fault = 1.0
    else:
        see(turns, position, reference_turns, reference, reference_velocity, reference_acceleration, n, m)
        respond(n, m, z, p, u)
    m.applied = held
    m.commanded = held
    return held


def follow(
    position: float, reference: float, reference_velocity: float, reference_acceleration: float, torque: float,
    n: Any, m: Any, z: Any, p: Any, u: Any,
) -> float:  # fmt: skip
    """Watch one sample while another controls the axis with `torque`, N·m; the sample that takes over starts there."""
    return follow_turns(
        0.0, position, 0.0, reference, reference_velocity, reference_acceleration, torque, n, m, z, p, u
    )


def functions_with(laws: Mapping[str, Callable[..., float]]) -> dict[str, Callable[..., float]]:
    """The functions of this file by name, with those of a controller's laws in their places."""
    home = globals()
    own = {
        name: value
        for name, value in home.items()
        if isinstance(value, types.FunctionType) and value.__globals__ is home and value is not functions_with
    }
    scope = dict(home)
    scope.update({name: rescoped(function, scope) for name, function in own.items()})
    scope.update(laws)
    return {name: scope[name] for name in own}
