"""The functions that call a controller's laws, written out: `stickslip.control.composition` runs them in a sample."""

from __future__ import annotations

import linecache
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from stickslip.control.block import ControlBlock

SUMS = {
    "estimate": ("estimator", "sample", "Velocity by the estimator, rad/s."),
    "feedforwards": ("feedforward", "sample", "Torque of the feedforwards, N·m."),
    "accelerations": (
        "feedforward", "accelerating", "The part of the feedforwards that accelerates the nominal inertia, N·m.",
    ),
    "observers": ("observer", "sample", "Torque of the observers, N·m."),
    "loops": ("loop", "sample", "Torque of the control loop, N·m."),
}  # fmt: skip


def calls_of(blocks: Mapping[str, ControlBlock]) -> dict[str, Callable[..., float]]:
    """The functions of `SUMS` and `left_over` of these laws."""
    lines: list[str] = []
    scope: dict[str, Any] = {}
    for name, (place, function, about) in SUMS.items():
        parts = [
            part
            for part, block in blocks.items()
            if block.law.place == place and getattr(block.law, function) is not None
        ]
        calls = [f"{part}_{function}(m, z.{part}, p.{part}, u)" for part in parts]
        # One call a line: languages that pass structures by value have no other place for it.
        lines += [
            f"def {name}(m, z, p, u):",
            f'    """{about}"""',
            f"    torque = {calls[0] if calls else '0.0'}",
        ]
        lines += [*(f"    torque += {call}" for call in calls[1:]), "    return torque", ""]
        scope |= {f"{part}_{function}": blocks[part].function(function) for part in parts}
    able = [part for part, block in blocks.items() if block.law.take_over]
    scope |= {f"{part}_take_over": blocks[part].function("take_over") for part in able}
    lines += [
        "def left_over(missing, m, z, p, u):",
        '    """What they cannot take over of a missing torque, N·m."""',
    ]
    lines += [f"    missing = {part}_take_over(missing, m, z.{part}, p.{part}, u)" for part in able]
    lines += ["    return missing", ""]
    written(lines, scope, f"controller of {named(blocks)}")
    return {name: scope[name] for name in (*SUMS, "left_over")}


def deviations_of(blocks: Mapping[str, ControlBlock]) -> dict[str, Callable[..., float]]:
    """Standard deviations of what these laws learn, by its whole names."""
    lines: list[str] = []
    scope: dict[str, Any] = {}
    own = {f"{part}_{name}": (part, f) for part, b in blocks.items() for name, f in b.law.deviations.items()}
    for name, (part, function) in own.items():
        about = (function.__doc__ or "").partition("\n")[0]
        lines += [
            f"def {name}_deviation(n, z, p):",
            f'    """{about}"""',
            f"    return {part}_{function.__name__}(z.{part}, p.{part}, n.sample_time)",
            "",
        ]
        scope[f"{part}_{function.__name__}"] = function
    written(lines, scope, f"deviations of {named(blocks)}")
    return {name: scope[f"{name}_deviation"] for name in own}


def named(blocks: Mapping[str, ControlBlock]) -> str:
    """The laws by their parts, for the name of a text."""
    return ", ".join(f"{part}: {block.law.name}" for part, block in blocks.items())


def written(lines: Sequence[str], scope: dict[str, Any], about: str) -> None:
    """Run a text; the translation reads it again, as it does that of a file."""
    text, file = "\n".join(lines), f"<{about}>"
    linecache.cache[file] = (len(text), None, text.splitlines(keepends=True), file)
    exec(compile(text, file, "exec"), scope)
