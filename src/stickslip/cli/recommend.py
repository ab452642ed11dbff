"""From an identified model to a setting that is safe to switch on.

stickslip recommend model.toml --bandwidth 15 --sample-time 0.001 --counts-per-rev 65536 --torque-limit 2
stickslip recommend model.toml --bandwidth 15 --out recommended.toml
stickslip export recommended.toml --to c99 --compensator recommended

stickslip recommend model.toml --loop kv=40,kvp=0.8,kvi=25,feed=1,filter=300,limit=3 --counts-per-rev 262144
stickslip recommend model.toml --loop kp=8,ki=60,kd=0.08,kr=0.08,limit=3 --motion cycle.csv

Simulates the linear controller alone (the loop given, or PD, PID by pole placement) and every candidate (law,
feedforward or feedback, gain, deadband) on the best estimate and on axes drawn from the model's intervals, along the
motion of the log (or one given) and at rest behind it, sampled as in the drive. Recommended is what limit-cycles on
none of them and leaves the least error on the worst. It is then simulated on other axes drawn from the intervals; the
error reduction that is printed is what it did there.
"""

from __future__ import annotations

import argparse
import math
import shlex
from pathlib import Path
from typing import TYPE_CHECKING

from stickslip.cli import _files

if TYPE_CHECKING:
    from collections.abc import Callable

    from stickslip.control.linear import Cascade, Gains
    from stickslip.identify.identified_file import Identified
    from stickslip.identify.motion import Motion
    from stickslip.identify.recommend import Candidate, Recommendation
    from stickslip.identify.setting_trial import Drive
    from stickslip.model import Model

SUMMARY = "which compensator to switch on: law, structure, gain, lead, deadband, and what to expect"


def arguments(parser: argparse.ArgumentParser) -> None:
    """Model, drive, motion."""
    parser.add_argument("model", type=Path, metavar="MODEL.toml", help="what `stickslip identify` wrote")
    for option, default, unit, what in (
        ("--bandwidth", 10.0, "HZ", "of the position loop"),
        ("--damping", 1.0, "D", "of its poles"),
        ("--sample-time", 1e-3, "S", "of the drive"),
        ("--counts-per-rev", 0.0, "N", "of the encoder; 0: exact"),
        ("--torque-limit", math.inf, "NM", "of the drive"),
    ):
        parser.add_argument(
            option, type=float, default=default, metavar=unit, help=f"{what} (default {default:g})"
        )
    parser.add_argument(
        "--linear",
        choices=("PD", "PID", "PR"),
        default="PD",
        help="what bandwidth and damping place (default PD)",
    )
    parser.add_argument(
        "--loop", metavar="kp=..,kd=..",
        help="the drive's own loop instead: kp (N·m/rad), ki, kd, kr of a PID, or kv (1/s), kvp (N·m·s/rad), kvi "
        "(N·m/rad), feed (part of the reference velocity fed forward, default 1) of position P around velocity PI; "
        "with filter (Hz, low-pass on its velocity) and limit (N·m)",
    )  # fmt: skip
    parser.add_argument(
        "--controller", type=Path, metavar="FILE.toml",
        help="the drive's own loop made of control laws instead (table [controller]), observers and all, but without "
        "friction laws",
    )  # fmt: skip
    parser.add_argument(
        "--motion", type=Path, metavar="FILE",
        help="log or CSV (time, position) of the motion that matters (default: that of the log, kept in MODEL.toml)",
    )  # fmt: skip
    parser.add_argument(
        "--amplitude",
        type=float,
        metavar="RAD",
        help="of a slow sinusoid as the motion instead (m of a linear axis)",
    )
    parser.add_argument("--frequency", type=float, metavar="HZ", help="of that sinusoid (default 0.5)")
    parser.add_argument(
        "--inertia", type=float, metavar="KGM2", help="where the model has none, or another one"
    )
    parser.add_argument(
        "--no-inertia-feedforward", dest="feed_inertia", action="store_false",
        help="leave out the inertia times the reference's acceleration, where the drive gives it itself or knows none",
    )  # fmt: skip
    parser.add_argument(
        "--axes",
        type=int,
        default=6,
        metavar="N",
        help="drawn from the intervals for all candidates (default 6)",
    )
    parser.add_argument(
        "--confirm", type=int, default=39, metavar="N",
        help="drawn for the recommended one: what it does on them is the interval of the error reduction, which holds "
        "with (N - 1)/(N + 1) (default 39: 95 %%)",
    )  # fmt: skip
    parser.add_argument(
        "--out",
        type=Path,
        metavar="FILE.toml",
        help="write what is recommended, as `stickslip export` takes it",
    )
    _files.force_argument(parser)
    parser.add_argument("--json", action="store_true", help="print the result as JSON, all candidates too")


