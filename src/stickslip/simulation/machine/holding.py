"""A sample of a machine whose contact holds at rest (Coulomb, static, Karnopp, ...): from event to event.

While it holds, the rest of the axis moves exactly, with the disk where it is. While it slides, its viscous friction
belongs to the linear part; the rest of its torque is linear in time over a step, its end solved from the law's own
``step``: Coulomb's law is exact. What lies between the ends of a step is shown by nodes: the load on the disk at rest,
or its velocity. Where a load comes to what the contact withstands, or a velocity to rest, the step is halved until it
resolves every mode; then it ends there (`series`).

Behind an event the next step leads back to a half, quarter and so on of the sample, whose flows are kept.
"""

from __future__ import annotations

import math

from stickslip.jit import call_holding, call_step, columns_times, kernel, pointer, record_at
from stickslip.simulation.case_arrays import AROUND
from stickslip.simulation.machine.contact import FLATTEST, STEEPEST, STIFF, finish, gain
from stickslip.simulation.machine.held_tables import FREE, HELD, NODES, PIECE, PULL, SHOWN, WATCH
from stickslip.simulation.machine.plant import (
    BLOCK,
    FINEST,
    FIRST,
    GIVEN,
    IN_MOTOR,
    LAST,
    LEVELS,
    SLOTS,
    Plant,
)
from stickslip.simulation.machine.series import (
    curve_at,
    expanded,
    first_root,
    load_curve,
    piece,
    shown_by_curve,
    speed_curve,
)
from stickslip.simulation.machine.substep import GROWS, act, least_level, rolled
from stickslip.simulation.root import MOST, ROOT
from stickslip.simulation.root import compiled as root
from stickslip.simulation.train.cross import SLIVER, snapped

DEEPEST = 24
"""Halvings of a sample that a step may need."""
LOOKS = 2
"""Halvings beyond those that resolve every mode, from which nodes show all that there is."""
MARGIN = 0.05
"""Of the range of what nodes show, by which it may pass them between."""
STORM = 10000
"""Steps in a sample, after which the motion is no number."""
DISTINCT = 1e-11
"""Of the torque that holds, by which a load breaks it away: by rounding alone it would come loose and rest again
without end, and move by nothing that a number shows."""
BARELY = 1e-30
"""rad/s, at which the law says what it takes when the contact has just begun to slide."""
CLOSER, STILL = math.inf, -1.0
"""What `tried` returns of a step that must be halved, and of one that should slide but does not leave rest."""
X, INVERSE, ENOUGH = (ROOT.scalars.index(name) for name in ("x", "inverse", "enough"))
begin, improve = root.begin, root.improve


@kernel()
def cross(plant: Plant, before: float, drive: float, late: int, factor: float) -> float:
    """Move on by a sample; arguments and what it returns as of `stickslip.simulation.machine.substep.cross`."""
    n, now = plant.machine, plant.now
    part = math.ldexp(float(late), -FINEST)
    energy, place, steps = 0.0, 0.0, 0
    while place < 1.0:
        early = place < part
        plant.axis[n.size + IN_MOTOR] = before if early else drive
        end = part if early else 1.0
        length = step(plant, place, end, factor)
        energy += now.friction * plant.axis[n.disk + 1] * length
        place = snapped(place + length, FINEST, end)
        steps += 1
        if steps > STORM or not math.isfinite(plant.axis[n.disk + 1]):
            plant.axis[n.disk] = math.nan
            break
    now.taken += steps
    return energy


@kernel(inline=True)
def fitting(level: int, resolving: int, place: float, end: float) -> tuple[int, float]:
    """How long a step of about so many halvings may be, in samples, to lie on a part of it; its halvings."""
    while level < FINEST:
        parts = float(1 << level)
        at = place * parts
        if at == math.floor(at) and at + 1.0 <= end * parts:
            return level, 1.0 / parts
        following = math.floor(at) + 1.0
        # Steps of other lengths are series, which have to resolve every mode.
        if level >= resolving and following <= end * parts and following - at >= SLIVER:
            return level, (following - at) / parts
        level += 1
    parts = float(1 << level)
    following = math.floor(place * parts) + 1.0
    if following - place * parts < SLIVER:
        following += 1.0
    return level, min(following / parts, end) - place


