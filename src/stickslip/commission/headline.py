"""A commissioning in five lines: friction, axis, trust, compensator, and what to do next."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from stickslip.analyse.wording import ends
from stickslip.commission.recommended import NONE_SAFE
from stickslip.identification.estimate import Estimate, Identification
from stickslip.identification.monte_carlo import resisting_torque

if TYPE_CHECKING:
    from stickslip.commission.commission import Commissioned

NAMED = 5
"""Parameters that are not identified, listed by name."""


def headline(found: Commissioned, command: str = "") -> tuple[tuple[str, str], ...]:
    """Five lines, each a word and what is to be said under it.

    Parameters
    ----------
    found : Commissioned
    command : str
        That uses what is recommended; without it, or without a recommendation, the model's.
    """
    return (
        ("Friction", friction(found)), ("Axis", axis(found)), ("Trust", trust(found)),
        ("Compensator", compensator(found)), ("Next", following(found, command)),
    )  # fmt: skip


def friction(found: Commissioned) -> str:
    """Break-away torque and sliding torque, at the speeds that were measured."""
    result = found.result
    said: list[str] = []
    for word in ("positive", "negative"):
        if e := named(result, f"breakaway.fs_{word}"):
            said.append(f"{with_interval(e)} in the {word} direction")
    text = f"breaks away at {' and '.join(said)}" if said else "break-away was not measured"
    sliding = found.stage("sliding").found
    slow, fast = sliding.details.get("speeds", (math.nan, math.nan)) if sliding else (math.nan, math.nan)
    if math.isfinite(slow):
        low, high = resisting_torque(found.model, np.array([slow, fast])).tolist()
        text += f"; slides at {low:.3g} N·m at {slow:.3g} rad/s and {high:.3g} N·m at {fast:.3g} rad/s"
    return f"{text} (mean of both directions; {found.model.law.title or found.model.law.name})."


def axis(found: Commissioned) -> str:
    """Inertia, stiffness before sliding, and the fastest loop that it bears."""
    parts = [f"inertia {with_interval(e)}" for e in [named(found.result, "inertia")] if e]
    stiffness = named(found.result, "presliding.stiffness")
    if stiffness:
        parts.append(f"stiffness before sliding {with_interval(stiffness)}")
    if found.recommended:
        parts.append(f"a PD of {found.recommended.known.bandwidth:.3g} Hz is recommended")
    return f"{'; '.join(parts)}."


def trust(found: Commissioned) -> str:
    """How many numbers are identified, which are not, and which checks failed."""
    estimates = found.result.estimates
    missing = [e.name for e in estimates if not e.identified]
    said = f"{len(estimates) - len(missing)} of {len(estimates)} numbers identified"
    if missing:
        more = f" and {len(missing) - NAMED} more" if len(missing) > NAMED else ""
        said += f"; not: {', '.join(missing[:NAMED])}{more}"
    failed = sorted({s.name for s in found.stages if not s.performed.passed})
    lost = sorted({s.name for s in found.stages if s.found is None})
    said += f"; checks failed in: {', '.join(failed)}" if failed else "; every check of the procedures passed"
    return said + (f"; nothing was identified from: {', '.join(lost)}." if lost else ".")


def compensator(found: Commissioned) -> str:
    """What is to be switched on, and what it did on the machine."""
    if found.recommended is None:
        return "not looked for, or not to be had: the notes below say why."
    chosen, tracked = found.recommended.advice.chosen, found.recommended.tracked
    if chosen is None:
        return f"none: {NONE_SAFE}."
    c = chosen.setting
    said = f"{c.kind} of law {c.law!r}, gain {c.gain:g}"
    if tracked:
        t = tracked[0]
        said += (
            f"; on the slow sinusoid the error fell from {1e3 * t.alone:.3g} to {1e3 * t.helped:.3g} mrad RMS, "
            f"{t.ratio:.3g} times, with a PD of {t.bandwidth:.3g} Hz"
        )
    return f"{said}."


def following(found: Commissioned, command: str) -> str:
    """The next command, or what to measure."""
    if command and found.recommended and found.recommended.advice.chosen:
        return command
    if found.result.measure_next:
        return found.result.measure_next[0]
    return 'take the model in a study or a simulation: law = {model = "model.toml"}.'


def named(result: Identification, name: str) -> Estimate | None:
    """An estimate by its name; None where there is none."""
    return next((e for e in result.estimates if e.name == name), None)


def with_interval(e: Estimate) -> str:
    """A number with its 95 % interval, or that it is not identified."""
    if not e.identified:
        return f"{e.value:.4g} {e.unit} (not identified)"
    return f"{e.value:.4g} {e.unit} [{', '.join(ends(e.value, e.lower, e.upper))}]"
