"""Export a friction model or controller for a drive, PLC or simulator.

stickslip export model.toml --to c99
stickslip export model.toml --to c99 --single --out firmware --name axis1
stickslip export run.toml --to c99 --controller      # the whole sampled controller of a `stickslip simulate` file
stickslip export model.toml --to c99 --compensator fb --filter-hz 10      # the law as a sampled compensator
stickslip export recommended.toml --to c99 --compensator recommended      # from `stickslip recommend --out`
stickslip export model.toml --to moteus      # the torque over the angle of `stickslip identify --method cogging`
stickslip export model.toml --to urdf --nearest      # nearest law that the target supports, with its error

model.toml is written by `stickslip identify`; by hand it is `law = "lugre"` and a table [parameters]. `stickslip export
--list` lists the targets. --check tests the export in the target's own tool, if that is installed.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from stickslip.cli import _files

if TYPE_CHECKING:
    from stickslip.exports.target import Target

NUMBERS = ("gain", "lead", "deadband", "offset", "inertia_feedforward", "filter_hz")
SUMMARY = "export a model as C, structured text, MATLAB, Python, ..."


def arguments(parser: argparse.ArgumentParser) -> None:
    """File, target and what to write."""
    parser.add_argument(
        "file", type=Path, nargs="?", metavar="MODEL.toml", help="model written by `stickslip identify`"
    )
    parser.add_argument("--to", metavar="TARGET", help="target, as listed by --list")
    parser.add_argument("--list", action="store_true", help="list the targets and exit")
    parser.add_argument("--out", type=Path, metavar="DIR", help="output folder (default: NAME-TARGET)")
    parser.add_argument("--name", help="prefix of all exported names (default: that of the file)")
    parser.add_argument("--single", action="store_true", help="single precision, if the target supports it")
    compensator_arguments(parser)
    parser.add_argument(
        "--nearest", action="store_true", help="export the nearest law that the target supports"
    )
    parser.add_argument(
        "--top-speed", type=float, metavar="SPEED",
        help="highest velocity of the application, for tables and sliding curves, rad/s "
        "(default: the fastest recorded of an identified model, "
        "else 100 times the velocity over which the law changes)",
    )  # fmt: skip
    parser.add_argument(
        "--set",
        action="append",
        default=[],
        metavar="NAME=VALUE",
        help="setting of the target, as listed by --list",
    )
    parser.add_argument(
        "--position-map",
        action="store_true",
        help="export the torque over the angle (identify --method cogging), not the law",
    )
    parser.add_argument("--check", action="store_true", help="test the export in the target's own tool")
    _files.force_argument(parser)
    parser.add_argument("--json", action="store_true", help="print files, notes and check as JSON")


def compensator_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options for exporting a controller or a compensator in place of the law."""
    parser.add_argument(
        "--controller", action="store_true", help="export the whole sampled controller in [controller]"
    )
    parser.add_argument(
        "--compensator", choices=("ff", "fb", "recommended"),
        help="export a sampled compensator: feedforward of the reference velocity (ff), feedback of the measured "
        "velocity (fb), or as recommended in the file",
    )  # fmt: skip
    parser.add_argument(
        "--sample-time",
        type=float,
        metavar="TIME",
        help="sample time of the compensator, s (default: recommended, or 0.001)",
    )
    parser.add_argument(
        "--filter-hz",
        type=float,
        metavar="FREQUENCY",
        help="low-pass on the compensator's velocity (default: none)",
    )
    for option, metavar, what in (
        ("--gain", "G", "factor on the compensating torque (default: 1)"),
        ("--lead", "TIME", "prediction horizon of the feedforward, s (default: 0)"),
        ("--deadband", "SPEED", "velocity that the law treats as zero below, rad/s (default: 0)"),
        ("--offset", "TORQUE", "torque offset, N·m (default: the file's)"),
        (
            "--inertia-feedforward",
            "INERTIA",
            "inertia of the acceleration feedforward, kg·m² (default: the file's)",
        ),
    ):
        parser.add_argument(option, type=float, metavar=metavar, help=what)
    parser.add_argument(
        "--substeps",
        type=int,
        metavar="N",
        help="integration steps of the law per sample (default: 1)",
    )


def run(args: argparse.Namespace) -> int:
    """Write the files; 1 if the check fails."""
    from stickslip.cli import _output
    from stickslip.core.config import named_values
    from stickslip.core.errors import InputError
    from stickslip.exports import TARGETS, target_named
    from stickslip.exports.maps import MAP_TARGETS
    from stickslip.verbs.export import export

    if args.list:
        for name in TARGETS:
            print("\n".join(described(target_named(name))))
        print(
            "For a torque over the angle (identify --method cogging; add --position-map if the file also has a law):"
        )
        for target in MAP_TARGETS.values():
            print(f"{target.name:<10}{target.title}{f', in {target.unit}' if target.unit else ''}")
        return 0
    if args.file is None or args.to is None:
        raise InputError(
            "give a model and a target: `stickslip export model.toml --to c99` (--list names them)"
        )
    numbers = {n: getattr(args, n) for n in ("sample_time", "substeps", *NUMBERS)}
    made = export(
        args.file, args.to, name=args.name, single=args.single, controller=args.controller,
        compensator=args.compensator, nearest=args.nearest, top_speed=args.top_speed,
        settings=named_values(args.set, "--set"), check=args.check, position_map=args.position_map, **numbers,
    )  # fmt: skip
    folder: Path = args.out or Path(f"{made.name}-{made.target.name}")
    _files.refuse_foreign([folder / name for name in made.files], args.force)
    made = made.save(folder)
    _files.written(made.paths)
    if args.check and made.check is None:
        print(f"check: {made.target.name} has no tool to run; its format is tested with the package")
    if args.json:
        tried = made.check
        check = {"passed": tried.passed, "text": tried.text, **tried.numbers} if tried else None
        files = [str(path) for path in made.paths]
        _output.print_json(
            {"target": made.target.name, "files": files, "notes": list(made.notes), "check": check}
        )
    else:
        print(made)
    return 1 if made.check and made.check.passed is False else 0


def described(target: Target) -> list[str]:
    """Return the lines of a target for `--list`."""
    lines = [f"{target.name:<10}{target.title}", f"{'':<10}carries {target.carries}"]
    for s in target.settings:
        default = "must be given" if s.default is None else f"default {s.default}"
        lines.append(f"{'':<10}--set {s.name}=...: {s.meaning} ({default})")
    return lines
