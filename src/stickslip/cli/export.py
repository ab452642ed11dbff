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
import math
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

from stickslip.cli import _files

if TYPE_CHECKING:
    from collections.abc import Iterator

    from stickslip.control.controller import Controller
    from stickslip.control.recommended import Recommended
    from stickslip.control.sampled_controller import SampledController
    from stickslip.export.job import Export, Job
    from stickslip.export.target import Target
    from stickslip.model import Model

SLOW = 0.02
"""s: sample times above it are told; a tenth of a period of 5 Hz."""
NUMBERS = ("gain", "lead", "deadband", "offset", "inertia_feedforward", "filter_hz")
"""Of a compensator: what --compensator ff or fb is given, and a recommendation sets."""
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
    from stickslip.export.target import settings_of

    if args.list:
        for name in TARGETS:
            print("\n".join(described(target_named(name))))
        return 0
    if args.file is None or args.to is None:
        raise InputError(
            "give a model and a target: `stickslip export model.toml --to c99` (--list names them)"
        )
    chosen = target_named(args.to)
    if args.single and not chosen.precision:
        raise InputError(f"--single: {chosen.name} has one precision; leave it out")
    refuse_controllers(args, chosen)
    if args.controller and (made := composed_in(args.file)) is not None:
        return export_composed(args, chosen, made)
    if args.controller and not chosen.controller:
        raise InputError(
            f'--controller: {chosen.name} carries controllers made of control laws (a loop, `loop = {{law = "pd"}}`), '
            f"and that of {args.file} is none; take --to c99"
        )
    job = job_of(args, chosen)
    if job.nearest and not chosen.forms:
        raise InputError(f"--nearest: {chosen.name} carries {chosen.carries}; leave it out")
    settings_of(chosen, job.settings)
    export = chosen.write(job)
    folder: Path = args.out or Path(f"{job.name}-{chosen.name}")
    written = store(export, folder, args.force)
    notes = [*export.notes, *around_of(chosen, job), *notes_on(args, job)]
    result = chosen.check(job, export) if args.check and chosen.check else None
    if args.check and result is None:
        print(f"check: {chosen.name} has no tool to run; its format is checked by our tests")
    if args.json:
        check = {"passed": result.passed, "text": result.text, **result.numbers} if result else None
        _output.print_json({"target": chosen.name, "files": written, "notes": notes, "check": check})
    else:
        report(chosen, notes, written)
        if result:
            print(f"check: {result.text}")
    return 1 if result and result.passed is False else 0


def refuse_controllers(args: argparse.Namespace, chosen: Target) -> None:
    """Refuse --controller and --compensator where the target carries the law alone.

    Raises
    ------
    InputError
    """
    from stickslip.errors import InputError
    from stickslip.export import CONTROLLER_TARGETS

    carried = {
        "controller": chosen.controller or chosen.name in CONTROLLER_TARGETS,
        "compensator": chosen.controller,
    }
    for option, possible in carried.items():
        if getattr(args, option) and not possible:
            raise InputError(
                f"--{option}: {chosen.name} carries the law alone; leave it out, or take --to c99"
            )


def composed_in(file: Path) -> SampledController | None:
    """The controller of a file, where it is made of control laws."""
    from stickslip.config import read_toml
    from stickslip.control.files import read_controller
    from stickslip.control.sampled_controller import SampledController
    from stickslip.study.study import load_run

    whole = read_toml(file)
    if whole.has("controller") and not whole.has("reference"):
        return read_controller(file)  # of `stickslip recommend --controller`, or written by hand
    control = load_run(file).control
    return control if isinstance(control, SampledController) else None


def export_composed(args: argparse.Namespace, chosen: Target, controller: SampledController) -> int:
    """Write a controller made of control laws; 1 if the check fails."""
    from stickslip.cli import _output
    from stickslip.export import controller_target

    name, target = name_of(args), controller_target(chosen.name)
    export = target.write(controller, name, args.single)
    written = store(export, args.out or Path(f"{name}-{chosen.name}"), args.force)
    result = target.check(export, name) if args.check and target.check else None
    if args.check and result is None:
        print(f"check: {chosen.name} has no tool to run; its format is checked by our tests")
    if args.json:
        check = {"passed": result.passed, "text": result.text, **result.numbers} if result else None
        _output.print_json({"target": chosen.name, "files": written, "notes": [], "check": check})
    else:
        report(chosen, [], written)
        if result:
            print(f"check: {result.text}")
    return 1 if result and result.passed is False else 0


def name_of(args: argparse.Namespace) -> str:
    """The prefix of every name: the one given, or the file's."""
    import re

    return args.name or re.sub(r"[^A-Za-z0-9_]+", "_", args.file.stem)


