"""Analyse records, machines and models: spectrum, repeatability, flexibility, sides, position, stability, attraction.

stickslip analyse spectrum run.npz --mode "elastic mode=335" --plot spectrum.png
stickslip analyse repeatability PID=1.npz PID=2.npz LuGre=3.npz LuGre=4.npz
stickslip analyse flexibility --stiffness 17800,396 --inertia 4.2757e-4 --torque dry=0.2951 --claimed 270,2750
stickslip analyse sides slow.npz fast.npz
stickslip analyse position slow.npz --channel sensor_torque
stickslip analyse stability --rig thesis-dry --linear PD --bandwidth 36 --plot map.png
stickslip analyse attraction gms.toml --plot responses.png
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from stickslip.cli import _files, _reading, _stability

if TYPE_CHECKING:
    from stickslip.core.record import Record

SUMMARY = (
    "analyse records, machines and models: spectrum, repeatability, flexibility, sides, position, stability"
)


def arguments(parser: argparse.ArgumentParser) -> None:
    """One analysis, its records and options."""
    from stickslip.cli import allow_code_argument

    kinds = parser.add_subparsers(dest="analysis", metavar="ANALYSIS", title="analyses", required=True)
    for name, (summary, own, work) in ANALYSES.items():
        sub = kinds.add_parser(name, help=summary, description=f"{summary[0].upper()}{summary[1:]}.")
        own(sub)
        sub.add_argument("--plot", type=Path, metavar="FILE", help="draw into FILE.png, .svg or .pdf")
        _files.force_argument(sub)
        allow_code_argument(sub)
        sub.add_argument("--json", action="store_true", help="print the result as JSON")
        sub.set_defaults(work=work)


def run(args: argparse.Namespace) -> int:
    """Print the result; draw it."""
    from stickslip.core.errors import InputError
    from stickslip.report.plots import FORMATS

    if args.plot and args.plot.suffix not in FORMATS:
        raise InputError(f"--plot {args.plot} must end in one of {', '.join(FORMATS)}")
    if args.plot:
        _files.refuse_foreign([args.plot], args.force)
    args.work(args)
    return 0


# ---- records ---------------------------------------------------------------------------------------------------


def _with_records(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("records", nargs="+", metavar="[NAME=]RECORD", help="records, optionally named")
    _reading.add_arguments(parser)


def _opened(args: argparse.Namespace) -> list[tuple[str, Record]]:
    """Return name and record of every argument; the default name is the file's."""
    out: list[tuple[str, Record]] = []
    for text in args.records:
        name, equals, path = str(text).partition("=")
        path = Path(path if equals else text)
        out.append((name if equals else path.stem, _reading.read_record(path, args)))
    return out


def _show(args: argparse.Namespace, found: Sequence[Any], picture: Callable[[], Any]) -> None:
    """Print lines or JSON, and draw the picture if requested."""
    from stickslip.cli import _output

    if args.json:
        data = [one.as_dict() for one in found]
        _output.print_json(data[0] if len(data) == 1 else data)
    else:
        for one in found:
            print("\n".join(one.lines()))
    if args.plot:
        from stickslip.report.analysis_pictures import draw_analysis

        draw_analysis(picture(), args.plot)
        _files.written([args.plot])
        if not args.json:
            print(f"picture: {args.plot}")


# ---- spectrum ----------------------------------------------------------------------------------------------------


def _spectrum_arguments(parser: argparse.ArgumentParser) -> None:
    _with_records(parser)
    parser.add_argument(
        "--channel", default="position_error", help="channel to analyse (default position_error)"
    )
    parser.add_argument(
        "--mode", action="append", default=[], metavar="NAME=HZ", help="known mode; nearby peaks get its name"
    )  # fmt: skip
    parser.add_argument(
        "--resolution",
        type=float,
        metavar="HZ",
        help="frequency resolution (default: 8 windows over the record)",
    )
    parser.add_argument("--from", dest="start", type=float, default=0.0, metavar="S", help="start time")
    parser.add_argument("--to", dest="end", type=float, default=float("inf"), metavar="S", help="end time")


