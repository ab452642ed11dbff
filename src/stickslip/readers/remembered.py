"""Numbers of a machine in a profile: which of them a file requires, and where they come from.

A profile without --profile is found by the names of the columns, which do not identify the machine. The meaning of a
column is valid for the next file; a rated torque, a lead or a gear ratio is valid for the file for which it was given.
Another file gets only the numbers without which its columns cannot be read, each with a warning.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from stickslip.core.errors import InputError
from stickslip.core.finding import Finding
from stickslip.core.messages import name_option, name_options
from stickslip.core.record import Record
from stickslip.readers._choose import Choice, choose, meant, parse_mapping
from stickslip.readers._units import parse_unit
from stickslip.readers.convert import EFFORT, MOTION, Drive, is_linear, unit_of
from stickslip.readers.profiles import PUTS_OUT, STATEMENTS, Profile, Statement, sizes
from stickslip.readers.table_columns import Table

UNITS = {
    "rated_torque": ("N·m", "NM"), "rated_current": ("A", "A"), "torque_constant": ("N·m/A", "NM_PER_A"),
    "force_constant": ("N/A", "N_PER_A"), "lead": ("mm", "MM"), "sample_time": ("s", "S"), "gear_ratio": ("", "N"),
    "counts_per_rev": ("", "N"), "pole_pairs": ("", "N"), "side": ("", "motor"),
}  # fmt: skip
"""Unit in messages, and the placeholder of the option's value in the help."""
BEHIND = {
    "speed": ("counts_per_rev", "pole_pairs", "gear_ratio", "lead"),
    "torque": ("torque_constant", "force_constant", "rated_torque", "rated_current", "gear_ratio", "lead"),
}
"""Numbers of the drive that scale a signal."""
OTHER = 4.0
"""Ratio of sizes, or its inverse, above which the numbers are questioned."""
FORGET = "delete that file to forget it"
CODES = ("saved-numbers", "profile-misfit", "profile", "profile-idle")
"""Codes of findings about a saved profile."""

Picked = Mapping[str, tuple[Any, Statement]]
"""Values and origins of numbers, by name."""


@dataclass(frozen=True, slots=True)
class Recalled:
    """Effect of an automatically found profile on a file.

    Attributes
    ----------
    profile : Profile
        The mapping of columns, and the numbers that are used.
    own : mapping
        Numbers given for this file.
    foreign : mapping
        Numbers given for another file.
    idle : mapping
        Numbers that are stored but not used.
    """

    profile: Profile
    own: Picked
    foreign: Picked
    idle: Picked


def recall(
    kept: Profile, table: Table, mapping: Sequence[str], said: Drive, given: Iterable[str], digest: str
) -> Recalled:
    """Return the effect of a profile on a table.

    Parameters
    ----------
    kept : Profile
    table : Table
    mapping : sequence of str
        The current mapping.
    said : Drive
        The current numbers.
    given : iterable of str
        Their names, `sample_time` and `side` among them.
    digest : str
        SHA-256 of the file.
    """
    now = set(given)
    now |= {name for said_now in tuple(now) for name in PUTS_OUT.get(said_now, ())}
    picked = {n: x for n, x in _latest(kept.said, digest).items() if n not in now}
    choices, _ = choose(table, {**meant(table, kept.mapping), **meant(table, parse_mapping(mapping))})
    known = said.known() | {n: x for n, (x, _) in picked.items()}
    needs = needed(choices, table, known)
    if "lead" in needs and "lead" in picked and "gear_ratio" in picked:
        needs |= {"gear_ratio"} if picked["gear_ratio"][1] is picked["lead"][1] else set[str]()
    used = {n: x for n, x in picked.items() if n in needs}
    numbers = {n: x for n, (x, _) in used.items()}
    period = numbers.pop("sample_time", None)
    own = {n: x for n, x in used.items() if x[1].sha256 == digest}
    return Recalled(
        Profile(kept.mapping, Drive(**numbers), period), own, {n: x for n, x in used.items() if n not in own},
        {n: x for n, x in picked.items() if n not in used},
    )  # fmt: skip