def described(target: Target) -> list[str]:
    """What `--list` says of a target."""
    lines = [f"{target.name:<10}{target.title}", f"{'':<10}carries {target.carries}"]
    for s in target.settings:
        default = "must be given" if s.default is None else f"default {s.default}"
        lines.append(f"{'':<10}--set {s.name}=...: {s.meaning} ({default})")
    return lines


def axis_of(file: Path) -> dict[str, float]:
    """The numbers that a file holds of its axis: inertia, offset, gravity, ..."""
    from stickslip.config import read_toml

    axis: object = read_toml(file).values.get("axis", {})
    known = cast("dict[str, Any]", axis) if isinstance(axis, dict) else {}
    return {k: float(v) for k, v in known.items() if isinstance(v, (int, float)) and math.isfinite(v)}


def mean_beside(file: Path) -> float:
    """The constant torque beside friction that a file holds of its axis or, where it is a map of the angle, its mean
    over a revolution, N·m."""
    from stickslip.config import read_toml
    from stickslip.machines.angle import AngleMap

    whole = read_toml(file)
    if whole.has("angle"):
        return AngleMap.of(whole.table("angle").values).offset
    return axis_of(file).get("offset", 0.0)


def axis_values(file: Path, chosen: Target) -> dict[str, str | float]:
    """Settings of the target that an identified model's file holds of its axis (growth with the load, ...)."""
    known = axis_of(file)
    return {s.name: known[s.name] for s in chosen.settings if s.name in known}


def job_of(args: argparse.Namespace, chosen: Target) -> Job:
    """The model of the file, or the model and controller of a file for `stickslip simulate`."""
    from stickslip.control.sampled_controller import SampledController
    from stickslip.errors import InputError
    from stickslip.export.job import Job
    from stickslip.model import Model

    name = name_of(args)
    options: dict[str, Any] = {
        "single": args.single, "nearest": args.nearest, "top_speed": args.top_speed,
        "settings": settings_given(args, chosen),
    }  # fmt: skip
    if args.compensator is None:
        for option in ("sample_time", "substeps", *NUMBERS):
            if getattr(args, option) is not None:
                raise InputError(
                    f"--{option.replace('_', '-')} belongs to --compensator; give both or neither"
                )
    elif args.controller:
        raise InputError("--controller takes the compensator of its file; leave --compensator out")
    if not args.controller:
        model = Model.from_file(args.file)
        return Job(model, name, compensator_of(args, model), **options)
    from stickslip.spec import Surroundings
    from stickslip.study.study import load_run

    run = load_run(args.file)
    controller = run.control
    if isinstance(controller, SampledController) or controller.compensator is None:
        raise InputError(f"{args.file}: [controller] has no compensator; add one, or export the law alone")
    around = Surroundings(load=run.axis.load, temperature=run.axis.temperature)
    return Job(controller.compensator.model, name, controller, surroundings=around, **options)


def settings_given(args: argparse.Namespace, chosen: Target) -> dict[str, str | float]:
    """The target's settings: what the model's file holds of its axis, and before that the command line."""
    from stickslip.errors import InputError

    given = axis_values(args.file, chosen)
    for text in args.set:
        key, equals, value = text.partition("=")
        if not equals:
            raise InputError(f"--set {text}: write NAME=VALUE")
        given[key] = value
    return given


def compensator_of(args: argparse.Namespace, model: Model) -> Controller | None:
    """A sampled controller that has nothing but the compensator asked for, with what the file knows of its axis."""
    from stickslip.control.compensators.feedback import Feedback
    from stickslip.control.compensators.feedforward import Feedforward
    from stickslip.control.controller import Controller
    from stickslip.control.linear import Gains

    if args.compensator is None:
        return None
    if args.compensator == "recommended":
        return recommended_in(args, model)
    kind = {"ff": Feedforward, "fb": Feedback}[args.compensator]
    time = 1e-3 if args.sample_time is None else args.sample_time
    axis = axis_of(args.file)
    known: dict[str, Any] = {
        "offset": axis.get("offset", 0.0), "inertia_feedforward": axis.get("inertia", 0.0)
    }  # fmt: skip
    given = {n: getattr(args, n) for n in ("substeps", *NUMBERS) if getattr(args, n) is not None}
    return Controller(Gains(kp=0.0), kind(model, **{**known, **given}), sample_time=time)


