"""Whether a law's parameters have the units that they are said to have: the same contact in other units of torque, time
and angle gives the same torque."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any, NamedTuple

from stickslip.contract.motions import example
from stickslip.contract.verdict import Verdict, failed, held, not_tried
from stickslip.core.errors import ParameterError
from stickslip.core.smoke_test import moments
from stickslip.core.spec import Field, Law, Surroundings

POWERS = {"²": "2", "³": "3", "⁴": "4", "⁻¹": "-1", "⁻²": "-2"}
WORD = re.compile(r"(N|m|rad|s|kg|J|W|Hz|K|°C|-|1)(?:\^(-?\d+(?:\.\d+)?))?")
ROUNDING = 1e-9
"""Share of the largest torque; factors of two change no digit, but what is made of them may."""


class Unit(NamedTuple):
    """Powers of newton, metre, radian and second."""

    newton: float = 0
    metre: float = 0
    radian: float = 0
    second: float = 0

    def times(self, other: Unit, power: float) -> Unit:
        """The product with a power of another unit."""
        return Unit(*(a + power * b for a, b in zip(self, other)))


WORDS = {
    "N": Unit(1), "m": Unit(0, 1), "rad": Unit(0, 0, 1), "s": Unit(0, 0, 0, 1), "kg": Unit(1, -1, 0, 2),
    "J": Unit(1, 1), "W": Unit(1, 1, 0, -1), "Hz": Unit(0, 0, 0, -1), "K": Unit(), "°C": Unit(), "-": Unit(),
    "1": Unit(),
}  # fmt: skip


def parsed(text: str) -> Unit | None:
    """The unit of words like ``N·m/(rad·s)``; None where it is not understood."""
    for sign, power in POWERS.items():
        text = text.replace(sign, f"^{power}")
    whole, over = Unit(), 1
    depth: list[int] = []
    for token in re.findall(r"[()/·* ]|[^()/·* ]+", text):
        if token == "(":
            depth.append(over)
        elif token == ")":
            if not depth:
                return None
            over = 1
            depth.pop()
        elif token == "/":
            over = -1
        elif token not in "·* ":
            word = WORD.fullmatch(token)
            if word is None:
                return None
            whole = whole.times(WORDS[word[1]], over * float(word[2] or 1))
            over = over if depth else 1
    return None if depth else whole


def units(law: Law) -> Verdict:
    """The law answers to a change of units as those of its parameters say."""
    name = "units"
    found = {f.name: parsed(f.par.unit) for f in (*law.fields, *law.state_fields)}
    strange = [f.par.unit for f in law.fields if found[f.name] is None]
    if strange:
        return not_tried(name, f"the unit {strange[0]!r} is not understood")
    # A law of a linear axis is in N and m, not N·m and rad.
    linear = any(u and u.newton != u.metre for u in found.values())
    said: list[str] = []
    for what, factors in (
        ("torque", (4.0, 1.0, 1.0)),
        ("time", (1.0, 1.0, 0.25)),
        ("angle", (1.0, 4.0, 1.0)),
    ):
        try:
            apart = _apart(law, factors, linear=linear)
        except ParameterError:
            continue  # its bounds allow no such parameters
        if apart > ROUNDING and what == "torque":
            return failed(
                name,
                f"with every N·m four times as large the torque is {apart:.2g} off; correct a parameter's unit",
            )
        if apart > ROUNDING:
            said.append(what)
    if said:
        kinds = " and ".join(said)
        remedy = "correct a parameter's unit, unless a number of the file has one"
        return held(name, f"the torque scales with its units, but not with those of {kinds}: {remedy}")
    return held(name, "the same contact in other units gives the same torque")


def _apart(law: Law, factors: Sequence[float], *, linear: bool) -> float:
    """Largest difference of the torques of the contact in other units, over the largest torque."""
    torque, angle, time = factors
    p = example(law)
    scaled = law.parameters({f.name: _scaled(f, getattr(p, f.name), factors, linear) for f in law.fields})
    here, there = _torques(law, p, 1.0, 1.0), _torques(law, scaled, angle / time, time)
    largest = max(map(abs, here))
    return max(abs(a - b / torque) for a, b in zip(here, there)) / largest if largest else 0.0


def _scaled(f: Field, value: Any, factors: Sequence[float], linear: bool) -> Any:
    unit = parsed(f.par.unit)
    assert unit is not None
    torque, angle, time = factors
    lengths = unit.radian + unit.metre if linear else unit.radian
    # The phase and the shape of something periodic in the angle are angles that no unit changes.
    if f.par.unit == "rad" and "phase" in f.name:
        return list(value) if f.per_element else value
    factor = torque**unit.newton * angle**lengths * time**unit.second
    return [factor * x for x in value] if f.per_element else factor * value


def _torques(law: Law, p: Any, faster: float, longer: float) -> list[float]:
    """Torques along the trial's random steps with all velocities and times multiplied."""
    z, v, out = law.state(p), 0.0, list[float]()
    for moment in moments(law, example(law)):
        end = faster * moment.velocity
        out.append(law.step(v, end, longer * STEP, z, p, Surroundings()))
        v = end
    return out


STEP = 1e-3
"""s"""
