"""Export a friction model to what another machine or simulator reads.

stickslip export model.toml --to c99
stickslip export model.toml --to c99 --single --out firmware --name axis1
stickslip export run.toml --to c99 --controller      # the whole sampled controller of a `stickslip simulate` file
stickslip export model.toml --to c99 --compensator fb --filter-hz 10      # the law as a sampled compensator
stickslip export recommended.toml --to c99 --compensator recommended      # of `stickslip recommend --out`
stickslip export model.toml --to urdf --nearest      # what a poorer target can hold, with its error

model.toml is what identification writes; by hand it is `law = "lugre"` and a table [parameters]. `stickslip export
--list` names the targets. With --check the export is tried in its own tool, where that is installed.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from stickslip.cli import _files

if TYPE_CHECKING:
    from stickslip.export.target import Target

NUMBERS = ("gain", "lead", "deadband", "offset", "inertia_feedforward", "filter_hz")
SUMMARY = "write a model as C, structured text, MATLAB, Python, ..."


def arguments(parser: argparse.ArgumentParser) -> None:
    """File, target and what to write."""
    parser.add_argument(
        "file", type=Path, nargs="?", metavar="MODEL.toml", help="what `stickslip identify` wrote"
    )
    parser.add_argument("--to", metavar="TARGET", help="the target; --list names them")
    parser.add_argument("--list", action="store_true", help="name the targets and exit")
    parser.add_argument(
        "--out", type=Path, metavar="DIR", help="folder of the export (default: NAME-TARGET here)"
    )
    parser.add_argument("--name", help="prefix of every name in the target's language (default: the file's)")
    parser.add_argument("--single", action="store_true", help="single precision, where the target has it")
    parser.add_argument(
        "--controller", action="store_true", help="the whole sampled controller of the file's [controller]"
    )
    parser.add_argument(
        "--compensator", choices=("ff", "fb", "recommended"),
        help="the law as a compensator that is called every sample: feedforward of the reference velocity, "
        "feedback of the measured one, or what the file recommends",
    )  # fmt: skip
    parser.add_argument(
        "--sample-time",
        type=float,
        metavar="TIME",
        help="of the compensator, s (default: 0.001, or the recommended one)",
    )
    parser.add_argument(
        "--filter-hz",
        type=float,
        metavar="FREQUENCY",
        help="low-pass on the compensator's velocity (default: none)",
    )
    for option, metavar, what in (
        ("--gain", "G", "factor on the compensating torque (default: 1)"),
        ("--lead", "TIME", "by which feedforward looks ahead of the reference, s (default: 0)"),
        ("--deadband", "SPEED", "velocity below which the compensator's law sees rest, rad/s (default: 0)"),
        ("--offset", "TORQUE", "constant torque that it gives beside friction's, N·m (default: the file's)"),
        (
            "--inertia-feedforward",
            "INERTIA",
            "times the reference's acceleration, kg·m² (default: the file's inertia)",
        ),
    ):
        parser.add_argument(option, type=float, metavar=metavar, help=what)
    parser.add_argument(
        "--substeps",
        type=int,
        metavar="N",
        help="steps of the compensator's law into which a sample is divided (default: 1); the README states the errors",
    )
    parser.add_argument(
        "--nearest", action="store_true", help="where the target cannot hold the law, the nearest that it can"
    )
    parser.add_argument(
        "--top-speed", type=float, metavar="SPEED",
        help="greatest velocity of the application, rad/s: up to it tables are made and sliding curves compared "
        "(default: 100 times the velocity over which the law changes)",
    )  # fmt: skip
    parser.add_argument(
        "--set",
        action="append",
        default=[],
        metavar="NAME=VALUE",
        help="a setting of the target; --list names them",
    )
    parser.add_argument("--check", action="store_true", help="try the export in its own tool")
    _files.force_argument(parser)
    parser.add_argument("--json", action="store_true", help="print files, notes and check as JSON")


def run(args: argparse.Namespace) -> int:
    """Write the files; 1 if the check fails."""
    from stickslip.cli import _output
    from stickslip.errors import InputError
    from stickslip.export import TARGETS, target_named
    from stickslip.verbs.export import export

    if args.list:
        for name in TARGETS:
            print("\n".join(described(target_named(name))))
        return 0
    if args.file is None or args.to is None:
        raise InputError(
            "give a model and a target: `stickslip export model.toml --to c99` (--list names them)"
        )
    numbers = {n: getattr(args, n) for n in ("sample_time", "substeps", *NUMBERS)}
    made = export(
        args.file, args.to, name=args.name, single=args.single, controller=args.controller,
        compensator=args.compensator, nearest=args.nearest, top_speed=args.top_speed,
        settings=settings_given(args.set), check=args.check, **numbers,
    )  # fmt: skip
    folder: Path = args.out or Path(f"{made.name}-{made.target.name}")
    _files.refuse_foreign([folder / name for name in made.files], args.force)
    made = made.save(folder)
    _files.written(made.paths)
    if args.check and made.check is None:
        print(f"check: {made.target.name} has no tool to run; its format is checked by our tests")
    if args.json:
        tried = made.check
        check = {"passed": tried.passed, "text": tried.text, **tried.numbers} if tried else None
        files = [str(path) for path in made.paths]
        _output.print_json(
            {"target": made.target.name, "files": files, "notes": list(made.notes), "check": check}
        )
    else:
        print(made)
        if made.check:
            print(f"check: {made.check.text}")
    return 1 if made.check and made.check.passed is False else 0


def settings_given(pairs: list[str]) -> dict[str, str]:
    """Settings of the target, NAME=VALUE."""
    from stickslip.errors import InputError

    given: dict[str, str] = {}
    for text in pairs:
        key, equals, value = text.partition("=")
        if not equals:
            raise InputError(f"--set {text}: write NAME=VALUE")
        given[key] = value
    return given


def described(target: Target) -> list[str]:
    """What `--list` says of a target."""
    lines = [f"{target.name:<10}{target.title}", f"{'':<10}carries {target.carries}"]
    for s in target.settings:
        default = "must be given" if s.default is None else f"default {s.default}"
        lines.append(f"{'':<10}--set {s.name}=...: {s.meaning} ({default})")
    return lines