@kernel()
def step(plant: Plant, place: float, end: float, factor: float) -> float:
    """Take one step; returns how long it is, in samples."""
    n, now = plant.machine, plant.now
    act(plant, factor, 0.0)
    side = direction(plant)
    forced = False
    level = max(now.level, least_level(plant), n.watched)
    while True:
        level, length = fitting(level, n.resolving, place, end)
        h = length * n.sample_time
        act(plant, factor, h)
        wrong, at = tried(plant, side, level, length, forced)
        if wrong == STILL:
            side, forced, now.rate = 0.0, True, 0.0
            level = max(level, n.resolving)
        elif wrong <= 1.0 or level >= DEEPEST:
            break
        else:
            level = max(level + 1, n.resolving if wrong == CLOSER else 0)
            while length * float(1 << level) < 1.0:
                level += 1
    now.level = level - 1 if wrong < GROWS and level > n.watched else level
    keep(plant, side, length * at * n.sample_time)
    return length * at


@kernel(inline=True)
def direction(plant: Plant) -> float:
    """Which way the disk slides, or will: 0 where it rests."""
    n, now, x = plant.machine, plant.now, plant.axis
    v = x[n.disk + 1]
    if v != 0.0:
        return math.copysign(1.0, v)
    if now.rate != 0.0:
        return now.rate
    load = load_now(plant)
    way = 1.0 if load > 0.0 else -1.0
    return way if abs(load) > withstood(plant, way) else 0.0


@kernel(inline=True)
def load_now(plant: Plant) -> float:
    """The torque on the disk at rest, N·m."""
    load = 0.0
    for j in range(plant.machine.size + GIVEN):
        load += plant.matrix[PULL + j] * plant.axis[j]
    return load


@kernel(inline=True)
def withstood(plant: Plant, side: float) -> float:
    """The torque beyond which the contact breaks away in a direction, N·m."""
    held = call_holding(plant.machine.holding, side, plant.contact, plant.parameters, plant.surroundings)
    return plant.now.scale * held * (1.0 + DISTINCT)


@kernel()
def sliding_torque(plant: Plant, side: float, v0: float, v: float, h: float) -> float:
    """The law's torque on a disk that slides in a direction, beside what is viscous, N·m; as at rest where the velocity
    would be another. Its states then lie behind those before."""
    n, z = plant.machine, plant.contact
    for i in range(n.states):
        z[n.states + i] = z[i]
    v = v if side * v > 0.0 else side * BARELY
    v0 = v0 if side * v0 > 0.0 else side * BARELY
    # A law with a band of rest gives back there what is applied.
    around = record_at(plant.surroundings, AROUND)
    around.applied = side * call_holding(n.holding, side, z, plant.parameters, plant.surroundings)
    behind = pointer(z, n.states)
    torque = call_step(n.step, v0, v, h, behind, plant.parameters, plant.surroundings)
    return plant.now.scale * torque - n.damping * v


# ---- a step that is tried ---------------------------------------------------------------------------------------


@kernel()
def tried(plant: Plant, side: float, level: int, length: float, forced: bool) -> tuple[float, float]:
    """Try a step; returns how many tolerances it is wrong by, and at which part of it it ends."""
    n, mem, x = plant.machine, plant.matrix, plant.axis
    kind = HELD if side == 0.0 else FREE
    h = length * n.sample_time
    kept = level <= FINEST and length * float(1 << level) == 1.0
    block = PIECE
    if kept:
        block = (kind * LEVELS + level) * BLOCK
        columns_times(pointer(mem, block), x, n.size + GIVEN, pointer(x, SLOTS))
    else:
        expanded(plant, kind, h)
        piece(plant, h, 1.0)
    if kind == HELD:
        return rests(plant, level, h, kept, forced)
    return slides(plant, side, level, h, block, kept)


