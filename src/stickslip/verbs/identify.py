"""From logs to inertia, friction law, intervals and verdicts: the verb `identify`."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from itertools import combinations
from pathlib import Path
from typing import Any, Literal, Unpack, cast

import numpy as np

from stickslip.control.own_loop import ReferenceVelocity, loop_text
from stickslip.core.arguments import arguments_checked
from stickslip.core.config import read_toml
from stickslip.core.errors import InputError
from stickslip.core.finding import Finding, sorted_findings
from stickslip.core.messages import name_loop, name_option, name_parameter, render, units_of_axis
from stickslip.core.record import Record, encoder_step, row_period
from stickslip.core.reprs import same
from stickslip.core.spec import Law
from stickslip.identification.doctor import Diagnosis, of_arrays
from stickslip.identification.doctor.steady_table import is_steady_table
from stickslip.identification.estimate import Identification, silent
from stickslip.identification.evidence import without_inverted_rest
from stickslip.identification.experiment import DRIVES
from stickslip.identification.held import held_in
from stickslip.identification.memo import SlidingMemo
from stickslip.identification.methods import method_named, methods_by_option
from stickslip.identification.methods.method import Method, Options, given_in
from stickslip.models import plugins
from stickslip.models.model import Model
from stickslip.readers.convert import pendulum_before_gear
from stickslip.readers.cut import file_rows
from stickslip.readers.derive import positioned
from stickslip.report.identified import Source
from stickslip.verbs.examiner import Examiner
from stickslip.verbs.export_notes import constant_torque
from stickslip.verbs.identification import IdentificationResult
from stickslip.verbs.reading import ARRAYS, Log, Reading, beside_of, named, open_log

Loops = (
    str
    | Mapping[str, float | ReferenceVelocity]
    | Sequence[str | Mapping[str, float | ReferenceVelocity]]
    | None
)


@arguments_checked
def identify(
    *logs: Log,
    method: str = "axis",
    law: str | Law | Sequence[str | Law] | None = None,
    hold_out: Log | Sequence[Log] = (),
    inertia: float | None = None,
    values: Mapping[str, float] | None = None,
    frozen: Iterable[str] = (),
    free: Iterable[str] = (),
    model: Model | str | os.PathLike[str] | None = None,
    noise: float | None = None,
    torque_channel: str = "",
    elements: int = 0,
    shares: Literal["free", "equal"] = "free",
    threshold: float | None = None,
    loop: Loops = None,
    loop_output: Literal["torque", "current", "voltage"] | None = None,
    inverse: bool = False,
    per_direction: bool = False,
    pendulum: bool = False,
    drive_gain: float | None = None,
    resistance: float | None = None,
    extra_torque: str = "",
    torque_is: Literal["commanded", "actual", "mean"] | None = None,
    delay: float | None = None,
    harmonics: int = 0,
    position_map: bool = False,
    load: bool = False,
    intervals: Literal["prediction", "covariance"] = "prediction",
    robust: bool = False,
    accept: Sequence[str] = (),
    progress: Callable[[str], None] = silent,
    tell: Callable[[str], None] = silent,
    **reading: Unpack[Reading],
) -> IdentificationResult:
    """Identify an axis or its friction: numbers with intervals, a verdict on each, a model and a report.

    Parameters
    ----------
    *logs : path, data frame, mapping of arrays, or Record
        Fitted together; none where arrays are given by name (`t`, `position`, `torque`, ...).
    method : str
        One of `stickslip.identification.methods.METHODS`: "axis" (inertia, offset or gravity and friction jointly, from
        any motion), "sliding" (constant velocities, a table of velocity and torque without times, or an axis that
        coasts with its `inertia` given), "breakaway" (torque ramps), "presliding" and "attraction" (GMS),
        "hysteresis" (a measured friction along its motion), "lugre" (sigma0, sigma1), "inertia" (frequency response),
        "cogging" (torque or current over the angle).
    law : str, Law or sequence of these, optional
        A law's name or file, or "all". Of several the error on data left out chooses; None: the method's candidates.
    hold_out : log or sequence of logs
        Not fitted, judge the result (axis).
    inertia : float, optional
        kg·m² (kg), where it is known: it is then not fitted.
    values : mapping of str to float, optional
        Starting values of parameters, and known ones of `frozen`, in SI units.
    frozen, free : iterable of str
        Parameters that keep their value; that are fitted although they usually are not.
    model : Model or path, optional
        What an earlier identification found.
    noise : float, optional
        Standard deviation of what is fitted: N·m, or rad (lugre).
    torque_channel : str
        "motor_torque", "sensor_torque", ...: which one, of several (not axis).
    elements : int
        Of GMS (presliding); 0: chosen.
    shares : {"free", "equal"}
        Of the elements in the sliding curve: fitted, or all the same (presliding).
    threshold : float, optional
        Velocity that is motion, rad/s or m/s (breakaway); 0.01.
    loop : str or mapping, or a sequence of them, optional
        The sampled controller that drove the log, ``{"kp": 8.0, "kd": 0.08, "limit": 3.0}``: kp e + ki (integral of e)
        + kr v_ref - kd v, kr = 0 where its velocity feedback knows no reference (also ki, kr, filter,
        period, count, span; or kv, kvp, kvi, feed of position P around velocity PI, as `recommend` has them): with it
        and a reference in the log the closed loop is simulated. One for all logs, or one each.
    loop_output : {"torque", "current", "voltage"}, optional
        What its output is where no drive signal is recorded.
    inverse : bool
        Linear least squares only, no simulation (axis).
    per_direction : bool
        Friction with parameters of its own for each direction (axis, sliding).
    pendulum : bool
        Gravity is m g l sin(q - q0), otherwise a constant torque (axis).
    drive_gain : float, optional
        Torque per unit of the drive's signal.
    resistance : float, optional
        Of the motor, ohm, where a voltage drives it.
    extra_torque : str
        Channel of a known torque that is added to the recorded one.
    torque_is : {"commanded", "actual", "mean"}, optional
        What the torque's column holds: the command from this row to the next, the value at the row, or the mean over
        the row before.
    delay : float, optional
        s from then until it acts; None: when it acted is found from the record.
    harmonics : int
        Of a torque over the position (axis).
    position_map : bool
        Whether a map over the angle, orders chosen by the records, is found and taken out first (axis).
    load : bool
        Friction that grows with the load of the gearing (axis).
    intervals : {"prediction", "covariance"}
        From the prediction error, or the narrower ones of the simulation's fit (axis).
    robust : bool
        Outliers count linearly in the output error (axis).
    accept : sequence of str
        Codes of errors of the doctor that count as warnings, since you know better.
    progress, tell : callable
        Are told what begins; what is odd about a log. Everything odd is in ``findings`` of the result, too.
    **reading
        Arrays, and how logs are read: see `stickslip.verbs.reading.Reading`.

    Returns
    -------
    IdentificationResult

    Raises
    ------
    InputError
        One line that names the thing, its value and the remedy; an error of the doctor, too.
    """
    kind = method_named(method)
    estimate = SlidingMemo()
    laws, left_out = laws_of(law)
    known_model, model_offset = model_and_offset(model)
    known = dict(values or {}) | ({} if inertia is None else {"inertia": inertia})
    options = Options(
        laws, known, (*frozen, *(["inertia"] if inertia is not None and method == "axis" else [])), tuple(free),
        known_model, noise, torque_channel, elements, threshold, 0, inverse, per_direction, pendulum, drive_gain,
        reading.get("torque_constant"), resistance, loop_output, extra_torque, torque_is, delay, harmonics,
        load, intervals, robust, estimate, progress, position_map, reading.get("force_constant"), shares, model_offset,
    )  # fmt: skip
    given = given_in(options, inertia=inertia is not None, loop=bool(loop), hold_out=bool(_listed(hold_out)))
    kind.refuse_unused(given, methods_by_option())
    coasting = method == "sliding" and inertia is not None
    expected = ["missing-column"] if kind.takes_current else ["no-torque"] if coasting else []
    examiner = Examiner((*accept, *expected), estimate, tell)
    sources = sources_of(logs, _listed(hold_out), loop, reading, examiner, steady=kind.takes_steady_points)
    if pendulum:
        sources = [replace(s, findings=with_pendulum(s)) for s in sources]
    if coasting:
        sources = [replace(s, findings=[f for f in s.findings if f.code != "no-torque"]) for s in sources]
    refuse_same(sources)
    records = [s.record for s in sources]
    options = replace(options, held_out=sum(s.held_out for s in sources))
    if method == "axis" and friction_alone(records, options):
        kind = method_named("hysteresis")
        why = "the friction itself is recorded, and no torque of a drive"
        tell(render(f"{why}: {name_option('method', 'hysteresis')} is taken, a law along the motion"))
        kind.refuse_unused(given, methods_by_option())
    kind.refuse_unknown(options)
    kind.check(records, options)
    examiner.warn(sources)
    progress(f"method {kind.name}, {sum(len(r) for r in records)} samples")
    with units_of_axis(all(is_linear(r) for r in records)):
        found = identified(kind, sources, options)
    found = with_notes(found, kind, records, options, left_out)
    sources = [replace(s, findings=[f.rendered(of_arrays(s.record)) for f in s.findings]) for s in sources]
    found = replace(found, findings=tuple(f for s in sources for f in s.findings))
    return IdentificationResult(found, tuple(sources), law_file(found, () if inverse else laws))


def model_and_offset(model: Model | str | os.PathLike[str] | None) -> tuple[Model | None, float]:
    """Return the model given or read from a file, and the constant torque that the file holds, N·m."""
    if model is None or isinstance(model, Model):
        return model, 0.0
    content = read_toml(Path(model))
    return Model.from_table(content), constant_torque(content)


def refuse_same(sources: Sequence[Source]) -> None:
    """Refuse a record that is given twice: intervals and held-out errors would come out too small.

    Raises
    ------
    InputError
    """
    for one, other in combinations(sources, 2):
        a, b = one.record, other.record
        if same(a.time, b.time) and same(a.channels, b.channels):
            raise InputError(
                f"{one.name} and {other.name} are the same record; give it once, and another one to hold out"
            )


def identified(kind: Method, sources: Sequence[Source], options: Options) -> Identification:
    """What the method finds; where it finds nothing in records with spikes, the error names these.

    Raises
    ------
    InputError
    """
    try:
        return kind.identify([s.record for s in sources], options)
    except InputError as error:
        spiky = [(s.name, f.message) for s in sources for f in s.findings if f.code == "spikes"]
        if not spiky:
            raise
        name, message = spiky[0]
        raise InputError(
            f"{error.message}; in {name} {message}: first try {name_option('leave_out', 'spikes')}"
        ) from error


def with_pendulum(source: Source) -> list[Finding]:
    """What the doctor found, its advice of a pendulum taken; and that a gear stands before it."""
    said = pendulum_before_gear(source.record, "a pendulum is asked for")
    taken = {"gravity", *(f.code for f in said)}
    return sorted_findings([*said, *(f for f in source.findings if f.code not in taken)])


def with_notes(
    found: Identification, kind: Method, records: Sequence[Record], options: Options, more: Sequence[str]
) -> Identification:
    """What was found in the units of the records, with what a reader must know of it."""
    if all(is_linear(r) for r in records) and kind.name not in ("axis", "inertia"):
        # Those two know their axis: their numbers have its units.
        found = found.of_linear_axis()
    found = replace(found, estimates=without_inverted_rest(found.estimates))
    said = (
        *assumptions(found, options, kind.name),
        *load_note(records, found),
        *(weight_notes(found, records) if options.pendulum else ()),
        *more,
    )
    held = held_in(found, options.frozen, options.values)
    return replace(found, notes=(*found.notes, *said), held=held)


def is_linear(record: Record) -> bool:
    """Whether the record is of an axis that moves along a line."""
    return "m" in (record.units.get("position"), record.units.get("velocity", "").removesuffix("/s"))


def laws_of(law: str | Law | Sequence[str | Law] | None) -> tuple[tuple[str | Law, ...], list[str]]:
    """The laws, and what is to be said of those that "all" leaves out."""
    asked: list[str | Law] = [] if law is None else [law] if isinstance(law, (str, Law)) else list(law)
    if "all" not in asked:
        return tuple(asked), []
    names = plugins.law_names()
    tried = [name for name in names if plugins.law(name).steady]
    left_out = ", ".join(name for name in names if name not in tried)
    said = (
        f"Not among all laws, as they say no torque at constant velocity: {left_out}; name one with "
        f"{name_option('law')}."
    )
    return (*tried, *(x for x in asked if x != "all" and x not in tried)), [said] if left_out else []


# ---- logs ---------------------------------------------------------------------------------------------------------


def sources_of(
    logs: Sequence[Log], held_out: Sequence[Log], loop: Loops, reading: Reading, examiner: Examiner, *,
    steady: bool = False,
) -> list[Source]:  # fmt: skip
    """Every log read, looked at by the doctor, with its loop."""
    given: list[Log | None] = [*(logs or [None]), *held_out]
    fitted = len(given) - len(held_out)
    loops, beside = loops_of(loop, len(given)), beside_of(reading, len(given))
    out: list[Source] = []
    for number, (log, text, more) in enumerate(zip(given, loops, beside, strict=True)):
        own = cast("Reading", {k: v for k, v in reading.items() if number < fitted or k not in ARRAYS})
        own["beside"] = more
        name = named(log)

        def doctor(record: Record, log: Log | None = log) -> list[Diagnosis]:
            return examiner.pieces(record, log)

        try:
            opened = open_log(log, own, doctor, steady=steady)
        except InputError as error:
            if number < fitted:
                raise
            raise InputError(f"{name_option('hold_out')}: {error.message}") from None
        every = doctor(opened.record)
        short = Path(name).name if log is not None and name != "the log" else f"log {number + 1}"
        names = [short]
        if len(every) > 1:
            ends = [file_rows(d.record)[[0, -1]] for d in every]
            names = [f"{short} rows {first}:{last}" for first, last in ends]
        out += [
            Source(
                n,
                with_loop(d.record if is_steady_table(d.record) else positioned(d.record), text),
                d.findings,
                about(d.record),
                number >= fitted,
            )
            for n, d in zip(names, every, strict=True)
        ]
    return out


def _listed(logs: Log | Sequence[Log]) -> list[Log]:
    """One log or several."""
    several: Any = logs
    return list(several) if isinstance(logs, (list, tuple)) else [logs]


def loops_of(loop: Loops, count: int) -> list[str]:
    """The text of the loop of every log: one for all, or one for each."""
    if loop is None or (not isinstance(loop, (str, Mapping)) and len(loop) == 0):
        return [""] * count
    every = [loop] if isinstance(loop, (str, Mapping)) else list(loop)
    if len(every) > 1 and len(every) != count:
        raise InputError(
            f"{name_option('loop')} is given {len(every)} times for {count} LOGs; give it once, or once for each"
        )
    if not all(every):
        raise InputError(
            f"{name_option('loop')}: {loop!r} names no gain; give them, such as {name_loop('kp=8,kd=0.08')}, or "
            "leave it out"
        )
    texts = [loop_text(x) for x in every]
    return texts if len(texts) > 1 else texts * count


def with_loop(record: Record, loop: str) -> Record:
    """The record, its loop's text in meta."""
    return replace(record, meta={**record.meta, "loop": loop}) if loop else record


