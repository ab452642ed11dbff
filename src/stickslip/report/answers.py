"""What an identification answers, in words: what the friction is, whether it can be trusted, and what to do now.

The head of the report and what `stickslip identify` prints are made of these sentences.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from stickslip.core.messages import code_of, name_option, render, rendered
from stickslip.core.record import Record
from stickslip.identification.doctor.change import DRIFTS_BY
from stickslip.identification.estimate import Estimate, Identification, missing_fall
from stickslip.identification.monte_carlo import resisting_torque
from stickslip.identification.motion import speeds_of
from stickslip.identification.notes import CONTRADICTED, TIMING_CONTRADICTED, drift_of, on_timing
from stickslip.identification.output_error.loop_check import OTHER_LOOP
from stickslip.identification.output_error.problem import mechanics_parameters
from stickslip.identification.regression.inverse import InverseDynamics
from stickslip.identification.sliding import SlidingPosterior
from stickslip.machines.servo import ServoAxis
from stickslip.report.next_steps import Step, next_steps
from stickslip.report.plots import quantity
from stickslip.report.sliding_torque import WORSE, Sliding, beaten, beside_held_inertia, sliding_of
from stickslip.simulation.recorded_input.simulation import Mechanics

ELSEWHERE = 1.5
"""Times the force error of the fitted records, from which on that of held-out ones is one of another machine."""
ROUGH = 0.1
"""Of the torque in gross sliding: what a model misses at most for its form to be taken as right."""
UNEVEN = 0.03
"""Of friction's level: a constant torque from which on it may be worth two levels."""
AMPLITUDE = 0.02
"""Part of friction's level that a torque over the position must be for it to be told. What the form of a law leaves
repeats with the motion, and so over the position: of 43 orders that no machine had, found beside whole turns in 144
logs with cogging (`benchmarks/ordinary_logs.py`), 39 were smaller, and none of 256 that were there."""
OWN_WORDS = {
    "fc": "Coulomb torque", "fs": "static (break-away) torque", "fs_positive": "break-away torque, v > 0",
    "stiffness": "stiffness at rest", "fs_negative": "break-away torque, v < 0",
    "rate_effect": "change per tenfold ramp rate",
}  # fmt: skip
"""Of numbers that no law and no axis describes."""


@dataclass(frozen=True)
class Answers:
    """The three answers, a sentence each line.

    Attributes
    ----------
    friction : tuple of str
        What the friction is, at the recorded speeds.
    trust : str
        Whether the numbers can be trusted, in a line.
    evidence : tuple of str
        Why.
    steps : tuple of Step
        What to do now, the first first.
    told : tuple of str
        Notes of the result that these say already.
    doubts : tuple of str
        What speaks against the numbers, as `trust` names it; empty where nothing does.
    """

    friction: tuple[str, ...]
    trust: str
    evidence: tuple[str, ...]
    steps: tuple[Step, ...]
    told: tuple[str, ...]
    doubts: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "trust", render(self.trust))
        for name in ("friction", "evidence", "told", "doubts"):
            object.__setattr__(self, name, rendered(getattr(self, name)))

    def as_dict(self) -> dict[str, Any]:
        """Trust, doubts and evidence as plain data for JSON and TOML."""
        return {"trust": self.trust, "doubts": list(self.doubts), "evidence": list(self.evidence)}


def answers_of(
    found: Identification, records: Sequence[Record], model_file: str | Path = "model.toml", files: Sequence[str] = ()
) -> Answers:  # fmt: skip
    """The answers of a result.

    Parameters
    ----------
    found : Identification
    records : sequence of Record
        What it was fitted to.
    model_file : path
        Where the model lies, for commands.
    files : sequence of str
        The records' files, for commands.
    """
    sliding = sliding_of(found)
    timing = [s for s in timing_of(found) if s in found.notes]
    missing = tuple(s for s in found.notes if code_of(s) == "not-identified")
    reasons = tuple(doubts(found, sliding))
    return Answers(
        tuple(friction_in(found, records)), trusted(found, reasons), (*evidence(found, sliding), *timing),
        tuple(next_steps(found, records, model_file, files)), (*timing, *missing), reasons,
    )  # fmt: skip


# ---- what is my friction ------------------------------------------------------------------------------------------


def linear(found: Identification) -> bool:
    """Whether the axis moves along a line."""
    return getattr(found.details.get("axis"), "motion", "rotary") == "linear"


def unit_in(found: Identification, unit: str) -> str:
    """A unit of a rotary axis as that of the identified one."""
    axis = found.details.get("axis")
    return axis.unit(unit) if isinstance(axis, ServoAxis) else unit


