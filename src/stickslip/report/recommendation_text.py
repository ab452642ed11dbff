"""A recommendation in lines of text: what was tried, what to switch on, what to expect."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator

from stickslip.control.learned import told
from stickslip.control.registry import control_law
from stickslip.model import Model
from stickslip.recommend.beside import Beside
from stickslip.recommend.candidates import Candidate
from stickslip.recommend.course import measured
from stickslip.recommend.notes import ALLOWANCE
from stickslip.recommend.recommendation import Recommendation

BEATEN = "not tried further: another one leaves less"


def recommendation_lines(result: Recommendation, unit: Callable[[str], str]) -> list[str]:
    """The setting, what to expect, and what was tried; `unit` turns an angular unit into the axis's own."""
    deadband = f"deadband, {unit('rad/s')}"
    wide = len(deadband)
    out = [f"{'law':<16}{'structure':<13}{'gain':>5}  {deadband}  {'error left':>10}  {'worst':>7}  safe"]
    for c in result.candidates:
        x = c.setting
        taken = result.switched_on
        mark = "<- " if taken and (x.label, x.kind, x.gain, x.deadband) == same(taken) else ""
        out.append(f"{x.label:<16}{x.kind:<13}{x.gain:>5.3g}  {x.deadband:>{wide}.3g}  {100 * c.errors[0]:>8.1f} %  "
              f"{worst_left(c):>7}  {mark}{safety(c)}")  # fmt: skip
    out.append("")
    path, course = result.drive.path, result.drive.course
    speed = f", up to {path.top_speed:.3g} {unit('rad/s')}" if path.top_speed else ""
    said = [f"{path.source}; {path.duration:.3g} s{speed}"]
    if measured(path):
        said.append("what the axis did, which need not be the drive's reference")
    if course.jumps:
        steps = f"{len(course.jumps)} steps of up to" if len(course.jumps) > 1 else "a step of"
        said.append(f"{steps} {course.highest_jump:.3g} {unit('rad')}")
    out.append(f"motion:            {'; '.join([*said, *([course.said] if course.said else [])])}")
    units = {f.name: f.par.unit for kind in ("gains", "cascade") for f in control_law(kind).fields}
    gains = ", ".join(
        f"{k} {v:.5g} {unit(units[k]) if units.get(k, '-') != '-' else ''}".rstrip()
        for k, v in result.gains.items()
        if v
    )
    out.append(f"linear controller: {gains}; RMS error alone {result.linear_error:.3g} {unit('rad')}")
    if result.rings:
        out.append(f"linear alone:      without a compensator it oscillates {result.rings}")
        if result.chosen or result.instead:
            out.append(
                f"{'':19}below, safe means that the compensator adds no oscillation to this one; it does not end it"
            )
    return [*out, *beside_lines(result), *chosen_lines(result, unit), *result.notes]


def chosen_lines(result: Recommendation, unit: Callable[[str], str]) -> list[str]:
    """What is switched on, and what to expect of it; nothing where no compensator is."""
    if result.instead is not None:
        return instead_lines(result, result.instead)
    c = result.chosen
    if c is None or result.model is None:
        return []
    x = c.setting
    out = [f"switch on:         {x.words}"]
    if x.compensates:
        out.append(f"parameters:        {parameters(result.model, unit)}")
        out.append(f"lead:              {x.lead:.4g} s")
        out.append(f"deadband:          {x.deadband:.4g} {unit('rad/s')}")
    fed = f"{x.inertia_feedforward:.4g} {unit('kg·m²')} times the acceleration"
    out.append(f"inertia:           {fed if x.inertia_feedforward else 'not fed forward'}")
    out.append(f"error reduction:   {reduction(result)}")
    if x.compensates:
        out += [f"of this:           {said}" for said in without_friction(result)]
        out.append(f"gain margin:       {margin(c, result)}")
    return out


def without_friction(result: Recommendation) -> Iterator[str]:
    """How much of the reduction the inertia feedforward alone gives, and friction compensation beyond it; nothing where
    no inertia is fed forward, or no friction compensated."""
    alone, whole = result.inertia_alone, result.chosen
    if alone is None or whole is None or not whole.setting.compensates:
        return
    fed = "inertia feedforward alone" + (" with the constant torque" if alone.setting.offset else "")
    if alone.unsafe:
        yield (
            f"{fed} gives {taken_away(alone.errors[0])} on the best estimate, and is not recommended without friction "
            f"compensation ({', '.join(alone.unsafe)})"
        )
        return
    half = (
        f" and at least {taken_away(alone.usual)} on half of the sampled axes"
        if result.confirmed_on > 1
        else ""
    )
    left = [
        with_friction / without for with_friction, without in zip(whole.errors, alone.errors, strict=True)
    ]
    unsure = (
        "" if ALLOWANCE * max(left) <= 1.0
        else f", but not surely: for what is not simulated {ALLOWANCE:g} times as much error is allowed"
    )  # fmt: skip
    yield (
        f"{fed} gives {taken_away(alone.errors[0])} on the best estimate{half}; of what it leaves there, friction "
        f"compensation takes {taken_away(left[0])}{unsure}"
    )