def run(args: argparse.Namespace) -> int:
    """Print the recommendation."""
    from stickslip.cli import _output
    from stickslip.errors import InputError
    from stickslip.identify.identified_file import read_identified
    from stickslip.identify.recommend import recommend

    if args.out:
        writable(args.out, args.model)
        _files.refuse_foreign([args.out], args.force)
    if args.axes < 1:
        raise InputError(
            f"--axes {args.axes} must be at least 1: what is safe on the best estimate alone need not be on the machine"
        )
    if args.confirm < 0:
        raise InputError(
            f"--confirm {args.confirm} must be at least 0, which confirms nothing; leave it out for 39"
        )
    found = read_identified(args.model)
    drive = drive_of(args, found)
    with _output.progress_bar("simulating") as progress:
        result = recommend(
            found,
            drive,
            inertia=args.inertia,
            axes=args.axes,
            confirm=args.confirm,
            progress=progress,
            feed_inertia=args.feed_inertia,
        )
    written = args.out and store(args.out, found, result)
    if written:
        _files.written([written])
    if args.json:
        _output.print_json({**result.as_dict(), "file": str(written) if written else None})
        return 0
    show(result, found.unit)
    if written:
        print(f"recommended: {written}")
        what = "--controller" if args.controller else "--compensator recommended"
        print(f"next: stickslip export {shlex.quote(str(written))} --to c99 {what}")
    return 0


def drive_of(args: argparse.Namespace, found: Identified) -> Drive:
    """The drive and the motion that the options describe."""
    from stickslip.errors import InputError
    from stickslip.identify.setting_trial import Drive

    if args.motion and args.amplitude is not None:
        raise InputError("--motion and --amplitude are two motions; give one of them")
    if args.frequency is not None and args.amplitude is None:
        raise InputError(f"--frequency {args.frequency:g} belongs to a sinusoid; give its --amplitude too")
    if args.loop and args.linear != "PD":
        raise InputError(
            f"--linear {args.linear} beside --loop, which gives the gains themselves; leave it out"
        )
    motion = motion_from(args.motion) if args.motion else None
    if args.controller:
        return drive_with(args, args.inertia or found.axis.get("inertia"), motion)
    gains, own = loop_of(args) if args.loop else (None, dict[str, float]())
    limit = own["limit"] if "limit" in own else float(args.torque_limit)
    return Drive(
        args.bandwidth, args.damping, args.sample_time, args.counts_per_rev, limit,
        args.amplitude, args.frequency or 0.5, args.linear, gains, own.get("filter", 0.0),
        motion,
    )  # fmt: skip


def drive_with(args: argparse.Namespace, inertia: float | None, motion: Motion | None) -> Drive:
    """The drive whose loop is made of control laws; sample time, limit and counts are the file's.

    Raises
    ------
    InputError
    """
    from stickslip.control.files import read_controller
    from stickslip.errors import InputError
    from stickslip.identify.setting_trial import Drive

    for option, usual in (
        ("loop", None),
        ("linear", "PD"),
        ("bandwidth", 10.0),
        ("damping", 1.0),
        ("sample_time", 1e-3),
    ):
        if getattr(args, option) != usual:
            raise InputError(
                f"--{option.replace('_', '-')} beside --controller {args.controller}, which says it; leave it out"
            )
    made = read_controller(args.controller, inertia)
    return Drive(
        sample_time=made.sample_time, encoder_counts=args.counts_per_rev or made.encoder_counts,
        torque_limit=args.torque_limit, amplitude=args.amplitude, frequency=args.frequency or 0.5, motion=motion,
        controller=made,
    )  # fmt: skip