def meaning_of(found: Identification) -> dict[str, str]:
    """What every number, fitted or given, is in words, by its name; empty for one that nothing describes."""
    described = {p.name: p.par.meaning for p in mechanics_parameters(ServoAxis(), "torque", {}, 0, 0)}
    law = {f.name: f.par.meaning for f in found.model.law.fields} if found.model else {}
    words = OWN_WORDS | described | law
    out: dict[str, str] = {}
    for e in (*found.estimates, *found.held):
        said = words.get(e.name.partition("[")[0].rpartition(".")[2], "")
        if linear(found):
            said = said.replace("torque", "force").replace("inertia", "mass")
        out[e.name] = said
    return out


def speeds_in(records: Iterable[Record]) -> dict[str, list[float]]:
    """Tenths of the recorded speeds in either direction; empty where no position is recorded."""
    moving = [r for r in records if "position" in r.channels and r.time.size > 1]
    return speeds_of(moving) if moving else {}


def friction_in(found: Identification, records: Sequence[Record]) -> list[str]:
    """Friction at three recorded speeds; nothing where the law has no torque at constant velocity."""
    model, speeds = found.model, speeds_in(records)
    if model is None or model.law.steady is None or not speeds:
        return []
    torque, speed = unit_in(found, "N·m"), unit_in(found, "rad/s")
    sides = {
        name: sign * resisting_torque(model, sign * np.array([tenths[1], tenths[5], tenths[-1]]))
        for (name, tenths), sign in zip(speeds.items(), (1.0 if n == "positive" else -1.0 for n in speeds), strict=True)
    }  # fmt: skip
    same = len(sides) == 2 and np.allclose(*(at_same(found, speeds, s) for s in (1.0, -1.0)), rtol=1e-3)
    out: list[str] = []
    for name, values in list(sides.items())[: 1 if same else 2]:
        at = [speeds[name][i] for i in (1, 5, 10)]
        listed = ", ".join(
            f"{quantity(float(y), torque)} at {x:.3g} {speed}" for x, y in zip(at, values, strict=True)
        )
        where = "" if same else f" in the {name} direction"
        out.append(f"At constant velocity it takes {listed}{where}.")
    low, high = min(s[0] for s in speeds.values()), max(s[-1] for s in speeds.values())
    out.append(
        f"Recorded speeds: {low:.3g} to {high:.3g} {speed}; what the curve says beyond them is extrapolated."
    )
    return out


def at_same(found: Identification, speeds: Mapping[str, Sequence[float]], side: float) -> Any:
    """Friction in one direction at the speeds of the other."""
    assert found.model is not None
    return side * resisting_torque(found.model, side * np.array(speeds["positive"]))


def one_number_each(estimates: Iterable[Estimate]) -> list[str]:
    """Why numbers are not identified, those with the same reason in one line."""
    reasons: dict[str, list[str]] = {}
    for e in estimates:
        if not e.identified:
            reasons.setdefault(e.verdict, []).append(e.name)
    return [
        f"{', '.join(names)} not identified: {why or 'not determined by the data'}"
        for why, names in reasons.items()
    ]


# ---- can I trust it -------------------------------------------------------------------------------------------------


def timing_of(found: Identification) -> list[str]:
    """When the torque acted, in a sentence."""
    sliding = found.details.get("sliding")
    return on_timing(sliding) if isinstance(sliding, SlidingPosterior) else []


def trusted(found: Identification, reasons: Sequence[str]) -> str:
    """Whether the numbers can be trusted, in a line; `reasons` speak against them."""
    good = [e.name for e in found.estimates if e.identified]
    bad = [e.name for e in found.estimates if not e.identified]
    if not found.estimates:
        return "Nothing was identified."
    if not good:
        return "No: none of the numbers is identified."
    rest = f"; not {', '.join(bad)}" if bad else ""
    if reasons:
        return f"With care: {'; '.join(reasons)}{rest}."
    if bad:
        return f"Yes, as far as identified: {', '.join(good)}{rest}."
    given = f"; given: {', '.join(h.name for h in found.held)}" if found.held else ""
    return f"Yes: every number is identified{given}."


