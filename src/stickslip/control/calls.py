"""The functions that call a controller's laws, written out: `stickslip.control.composition` runs them in a sample."""

from __future__ import annotations

import linecache
from collections.abc import Callable, Mapping
from typing import Any

from stickslip.control.block import ControlBlock

__all__ = ["calls_of"]

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
    text = "\n".join(lines)
    # The translation reads a function's text, as it does that of a file.
    file = f"<controller of {', '.join(f'{part}: {block.law.name}' for part, block in blocks.items())}>"
    linecache.cache[file] = (len(text), None, text.splitlines(keepends=True), file)
    exec(compile(text, file, "exec"), scope)
    return {name: scope[name] for name in (*SUMS, "left_over")}
