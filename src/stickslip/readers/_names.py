"""Parse column names: quantity, unit, axis and side of the gear.

English, German, the main words in French, Italian and Spanish, and the names drives and controllers use (CiA 402
objects, TwinCAT, Sinamics, Sercos, Logix, AKD, ODrive, Dynamixel, ROS). A name is split into words; its role follows
from one of its words or from the whole name.
"""

from __future__ import annotations

import re
import unicodedata
from dataclasses import dataclass

from stickslip.readers._units import Unit, in_its_case, may_be_unit, parse_unit
from stickslip.readers._vocabulary import (
    AXES,
    CARTESIAN,
    CHANNELS,
    COMPOUNDS,
    ERROR,
    FORCE,
    FORCE_SYMBOL,
    LOAD_SIDE,
    MOTOR_SIDE,
    NAMED_BY_UNIT,
    NO_SIGNAL,
    NO_TAIL,
    OF_OTHERS,
    OF_REFERENCE,
    OTHER_COMPOUNDS,
    REFERENCED,
    SENSOR,
    SKIP,
    WHOLE,
    WORDS,
)

KINDS: dict[str, tuple[str, ...]] = {
    "time": ("time",),
    "position": ("angle", "length", "counts"),
    "position_reference": ("angle", "length", "counts"),
    "position_error": ("angle", "length", "counts"),
    "velocity": ("angular velocity", "velocity", "count rate", "electrical speed"),
    "velocity_reference": ("angular velocity", "velocity", "count rate", "electrical speed"),
    "acceleration": ("angular acceleration", "acceleration"),
    "motor_torque": ("torque", "force", "share"),
    "friction_torque": ("torque", "force"),
    "sensor_torque": ("torque", "force"),
    "compensation_torque": ("torque", "force", "share"),
    "current": ("current", "share"),
    "current_reference": ("current", "share"),
    "voltage": ("voltage",),
    "supply": ("voltage",),
    "load": ("force", "torque", "share"),
    "temperature": ("temperature",),
}
"""Channels that a file can have, and the kinds of unit of each; the first is the default."""

ROLES = tuple(KINDS)

ALIASES = {
    "t": "time",
    "torque": "motor_torque",
    "force": "motor_torque",
    "friction": "friction_torque",
    "reference": "position_reference",
    "angle": "position",
    "speed": "velocity",
    "normal_force": "load",
}
"""Short names accepted in a mapping."""


IN_BRACKETS = re.compile(r"[\[(<{]\s*([^\])>}]{1,24}?)\s*[\])>}]")
INDEX = re.compile(r"\[\s*(\d{1,3})\s*\]|\(\s*(\d{1,3})\s*\)")
"""The index of a column: an integer alone in brackets is not a unit."""
OF_AXIS = re.compile(r"(joint|axis|achse|gelenk|motor|drive|servo|actuator|axe|eje|j|a|m)(\d{1,2})")
LETTERED = re.compile(r"(?i)(?:axis|achse|axe|eje)[ _.-]?([a-hx-z])(?=[^a-z0-9]+[a-z])")
"""The letter of an axis, followed by a quantity: "Axis A Position", but not "axis.fActPos"."""
AFTER_IN = re.compile(r"\s+in\s+(\S{1,12})\s*$|\s*[/,]\s*(\S{1,12})\s*$", re.IGNORECASE)
CAMEL = re.compile(r"(?<=[a-zäöüß])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])")
IN_GROUP = re.compile(r"^/(?:\w+/)*|^.*[|]|^\w+(?:\.\w+)*\.(?=[^\W\d])")
"""Groups before the name of a signal: "state.tau_J", "/motor_state/torque"."""
PIECES = re.compile(r"[_\s]+")
WORD_ENDS = re.compile(rf"{PIECES.pattern}|{CAMEL.pattern}")
NUMBERED = re.compile(r"\d{1,2}")
PER = re.compile(r"(?<=[A-Za-z])(?:_(?:per|PER)_(?=[A-Za-z])|Per(?=[A-Z]))")
UMLAUTS = str.maketrans(
    {
        "ä": "ae",
        "ö": "oe",
        "ü": "ue",
        "ß": "ss",
        "θ": "theta",
        "φ": "phi",
        "ϕ": "phi",
        "ω": "omega",
        "τ": "tau",
    }
)


