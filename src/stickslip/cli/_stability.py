"""`stickslip analyse stability`: options and output."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from stickslip.analyse.stability_result import Stability
    from stickslip.control.linear import Gains
    from stickslip.machines.machine import Machine
    from stickslip.models.model import Model
    from stickslip.studies.stability_map import Confirmed


def arguments(parser: argparse.ArgumentParser) -> None:
    """Machine, linear controller, drive."""
    parser.add_argument(
        "--rig", required=True, metavar="MACHINE", help="machine: name from the library, or TOML file"
    )
    parser.add_argument(
        "--without", default="", metavar="NAMES", help="imperfections to switch off, comma-separated"
    )
    parser.add_argument(
        "--controller",
        metavar="FILE.toml",
        help="controller made of control laws, from a table [controller]",
    )
    parser.add_argument(
        "--linear", choices=("PR", "PD", "PID"), default="PD", help="linear controller (default PD)"
    )
    for option, default, unit, what in (
        ("--bandwidth", 36.0, "HZ", "bandwidth of the placed poles"),
        ("--damping", 1.0, "D", "damping of the placed poles"),
    ):
        parser.add_argument(
            option, type=float, default=default, metavar=unit, help=f"{what} (default {default:g})"
        )
    parser.add_argument(
        "--inertia",
        type=float,
        metavar="KGM2",
        help="inertia used for pole placement (default: the machine's)",
    )
    parser.add_argument("--sample-time", type=float, metavar="S", help="sample time (default: the machine's)")
    parser.add_argument(
        "--delay", type=float, metavar="SAMPLES", help="torque delay in samples (default: the machine's)"
    )
    parser.add_argument("--filter", action="append", type=float, default=[], metavar="HZ",
                        help="low-pass on the compensators' velocity; repeatable; 0: none (default 0, 10)")  # fmt: skip
    parser.add_argument("--amplitude", type=float, default=0.0, metavar="RAD",
                        help="amplitude of the motion at the encoder (default one count, or unrest)")  # fmt: skip
    parser.add_argument(
        "--confirm",
        action="store_true",
        help="check the result by simulation on the virtual rig (of a controller: with its loop gains scaled, too)",
    )
    parser.add_argument("--law", action="append", default=[], metavar="NAME",
                        help="law among the machine's models (default all)")  # fmt: skip


def work(
    args: argparse.Namespace, show: Callable[[argparse.Namespace, list[Any], Callable[[], Any]], None]
) -> None:
    """Compute and print the stability."""
    if args.controller:
        composed(args, show)
        return
    found = computed(args)
    tried: Confirmed | None = None
    if args.confirm:
        from stickslip.studies.stability_map import confirmed

        plant, gains, models = described(args)
        tried = confirmed(plant, gains, models, found.recommended, drawn=args.plot is not None)

    def picture() -> Any:
        from stickslip.report.stability_pictures import picture_of_confirmed, picture_of_stability

        return picture_of_confirmed(tried) if tried else picture_of_stability(found)

    show(args, [found, tried] if tried else [found], picture)


BESIDE: dict[str, Any] = {
    "linear": "PD", "bandwidth": 36.0, "damping": 1.0, "sample_time": None, "filter": [], "law": [],
}  # fmt: skip
"""Options of a linear controller and its compensators, with defaults."""


def composed(
    args: argparse.Namespace, show: Callable[[argparse.Namespace, list[Any], Callable[[], Any]], None]
) -> None:
    """Compute and print the stability of a controller made of control laws."""
    from stickslip.analyse.controller_margins import controller_stability
    from stickslip.analyse.machine_axis import axis_of
    from stickslip.control.files import read_controller
    from stickslip.core.errors import InputError

    for name, usual in BESIDE.items():
        if getattr(args, name) != usual:
            raise InputError(
                f"--{name.replace('_', '-')} cannot be combined with --controller {args.controller}, which defines it; "
                "leave it out"
            )
    plant = machine_of(args)
    controller = read_controller(
        args.controller,
        plant.inertia if args.inertia is None else args.inertia,
        plant.models,
        plant.sample_time,
    )
    delay = plant.delay if args.delay is None else args.delay
    if args.confirm and args.delay is not None:
        raise InputError("--confirm runs the machine with its own delay; leave --delay out")
    amplitude, tried = args.amplitude, None
    if args.confirm:
        from stickslip.studies.controller_confirmed import confirmed_controller

        tried = confirmed_controller(plant, controller)
        amplitude = amplitude or tried.amplitude  # the poles apply to the motion that is confirmed
    found = controller_stability(axis_of(plant, amplitude), controller, delay)
    results: list[Any] = [found, tried] if tried else [found]

    def picture() -> Any:
        from stickslip.report.stability_pictures import picture_of_controller

        return picture_of_controller(found)

    show(args, results, picture)


def machine_of(args: argparse.Namespace) -> Machine:
    """Return the machine without the imperfections switched off."""
    from stickslip.core.errors import InputError
    from stickslip.machines.files import machine

    if args.amplitude < 0.0 or any(f < 0.0 for f in args.filter):
        raise InputError("--amplitude and --filter must be 0 or greater")
    return machine(args.rig).without(*(n.strip() for n in args.without.split(",") if n.strip()))


def described(args: argparse.Namespace) -> tuple[Machine, Gains, dict[str, Model]]:
    """Return the machine, the linear controller and the compensators' laws of the options."""
    from stickslip.control.linear import place
    from stickslip.core.errors import InputError

    plant = machine_of(args)
    inertia = plant.inertia if args.inertia is None else args.inertia
    if args.confirm and (args.sample_time is not None or args.delay is not None):
        raise InputError(
            "--confirm runs the machine with its own sample time and delay; leave the options out"
        )
    gains = place(args.linear, inertia, args.bandwidth, args.damping)
    return plant, gains, {name: plant.models[name] for name in _chosen(plant, args.law)}


def computed(args: argparse.Namespace) -> Stability:
    """Return the stability for the options."""
    from stickslip.analyse.machine_axis import axis_of
    from stickslip.analyse.presliding_loop import Drive
    from stickslip.analyse.stability import stability
    from stickslip.control.short_form import highest_corner
    from stickslip.core.errors import InputError

    plant, gains, models = described(args)
    drive = Drive(
        gains, sample_time=plant.sample_time if args.sample_time is None else args.sample_time,
        delay=plant.delay if args.delay is None else args.delay,
    )  # fmt: skip
    highest = highest_corner(drive.sample_time)
    if any(corner > highest for corner in args.filter):
        raise InputError(
            f"--filter {max(args.filter):g}: a sample time of {drive.sample_time:g} s allows at most {highest:g} Hz"
        )
    return stability(axis_of(plant, args.amplitude), drive, models, args.filter or (0.0, 10.0))


def _chosen(plant: Machine, names: list[str]) -> list[str]:
    from stickslip.core.errors import InputError, UnknownName

    for name in names:
        if name not in plant.models:
            raise UnknownName("model of this machine", name, plant.models)
    if not plant.models:
        raise InputError(
            f"machine {plant.name}: no [models.NAME]; give it the laws that its compensators run"
        )
    return names or list(plant.models)
