"""A recommendation in lines of text: what was tried, what to switch on, what to expect."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator

from stickslip.analyse.controller_margins import ControllerStability
from stickslip.analyse.wording import quantity
from stickslip.control.learned import told
from stickslip.control.linear import Cascade
from stickslip.control.registry import control_law
from stickslip.identification.identified_file import Identified
from stickslip.models.model import Model
from stickslip.recommendation.beside import Beside
from stickslip.recommendation.candidates import Candidate
from stickslip.recommendation.course import measured
from stickslip.recommendation.notes import ALLOWANCE, not_simulated
from stickslip.recommendation.recommendation import Recommendation
from stickslip.report.plots import one_prefix

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
    out.append(f"motion:            {motion_words(result, unit)}")
    out.append(
        f"linear controller: {gain_words(result, unit)}; RMS error alone {result.linear_error:.3g} {unit('rad')}"
    )
    if result.rings:
        out.append(f"linear alone:      without a compensator it oscillates {result.rings}")
        if result.chosen or result.instead:
            out.append(
                f"{'':19}below, safe means that the compensator adds no oscillation to this one; it does not end it"
            )
    return [*out, *beside_lines(result), *chosen_lines(result, unit), *result.notes]


def summary_lines(
    result: Recommendation, found: Identified, stability: ControllerStability | None = None
) -> list[str]:
    """Return the recommendation in about eight lines: setting, error, what it holds for, margins, warnings.

    Parameters
    ----------
    result : Recommendation
    found : Identified
        The model that it was made for.
    stability : ControllerStability, optional
        Of the loop with what is recommended, about rest.
    """
    unit, comparisons = found.unit, result.comparisons
    angle = unit("rad")
    if result.why_none:
        out = [f"switch on:         no friction compensator: {result.why_none}"]
        out.append(
            f"error:             {quantity(result.linear_error, angle)} RMS with the linear controller alone"
        )
    else:
        out = [f"switch on:         {switched_on_words(result, unit)}"]
        said = [f"{error_from_to(*c.errors, angle)} RMS ({c.axis})" for c in comparisons]
        out.append(f"error:             {'; '.join(said)}")
        out.append(f"error reduction:   {reduction_words(result)}")
    out.append(f"loop:              {loop_words(result, unit)}")
    out.append(f"motion:            {motion_words(result, unit)}")
    if margins := list(margin_words(result, stability)):
        out.append(f"margins:           {'; '.join(margins)}")
    if result.hunting and not result.rings:
        out.append(f"at rest:           {result.hunting}")
    if result.rings:
        out.append(f"linear alone:      without a compensator it oscillates {result.rings}")
    missing = ", ".join(not_simulated(result.drive.machine, found.train))
    out.append(
        f"not simulated:     {missing}{'; the interval allows for them' if result.confirmed_on > 1 else ''}"
    )
    return [*out, *(f"warning:           {text}" for text in result.warnings)]


def switched_on_words(result: Recommendation, unit: Callable[[str], str]) -> str:
    """Return what is switched on, with the inertia and the constant torque that are fed forward too."""
    if result.instead is not None:
        return result.instead.label
    assert result.chosen is not None
    setting = result.chosen.setting
    more = [f"lead {setting.lead:.3g} s"] if setting.lead else []
    more += [f"dead band {setting.deadband:.3g} {unit('rad/s')}"] if setting.deadband else []
    fed = ["inertia"] if setting.inertia_feedforward and setting.compensates else []
    fed += ["constant torque"] if setting.offset else []
    more += [f"{' and '.join(fed)} fed forward"] if fed else []
    return ", ".join([setting.words, *more])


def verdict(result: Recommendation, unit: Callable[[str], str]) -> str:
    """Return the recommendation in one sentence."""
    if result.why_none:
        return f"Switch on no friction compensator: {result.why_none}."
    first = result.comparisons[0]
    promise = f", and by {percent(*result.reduction)} on the axis " if result.confirmed_on > 1 else " "
    sure = f"({100.0 * result.confidence:.0f} % interval)" if result.confirmed_on > 1 else "(no interval)"
    return (
        f"Switch on {switched_on_words(result, unit)}: the RMS position error falls from "
        f"{error_from_to(*first.errors, unit('rad'))} on the best estimate{promise}{sure}."
    )


def error_from_to(before: float, after: float, angle: str) -> str:
    """Return two errors, rad (m), in one prefix: "48.8 to 0.34 mrad"."""
    factor, prefix = one_prefix(before, after)
    return f"{factor * before:.3g} to {factor * after:.3g} {prefix}{angle}"


def reduction_words(result: Recommendation) -> str:
    """Return the promised part of the error that is taken away."""
    if result.confirmed_on < 2:
        return "no interval (the law has none, or fewer than two axes were sampled)"
    return (
        f"{percent(*result.reduction)} ({100.0 * result.confidence:.0f} % interval), safe on all "
        f"{result.confirmed_on} sampled axes"
    )


def margin_words(result: Recommendation, stability: ControllerStability | None) -> Iterator[str]:
    """Yield the margin of the compensator's gain, and those of the loop while the axis slides."""
    chosen = result.switched_on
    if chosen is not None and chosen.setting.compensates:
        yield f"compensator gain {margin(chosen, result)}"
    if stability is None or not stability.is_linear:
        return
    sliding = stability.loops[1]
    yield (
        f"loop {sliding.margins()}" if sliding.poles.stable else "the loop is unstable while the axis slides"
    )