@dataclass(frozen=True, slots=True)
class Name:
    """A parsed column name.

    Attributes
    ----------
    role : str
        A channel; empty if none is recognised.
    sure : int
        2: a whole name; 1: a word among others; 0: a command that may replace a measurement, or nothing.
    unit : str
        The unit written in the name, or empty.
    axis : str
        Number or letter of the axis or joint ("pos2" and "q[2]" give "2", "Axis A Position" gives "a"), or empty.
    side : {"", "motor", "load"}
    family : str
        The name without its axis; columns of one array have one family, which ends in "[]".
    """

    role: str
    sure: int
    unit: str
    axis: str
    side: str
    family: str = ""


def words(name: str) -> list[str]:
    """Split a name at signs, at capitals and between letters and digits, in lower case."""
    cut = CAMEL.sub(" ", name).lower().translate(UMLAUTS)
    plain = "".join(c for c in unicodedata.normalize("NFKD", cut) if not unicodedata.combining(c))
    return [w for w in re.split(r"[^0-9a-z]+", plain) if w]


def role_of(name: str, unit: str = "") -> Name:
    """Parse a column's name; `unit` is the unit that the file states separately."""
    bare, stated, parts, axis = _pieces(name, unit)
    family = " ".join(parts) + ("[]" if INDEX.search(name) else "")
    own = words(IN_GROUP.sub("", INDEX.sub("", name)))
    if not _is_of_joint(parts, axis) or not (NO_SIGNAL.isdisjoint(own) or _whole(bare)):
        return Name("", 0, stated, axis, "", family)
    role, sure = _role(bare, parts)
    if role:
        stated = in_its_case(stated, KINDS[role]) or stated
    parsed = parse_unit(stated) if stated else None
    if not role and parsed is not None:
        role = _role_by_unit(parts, parsed)
        sure = int(OF_REFERENCE.isdisjoint(parts))
    if role == "motor_torque" and parsed is not None and parsed.kind == "current":
        role = "current"
    if role and parsed is not None and parsed.kind not in KINDS[role]:
        role, sure = "", 0
    return Name(role, sure if role else 0, stated, axis, _side(parts, role), family)


def _is_of_joint(parts: list[str], axis: str) -> bool:
    """Whether a name may belong to an axis or joint: pose and forces of an end effector do not."""
    # The cart of a pendulum has one position, a Cartesian one has several.
    cartesian = "cart" in parts and (axis or parts[-1] in ("x", "y", "z"))
    return "joint" in parts or (CARTESIAN.isdisjoint(parts) and not cartesian)


def commanded(name: str) -> bool:
    """Whether a name marks a commanded, not a measured, quantity."""
    return not OF_REFERENCE.isdisjoint(words(name))


def motor_force(name: str, unit: str = "") -> Name | None:
    """Return the motor's force by its symbol, as in "F [N]" or "F_motor [N]"; None if name and unit do not match.

    Only a linear axis has one: elsewhere F is another force.
    """
    _, stated, parts, axis = _pieces(name, unit)
    parsed = parse_unit(stated)
    symbol = "".join(w for w in parts if w not in SKIP | OF_REFERENCE | MOTOR_SIDE)
    if parsed is None or parsed.kind != "force" or symbol not in FORCE_SYMBOL:
        return None
    sure = int(OF_REFERENCE.isdisjoint(parts))
    return Name("motor_torque", sure, stated, axis, _side(parts, "motor_torque"))


