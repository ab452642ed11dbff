"""Run procedures on a rig: a virtual machine, or a real one described in a TOML file.

stickslip rig list
stickslip rig run breakaway --rig thesis-dry --out breakaway.npz
stickslip rig run sliding --rig thesis-grease --set velocities=5,1,0.2 --without cogging
stickslip rig run track --rig thesis-dry --set compensator=feedforward --set model=lugre
stickslip rig run track --rig thesis-dry --set controller=my_controller.toml      # made of control laws
stickslip rig run inertia --rig my_machine.toml --dry-run
stickslip rig run breakaway --rig drive.toml --limit torque=0.5 --stream breakaway.stream
stickslip rig commission --rig thesis-dry --out commissioned      # run again to resume after an interruption

A rig is the name of a machine in the library, the TOML file of a machine, or a TOML file with a table [rig] (`kind` and
the settings of that kind). --dry-run prints travel, speed, torque and duration without moving. The record is a .npz
file for `stickslip identify` and `stickslip doctor`.
"""

from __future__ import annotations

import argparse
import math
import os
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from stickslip.cli import _files

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from stickslip.commission.commission import Commissioned
    from stickslip.core.finding import Finding
    from stickslip.rigs.procedures.base import Performed, Plan, Procedure
    from stickslip.rigs.rig import Rig

SHOWN = 4
"""Most passed checks that a report lists; more are counted."""
SUMMARY = "run identification procedures on a virtual or real machine"


def arguments(parser: argparse.ArgumentParser) -> None:
    """Actions and their options."""
    from stickslip.cli import allow_code_argument

    actions = parser.add_subparsers(dest="action", metavar="ACTION", required=True)
    run_one = actions.add_parser("run", help="perform one procedure")
    run_one.add_argument("procedure", metavar="NAME", help="procedure, as listed by `stickslip rig list`")
    run_one.add_argument(
        "--set", action="append", default=[], metavar="NAME=VALUE", help="option of the procedure"
    )
    run_one.add_argument("--out", type=Path, metavar="FILE.npz", help="record to write (default: NAME.npz)")
    run_one.add_argument("--realtime", action="store_true", help="run a virtual rig in real time")
    run_one.add_argument("--stream", type=Path, metavar="FILE", help="also stream every sample to this file")
    _files.force_argument(run_one)
    whole = actions.add_parser(
        "commission", help="run all procedures; writes model.toml, machine.toml and a report"
    )
    whole.add_argument(
        "--out",
        type=Path,
        default=Path("commission"),
        metavar="DIR",
        help="output folder (default commission)",
    )
    whole.add_argument(
        "--cogging",
        choices=("rotation", "standstill"),
        default="",
        help="also map the torque over the angle, in slow rotations or held at places",
    )
    whole.add_argument(
        "--force",
        action="store_true",
        help="measure everything again and overwrite existing results",
    )
    actions.add_parser("list", help="list machines, procedures and imperfections")
    for action in (run_one, whole):
        action.add_argument("--rig", required=True, metavar="RIG", help="name of a machine, or TOML file")
        action.add_argument(
            "--without", action="append", default=[], metavar="NAME", help="imperfection to switch off"
        )
        action.add_argument(
            "--limit", action="append", default=[], metavar="NAME=VALUE",
            help="tighter limit than the rig's: torque, speed, lowest_position, highest_position, temperature, "
            "following_error, stop_time, answer_time, standstill_torque (SI units)",
        )  # fmt: skip
        action.add_argument("--dry-run", action="store_true", help="print the plan without moving")
        action.add_argument(
            "--no-watchdog", action="store_true", help="allow a rig that declares no watchdog"
        )
        action.add_argument("--json", action="store_true", help="print the result as JSON")
        allow_code_argument(action)


def run(args: argparse.Namespace) -> int:
    """Run the action; return 1 if a check failed."""
    if args.action == "list":
        return listed()
    return commissioned(args) if args.action == "commission" else performed(args)


def listed() -> int:
    """Print machines, procedures and imperfections."""
    from stickslip.machines.files import library, machine
    from stickslip.machines.machine import IMPERFECTIONS
    from stickslip.rigs.kinds import rig_kind_names
    from stickslip.rigs.procedures import PROCEDURES, procedure

    print("machines (--rig):")
    for name in library():
        print(f"  {name:14} {machine(name).title}")
    print("procedures:")
    for name in PROCEDURES:
        print(f"  {name:14} {procedure(name).title}")
    print("kinds of rig ([rig] kind = ...):")
    print(f"  {', '.join(rig_kind_names())}")
    print("imperfections of a virtual machine (--without):")
    print(f"  {', '.join(IMPERFECTIONS)}")
    return 0