def _latest(statements: Sequence[Statement], digest: str) -> dict[str, tuple[Any, Statement]]:
    """Return the latest value of every number; those of the file itself have priority."""
    own = [s for s in statements if digest and s.sha256 == digest]
    out: dict[str, tuple[Any, Statement]] = {}
    for statement in (*own, *(s for s in reversed(statements) if s not in own)):
        out_of_place = {n for name in out for n in PUTS_OUT.get(name, ())}
        new = {n: x for n, x in statement.numbers().items() if n not in out and n not in out_of_place}
        out |= {n: (x, statement) for n, x in new.items()}
    return out


def needed(choices: Sequence[Choice], table: Table, known: Mapping[str, Any]) -> set[str]:
    """Return the numbers that are required to read the columns.

    Parameters
    ----------
    choices : sequence of Choice
    table : Table
    known : mapping
        Known numbers, by name.
    """
    linear = is_linear({c.role: c for c in choices})
    kinds = {c.role: unit_of(c, linear).kind for c in choices}
    out: set[str] = set()
    if {"counts", "count rate"} & set(kinds.values()):
        out.add("counts_per_rev")
    if "electrical speed" in kinds.values():
        out.add("pole_pairs")
    if "share" in (kinds.get("motor_torque"), kinds.get("compensation_torque")):
        out.add("rated_torque")
    if "share" in (kinds.get("current"), kinds.get("current_reference")):
        out.add("rated_current")
    if "motor_torque" not in kinds:  # a current gives a torque, and a voltage drives a motor with it
        out |= {"torque_constant", "force_constant"}
    if any(c.side == "load" for c in choices if c.role in (*MOTION, *EFFORT)):
        out |= {"gear_ratio", "side"}
    motion = {_shape(kinds[r]) for r in MOTION if r in kinds}
    effort = {_shape(kinds[r]) for r in EFFORT if r in kinds}
    if "motor_torque" not in kinds and "current" in kinds and "torque_constant" in known:
        effort.add("turning")
    if {"turning", "along"} <= motion | effort:
        out.add("lead")
    timed = any(c.role == "time" and parse_unit(c.unit) is not None for c in choices)
    if not timed and all(c.clock is None for c in table.columns):
        out.add("sample_time")
    return out


def _shape(kind: str) -> str:
    """Return whether a quantity is rotary or linear."""
    return "along" if kind in ("length", "velocity", "acceleration", "force") else "turning"


def digest_of_file(path: Path) -> str:
    """Return the SHA-256 of a file; empty for a folder."""
    return hashlib.sha256(path.read_bytes()).hexdigest() if path.is_file() else ""


# ---- what is kept ---------------------------------------------------------------------------------------------


def kept_now(
    kept: Profile | None, record: Record, mapping: Sequence[str], said: Drive, period: float | None, path: Path,
    digest: str,
) -> Profile:  # fmt: skip
    """Return the profile with the numbers given for this file."""
    before = kept or Profile({}, Drive())
    columns: list[dict[str, Any]] = record.meta["reading"]["columns"]
    # A unit that followed from a number of the drive belongs to the column.
    told = {c["channel"]: f"{c['column']}:{c['unit']}" for c in columns if c["source"] == "drive"}
    meanings = {**before.mapping, **told, **parse_mapping(mapping)}
    new = Statement(said, period)
    if not new.numbers():
        return Profile(meanings, Drive(), None, before.said)
    own = next((s for s in before.said if s.sha256 == digest), Statement(Drive()))
    out = {n for name in new.numbers() for n in PUTS_OUT.get(name, ())}
    numbers = {n: x for n, x in own.numbers().items() if n not in out} | new.numbers()
    latest = numbers.pop("sample_time", None)
    statement = Statement(
        Drive(**numbers), latest, str(path), digest, datetime.now(UTC).date().isoformat(), sizes(record)
    )
    others = [s for s in before.said if s.sha256 != digest]
    return Profile(meanings, Drive(), None, (*others, statement)[-STATEMENTS:])


# ---- what is said of it ---------------------------------------------------------------------------------------


def findings_of(path: Path, recalled: Recalled, mapping: Sequence[str], record: Record) -> list[Finding]:
    """Return findings about the effect of the profile at `path`, in addition to the current mapping."""
    out = [*_foreign(recalled.foreign), *_misfits(recalled.foreign, record)]
    if words := _applied(path, recalled.profile.mapping, recalled.own, mapping):
        out.append(Finding("note", "profile", words, remedy=FORGET))
    for origin, names in _by_origin(recalled.idle):
        listed, options = _listed(recalled.idle, names), _options(recalled.idle, names)
        words = f"{listed} ({_where(origin)}) is kept and not used: the columns can be read without"
        out.append(
            Finding("note", "profile-idle", words, remedy=f"give {options}, if it holds for this axis")
        )
    return out