def _pieces(name: str, unit: str) -> tuple[str, str, list[str], str]:
    """Return a name without its unit, the unit, the words of the name, and the number of its axis."""
    indices = [first or second for first, second in INDEX.findall(name)]
    bare, inner = _without_unit(INDEX.sub("", name))
    if not unit and not inner and not _whole(bare):
        bare, inner = _without_tail(bare)
    stated = unit or inner or (bare if bare.lower() in NAMED_BY_UNIT else "")
    parts = words(bare)
    if (match := LETTERED.search(bare)) is not None:
        number, parts = match[1].lower(), words(bare[: match.start(1)] + bare[match.end(1) :])
    elif _whole(bare):
        groups = words(" ".join(re.split(r"[./|:]", bare)[:-1]))
        number = _numbered_axis([*groups, ""]) if groups else ""
    elif number := _numbered_axis(parts):
        bare = "_".join(parts)
    return bare, stated, parts, ".".join([number, *indices] if number else indices)


def _numbered_axis(parts: list[str]) -> str:
    """Take the number of the axis out of a name's words: "joint 3 position", "j3 q", "pos 2"."""
    for i, word in enumerate(parts[:-1]):
        if (match := OF_AXIS.fullmatch(word)) is not None:
            parts[i : i + 1] = [match[1]] if match[1] in MOTOR_SIDE else []
            return match[2]
        after = parts[i + 1]
        if word in AXES and NUMBERED.fullmatch(after):
            del parts[i if word not in MOTOR_SIDE else i + 1 : i + 2]
            return after
    if parts and (match := re.fullmatch(r"([a-z]+)(\d{1,2})", parts[-1])):
        parts[-1] = match[1]
        return "" if match[1] in CHANNELS else match[2]
    if len(parts) > 1 and NUMBERED.fullmatch(parts[-1]):
        number = parts.pop()
        return "" if parts[-1] in CHANNELS else number
    return ""


def _without_tail(bare: str) -> tuple[str, str]:
    """Split off a unit after the last underscore or space, as a last word, or before a qualifier: "q_deg",
    "omega_rad_s", "torqueNm", "torque_Nm_filtered", "pos_deg_2"."""
    bare = PER.sub("/", bare)
    for cut, alone in ((PIECES, True), (WORD_ENDS, False)):
        pieces, behind = [p for p in cut.split(bare) if p], list[str]()
        while len(pieces) > 2 and (
            pieces[-1].lower() in SKIP | OF_REFERENCE or NUMBERED.fullmatch(pieces[-1])
        ):
            behind.insert(0, pieces.pop())
        for count, join in ((2, "/"), (1, "")):
            tail = join.join(pieces[-count:])
            tail = tail if alone else tail.lower()
            if len(pieces) <= count or tail in NO_TAIL or not may_be_unit(tail):
                continue
            head = "_".join([*pieces[:-count], *behind])
            role, unit = _role(head, words(head))[0], parse_unit(tail)
            # The last word may be part of the name if nothing else identifies the quantity.
            if (alone and unit and role in ("", "motor_torque")) or (role and in_its_case(tail, KINDS[role])):
                return head, tail
    return bare, ""


def _without_unit(name: str) -> tuple[str, str]:
    """Return the name without its unit, and the unit."""
    for match in reversed(list(IN_BRACKETS.finditer(name))):
        if may_be_unit(match[1]) and not match[1].isdigit():
            return (name[: match.start()] + " " + name[match.end() :]).strip(), match[1]
    head, _, last = name.rstrip().rpartition(" ")
    if head and "/" in last and may_be_unit(last):
        return head.strip(), last
    tail = match[1] or match[2] if (match := AFTER_IN.search(name)) is not None else ""
    if match is not None and may_be_unit(tail) and not tail.isdigit():
        return name[: match.start()].strip(), tail
    beside = IN_BRACKETS.sub("", name).strip()
    return (beside if _whole(beside) else name.strip()), ""


