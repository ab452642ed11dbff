"""The sampled controller in C: its functions, their values, and golden samples.

Single precision loses the low digits of a large angle. There `NAME_sample` takes positions in double precision, splits
off parts of turns that a single number holds exactly, and leaves the rest to `NAME_sample_turns`, whose differences are
then as exact at a thousand turns as at none. Where `double` is no wider (AVR), `NAME_sample_turns` is the one to call.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from typing import Any

import numpy as np

from stickslip.control.controller import Controller
from stickslip.control.sampled import Memory, Settings, functions_by, settings
from stickslip.export._analysis import Facts
from stickslip.export._c import Dialect, head
from stickslip.export._text import ascii_only
from stickslip.export.golden import Samples
from stickslip.export.job import Job
from stickslip.spec import fields_of
from stickslip.subset import Layout

__all__ = ["LAYOUTS", "PUBLIC", "compensates_alone", "entries_of", "given_by", "rows_of", "wide"]

PUBLIC = ("_sample", "_sample_turns", "_follow", "_follow_turns")
LAYOUTS = {
    "n": Layout.of(fields_of(Settings), counted=False),
    "m": Layout.of(fields_of(Memory), counted=False),
}
NARROW = "float turns, float position, float wanted_turns, float wanted, "
ABOUT = {
    "_sample": "One sample; positions in double precision, so that their difference is rounded and not they.",
    "_follow": "Watch one sample while another has the axis with `torque`, N*m; positions in double precision.",
}


def entries_of(job: Job) -> dict[str, Callable[..., float]]:
    """The functions that are translated, by their names in C."""
    if job.controller is None:
        return {}
    law = job.model.law if job.controller.compensator else None
    found = functions_by(law)
    # In single precision the ones with whole positions are `wide`.
    return {name: found[name[1:]] for name in PUBLIC if name.endswith("_turns") or not job.single}


def wide(known: Mapping[str, Facts], dialect: Dialect) -> Iterable[Mapping[str, Any]]:
    """In single precision: the functions that take positions in double precision."""
    for name, about in ABOUT.items():
        inner = f"{name}_turns"
        if not dialect.single or inner not in known:
            continue
        given = ", ".join(known[inner].arguments[4:])
        own = head(inner, known[inner], dialect).replace(
            f"{inner}({NARROW}", f"{name}(double position, double wanted, "
        )
        yield {"about": ascii_only(about), "head": own, "call": f"{dialect.prefix}{inner}", "given": given}


def compensates_alone(controller: Controller) -> bool:
    """Whether it has no loop of its own: its torque belongs to that of another controller."""
    return not any(controller.linear)


def given_by(controller: Controller) -> str:
    """What its torque is made of, for people."""
    helper, n = controller.compensator, settings(controller)
    parts = [] if compensates_alone(controller) else ["the linear controller's torque"]
    if helper:
        velocity = "reference's velocity" if helper.velocity == "reference" else "measured velocity"
        parts += [f"{n.gain:.6g} times the law's torque at the {velocity}"]
        parts += [f"the constant torque `offset` = {n.offset:.6g} N·m"] if n.offset else []
        parts += (
            [f"`inertia` = {n.inertia:.6g} kg·m² times the reference's acceleration"] if n.inertia else []
        )
        parts += [] if n.offset else ["no constant torque (`offset` is 0)"]
        parts += [] if n.inertia else ["nothing for the inertia (`inertia` is 0)"]
    parts += [f"within ±{n.torque_limit:.6g} N·m"] if math.isfinite(n.torque_limit) else []
    return ", ".join(parts) or "nothing"


def rows_of(samples: Samples) -> list[str]:
    """Golden samples as initializers of C."""
    return [", ".join("(double)NAN" if np.isnan(x) else repr(float(x)) for x in row) for row in zip(*samples)]
