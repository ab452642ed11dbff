"""A short trial of a law that comes from outside, once, when it is first used.

Some hundred steps of plain Python with the law's example: every torque is a number, a step of no length gives the
torque now, and `rate` moves the state as `step` does. `stickslip law FILE.py --check` looks at everything
(`stickslip.contract`).
"""

from __future__ import annotations

import copy
import math
import random
from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any, NamedTuple

from stickslip.core.spec import Law, Surroundings

STEPS = 150
NOW = 1e-6
"""What the torque of a step of no length, and that of `rate`, may differ by from the torque now, over the largest."""
SMOOTH, APART, SHARE = 0.02, 0.05, 0.25
"""Where the state's velocity over a step and over half of it agree to SMOOTH, it may differ by APART from what `rate`
writes; more than SHARE of the states beyond that are no break-away that happens to fall into a step."""
TINY = 1e-5
"""Share of the largest value of a state by which it moves in such a step."""
U = Surroundings()


class Moment(NamedTuple):
    """What a law remembers after a step: the velocity (rad/s), its torque (N·m), a copy of its state."""

    velocity: float
    torque: float
    state: SimpleNamespace


def complaint(law: Law) -> str:
    """Say what is wrong with the law, in a sentence without its end; "" where nothing is found."""
    p = law.parameters(dict(law.example))
    try:
        seen: list[Moment] = []
        for moment in moments(law, p):
            if wrong := _no_number(law, moment):
                return wrong
            seen.append(moment)
        largest = max(abs(m.torque) for m in seen)
        for moment in seen:
            if wrong := _not_now(law, p, moment, NOW * largest):
                return wrong
        return _rate_apart(law, p, seen) if law.rate and law.state_fields else ""
    except Exception as error:  # whatever the law's own code may raise
        return f"its functions end in {type(error).__name__} ({error}) with the law's example"


def moments(law: Law, p: Any, steps: int = STEPS, seed: int = 1) -> Iterator[Moment]:
    """Random steps from rest: speeds over seven decades, reversals, rests; dt from 1e-6 to 0.1 s."""
    draw, z, v = random.Random(seed), law.state(p), 0.0
    for _ in range(steps):
        end = 0.0 if draw.random() < 0.1 else draw.choice((-1.0, 1.0)) * 10.0 ** draw.uniform(-7.0, 0.0)
        torque = law.step(v, end, 10.0 ** draw.uniform(-6.0, -1.0), z, p, U)
        v = end
        yield Moment(v, torque, copy.deepcopy(z))


def _no_number(law: Law, moment: Moment) -> str:
    torque: Any = moment.torque
    if not isinstance(torque, (int, float)):
        return f"step returns {torque!r} at v1 = {moment.velocity:g} rad/s, no torque"
    if not math.isfinite(torque) or not all(map(math.isfinite, law.pack_state(moment.state))):
        return f"step gives a torque or state that is not finite at v1 = {moment.velocity:g} rad/s"
    return ""


def _not_now(law: Law, p: Any, moment: Moment, room: float) -> str:
    v, torque = moment.velocity, moment.torque
    now = law.step(v, v, 0.0, copy.deepcopy(moment.state), p, U)
    if not abs(now - torque) <= room:
        return f"step with dt = 0 gives {now:.6g} N·m at v = {v:.3g} rad/s, where the torque now is {torque:.6g} N·m"
    if law.rate is None or v == 0.0:
        return ""
    said = law.rate(v, copy.deepcopy(moment.state), p, U, law.state(p))
    if not abs(said - torque) <= room:
        return f"rate gives {said:.6g} N·m at v = {v:.3g} rad/s, where step gives {torque:.6g} N·m"
    return ""


def _rate_apart(law: Law, p: Any, seen: list[Moment]) -> str:
    """Whether `rate` moves the state otherwise than a short step does, in so many states that it is no event."""
    names = [f.name for f in law.state_fields if not f.per_element]
    names += [f.name for f in law.state_fields if f.per_element for _ in range(law.elements_in(p))]
    free = [i for i, mode in enumerate(law.mode_mask(p)) if not mode]
    packed = [law.pack_state(m.state) for m in seen]
    largest = {i: max(abs(values[i]) for values in packed) for i in free}
    for i in free:
        compared = [c for m in seen if m.velocity != 0.0 and (c := _velocities(law, p, m, i, largest[i]))]
        off = [c for c in compared if abs(c[1] - c[2]) > APART * max(abs(c[1]), abs(c[2])) + c[3]]
        if compared and len(off) > SHARE * len(compared):
            v, stepped, written, _ = off[0]
            return (
                f"step and rate are not the same law: at v = {v:.3g} rad/s the state {names[i]!r} moves by "
                f"{stepped:.4g}/s in a short step, and rate writes {written:.4g}/s"
            )
    return ""


def _velocities(
    law: Law, p: Any, moment: Moment, i: int, largest: float
) -> tuple[float, float, float, float] | None:
    """The velocity (rad/s), that of state i in a short step and by `rate` (1/s), and what rounding makes of it;
    None where the step meets an event, or the state rests."""
    v, dz = moment.velocity, law.state(p)
    before = law.pack_state(moment.state)
    law.rate(v, copy.deepcopy(moment.state), p, U, dz)  # type: ignore[misc]
    written = law.pack_state(dz)[i]
    h = min(1e-3, TINY * largest / abs(written)) if written else 1e-6
    found: list[float] = []
    for part in (h, 0.5 * h):
        z = copy.deepcopy(moment.state)
        law.step(v, v, part, z, p, U)
        after = law.pack_state(z)
        if any(m and a != b for m, a, b in zip(law.mode_mask(p), before, after)):
            return None
        found.append((after[i] - before[i]) / part)
    rounding = 1e-12 * largest / h
    if abs(found[0] - found[1]) > SMOOTH * (abs(found[0]) + abs(found[1])) + rounding:
        return None
    return v, found[1], written, rounding