def taken_away(left: float) -> str:
    """The part of the error that is taken away, for people; of what makes it larger 0 %."""
    part = max(1.0 - left, 0.0)
    return percent(part, part)


def beside_lines(result: Recommendation) -> list[str]:
    """Compensators of the catalogue: the error that each leaves, or why it is not switched on."""
    if not result.beside:
        return []
    out = ["", f"{'compensator':<22}{'error left':>10}  {'worst':>7}  switched on"]
    for b in result.beside:
        numbers = (
            f"{100 * b.errors[0]:>8.1f} %  {100 * b.worst:>5.1f} %" if b.errors else f"{'–':>10}  {'–':>7}"
        )
        hardly = result.instead is None and result.chosen is not None and b.at_most <= result.chosen.worst
        why = b.why_not or ("it leaves hardly less" if hardly else "another one leaves less")
        mark = "<- yes" if b is result.instead else f"no: {why}"
        out.append(f"{b.label:<22}{numbers}  {mark}")
    return [*out, ""]


def instead_lines(result: Recommendation, taken: Beside) -> list[str]:
    """Describe the compensator of the catalogue that is switched on: the error left, and what it has learned."""
    said = (
        f"it leaves at most {100 * taken.at_most:.1f} % of the linear controller's error on all sampled axes, up to "
        f"{100 * min(ALLOWANCE * taken.at_most, 1.0):.1f} % with what is not simulated"
    )
    best = result.chosen
    if best is not None:
        other = result.hunts or f"leaves up to {100 * best.worst:.1f} %"
        other = f"; the best setting of a law ({best.setting.words}) {other}"
    else:
        other = "; no setting of a law is safe and worth it"
    learned = [f"learned there:     {line}" for line in told({"learned": taken.learned})]
    return [f"switch on:         {taken.label}; {said}{other}", *learned]


def worst_left(c: Candidate) -> str:
    """Return the greatest part of the error left on any axis; a dash for a candidate that was not tried on all."""
    return f"{100 * c.worst:.1f} %" if c.finished else "–"


def safety(c: Candidate) -> str:
    """Return whether a candidate is safe, or why it is not, is not worth it or was not tried further."""
    if not c.finished:
        return BEATEN
    if c.unsafe:
        return f"no: {', '.join(c.unsafe)}"
    return f"yes, but {c.useless}" if c.useless else "yes"


def margin(chosen: Candidate, result: Recommendation) -> str:
    """How many times the gain is safe, and the gains of the table that tell so."""
    last = f"{result.margin:.3g} (safe at gain {result.margin * chosen.setting.gain:.3g}"
    return (
        f"{last}, not at {result.unsafe_gain:.3g})"
        if math.isfinite(result.unsafe_gain)
        else f"{last}, the highest tried)"
    )


def same(chosen: Candidate) -> tuple[str, str, float, float]:
    """What tells the row of the chosen setting: its lead was found later."""
    x = chosen.setting
    return x.label, x.kind, x.gain, x.deadband


def reduction(result: Recommendation) -> str:
    """What to expect of the setting as it is recommended."""
    assert result.chosen
    best = percent(1.0 - result.chosen.errors[0], 1.0 - result.chosen.errors[0])
    if result.confirmed_on < 2:
        return f"{best} on the best estimate; no interval"
    usual = percent(result.usual_reduction, result.usual_reduction)
    return (
        f"{best} on the best estimate, at least {usual} on half of the sampled axes; "
        f"{100.0 * result.confidence:.0f} % interval {percent(*result.reduction)}, "
        f"safe on all {result.confirmed_on} sampled axes (Monte Carlo)"
        + (", along the motion as measured" if measured(result.drive.path) else "")
        + (", but for the linear controller's own oscillation" if result.rings else "")
    )


def parameters(model: Model, unit: Callable[[str], str]) -> str:
    """A law's parameters to four digits, with their units; --json has all digits."""
    parts: list[str] = []
    for f in model.law.fields:
        value = getattr(model.parameters, f.name)
        numbers = ", ".join(f"{v:.4g}" for v in value) if f.per_element else f"{value:.4g}"
        own = "" if f.par.unit == "-" else f" {unit(f.par.unit)}"
        parts.append(f"{f.name} {f'[{numbers}]' if f.per_element else numbers}{own}")
    return "; ".join(parts)


def percent(low: float, high: float) -> str:
    """A range of parts of 1, as one number where both ends read alike; never 100 % for what is less."""

    def shown(part: float) -> str:
        return f"{math.floor(1000.0 * part) / 10.0:.1f}" if 0.995 <= part < 1.0 else f"{100.0 * part:.0f}"

    a, b = shown(low), shown(high)
    return f"{a} %" if a == b else f"{a} to {b} %"