def _whole(bare: str) -> str:
    """Return the role of a whole name, or of its last part after a dot."""
    spelled = bare.lower().translate(UMLAUTS).strip().replace(" ", "_")
    last = re.split(r"[./|:]", spelled)[-1]
    code = re.search(r"(?:0x|index_?)?(60[0-9a-f]{2})h?(?::\w+)?$", spelled)
    for candidate in (spelled, last, code[1] if code else ""):
        for role, names in WHOLE.items():
            if candidate in names or candidate in (role, *_aliases(role)):
                return role
    return ""


def _aliases(role: str) -> tuple[str, ...]:
    return tuple(a for a, r in ALIASES.items() if r == role)


def _role(bare: str, parts: list[str]) -> tuple[str, int]:
    """Return the quantity of a name, and how certain it is."""
    if role := _whole(bare):
        return role, 2
    is_reference = not OF_REFERENCE.isdisjoint(parts)
    found = [role for role, known in WORDS.items() if not set(known).isdisjoint(parts)]
    if "load" in found and "normal" in parts and not FORCE.isdisjoint(parts):
        return "load", 1
    if found == ["motor_torque"] and not SENSOR.isdisjoint(parts) and MOTOR_SIDE.isdisjoint(parts):
        return "sensor_torque", 1
    if "load" in found and len(found) > 1:
        found.remove("load")  # "load position" is a position on the load side
    if {"supply", "current"} <= set(found):
        return "", 0  # the supply's current is not the motor's
    for one in ("friction_torque", "supply"):
        if one in found:
            found = [one]
    if (
        {"following", "error"} <= set(parts)
        or "position_error" in found
        or ("position" in found and not ERROR.isdisjoint(parts))
    ):
        return "position_error", 1
    if "position" in found and len(found) > 1:
        found = [
            r for r in found if r != "position" or not {"encoder", "enc", "resolver"} & set(parts)
        ] or found
    if len(found) > 1:
        found = [r for r in found if r != "time"] or found
    if not found:
        # A short name with a qualifier: "q act", "ist n".
        rest = [
            w
            for w in parts
            if w not in SKIP and w not in OF_REFERENCE and w not in LOAD_SIDE and w not in MOTOR_SIDE
        ]
        role = _whole(rest[0]) if len(rest) == 1 else ""
        if rest == ["qd"] and len(parts) > 1:
            role = "velocity"  # "actual_qd", "qd_ref": the rate of q; alone it may be a desired q
        role = role or _compound(parts)
        if not role:
            return "", 0
        found = [role]
    role = found[0]
    if role == "motor_torque" and not OF_OTHERS.isdisjoint(parts):
        return "", 0
    if {"motor_torque", "current"} <= set(found):
        # The last noun counts: "torque current" is a current, "current as torque" a torque.
        role = max(
            ("motor_torque", "current"), key=lambda r: max(parts.index(w) for w in WORDS[r] if w in parts)
        )
    if is_reference and role == "motor_torque":
        return role, 0
    if is_reference:
        role = REFERENCED.get(role, role if role.endswith("_reference") else "")
    return role, 1


def _compound(parts: list[str]) -> str:
    """Return the role of a German compound by its ending: "Spindelposition", "Vorschubkraft"; empty for load, friction
    or none."""
    for word in parts:
        for end, role in COMPOUNDS.items():
            if word.endswith(end) and not word.startswith(OTHER_COMPOUNDS):
                return role
    return ""


def _role_by_unit(parts: list[str], unit: Unit) -> str:
    """Return the role of an unknown name if its unit determines it, else an empty string."""
    if not OF_REFERENCE.isdisjoint(parts):
        return "motor_torque" if unit.kind == "torque" else ""
    return {"angular velocity": "velocity", "electrical speed": "velocity", "torque": "motor_torque",
            "current": "current", "voltage": "voltage",
            "temperature": "temperature", "angle": "position", "counts": "position"}.get(unit.kind, "")  # fmt: skip


def _side(parts: list[str], role: str) -> str:
    if role in ("load", ""):
        return ""
    if not LOAD_SIDE.isdisjoint(parts):
        return "load"
    return "motor" if not MOTOR_SIDE.isdisjoint(parts) else ""