def blamed(
    error: InputError, path: Path, kept: Profile, recalled: Recalled | None, mapping: Sequence[str]
) -> InputError:
    """Return the error of a file, which names the profile at `path` if that had an effect."""
    numbers = {**recalled.own, **recalled.foreign} if recalled else {}
    words = _applied(path, kept.mapping, numbers, mapping)
    return InputError(f"{error}; the file was {words}: {FORGET}") if words else error


def _applied(path: Path, meanings: Mapping[str, str], numbers: Picked, mapping: Sequence[str]) -> str:
    """Return the effect of a profile in addition to the current mapping, as text; empty if there is none."""
    said = parse_mapping(mapping)
    more = [_meaning(role, text) for role, text in meanings.items() if role not in said]
    more += [f"{name} = {x}" for name, (x, _) in numbers.items()]
    return f"read by the saved profile {path}, which says {', '.join(more)}" if more else ""


def _meaning(role: str, text: str) -> str:
    """Return the meaning of a channel, and whether its sign is inverted."""
    turned = ":" in text and text.rsplit(":", 1)[1].lstrip().startswith("-")
    return f"{role}={text}" + (" (the sign turned)" if turned else "")


def _foreign(foreign: Picked) -> list[Finding]:
    out: list[Finding] = []
    for origin, names in _by_origin(foreign):
        listed, options = _listed(foreign, names), _options(foreign, names)
        message = (
            f"{listed}: not said for this file, but {_where(origin)}, whose columns have the same names; another axis "
            "has others"
        )
        open_values = name_options(**{n: UNITS[n][1] for n in names})
        remedy = f"give this axis's own with {open_values}, or {options} if these are its own"
        out.append(Finding("warning", "saved-numbers", message, remedy=remedy))
    return out


def _misfits(foreign: Picked, record: Record) -> list[Finding]:
    """Return a warning if the record has another size than that for which the numbers were given."""
    out: list[Finding] = []
    now = sizes(record)
    for origin, names in _by_origin(foreign):
        for key, before in origin.seen.items():
            brought = [n for n in names if n in BEHIND[key]]
            if key not in now or not brought or 1.0 / OTHER < now[key] / before < OTHER:
                continue
            unit = record.units["motor_torque"] if key == "torque" else f"{record.units['position']}/s"
            said = " and ".join(f"{name} = {foreign[name][0]:g}" for name in brought)
            message = (
                f"the saved profile was written for a record of {before:.3g} {unit} of {key}, this one has "
                f"{now[key]:.3g}: does {said} hold for this machine?"
            )
            remedy = (
                f"if not, give {' or '.join(name_option(n) for n in brought)}; with "
                f"{name_option('profile', 'FILE.toml')} a machine has a "
                "profile of its own"
            )
            out.append(Finding("warning", "profile-misfit", message, remedy=remedy))
    return out


def _by_origin(picked: Picked) -> list[tuple[Statement, list[str]]]:
    """Group names by their statement."""
    out: list[tuple[Statement, list[str]]] = []
    for name, (_, origin) in picked.items():
        found = next((names for known, names in out if known is origin), None)
        if found is None:
            out.append((origin, [name]))
        else:
            found.append(name)
    return out


def _where(origin: Statement) -> str:
    return f"for {origin.file} on {origin.date}" if origin.file else "for a file that is not known"


def _shown(name: str, value: Any) -> str:
    """Return the value in the unit of its option: the lead in mm."""
    if isinstance(value, str):
        return value
    shown = 1e3 * value if name == "lead" else value
    return f"{shown:.10g}" if math.isfinite(shown) else str(shown)


def _listed(picked: Picked, names: Sequence[str]) -> str:
    return ", ".join(f"{n} = {_shown(n, picked[n][0])} {UNITS[n][0]}".rstrip() for n in names)


def _options(picked: Picked, names: Sequence[str]) -> str:
    return name_options(**{n: _shown(n, picked[n][0]) for n in names})
