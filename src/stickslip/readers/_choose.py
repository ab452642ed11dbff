"""Assign columns to channels: by the user's mapping, then a profile, then names and units."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from stickslip.core.errors import InputError, suggestion
from stickslip.core.finding import Finding
from stickslip.core.messages import name_columns, name_option
from stickslip.readers._joints import MAIN, Joints, listed_names, with_rates
from stickslip.readers._names import ALIASES, KINDS, ROLES, Name, motor_force, role_of, words
from stickslip.readers._units import in_its_case, may_be_unit, parse_unit, spellings
from stickslip.readers.table_columns import Column, Table

MOTION = ("position", "velocity")
"""Channels that show whether the axis is rotary or linear."""
DEFINED = 3
"""`Name.sure` of a column whose format defines its channel."""
AMBIGUOUS = {"grad": "is a degree in German and a gradian in English; say deg, or 0.9 deg for gradians"}
"""Units that may occur in a file but are ambiguous in a mapping."""


@dataclass(frozen=True, slots=True)
class Choice:
    """A channel and the column that fills it.

    Attributes
    ----------
    role : str
    column : str
        Its name in the file.
    unit : str
        As written; empty if unknown, and then SI.
    source : {"map", "profile", "file", "name", "drive", "assumed"}
        Source of the unit: the user, a profile, the file, the column name, a number of the drive, or none.
    side : {"", "motor", "load"}
        Side of the gear where it is measured; empty if unknown.
    """

    role: str
    column: str
    unit: str
    source: str
    side: str = ""


def parse_mapping(mapping: Mapping[str, str] | Sequence[str]) -> dict[str, str]:
    """Return columns by channel, from a mapping or from strings like "position=q_deg:deg".

    Raises
    ------
    InputError
        If a string has no "=", a channel is unknown or named twice.
    """
    if isinstance(mapping, str):
        mapping = [mapping]
    pairs: list[tuple[str, str]] = []
    if isinstance(mapping, Mapping):
        pairs += mapping.items()
    else:
        for text in mapping:
            role, equals, column = text.partition("=")
            if not equals or not column.strip():
                raise InputError(
                    f"{name_option('map')} {text!r} must be CHANNEL=COLUMN or CHANNEL=COLUMN:UNIT, such as "
                    "position=q_deg:deg"
                )
            pairs.append((role, column))
    out: dict[str, str] = {}
    for written, column in pairs:
        role = ALIASES.get(written.strip(), written.strip())
        if role not in KINDS:
            raise InputError(
                f"{name_option('map')} names the unknown channel {written!r}; {suggestion(written, [*ROLES, *ALIASES])}"
            )
        if role in out:
            raise InputError(f"{name_option('map')} gives {role} twice; give it once")
        out[role] = column.strip()
    return out


def choose(table: Table, mapping: Mapping[str, str]) -> tuple[list[Choice], list[Finding]]:
    """Assign columns to channels.

    Parameters
    ----------
    table : Table
    mapping : mapping of str to str
        As `parse_mapping` gives it; "none" leaves a channel out.

    Raises
    ------
    InputError
        If the mapping names a column that is not there, or a unit that is none or of the wrong kind.
    """
    mapping = meant(table, mapping)
    chosen = {role: _explicit(table, role, text) for role, text in mapping.items() if text.lower() != "none"}
    taken = {choice.column for choice in chosen.values()}
    names = with_rates(table.columns, {c.name: _name_of(c) for c in table.columns})
    joints = Joints(names)
    findings = joints.take([(role, choice.column) for role, choice in chosen.items()])
    for role in ROLES:
        if role in mapping:
            continue
        candidates = [c for c in table.columns if c.name not in taken and names[c.name].role == role]
        if role == "motor_torque" and not candidates and _along_a_line(chosen):
            forces = {
                c.name: read
                for c in table.columns
                if not c.channel and (read := motor_force(c.name, _unit_of(c)))
            }
            names |= forces
            candidates = [c for c in table.columns if c.name in forces and c.name not in taken]
        candidates, found = joints.of_one_axis(role, candidates)
        findings += found
        column, found = _pick(role, candidates, names, chosen)
        findings += found
        if column is None:
            continue
        if role == "motor_torque" and column.name.upper() == "F_N":
            findings.append(_doubtful(column))
        findings += joints.take([(role, column.name)])
        taken.add(column.name)
        chosen[role] = _guessed(role, column, names[column.name])
    return [chosen[role] for role in ROLES if role in chosen], findings


def meant(table: Table, mapping: Mapping[str, str]) -> dict[str, str]:
    """Return the mapping, in which a torque with a unit of current becomes the current that gives the torque.

    Raises
    ------
    InputError
        If the mapping also names another column as current.
    """
    text = mapping.get("motor_torque", "none")
    if not _is_current(table, text):
        return dict(mapping)
    other = mapping.get("current", text)
    if other not in (text, "none"):
        raise InputError(
            f"{name_columns(torque=text)} is a current, and {name_columns(current=other)} names another; give one of "
            "them"
        )
    return {**mapping, "motor_torque": "none", "current": text}


def _is_current(table: Table, text: str) -> bool:
    """Whether a mapped column has a unit of current: the mapped unit, else its own."""
    text = re.sub(r"@(motor|load)$", "", text)
    column, unit = _find(table, text), ""
    if column is None and ":" in text:
        name, unit = (part.strip() for part in text.rsplit(":", 1))
        column = _find(table, name)
    if column is None:
        return False
    parsed = parse_unit(unit or _unit_of(column) or role_of(column.name).unit)
    return parsed is not None and parsed.kind == "current"


def _explicit(table: Table, role: str, text: str) -> Choice:
    """Return the user's choice: COLUMN or COLUMN:UNIT, with an optional @load or @motor."""
    side = ""
    if text not in _names_of(table) and (match := re.fullmatch(r"(.+)@(motor|load)", text)):
        text, side = match[1], match[2]
    name, unit = text, ""
    if _find(table, text) is None and ":" in text:
        name, unit = (part.strip() for part in text.rsplit(":", 1))
    column = _find(table, name)
    if column is None:
        raise InputError(f"{name_columns(**{role: text})}: {_absent(table, name)}")
    if unit:
        unit = in_its_case(unit, KINDS[role]) or unit
        parsed = None if unit.lower() in AMBIGUOUS else parse_unit(unit)
        if parsed is None or parsed.kind not in KINDS[role]:
            what = "is not a unit that is known" if parsed is None else f"is a unit of {parsed.kind}"
            what = AMBIGUOUS.get(unit.lower(), what)
            driven = role == "motor_torque" and parsed is not None and parsed.kind == "voltage"
            remedy = (
                f"map it as voltage and give {name_option('resistance')} and {name_option('torque_constant')}"
                if driven
                else f"{role} takes {spellings(KINDS[role])}"
            )
            raise InputError(f"{name_columns(**{role: text})}: {unit!r} {what}; {remedy}")
        return Choice(role, column.name, unit, "map", side)
    read = role_of(column.name, _unit_of(column))
    guess = _guessed(role, column, read)
    return Choice(role, column.name, guess.unit, guess.source, side or guess.side)


