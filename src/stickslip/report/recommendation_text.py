"""A recommendation in lines of text: what was tried, what to switch on, what to expect."""

from __future__ import annotations

import math
from collections.abc import Callable

from stickslip.control.learned import told
from stickslip.control.registry import control_law
from stickslip.model import Model
from stickslip.recommend.notes import HARDLY, WORTH
from stickslip.recommend.recommend import Candidate, Recommendation


def recommendation_lines(result: Recommendation, unit: Callable[[str], str]) -> list[str]:
    """The setting, what to expect, and what was tried; `unit` turns an angular unit into the axis's own."""
    deadband = f"deadband, {unit('rad/s')}"
    wide = len(deadband)
    out = [f"{'law':<16}{'structure':<13}{'gain':>5}  {deadband}  {'error left':>10}  {'worst':>7}  safe"]
    for c in result.candidates:
        x = c.setting
        mark = "<- " if result.chosen and (x.law, x.kind, x.gain, x.deadband) == same(result.chosen) else ""
        out.append(f"{x.law:<16}{x.kind:<13}{x.gain:>5.3g}  {x.deadband:>{wide}.3g}  {100 * c.errors[0]:>8.1f} %  "
              f"{100 * c.worst:>5.1f} %  {mark}{safety(c)}")  # fmt: skip
    out.append("")
    path = result.drive.path
    out.append(
        f"motion:            {path.source}; {path.duration:.3g} s, up to {path.top_speed:.3g} {unit('rad/s')}"
    )
    units = {f.name: f.par.unit for kind in ("gains", "cascade") for f in control_law(kind).fields}
    gains = ", ".join(
        f"{k} {v:.5g} {unit(units[k]) if units.get(k, '-') != '-' else ''}".rstrip()
        for k, v in result.gains.items()
        if v
    )
    out.append(f"linear controller: {gains}; RMS error alone {result.linear_error:.3g} {unit('rad')}")
    if result.rings:
        out.append(f"linear alone:      without a compensator it oscillates {result.rings}")
        if result.chosen:
            out.append(
                f"{'':19}below, safe means that the compensator adds no oscillation to this one; it does not end it"
            )
    c = result.chosen
    if c and result.model:
        out.append(
            f"switch on:         {c.setting.kind} of law {result.model.law.name!r}, gain {c.setting.gain:g}"
        )
        out.append(f"parameters:        {parameters(result.model, unit)}")
        out.append(f"lead:              {c.setting.lead:.4g} s")
        out.append(f"deadband:          {c.setting.deadband:.4g} {unit('rad/s')}")
        inertia = c.setting.inertia_feedforward
        said = f"{inertia:.4g} {unit('kg·m²')} times the acceleration" if inertia else "not fed forward"
        out.append(f"inertia:           {said}")
        out.append(f"error reduction:   {reduction(result)}")
        out.append(f"gain margin:       {margin(c, result)}")
    out += beside_lines(result)
    for note in result.notes:
        out.append(note)
    return out


def beside_lines(result: Recommendation) -> list[str]:
    """Compensators of the catalogue: what each leaves of the error, or why it is not switched on; what is learned."""
    if not result.beside:
        return []
    out = ["", f"{'compensator':<22}{'error left':>10}  {'worst':>7}  switched on"]
    for b in result.beside:
        numbers = (
            f"{100 * b.errors[0]:>8.1f} %  {100 * b.worst:>5.1f} %" if b.errors else f"{'–':>10}  {'–':>7}"
        )
        mark = "<- yes" if b is result.instead else f"no: {b.why_not or 'another one leaves less'}"
        out.append(f"{b.label:<22}{numbers}  {mark}")
    taken = result.instead
    if taken is None:
        return [*out, "none of these is better than what is said above"]
    said = (
        f"it leaves at most {100 * taken.at_most:.1f} % of the linear controller's error on all sampled axes"
    )
    why = f"; the setting above {result.hunts}" if result.hunts else ""
    learned = [f"learned there:     {line}" for line in told({"learned": taken.learned})]
    return [*out, f"switch on instead: {taken.label}; {said}{why}", *learned]


def safety(c: Candidate) -> str:
    """Whether it is safe; why it is not, or not worth it."""
    if c.unsafe:
        return f"no: {', '.join(c.unsafe)}"
    useless = c.useless or (HARDLY if c.worst > WORTH else "")
    return f"yes, but {useless}" if useless else "yes"


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
    return x.law, x.kind, x.gain, x.deadband


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