def loop_of(args: argparse.Namespace) -> tuple[Gains | Cascade, dict[str, float]]:
    """Gains of ``--loop``, and its filter and limit.

    Raises
    ------
    InputError
        If a name is unknown, both kinds of loop are mixed, or a number is out of bounds.
    """
    from stickslip.config import named_numbers
    from stickslip.control.linear import Cascade, Gains
    from stickslip.errors import InputError, UnknownName

    given = named_numbers(args.loop.split(","))
    kind = Cascade if "kv" in given else Gains
    names = (*kind._fields, "filter", "limit")
    for name, value in given.items():
        if name not in names:
            raise UnknownName(f"number of --loop of a {'cascade' if kind is Cascade else 'PID'}", name, names)
        if not (value >= 0.0 and (math.isfinite(value) or name == "limit")) or (
            name == "limit" and value == 0.0
        ):
            raise InputError(
                f"--loop: {name} = {value:g} must be a number of 0 or more, a limit greater than 0"
            )
    for name in ("kv", "kvp") if kind is Cascade else ("kp",):
        if not given.get(name, 0.0) > 0.0:
            raise InputError(f"--loop {args.loop}: give {name}, greater than 0")
    if "limit" in given and math.isfinite(args.torque_limit):
        raise InputError(f"--torque-limit {args.torque_limit:g} beside --loop's limit; give one of them")
    own = {name: given.pop(name) for name in ("filter", "limit") if name in given}
    return kind(**given), own


def motion_from(path: Path) -> Motion:
    """The motion of a log or of a table of points."""
    from stickslip.identify.motion import motion_of
    from stickslip.readers import read

    return motion_of(read(path), path.name)


def store(out: Path, found: Identified, result: Recommendation) -> Path | None:
    """Write the recommendation; where there is none, an earlier one must not be taken for it."""
    from stickslip.config import read_toml
    from stickslip.identify.setting_file import write_setting

    if result.chosen is not None:
        return write_setting(out, found, result)
    if out.is_file() and out.suffix == ".toml" and read_toml(out).has("recommended"):
        out.unlink()
    return None


def writable(out: Path, model: Path) -> None:
    """Refuse before the simulations what cannot be written after them.

    Raises
    ------
    InputError
    """
    from stickslip.errors import InputError
    from stickslip.study.files import prepared_folder

    if out.resolve() == model.resolve():
        raise InputError(f"--out {out} is the model itself; give another name, such as recommended.toml")
    if out.is_dir():
        raise InputError(
            f"--out {out} is a folder; give the name of a file, such as {out / 'recommended.toml'}"
        )
    prepared_folder(out.parent)


def show(result: Recommendation, unit: Callable[[str], str]) -> None:
    """The setting, what to expect, and what was tried; `unit` turns an angular unit into the axis's own."""
    print(f"{'law':<16}{'structure':<13}{'gain':>5}  {'deadband':>8}  {'error left':>10}  {'worst':>7}  safe")
    for c in result.candidates:
        x = c.setting
        mark = "<- " if result.chosen and (x.law, x.kind, x.gain, x.deadband) == same(result.chosen) else ""
        print(f"{x.law:<16}{x.kind:<13}{x.gain:>5.3g}  {x.deadband:>8.3g}  {100 * c.errors[0]:>8.1f} %  "
              f"{100 * c.worst:>5.1f} %  {mark}{safety(c)}")  # fmt: skip
    print()
    path = result.drive.path
    print(
        f"motion:            {path.source}; {path.duration:.3g} s, up to {path.top_speed:.3g} {unit('rad/s')}"
    )
    gains = ", ".join(f"{k} {v:.5g}" for k, v in result.gains.items() if v)
    print(f"linear controller: {gains}; RMS error alone {result.linear_error:.3g} {unit('rad')}")
    if result.rings:
        print(f"it rings alone:    {result.rings}")
    c = result.chosen
    if c and result.model:
        print(
            f"switch on:         {c.setting.kind} of law {result.model.law.name!r}, gain {c.setting.gain:g}"
        )
        print(f"parameters:        {parameters(result.model, unit)}")
        print(f"lead:              {c.setting.lead:.4g} s")
        print(f"deadband:          {c.setting.deadband:.4g} {unit('rad/s')}")
        inertia = c.setting.inertia_feedforward
        said = f"{inertia:.4g} {unit('kg·m²')} times the acceleration" if inertia else "not fed forward"
        print(f"inertia:           {said}")
        print(f"error reduction:   {reduction(result)}")
        print(f"margin of gain:    {margin(c, result)}")
    for note in result.notes:
        print(note)


def safety(c: Candidate) -> str:
    """Whether it is safe; why it is not, or not worth it."""
    from stickslip.identify.recommend import WORTH

    if c.unsafe:
        return f"no: {', '.join(c.unsafe)}"
    useless = c.useless or ("hardly less error" if c.worst > WORTH else "")
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
    return (
        f"{best} on the best estimate; {100.0 * result.confidence:.0f} % interval {percent(*result.reduction)}, "
        f"safe on all {result.confirmed_on} axes drawn for it"
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