def loop_words(result: Recommendation, unit: Callable[[str], str]) -> str:
    """Return the loop, its gains and its sample time in words."""
    drive = result.drive
    if drive.controller is not None:
        kind = "own control laws"
    elif isinstance(drive.gains, Cascade):
        kind = "position P, velocity PI"
    elif drive.gains is not None:
        kind = "own gains"
    else:
        kind = f"{drive.linear} at {drive.bandwidth:g} Hz"
    own = [f"velocity filter {drive.velocity_filter:g} Hz"] if drive.velocity_filter else []
    return "; ".join(
        [f"{kind} ({gain_words(result, unit)})", *own, f"sampled every {1e3 * drive.sample_time:g} ms"]
    )


def gain_words(result: Recommendation, unit: Callable[[str], str]) -> str:
    """Return the gains of the linear controller with their units."""
    units = {f.name: f.par.unit for kind in ("gains", "cascade") for f in control_law(kind).fields}
    return ", ".join(
        f"{k} {v:.5g} {unit(units[k]) if units.get(k, '-') != '-' else ''}".rstrip()
        for k, v in result.gains.items()
        if v
    )


def motion_words(result: Recommendation, unit: Callable[[str], str]) -> str:
    """Return the motion's source, duration and highest speed, and how it starts and ends."""
    path, course = result.drive.path, result.drive.course
    speed = f", up to {path.top_speed:.3g} {unit('rad/s')}" if path.top_speed else ""
    said = [f"{path.source}; {path.duration:.3g} s{speed}"]
    if measured(path):
        said.append("what the axis did, which need not be the drive's reference")
    if course.jumps:
        steps = f"{len(course.jumps)} steps of up to" if len(course.jumps) > 1 else "a step of"
        said.append(f"{steps} {course.highest_jump:.3g} {unit('rad')}")
    return "; ".join([*said, *([course.said] if course.said else [])])


def setting_rows(result: Recommendation, unit: Callable[[str], str]) -> Iterator[tuple[str, str, str]]:
    """Yield name, value and unit of every number to set."""
    chosen = result.switched_on
    if result.instead is not None:
        assert result.instead.controller is not None
        yield "controller", result.instead.label, ""
        for name, value in result.instead.controller.numbers().items():
            yield name, f"{value:.6g}", ""
        return
    if chosen is None or result.model is None:
        return
    setting, model = chosen.setting, result.model
    if setting.compensates:
        yield "compensator", f"{setting.kind} of law {setting.law!r}", ""
        yield "gain", f"{setting.gain:g}", ""
        for f in model.law.fields:
            value = getattr(model.parameters, f.name)
            numbers = ", ".join(f"{v:.5g}" for v in value) if f.per_element else f"{value:.5g}"
            yield f.name, numbers, "" if f.par.unit == "-" else unit(f.par.unit)
        yield "lead", f"{setting.lead:.4g}", "s"
        yield "dead band", f"{setting.deadband:.4g}", unit("rad/s")
    yield "inertia times the reference's acceleration", f"{setting.inertia_feedforward:.5g}", unit("kg·m²")
    yield "constant torque", f"{setting.offset:.5g}", unit("N·m")


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
    said = [f"{error_from_to(*x.errors, unit('rad'))} ({x.axis})" for x in result.comparisons]
    out.append(f"RMS error:         {'; '.join(said)}")
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
    rows = list(beside_rows(result))
    head = ["", f"{'compensator':<22}{'error left':>10}  {'worst':>7}  switched on"]
    return (
        [*head, *(f"{name:<22}{left:>10}  {worst:>7}  {why}" for name, left, worst, why in rows), ""]
        if rows
        else []
    )


def beside_rows(result: Recommendation) -> Iterator[tuple[str, str, str, str]]:
    """Yield every compensator of the catalogue: name, error left, worst axis, and whether it is switched on or why
    not."""
    for b in result.beside:
        left, worst = (f"{100 * b.errors[0]:.1f} %", f"{100 * b.worst:.1f} %") if b.errors else ("–", "–")
        hardly = result.instead is None and result.chosen is not None and b.at_most <= result.chosen.worst
        why = b.why_not or ("it leaves hardly less" if hardly else "another one leaves less")
        yield b.label, left, worst, "<- yes" if b is result.instead else f"no: {why}"


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