def rig_of(args: argparse.Namespace) -> Rig:
    """Return the rig of --rig, without the imperfections of --without, with the limits of --limit.

    Raises
    ------
    InputError
    """
    from stickslip.core.config import named_numbers, read_toml
    from stickslip.core.errors import InputError
    from stickslip.rigs.files import read_rig
    from stickslip.rigs.narrower_limits import limited
    from stickslip.rigs.virtual import virtual_rig

    name = str(args.rig)
    if name.endswith(".toml") and read_toml(Path(name)).has("rig"):
        if args.without:
            raise InputError("--without is for virtual machines; write it into the file's [rig]")
        return limited(read_rig(name), named_numbers(args.limit, "--limit"))
    return limited(virtual_rig(name, args.without), named_numbers(args.limit, "--limit"))


def performed(args: argparse.Namespace) -> int:
    """Run `stickslip rig run`."""
    from stickslip.cli import _output
    from stickslip.core.config import named_values
    from stickslip.core.errors import InputError
    from stickslip.core.whole_files import prepared_folder
    from stickslip.rigs.procedures import procedure
    from stickslip.rigs.procedures.base import perform, planned

    kind = procedure(args.procedure)
    given = named_values(args.set, "--set")
    chosen = kind.with_options(given)
    sensible(chosen, given)
    rig = rig_of(args)
    out: Path = args.out or Path(f"{args.procedure}.npz")
    plan = planned(chosen, rig)
    if args.dry_run:
        return told(plan, rig, args)
    if out.is_dir():
        raise InputError(f"--out {out} is a folder; give the name of a file")
    if args.stream is not None and os.path.realpath(args.stream) == os.path.realpath(out):
        raise InputError(f"--out and --stream are both {out}; give different names")
    prepared_folder(out.parent)
    _files.refuse_foreign([out], args.force)
    result = perform(
        chosen, rig, path=args.stream, progress=_output.say, without_watchdog=args.no_watchdog,
        realtime=args.realtime or None,
    )  # fmt: skip
    result.record.save(out)
    _files.written([out])
    return shown(result, out, args)


def sensible(chosen: Procedure, given: Mapping[str, str]) -> None:
    """Refuse numbers that are not finite; the procedure checks their sign.

    Raises
    ------
    InputError
    """
    from stickslip.core.errors import InputError

    for name, text in given.items():
        value: Any = getattr(chosen, name)
        values: list[Any] = list(value) if isinstance(value, tuple) else [value]  # type: ignore[reportUnknownArgumentType]
        if any(isinstance(v, (int, float)) and not math.isfinite(v) for v in values):
            raise InputError(f"{chosen.name}: {name} = {text} must be finite")


def told(plan: Plan, rig: Rig, args: argparse.Namespace) -> int:
    """Print the plan; return whether the rig allows it."""
    from stickslip.cli import _output

    plan.within(rig)
    if args.json:
        _output.print_json({"rig": rig.name, **vars(plan)})
        return 0
    print(f"{args.procedure} on {rig.name}")
    for line in plan.text:
        print(f"  {line}")
    print(f"travel  up to {plan.travel:.4g} rad")
    print(f"speed   up to {plan.speed:.4g} rad/s of {rig.limits.speed:.4g}")
    print(f"torque  up to {plan.torque:.4g} N·m of {rig.limits.torque:.4g}")
    print(f"time    up to {clock(plan.duration)}, and {clock(plan.pauses)} at rest")
    return 0