def about(record: Record) -> dict[str, Any]:
    """File, hash and size of a record, the time between its rows (s), and the step of its positions (rad or m)."""
    reading: dict[str, Any] = record.meta.get("reading", {})
    said: dict[str, Any] = {
        "file": str(reading.get("file", "")), "sha256": reading.get("sha256", ""), "rows": len(record)
    }  # fmt: skip
    if period := row_period(record):
        said["sample_time"] = period
    if "position" in record.channels and (step := encoder_step(record["position"])) > 0.0:
        said["position_step"] = step
    kept = ", ".join(f"{a}:{b}" for a, b in reading.get("kept_rows", [])[:20])
    return {**said, "rows_of_file": kept} if kept else said


def friction_alone(records: Sequence[Record], options: Options) -> bool:
    """Whether a record holds what an axis has no equation of motion for: friction as a sensor measures it."""
    channels = set[str]().union(*(r.channels for r in records))
    asked = (
        options.inverse
        or options.position_map
        or options.held_out
        or len(records) != 1
        or records[0].meta.get("loop")
    )
    return not asked and "friction_torque" in channels and not channels & set(DRIVES)


# ---- what is said of the result -----------------------------------------------------------------------------------


def assumptions(found: Identification, options: Options, method: str) -> list[str]:
    """That parameters of the law which nobody gave were not fitted, and their values."""
    given = {*options.values, *options.frozen, *found.details.get("untouched", ())}
    values: dict[str, list[float]] = {}
    for name, value in found.assumed.items() if options.model is None else ():
        if name not in given and name.partition("[")[0] not in given:
            values.setdefault(name.partition("[")[0], []).append(value)
    if not values:
        return []
    listed = ", ".join(f"{name} = {', '.join(f'{x:.4g}' for x in own)}" for name, own in values.items())
    fit = f"; {name_option('free', 'NAME')} fits one" if method == "axis" else ""
    return [f"Assumed, not fitted: {listed}{fit}, {name_parameter('NAME', 'VALUE')} takes another."]