def _absent(table: Table, name: str) -> str:
    """Return the message that a column is missing or cannot be read."""
    unread = next((n for n in table.unread if n.lower() == name.lower()), None)
    if unread is None:
        return f"the file has no column {name!r}; {suggestion(name, _names_of(table))}"
    held = f", first {table.unread[unread]!r}" if table.unread[unread] else ""
    return (
        f"column {unread!r} holds neither numbers nor a clock that can be read{held}; "
        f"{suggestion('', _names_of(table))}"
    )


def _unit_of(column: Column) -> str:
    """Return the unit that the file states next to the name, if it is valid."""
    return column.unit if may_be_unit(column.unit) else ""


def _name_of(column: Column) -> Name:
    """Return the meaning of a column, by its format, else by its name and unit."""
    read = role_of(column.name, _unit_of(column))
    if not column.channel:
        return read
    channel = "" if column.channel == "none" else column.channel
    return Name(channel, DEFINED, read.unit, read.axis, read.side)


def _along_a_line(chosen: Mapping[str, Choice]) -> bool:
    """Whether the motion found is linear."""
    units = [parse_unit(choice.unit) for role, choice in chosen.items() if role in MOTION]
    kinds = {unit.kind for unit in units if unit is not None}
    return bool(kinds) and kinds <= {"length", "velocity"}