def commissioned(args: argparse.Namespace) -> int:
    """Run `stickslip rig commission`."""
    from stickslip.cli import _output
    from stickslip.commission.commission import commission
    from stickslip.commission.headline import headline
    from stickslip.commission.resume import RESULTS, claimed
    from stickslip.core.errors import InputError
    from stickslip.core.whole_files import prepared_folder

    rig = rig_of(args)
    if args.dry_run:
        return print_plan(rig, args.cogging)
    if args.out.is_file():
        raise InputError(f"--out {args.out} is a file; give a folder")
    folder: Path = prepared_folder(args.out)
    claimed(folder, rig, anew=args.force, own=_files.listed)
    try:
        found = commission(
            rig,
            folder=folder,
            progress=_output.tell,
            without_watchdog=args.no_watchdog,
            resume=not args.force,
            cogging=args.cogging,
        )
    except KeyboardInterrupt:
        raise KeyboardInterrupt(
            f"the records are kept in {folder}; run the same command again, without --force, to resume"
        ) from None
    track = f"stickslip rig run track --rig {args.rig} --set compensator=recommended"
    lines = headline(found, f"{track} --set model={folder / 'recommended.toml'}")
    try:
        model, report = write_commissioned(found, rig, folder, lines)
    finally:
        _files.written(path for name in RESULTS if (path := folder / name).exists())
    if args.json:
        said = {word.lower(): line for word, line in lines}
        _output.print_json({**found.result.as_dict(), "headline": said, "folder": str(folder)})
        return 0
    for word, line in lines:
        print(f"{word:<13}{line}")
    print()
    for note in found.result.notes:
        print(f"- {note}")
    if found.recommended:
        print(f"machine: {folder / 'machine.toml'}")
    print(f"model: {model}\nreport: {report}\nrecords: {folder}")
    return 0


def print_plan(rig: Rig, cogging: Literal["", "rotation", "standstill"]) -> int:
    """Print the plan of `stickslip rig commission` and its longest duration."""
    from stickslip.commission.commission import planned

    total = 0.0
    for plan in planned(rig, cogging=cogging):
        total += plan.duration + plan.pauses
        print("\n".join(plan.text))
    print(f"time    up to {clock(total)}")
    return 0


def write_commissioned(
    found: Commissioned, rig: Rig, folder: Path, lines: Sequence[tuple[str, str]]
) -> tuple[Path, Path]:
    """Write model.toml, machine.toml, recommended.toml if there is one, and the report; return model and report."""
    from stickslip.commission.recommended import write_identified_machine, write_recommended
    from stickslip.identification.model_file import versions, write_model
    from stickslip.report.identified import Source, write_identification

    stages = [s for s in found.stages if s.name != "angle"]  # a second evaluation of the sliding record
    records = {s.name: s.performed.record for s in stages}
    data = [described(folder / f"{name}.npz", len(record)) for name, record in records.items()]
    model = write_model(folder / "model.toml", found.result, data=data)
    if found.recommended:
        write_identified_machine(folder / "machine.toml", found.recommended, rig, found.lugre)
    if found.recommended and found.recommended.advice.chosen:
        write_recommended(folder / "recommended.toml", found.recommended)
    sources = [Source(s.name, s.performed.record, findings_of(s.performed)) for s in stages]
    report = write_identification(
        folder / "report.html",
        found.result,
        sources,
        title=f"Commissioning of {rig.name}",
        versions=versions(),
        headline=lines,
    )
    return model, report


def findings_of(performed: Performed) -> list[Finding]:
    """Return the acceptance checks of a procedure as findings for a report."""
    from stickslip.core.finding import Finding

    failed = [c for c in performed.checks if not c.passed]
    out = [Finding("warning", c.name, c.text) for c in failed]
    good = [c for c in performed.checks if c.passed]
    if len(good) > SHOWN:
        return [*out, Finding("note", "checks", f"{len(good)} of {len(performed.checks)} checks passed")]
    return [*out, *(Finding("note", c.name, c.text) for c in good)]


def described(path: Path, rows: int) -> dict[str, Any]:
    """Return the entry of a record for model.toml."""
    import hashlib

    return {"file": path.name, "sha256": hashlib.sha256(path.read_bytes()).hexdigest(), "rows": rows}


def clock(seconds: float) -> str:
    """Return a duration as text."""
    return f"{seconds:.3g} s" if seconds < 120.0 else f"{seconds / 60.0:.3g} min"


def shown(result: Performed, out: Path, args: argparse.Namespace) -> int:
    """Print the checks and the path of the record."""
    from dataclasses import asdict

    from stickslip.cli import _output

    if args.json:
        data: dict[str, Any] = {"record": str(out), "checks": [asdict(c) for c in result.checks]}
        _output.print_json({**data, "passed": result.passed})
    else:
        for check in result.checks:
            print(f"{'ok    ' if check.passed else 'FAILED'} {check.name}: {check.text}")
        if "loop" in result.record.meta:
            from stickslip.rigs.realtime import Account

            print(*Account(**result.record.meta["loop"]).lines(), sep="\n")
        print(f"record: {out} ({len(result.record)} rows)")
    return 0 if result.passed else 1