def _spectrum(args: argparse.Namespace) -> None:
    from stickslip.analyse.spectrum import spectrum
    from stickslip.core.config import named_numbers

    modes = named_numbers(args.mode, "--mode", "Hz", value="HZ")
    found = [
        spectrum(
            record, args.channel, modes=modes, resolution=args.resolution, start=args.start, end=args.end, name=name
        )
        for name, record in _opened(args)
    ]  # fmt: skip

    def picture() -> Any:
        from stickslip.report.analysis_pictures import picture_of_spectra

        return picture_of_spectra(found)

    _show(args, found, picture)


# ---- repeatability ----------------------------------------------------------------------------------------------


def _repeatability_arguments(parser: argparse.ArgumentParser) -> None:
    _with_records(parser)
    parser.add_argument("--channel", default="position", help="channel to analyse (default position)")


def _repeatability(args: argparse.Namespace) -> None:
    from stickslip.analyse.repeatability import repeatability
    from stickslip.analyse.split_runs import pieces

    groups: dict[str, list[Record]] = {}
    for text, (name, record) in zip(args.records, _opened(args), strict=True):
        runs = [piece for _, piece in pieces(name, record)]
        groups.setdefault(name if "=" in text or len(runs) > 1 else "runs", []).extend(runs)
    found = repeatability(groups, args.channel)

    def picture() -> Any:
        from stickslip.report.analysis_pictures import picture_of_repeatability

        return picture_of_repeatability(found)

    _show(args, found, picture)


# ---- flexibility -------------------------------------------------------------------------------------------------


def _flexibility_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--stiffness", default="", metavar="K1,K2", help="spring stiffnesses, motor first, N·m/rad"
    )
    parser.add_argument(
        "--inertia", required=True, metavar="J or J1,J2,J3", help="total inertia or its parts, kg·m²"
    )
    parser.add_argument(
        "--torque",
        action="append",
        default=[],
        metavar="[NAME=]NM",
        help="torque for the static twist; repeatable",
    )
    parser.add_argument(
        "--shaft", action="append", default=[], metavar="D,L,G",
        help="round shaft after the springs of --stiffness: diameter and length (m), shear modulus (Pa); repeatable",
    )  # fmt: skip
    parser.add_argument(
        "--claimed", metavar="F1,F2", help="claimed elastic modes to check, first and second, Hz"
    )


def _flexibility(args: argparse.Namespace) -> None:
    from stickslip.analyse.flexibility import flexibility, shaft_stiffness
    from stickslip.core.config import listed_numbers, named_numbers
    from stickslip.core.errors import InputError

    springs = list(listed_numbers(args.stiffness, "--stiffness", "N·m/rad")) if args.stiffness else []
    for text in args.shaft:
        shaft = listed_numbers(text, "--shaft", "m, m, Pa")
        if len(shaft) != 3:
            raise InputError(
                f"--shaft {text} must be diameter,length,shear modulus, such as 0.012,0.396,77e9"
            )
        springs.append(shaft_stiffness(*shaft))
    if not springs:
        raise InputError("analyse flexibility needs --stiffness K1,K2 or --shaft D,L,G")
    inertias = listed_numbers(args.inertia, "--inertia", "kg·m²")
    found = flexibility(
        springs, sum(inertias),
        torques=named_numbers(args.torque, "--torque", "N·m", value="NM", nameless=True),
        inertias=inertias if len(inertias) > 1 else (),
        claimed=listed_numbers(args.claimed, "--claimed", "Hz") if args.claimed else (),
    )  # fmt: skip

    def picture() -> Any:
        from stickslip.report.analysis_pictures import picture_of_flexibility

        return picture_of_flexibility(found)

    _show(args, [found], picture)


# ---- both sides, position -----------------------------------------------------------------------------------------