@kernel()
def rests(plant: Plant, level: int, h: float, kept: bool, forced: bool) -> tuple[float, float]:
    """A step in which the disk rests, or at whose end it breaks away."""
    n, now, mem, x = plant.machine, plant.now, plant.matrix, plant.axis
    show(plant, HELD, level, h, kept, 0.0, 0.0)
    at, before = 1.0, load_now(plant)
    for side in (1.0, -1.0):
        level_at = withstood(plant, side)
        first, most, _ = extreme(plant, side, side * before, level_at)
        if (forced and first == 0) or (first < 0 and most <= level_at):
            continue
        if level < n.resolving + LOOKS and (first < 0 or level < n.resolving):
            return CLOSER, 1.0
        if first < 0:
            continue
        if kept:
            expanded(plant, HELD, h)
            load_curve(plant)
        root_at = first_root(plant, side, level_at, first / NODES, (first + 1.0) / NODES)
        if root_at < at:
            at, now.rate = root_at, side
            piece(plant, h, at)
    x[SLOTS + n.disk + 1] = 0.0
    now.rest = 0.0
    for j in range(n.size):
        now.rest += mem[PULL + j] * x[SLOTS + j]
    for j in range(n.size, n.size + GIVEN):
        now.rest += mem[PULL + j] * x[j]
    return 0.0, at


@kernel(inline=True)
def show(plant: Plant, kind: int, level: int, h: float, kept: bool, start: float, end: float) -> None:
    """Write what the nodes of a step show."""
    mem = plant.matrix
    if not kept:
        if kind == FREE:
            speed_curve(plant, h, start, end - start, 1)
        else:
            load_curve(plant)
        shown_by_curve(plant, 1.0)
        return
    watch, shown = WATCH + (kind * (FINEST + 1) + level) * BLOCK, pointer(mem, SHOWN)
    columns_times(pointer(mem, watch), plant.axis, plant.machine.size + GIVEN, shown)
    if kind == FREE:
        for i in range(NODES):
            mem[SHOWN + i] -= mem[watch + FIRST * SLOTS + i] * start + mem[watch + LAST * SLOTS + i] * end


@kernel(inline=True)
def extreme(plant: Plant, side: float, before: float, limit: float) -> tuple[int, float, int]:
    """Of what the nodes show, times a side: the interval at whose end it is first beyond a limit, or -1; how far it may
    come, between nodes included; where."""
    most, least, node = before, before, -1
    for i in range(NODES):
        value = side * plant.matrix[SHOWN + i]
        if value > limit:
            return i, value, i
        if value > most:
            most, node = value, i
        least = min(least, value)
    # An end is what it is; between nodes there may be more beside a peak.
    return -1, most + (MARGIN * (most - least) if 0 <= node < NODES - 1 else 0.0), node


@kernel()
def slides(plant: Plant, side: float, level: int, h: float, block: int, kept: bool) -> tuple[float, float]:
    """A step in which the disk slides, or at whose end it comes to rest."""
    n, now, x = plant.machine, plant.now, plant.axis
    v0 = x[n.disk + 1]
    start = sliding_torque(plant, side, v0, v0, 0.0)
    flat = plant.search[INVERSE] * STIFF < 1.0
    v, end = solved(plant, side, h, block, start, flat)
    start = end if flat else start
    show(plant, FREE, level, h, kept, start, end)
    leaves = v0 == 0.0
    first, most, _ = extreme(plant, -side, -side * v0, 0.0)
    # A disk that leaves rest is nearest to it where it starts.
    if first < 0 and most > 0.0 and not leaves and level < n.resolving + LOOKS:
        return CLOSER, 1.0
    if first < 0:
        wrong = beside(plant, side, level, h, start, end)
        finish(plant, block, start, end)
        sliding_torque(plant, side, v0, v, h)
        now.rest += n.damping * x[SLOTS + n.disk + 1]
        return wrong, 1.0
    if level < n.resolving:
        return CLOSER, 1.0
    if kept:
        expanded(plant, FREE, h)
    return lands(plant, side, first, h, start, flat)