def load_note(records: Sequence[Record], found: Identification) -> list[str]:
    """What the recorded normal load means for the friction found; empty without one."""
    loads = [r["load"] for r in records if "load" in r.channels and r.units["load"] == "N"]
    if not loads:
        return []
    values = np.abs(np.concatenate(loads))
    low, mean, high = np.nanpercentile(values, 5), np.nanmean(values), np.nanpercentile(values, 95)
    said = f"Normal load recorded: {mean:.4g} N ({low:.4g} to {high:.4g} in 90 % of the rows); friction holds at it"
    levels = {e.name: e.value for e in found.estimates}
    linear = all(r.units.get("position") == "m" for r in records)
    if linear and mean > 0.0 and levels.get("fc", 0.0) > 0.0:
        each = [levels["fc"], levels.get("fc_negative", levels["fc"])]
        said += f", a coefficient of friction F_C / N of {0.5 * sum(each) / mean:.3g}"
    return [f"{said}. No fit here follows the load: identify records of other loads alone."]


def weight_notes(found: Identification, records: Sequence[Record]) -> list[str]:
    """Of a pendulum that was asked for: that a gear stands before it, or else what an axis of inertia and friction
    leaves out of it, and what has it."""
    geared = [f.line() for r in records for f in pendulum_before_gear(r, "A pendulum is asked for")]
    if geared:
        return [f"{geared[0]}."]
    mechanics: Any = found.details.get("mechanics")
    told = {e.name for e in found.estimates if e.identified}
    if mechanics is None or not {"gravity", "gravity_angle"} <= told:
        return []
    phase = math.remainder(0.5 * math.pi - mechanics.gravity_angle, math.tau)
    return [
        "A simulated axis (in Python `found.axis`) has inertia and friction, neither gravity nor offset; a machine "
        f"has this gravity as cogging of order 1, amplitude {mechanics.gravity:.4g} N·m, phase {phase:.4g} rad."
    ]


def law_file(found: Identification, laws: Sequence[str | Law]) -> str:
    """The file of the law that was taken, if it came from one."""
    if found.model is None:
        return ""
    files = (x for x in laws if isinstance(x, str) and Path(x).suffix == ".py")
    return next((x for x in files if plugins.law(x).name == found.model.law.name), "")
