"""Control laws whose torque depends on the absolute angle: sines in other units of angle, positions without turns."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from types import FunctionType, SimpleNamespace
from typing import Any

from stickslip.contract.specimens import LIMIT, Array, Plain, clean_motion, specimen
from stickslip.contract.verdict import Verdict, failed, held
from stickslip.core.control_spec import ControlLaw
from stickslip.core.rebinding import bound

TURN = 2.0 * math.pi
TAKES, GIVES = ("sin", "cos", "tan"), ("asin", "acos", "atan", "atan2")
"""Functions that take an angle, and that give one."""
SPLIT = 128.0 + 333.0 / 1024.0
"""Turns that are split off: C in single precision splits off 1/1024 of a turn and multiples of it."""
ALIKE = 1e-6
"""Of the limit: what a torque may differ by as positions are split."""


def in_other_angles(law: ControlLaw, factor: float, gives: Sequence[str] = GIVES) -> ControlLaw:
    """The law where angles are `factor` times as large: sines take them so, and a turn is as much larger.

    `gives` are the functions that give such an angle; an arcus tangent may as well smooth a sign. Numbers that a
    function writes out stay what they are.
    """
    functions: dict[str, Callable[..., float]] = {n: _taking(getattr(math, n), factor) for n in TAKES}
    functions |= {n: _giving(getattr(math, n), factor) for n in gives}
    turned = {"pi": factor * math.pi, "tau": factor * TURN}
    other = SimpleNamespace(**{**vars(math), **functions, **turned})
    choices = tuple(
        replace(
            c,
            options={
                n: replace(o, function=_rebound(o.function, other, factor)) for n, o in c.options.items()
            },
        )
        for c in law.choices
    )
    sample = _rebound(law.written["sample"], other, factor)
    written: dict[str, Any] = {**law.written, "sample": sample, "choices": choices, "variants": {}}
    return ControlLaw(**written)


def _rebound(function: Any, other: SimpleNamespace, factor: float) -> Any:
    """The function with other sines; numbers of its file that are parts of a turn are as much larger."""
    if not isinstance(function, FunctionType):
        return function
    names: dict[str, Any] = {}
    for name, value in function.__globals__.items():
        if value is math:
            names[name] = other
        elif isinstance(value, float) and _part_of_a_turn(value):
            names[name] = factor * value
    return bound(function, names)


def _part_of_a_turn(value: float) -> bool:
    """Whether a number is a whole number of twelfths of π, to its last digits."""
    parts = 12.0 * value / math.pi
    return parts != 0.0 and abs(parts) < 1e3 and abs(parts - round(parts)) < 1e-14 * abs(parts)


def _taking(function: Callable[[float], float], factor: float) -> Callable[[float], float]:
    return lambda angle: function(angle / factor)


def _giving(function: Callable[..., float], factor: float) -> Callable[..., float]:
    return lambda *given: factor * function(*given)


def turns(law: ControlLaw) -> Verdict:
    """Positions split into turns and the rest, as C in single precision splits them, give the same torque."""
    inputs = clean_motion()
    whole = Plain(specimen(law)), Plain(specimen(law))
    apart = max(abs(_split(whole[0], row, 0.0) - _split(whole[1], row, SPLIT)) for row in inputs)
    if apart <= ALIKE * LIMIT:
        return held("turns", "the same torque with turns split off the positions")
    said = f"with turns split off the positions, as in single precision, the torque is {apart:.3g} N·m off"
    return failed("turns", f"{said}; write 2π y.turns + y.position, and + y.error for the reference's angle")


def _split(plain: Plain, row: Array, split: float) -> float:
    """The torque of a sample whose positions have so many turns split off, N·m."""
    position, reference = (float(x) - TURN * split for x in row[:2])
    run = plain.functions["sample_turns"]
    return run(
        split, position, split, reference, *map(float, row[2:]), plain.n, plain.m, plain.z, plain.p, plain.u
    )