def _sides_arguments(parser: argparse.ArgumentParser) -> None:
    _with_records(parser)
    parser.add_argument(
        "--inertia", type=float, default=0.0, metavar="KGM2", help="inertia, if the speed changes (default 0)"
    )


def _sides(args: argparse.Namespace) -> None:
    from stickslip.analyse.motor_vs_sensor import sides

    found = sides(_distinct(_runs(args)), args.inertia)

    def picture() -> Any:
        from stickslip.report.analysis_pictures import picture_of_sides

        return picture_of_sides(found)

    _show(args, [found], picture)


def _runs(args: argparse.Namespace) -> list[tuple[str, Record]]:
    """Return every run of every record."""
    from stickslip.analyse.split_runs import pieces

    return [piece for name, record in _opened(args) for piece in pieces(name, record)]


def _distinct(named: Sequence[tuple[str, Record]]) -> dict[str, Record]:
    """Return records by name; equal names are numbered."""
    names = [name for name, _ in named]
    return {
        name if names.count(name) == 1 else f"{name}-{names[: i + 1].count(name)}": record
        for i, (name, record) in enumerate(named)
    }


def _position_arguments(parser: argparse.ArgumentParser) -> None:
    _with_records(parser)
    parser.add_argument(
        "--channel", action="append", default=[], help="torque channel; repeatable (default motor_torque)"
    )  # fmt: skip
    parser.add_argument(
        "--transient", type=float, default=20.0, metavar="DEG", help="travel left out at the start (default 20)"
    )  # fmt: skip


def _position(args: argparse.Namespace) -> None:
    from math import radians

    from stickslip.analyse.dependence import dependence

    channels = args.channel or ["motor_torque"]
    found = dependence(_distinct(_runs(args)), *channels, transient=radians(args.transient))

    def picture() -> Any:
        from stickslip.report.analysis_pictures import picture_of_dependence

        return picture_of_dependence(found)

    _show(args, [found], picture)


# ---- attraction parameter -----------------------------------------------------------------------------------------


def _attraction_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "model", type=Path, metavar="MODEL.toml", help="GMS law with its elements and sliding curve"
    )
    parser.add_argument(
        "--velocity", type=float, default=5.0, metavar="RAD/S", help="sudden velocity (default 5)"
    )
    parser.add_argument(
        "--rise-time",
        type=float,
        default=1e-3,
        metavar="S",
        help="time in which it is reached (default 0.001)",
    )


def _attraction(args: argparse.Namespace) -> None:
    from stickslip.identification.presliding.attraction import apply_overshoot_rule
    from stickslip.models.model import Model

    found = apply_overshoot_rule(
        Model.from_file(args.model), velocity=args.velocity, rise_time=args.rise_time
    )

    def picture() -> Any:
        from stickslip.report.analysis_pictures import picture_of_overshoot

        return picture_of_overshoot(found)

    _show(args, [found], picture)


Arguments = Callable[[argparse.ArgumentParser], None]
Work = Callable[[argparse.Namespace], None]
ANALYSES: dict[str, tuple[str, Arguments, Work]] = {
    "spectrum": ("power spectral density of an oscillating run, and excited modes",
                 _spectrum_arguments, _spectrum),
    "repeatability": ("differences between repeated runs, per controller", _repeatability_arguments, _repeatability),
    "flexibility": ("static twist, modes, and bounds of the first mode",
                    _flexibility_arguments, _flexibility),
    "sides": ("motor torque against sensor torque: bearing friction", _sides_arguments, _sides),
    "stability": ("stability of feedback compensation: margins over gain, sample time, filter",
                  _stability.arguments, lambda args: _stability.work(args, _show)),
    "attraction": ("attraction parameter C of GMS: first response to a sudden velocity without overshoot",
                   _attraction_arguments, _attraction),
    "position": ("torque against position and time while the axis slides", _position_arguments, _position),
}  # fmt: skip