def doubts(found: Identification, sliding: Sliding | None) -> list[str]:
    """What speaks against the numbers, in a few words each."""
    out, effort = list[str](), "force" if linear(found) else "torque"
    if sliding is not None and sliding.relative > ROUGH:
        out.append(
            f"the model misses {percent(sliding.relative)} of the {effort} even where the axis slides"
            f"{mostly_waves(found, sliding)}"
        )
    if sliding is not None and beaten(sliding):
        better = (
            f"plain least squares ({name_option('inverse', True)}) explains the {effort} better where the "
            "axis slides"
        )
        out.append(f"{better}{beside_held_inertia(found, unit_in(found, 'kg·m²'))}")
    fall = missing_fall(found.misfit)
    if fall > 0.0 and found.model is not None:
        out.append(
            f"friction falls by {quantity(fall, unit_in(found, 'N·m'))} with velocity, which law "
            f"{found.model.law.name!r} does not have: take 'stribeck' or 'lugre'"
        )
    plain = found.misfit.get("inverse_dynamics_relative", math.nan)
    if sliding is None and found.misfit.get("force_relative", 0.0) > WORSE * plain:
        out.append(f"the model's {effort} is farther from the measured one than plain least squares'")
    held, own = (found.misfit.get(f"{p}force_relative", math.nan) for p in ("held_out_", ""))
    if held > ELSEWHERE * own:
        out.append(f"on records held out its force error is {percent(held)}, {percent(own)} on those fitted")
    known = {code_of(note) for note in found.notes}
    if OTHER_LOOP in known:
        out.append("the record shows another controller than the loop given")
    if TIMING_CONTRADICTED in known:
        out.append(f"the {CONTRADICTED}")
    warned = [f for f in found.findings if getattr(f, "level", "") == "warning"]
    posterior = found.details.get("sliding")
    if isinstance(posterior, SlidingPosterior) and not any(f.code == "change" for f in warned):
        drift = drift_of(posterior)
        if drift is not None and abs(drift.share) >= DRIFTS_BY:
            out.append(
                f"friction {drift} over the record: warm the axis up first, or cut with {name_option('start')} "
                f"and {name_option('end')}"
            )
    # Whose numbers they are is for the reader to say: each is named here.
    out += dict.fromkeys(f.message for f in warned if f.code == "saved-numbers")
    if warned := [f for f in warned if f.code != "saved-numbers"]:
        out.append(f"the doctor warns of the record{'s' if len(warned) > 1 else ''} ({codes(warned)})")
    return out


def mostly_waves(found: Identification, sliding: Sliding) -> str:
    """Return that the torque over the position is most of what the model misses; empty if it is not."""
    posterior = found.details.get("sliding")
    waves = [size for _, size in posterior.waves] if isinstance(posterior, SlidingPosterior) else []
    if not waves or sum(x * x for x in waves) < sliding.rms**2:
        return ""
    size = quantity(max(waves), unit_in(found, "N·m"))
    return f", mostly a torque over the position (cogging, {size}), which no friction law contains"


def codes(findings: Iterable[Any]) -> str:
    """The names of findings, each once."""
    return ", ".join(dict.fromkeys(f.code for f in findings))


def percent(share: float) -> str:
    """A share to three digits."""
    return f"{100.0 * share:.3g} %"


def evidence(found: Identification, sliding: Sliding | None) -> list[str]:
    """How far the model's torque is from the measured one, in sentences."""
    out, effort = list[str](), "force" if linear(found) else "torque"
    unit, posterior = unit_in(found, "N·m"), found.details.get("sliding")
    if sliding is not None:
        speeds = (
            within_speeds(posterior, unit_in(found, "rad/s"))
            if isinstance(posterior, SlidingPosterior)
            else ""
        )
        out.append(
            f"In gross sliding ({100.0 * sliding.share:.0f} % of the record{speeds}) the model's {effort} is "
            f"{percent(sliding.relative)} off the measured one, {quantity(sliding.rms, unit)} root mean "
            f"square{plain_there(found, sliding)}."
        )
    reason = (
        "less at standstills and reversals alone"
        if sliding is not None and not beaten(sliding)
        else why_plain_leaves_less(found)
    )
    out += force_errors(found.misfit, reason)
    out += either_way(found)
    if (off := found.misfit.get("drive_relative")) is not None:
        out.append(
            f"The loop, simulated with the model, makes a drive signal {percent(off)} off the recorded one."
        )
    if isinstance(posterior, SlidingPosterior):
        out += around(posterior, found)
    if (rms := found.misfit.get("rms_N" if linear(found) else "rms_Nm")) is not None:
        what = "force" if linear(found) else "torque"
        out.append(
            f"Residual {what} of the curve: {quantity(float(rms), unit_in(found, 'N·m'))} root mean square."
        )
    return out


