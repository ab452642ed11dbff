"""Tasks of a worker on rigs: inspect an uploaded file, plan a procedure, and run it.

A rig is a machine of the library, which is simulated, or the ``rig.toml`` of an item of the project; code that such a
file names runs only if this user has approved it.
"""

from __future__ import annotations

import os
import tomllib
from collections.abc import Callable, Generator, Mapping
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import Any, cast

from stickslip.core.errors import InputError
from stickslip.rigs.rig import LIMIT_UNITS, Limits, Rig
from stickslip.web.worker import Said

Request = Mapping[str, Any]
MAIN = "rig.toml"


def described(path: Path) -> dict[str, Any]:
    """Return the description of a rig's file for the page, before anything is connected.

    Raises
    ------
    InputError
        If it is not a rig, or one that the page does not support.
    CodeRefused
        If it names code that is not approved.
    """
    rig = rig_at(path)
    table = tomllib.loads(path.read_text(encoding="utf-8"))["rig"]
    kind, limits = str(table["kind"]), rig.limits.plain()
    bus = cast("dict[str, Any]", table["bus"]) if isinstance(table.get("bus"), dict) else {}
    where = " ".join(str(bus[k]) for k in ("interface", "channel") if k in bus)
    facts = [
        f"kind {kind}", rig.name, *([f"bus {where}"] if where else []),
        f"at most {within(rig.limits)}", f"torque to zero within {rig.limits.stop_time:g} s",
    ]  # fmt: skip
    return {
        "state": "ready", "rig": rig.name, "rig_kind": kind, "facts": facts, "limits": limits,
        "real": kind not in ("virtual", "replay"),
        "sentence": sentence(kind, rig, where),
    }  # fmt: skip


def within(limits: Limits) -> str:
    """Return the finite limits as text."""
    said = [(limits.text(name), LIMIT_UNITS[name], name) for name in ("torque", "speed")]
    low, high = limits.position
    if low > -float("inf") or high < float("inf"):
        said.append((limits.text("position"), "rad", "position"))
    said += [
        (limits.text(name), LIMIT_UNITS[name], name)
        for name in ("temperature", "following error")
        if limits.text(name) != "inf"
    ]
    return ", ".join(
        f"{value} {unit}" + ("" if name in ("torque", "speed") else f" ({name})")
        for value, unit, name in said
    )


def sentence(kind: str, rig: Rig, where: str) -> str:
    """Return the statement to confirm before a rig is armed; empty for a simulated one."""
    if kind == "virtual":
        return ""
    if kind == "replay":
        return f"This replays a record: {rig.name} moves nothing and ignores commands"
    named = f"{rig.name} on {where}" if where else rig.name
    most = f"{rig.limits.torque:g} N·m and {rig.limits.speed:g} rad/s"
    return f"This moves a real machine: {named}, with up to {most}; its emergency stop is at hand"


def rig_at(path: Path) -> Rig:
    """Return the rig of a file, not yet open; messages use plain names of the files in its folder.

    Raises
    ------
    InputError, CodeRefused
    """
    from stickslip.rigs.files import read_rig

    with plainly(path.parent):
        rig = read_rig(path)
        if rig.capabilities.watchdog is None:
            raise InputError(
                f"{rig.name} declares no watchdog: nothing would remove its torque if this process died; give it "
                "one (the page arms no rig without)"
            )
    return rig


@contextmanager
def plainly(folder: Path) -> Generator[None]:
    """Shorten paths in the folder to names in error messages."""
    try:
        yield
    except InputError as error:
        error.args = (str(error).replace(f"{folder}{os.sep}", ""), *error.args[1:])
        raise


def rig_plan(request: Request, say: Said) -> dict[str, Any]:
    """Return the plan of a procedure on a rig; nothing moves."""
    from stickslip.rigs.procedures.base import planned

    chosen, rig = procedure_on(request)
    plan = planned(chosen, rig)
    plan.within(rig)
    return {
        "text": list(plan.text), "duration": plan.duration, "pauses": plan.pauses, "travel": plan.travel,
        "speed": plan.speed, "torque": plan.torque, "limits": rig.limits.plain(), "rig": rig.name, **facts_of(request),
    }  # fmt: skip


def facts_of(request: Request) -> dict[str, Any]:
    """Return the facts in the file of a rig, and the sentence to confirm; both empty for a machine of the library."""
    file = str(request["rig"])
    if not file:
        return {"facts": [], "sentence": ""}
    said = described(Path(file))
    return {key: said[key] for key in ("facts", "sentence")}


def rig_run(request: Request, say: Said) -> dict[str, Any]:
    """Perform a procedure in real time; every sample is streamed immediately."""
    from stickslip.rigs.procedures.base import perform

    folder = Path(request["folder"])
    if facts_of(request)["sentence"] != request["understood"]:
        raise InputError("the file of the rig has changed since it was planned; plan again")
    chosen, rig = procedure_on(request)
    say({"tell": "preparing: nothing moves yet"})
    stream = folder / "live.stream"
    done = perform(chosen, rig, path=stream, progress=lambda label: say({"tell": label}), realtime=True)
    done.record.save(folder / "upload.npz")
    return {"passed": done.passed, "checks": [asdict(c) for c in done.checks]}


def procedure_on(request: Request) -> tuple[Any, Rig]:
    """Return the procedure with its options, and the rig."""
    from stickslip.rigs.procedures import procedure
    from stickslip.rigs.virtual import virtual_rig

    file = str(request["rig"])
    rig = rig_at(Path(file)) if file else virtual_rig(request["machine"])
    return procedure(request["procedure"]).with_options(request["options"]), rig


RIG_TASKS: dict[str, Callable[[Request, Said], dict[str, Any]]] = {"rig_plan": rig_plan, "rig_run": rig_run}