def _doubtful(column: Column) -> Finding:
    """Return the note that F_N may be a force in newtons or a normal force."""
    name = column.name
    return Finding(
        "note",
        "ambiguous-column",
        f"column {name!r} was taken as the motor's force in N; it may be a normal force",
        remedy=f"if it is, say {name_columns(torque='none', load=f'{name}:N')}",
    )


def _find(table: Table, name: str) -> Column | None:
    """Return the column of a name, ignoring case."""
    exact = [c for c in table.columns if c.name == name]
    found = exact or [c for c in table.columns if c.name.lower() == name.lower()]
    return found[0] if found else None


def _names_of(table: Table) -> list[str]:
    return [c.name for c in table.columns]


def _guessed(role: str, column: Column, name: Name) -> Choice:
    """Return a choice with the unit from the file or the name, if it suits the channel."""
    unit, source = (column.unit, "file") if may_be_unit(column.unit) else (name.unit, "name")
    unit = in_its_case(unit, KINDS[role])
    return Choice(role, column.name, unit, source if unit else "assumed", name.side)


def _pick(
    role: str, candidates: Sequence[Column], names: Mapping[str, Name], chosen: Mapping[str, Choice]
) -> tuple[Column | None, list[Finding]]:
    """Return the best candidate and the findings about the choice."""
    if role == "load":
        unsure = [c for c in candidates if not names[c.name].unit]
        candidates = [c for c in candidates if names[c.name].unit]
        if unsure and not candidates:
            # Drives call their torque or utilisation "load" as well.
            name = unsure[0].name
            doubt = f"column {name!r} has no unit: it may be a normal force, a torque or a utilisation; it is not used"
            remedy = f"if it is the normal force, say {name_columns(load=f'{name}:N')}"
            return None, [Finding("note", "not-used", doubt, remedy=remedy)]
    if not candidates:
        return None, []
    remedy = f"if another is meant, say {name_columns(**{role: 'COLUMN'})}"
    listed = listed_names(candidates)
    ranked = sorted(candidates, key=lambda c: _merit(names[c.name]), reverse=True)
    first = ranked[0]
    if len(ranked) == 1:
        return first, []
    if _merit(names[first.name]) > _merit(names[ranked[1].name]):
        return first, [
            Finding(
                "note",
                "ambiguous-column",
                f"{role} may be any of {listed}; {first.name!r} was taken",
                remedy=remedy,
            )
        ]
    if kin := _of_same_words(
        [c for c in ranked if _merit(names[c.name]) == _merit(names[first.name])], chosen
    ):
        other = kin[1]
        message = (
            f"{role} may be any of {listed}; {kin[0].name!r} was taken, whose name has the words of {other.role} "
            f"{other.column!r}"
        )
        return kin[0], [Finding("note", "ambiguous-column", message, remedy=remedy)]
    if role not in MAIN:
        return None, [
            Finding(
                "warning",
                "ambiguous-column",
                f"{role} may be any of {listed}; none was taken",
                remedy=f"say {name_columns(**{role: first.name})}, or another, to use one",
            )
        ]
    return first, [
        Finding(
            "error",
            "ambiguous-column",
            f"{role} may be any of {listed}",
            remedy=f"say which, such as {name_columns(**{role: first.name})}",
        )
    ]


def _of_same_words(
    candidates: Sequence[Column], chosen: Mapping[str, Choice]
) -> tuple[Column, Choice] | None:
    """Return the candidate that shares words with the chosen motion or torque column, and that column: "right_vel" for
    "right_pos", not "left_vel"."""
    own = [frozenset(words(c.name)) for c in candidates]
    common = own[0].intersection(*own[1:])
    for other in (chosen[role] for role in (*MAIN[1:], "current") if role in chosen):
        kin = [
            c
            for c, w in zip(candidates, own, strict=True)
            if not (w - common).isdisjoint(words(other.column))
        ]
        if len(kin) == 1:
            return kin[0], other
    return None


def _merit(name: Name) -> tuple[int, int, int]:
    return (name.side != "load", name.sure, bool(name.unit))