def around(posterior: SlidingPosterior, found: Identification) -> list[str]:
    """The torque over the position that was found, in a sentence; nothing where there is none."""
    turn, per = (1.0 / (2.0 * math.pi), "a metre") if linear(found) else (1.0, "a revolution")
    listed = [
        f"{quantity(size, unit_in(found, 'N·m'))} at {turn * number:.3g} {per}"
        for number, size in posterior.waves if size > AMPLITUDE * posterior.friction
    ]  # fmt: skip
    if not listed:
        return []
    return [
        f"Torque over the position (cogging, unbalance), allowed for but not part of the law: {', '.join(listed)}."
    ]


def either_way(found: Identification) -> list[str]:
    """That a constant torque may be friction that differs by direction, in a sentence; nothing where none shows."""
    by_name = {e.name: e for e in found.estimates}
    if "fc_negative" in by_name or not {"offset", "fc"} <= by_name.keys():
        return []
    offset, level = by_name["offset"], by_name["fc"].value
    shown = offset.identified and level > abs(offset.value) > UNEVEN * level
    if not shown or offset.lower <= 0.0 <= offset.upper:
        return []
    return [
        f"The constant torque may as well be friction that is {percent(2.0 * abs(offset.value) / level)} of its level "
        f"greater in one direction; {name_option('per_direction', True)} gives each its own."
    ]


def within_speeds(posterior: SlidingPosterior, unit: str) -> str:
    """Return the range of speeds in gross sliding: the record contains no others."""
    return f", {posterior.slowest:.3g} to {posterior.fastest:.3g} {unit}"


def plain_there(found: Identification, sliding: Sliding) -> str:
    """Return what plain least squares leaves in the same rows, and the reason if it is less, to end a sentence."""
    if not math.isfinite(sliding.plain):
        return ""
    own, plain = sliding.relative, sliding.plain * sliding.relative / max(sliding.rms, 1e-300)
    if percent(plain) == percent(own) or plain > own:
        return f"; plain least squares: {percent(plain)}"
    reason = why_plain_leaves_less(found) if beaten(sliding) else "not significantly less"
    return f"; plain least squares: {percent(plain)}, {reason}"


def why_plain_leaves_less(found: Identification) -> str:
    """Return why the error of plain least squares is lower: it minimizes this error alone, mostly by one number."""
    reason, inverse = "which minimizes this error alone", found.details.get("inverse")
    mechanics = found.details.get("mechanics")
    if (
        not isinstance(inverse, InverseDynamics)
        or not isinstance(mechanics, Mechanics)
        or found.model is None
    ):
        return reason
    own = {**found.model.parameters._asdict(), "inertia": mechanics.inertia, "offset": mechanics.offset}
    speed = float(np.sqrt(np.mean(inverse.velocity**2)))
    pulls = inverse.matrix[:, inverse.names.index("inertia")]
    sizes = {"inertia": float(np.sqrt(np.mean(pulls**2))), "sigma2": speed, "fc": 1.0, "offset": 1.0}
    plain = inverse.numbers()
    shared = [n for n in sizes if isinstance(own.get(n), float)]
    if not shared:
        return reason
    name = max(shared, key=lambda n: abs(plain[n] - own[n]) * sizes[n])
    unit = unit_in(found, {"inertia": "kg·m²", "sigma2": "N·m·s/rad"}.get(name, "N·m"))
    instead, given = (f"{values[name]:.3g}" for values in (plain, own))
    impossible = " (impossible)" if plain[name] < 0.0 and name != "offset" else ""
    return (
        reason
        if instead == given
        else f"{reason}, by {name} = {instead} {unit}{impossible} in place of {given}"
    )


def force_errors(misfit: Mapping[str, float], reason: str = "which minimizes this error alone") -> list[str]:
    """Force error of training and held-out records next to plain least squares', in sentences.

    `reason`: why the error of plain least squares is lower where it is significantly lower.
    """
    out: list[str] = []
    for prefix, where in (
        ("", "Over the whole record, standstills and reversals included (where velocity does not give the torque)"),
        ("held_out_", "On the records held out, likewise"),
    ):  # fmt: skip
        own = float(misfit.get(f"{prefix}force_relative", math.nan))
        plain = float(misfit.get(f"{prefix}inverse_dynamics_relative", math.nan))
        if math.isfinite(own):
            beside = f"; plain least squares: {percent(plain)}" if math.isfinite(plain) else ""
            more = ""
            if own > WORSE * plain:
                more = f", {reason}" if not prefix else ", for the same reason"
            elif plain < own and percent(plain) != percent(own):
                more = ", not significantly less"
            out.append(f"{where}: {percent(own)} force error{beside}{more}.")
        elif math.isfinite(plain):
            out.append(f"{where}: {percent(plain)} force error (plain least squares).")
    return out