@kernel()
def lands(plant: Plant, side: float, first: int, h: float, start: float, flat: bool) -> tuple[float, float]:
    """A step that ends where the disk comes to rest, in or before the interval `first` between its nodes."""
    n, x = plant.machine, plant.axis
    v0 = x[n.disk + 1]
    rest = sliding_torque(plant, side, 0.0, 0.0, 0.0)
    start = rest if flat else start
    low, high = first / NODES, (first + 1.0) / NODES
    speed_curve(plant, h, start, rest - start, 0)
    if first == 0 and v0 == 0.0:
        # It has to move before it may stop.
        low = high
        while low > 1e-9 and side * curve_at(plant, low) <= 0.0:
            low *= 0.25
        if low <= 1e-9:
            return STILL, 1.0
    if side * curve_at(plant, high) > 0.0:
        high = 1.0
        if side * curve_at(plant, high) > 0.0:
            return CLOSER, 1.0
    at = first_root(plant, -side, 0.0, low, high)
    piece(plant, h, at)
    speed_curve(plant, h, start, (rest - start) / at, 1)
    shown_by_curve(plant, at)
    wrong = beside(plant, side, FINEST, at * h, start, rest)
    finish(plant, PIECE, start, rest)
    sliding_torque(plant, side, v0, 0.0, at * h)
    x[SLOTS + n.disk + 1] = 0.0
    return wrong, at


@kernel(inline=True)
def solved(plant: Plant, side: float, h: float, block: int, start: float, flat: bool) -> tuple[float, float]:
    """Velocity and the contact's torque at the end of a step."""
    n, r, x = plant.machine, plant.search, plant.axis
    v0 = x[n.disk + 1]
    first, last = gain(plant, block, 1, FIRST), gain(plant, block, 1, LAST)
    free = x[SLOTS + n.disk + 1]
    if flat:
        first, last = 0.0, first + last
    free -= first * start
    r[ENOUGH] = n.unbalance
    begin(r, free - last * start)
    for _ in range(MOST):
        v = r[X]
        if improve(r, v - free + last * sliding_torque(plant, side, v0, v, h)) == 0.0:
            break
    r[INVERSE] = min(max(r[INVERSE], 1.0 / STEEPEST), 1.0 / FLATTEST)
    return r[X], (free - r[X]) / last


@kernel(inline=True)
def beside(plant: Plant, side: float, level: int, h: float, start: float, end: float) -> float:
    """How many tolerances the law's torque lies beside the straight line, by what the nodes show."""
    n, worst = plant.machine, 0.0
    v0 = plant.axis[n.disk + 1]
    apart = 4 if level < n.resolving else 8
    for node in range(apart, NODES, apart):
        v = plant.matrix[SHOWN + node - 1]
        line = start + (end - start) * (float(node) / NODES)
        torque = sliding_torque(plant, side, v0, v, h * (float(node) / NODES))
        worst = max(worst, abs(torque - line))
    return worst * h * n.weight


@kernel(inline=True)
def keep(plant: Plant, side: float, h: float) -> None:
    """Make the step that was tried the machine's."""
    n, now, x, z = plant.machine, plant.now, plant.axis, plant.contact
    if side != 0.0:
        now.rate = 0.0
    if n.bearing > 0.0:
        now.bearing = rolled(n, now.bearing, x[SLOTS + n.shaft] - x[n.shaft])
    now.friction = now.rest / now.scale
    for i in range(n.size):
        x[i] = x[SLOTS + i]
    if side != 0.0:
        for i in range(n.states):
            z[i] = z[n.states + i]