def recommended_in(args: argparse.Namespace, model: Model) -> Controller:
    """What the file recommends, and nothing beside it that it was not tried with.

    Raises
    ------
    InputError
    """
    from dataclasses import replace

    from stickslip.control.controller import Controller
    from stickslip.control.linear import Gains
    from stickslip.control.recommended import read_recommended
    from stickslip.errors import InputError

    found = read_recommended(args.file)
    for option in NUMBERS:
        if getattr(args, option) is not None:
            raise InputError(
                f"--{option.replace('_', '-')} beside --compensator recommended, which sets it; leave it out, or give "
                "--compensator ff or fb"
            )
    tried, asked = found.sample_time, args.sample_time
    if tried and asked is not None and not math.isclose(tried, asked):
        raise InputError(
            f"--sample-time {asked:g}: {args.file} is recommended for {tried:g} s; leave the option out, or ask "
            "`stickslip recommend` with that sample time"
        )
    if not found.offset:
        found = replace(found, offset=mean_beside(args.file))
    helper = replace(found.on(model), substeps=1 if args.substeps is None else args.substeps)
    return Controller(Gains(kp=0.0), helper, sample_time=tried or asked or 1e-3)


def notes_on(args: argparse.Namespace, job: Job) -> Iterator[str]:
    """What the user must know of a compensator beside what the target says, and of what is not in the export."""
    from stickslip.config import read_toml
    from stickslip.control.recommended import read_recommended
    from stickslip.export._c_control import given_by

    whole = read_toml(args.file)
    if not args.controller and args.compensator != "recommended" and whole.has("recommended"):
        yield (
            f"{args.file} recommends {in_words(read_recommended(args.file))}: that is not in this export; "
            "`--to c99 --compensator recommended` (or `--to arduino`) writes it"
        )
    if not args.controller:
        yield from beside_friction(args.file, job)
    if job.controller is None or args.compensator is None:
        return
    time = job.controller.sample_time
    yield f"it gives {given_by(job.controller)}"
    if time > SLOW:
        yield (
            f"a sample time of {time:g} s compensates a reversal up to {time:g} s late, and a loop bears it up to some "
            f"{0.1 / time:.2g} Hz only; give --sample-time in seconds"
        )
    if args.compensator == "recommended":
        found = read_recommended(args.file)
        what = "the loop of" if found.gains else f"a PD of {found.bandwidth:.4g} Hz:"
        gains = ", ".join(f"{k} {v:.5g}" for k, v in found.linear._asdict().items() if v or k == "feed")
        yield f"it was tried beside {what} {gains}; the linear controller is not in the export"
        if whole.has("angle"):
            yield (
                "what the file knows of the angle ([angle]) is not in the export but for the mean of the torque beside "
                "friction: `stickslip rig run track` runs it"
            )


def around_of(chosen: Target, job: Job) -> Iterator[str]:
    """Where the target finds what the law depends on."""
    from stickslip.export._nearest import read_by

    if (read := read_by(job.model)) and chosen.around:
        yield f"friction depends on {read}: {chosen.around}"


def in_words(found: Recommended) -> str:
    """What a file recommends, with its numbers."""
    units = {
        "lead": " s",
        "deadband": " rad/s",
        "filter": " Hz",
        "offset": " N·m",
        "inertia_feedforward": " kg·m²",
    }
    more = [
        f", {k.replace('_', ' ')} {getattr(found, k):.4g}{u}" for k, u in units.items() if getattr(found, k)
    ]
    return f"{found.compensator} with gain {found.gain:.4g}{''.join(more)}"


def beside_friction(file: Path, job: Job) -> Iterator[str]:
    """Torques that the file holds beside friction's and that are not in the export."""
    known = axis_of(file)
    offset, gravity = mean_beside(file), known.get("gravity", 0.0)
    helper = job.controller.compensator if job.controller else None
    missing = helper.offset != offset if helper else "offset" not in job.settings
    if offset and missing:
        yield f"the constant torque of {offset:.4g} N·m that acts beside friction is not in the export"
    if gravity and "gravity" not in job.settings:
        yield (
            f"gravity, up to {gravity:.4g} N·m over the angle, acts beside friction and is not in the export: add "
            "gravity sin(q - gravity_angle) of the file's [axis] to the drive's torque"
        )


def store(export: Export, folder: Path, force: bool = False) -> list[str]:
    """Write the files of an export; returns their paths."""
    from stickslip.study.files import prepared_folder, unwritable

    prepared_folder(folder)
    _files.refuse_foreign([folder / name for name in export.files], force)
    written: list[str] = []
    for name, content in export.files.items():
        path = folder / name
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(content if isinstance(content, bytes) else content.encode())
        except OSError as error:
            raise unwritable(path, error) from None
        written.append(str(path))
    _files.written(map(Path, written))
    return written


def report(chosen: Target, notes: list[str], written: list[str]) -> None:
    """Say what was written."""
    print(f"{chosen.title}:")
    for path in written:
        print(f"  {path}")
    for note in notes:
        print(f"note: {note}")
