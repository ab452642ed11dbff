"""Parse units as people and machines write them, and convert them to SI."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, replace

SI = {
    "time": "s", "angle": "rad", "length": "m", "angular velocity": "rad/s", "velocity": "m/s",
    "angular acceleration": "rad/s²", "acceleration": "m/s²", "torque": "N·m", "force": "N", "current": "A",
    "voltage": "V", "temperature": "°C", "share": "1", "counts": "counts", "count rate": "counts/s",
    "electrical speed": "rad/s",
}  # fmt: skip
"""Unit of each kind of quantity in a record. Temperatures are in °C, as in `Surroundings`."""


@dataclass(frozen=True, slots=True)
class Unit:
    """value in SI = factor · value + offset"""

    kind: str
    factor: float = 1.0
    offset: float = 0.0


TURN = 2.0 * math.pi
POUND_FORCE = 4.4482216152605
INCH = 0.0254
POND = 9.80665e-3
"""gf in N"""

PLAIN: dict[str, Unit] = {
    # Angles
    "rad": Unit("angle"), "radian": Unit("angle"), "radians": Unit("angle"), "radiant": Unit("angle"),
    "deg": Unit("angle", TURN / 360), "degree": Unit("angle", TURN / 360), "degrees": Unit("angle", TURN / 360),
    "grad": Unit("angle", TURN / 360), "arcmin": Unit("angle", TURN / 360 / 60),
    "arcsec": Unit("angle", TURN / 360 / 3600),
    "rev": Unit("angle", TURN), "revs": Unit("angle", TURN), "revolution": Unit("angle", TURN),
    "revolutions": Unit("angle", TURN), "turn": Unit("angle", TURN), "turns": Unit("angle", TURN),
    **dict.fromkeys(("rot", "rots", "rotation", "rotations"), Unit("angle", TURN)),
    "umdr": Unit("angle", TURN), "umdrehung": Unit("angle", TURN), "umdrehungen": Unit("angle", TURN),
    "U": Unit("angle", TURN), "giri": Unit("angle", TURN), "giro": Unit("angle", TURN), "tr": Unit("angle", TURN),
    "tour": Unit("angle", TURN), "tours": Unit("angle", TURN),
    # Counts of an encoder
    **dict.fromkeys(
        ("counts", "count", "cnt", "cnts", "cts", "inc", "incs", "incr", "increment", "increments", "ink", "inkr",
         "inkremente", "tick", "ticks", "pulse", "pulses", "puls", "pulse_unit", "encoderpulse", "encoderpulses", "lsb",
         "digit", "digits"),
        Unit("counts"),
    ),
    # Speeds that are not quotients
    **dict.fromkeys(("rpm", "upm", "1/min", "min-1", "u/min", "rev/min", "r/min", "umdr/min", "turn/min", "turns/min"),
                    Unit("angular velocity", TURN / 60)),
    **dict.fromkeys(("rps", "rev/s", "u/s", "r/s", "turn/s", "turns/s", "umdr/s", "revs/s"),
                    Unit("angular velocity", TURN)),
    "krpm": Unit("angular velocity", TURN / 60 * 1e3), "mrpm": Unit("angular velocity", TURN / 60 * 1e-3),
    "erpm": Unit("electrical speed", TURN / 60),
    "dps": Unit("angular velocity", TURN / 360), "rads-1": Unit("angular velocity"),
    # Non-metric torques and forces
    "lbin": Unit("torque", POUND_FORCE * INCH), "lbfin": Unit("torque", POUND_FORCE * INCH),
    "inlb": Unit("torque", POUND_FORCE * INCH), "inlbf": Unit("torque", POUND_FORCE * INCH),
    "lbft": Unit("torque", POUND_FORCE * INCH * 12), "lbfft": Unit("torque", POUND_FORCE * INCH * 12),
    "ftlb": Unit("torque", POUND_FORCE * INCH * 12), "ftlbf": Unit("torque", POUND_FORCE * INCH * 12),
    "ozin": Unit("torque", POUND_FORCE * INCH / 16), "ozfin": Unit("torque", POUND_FORCE * INCH / 16),
    "inoz": Unit("torque", POUND_FORCE * INCH / 16),
    "kgcm": Unit("torque", POND * 10), "kgfcm": Unit("torque", POND * 10), "gcm": Unit("torque", POND * 1e-2),
    "gfcm": Unit("torque", POND * 1e-2), "kgm": Unit("torque", POND * 1e3), "kgfm": Unit("torque", POND * 1e3),
    "lbf": Unit("force", POUND_FORCE), "lb": Unit("force", POUND_FORCE), "kgf": Unit("force", POND * 1e3),
    "gf": Unit("force", POND), "kp": Unit("force", POND * 1e3),
    # Non-metric lengths
    "in": Unit("length", INCH), "inch": Unit("length", INCH), "inches": Unit("length", INCH),
    "ft": Unit("length", INCH * 12), "micron": Unit("length", 1e-6), "microns": Unit("length", 1e-6),
    # Times
    "sec": Unit("time"), "secs": Unit("time"), "second": Unit("time"), "seconds": Unit("time"),
    "sek": Unit("time"), "sekunden": Unit("time"), "min": Unit("time", 60.0), "minutes": Unit("time", 60.0),
    "h": Unit("time", 3600.0), "hours": Unit("time", 3600.0),
    **dict.fromkeys(("msec", "msecs", "millisecond", "milliseconds", "millis"), Unit("time", 1e-3)),
    **dict.fromkeys(("usec", "usecs", "microsecond", "microseconds", "micros"), Unit("time", 1e-6)),
    **dict.fromkeys(("nsec", "nsecs", "nanosecond", "nanoseconds", "nanos"), Unit("time", 1e-9)),
    "100ns": Unit("time", 1e-7),
    # Currents, voltages
    **dict.fromkeys(("amp", "amps", "ampere", "amperes", "arms", "a_rms", "aeff", "apk", "a_pk", "apeak"),
                    Unit("current")),
    "marms": Unit("current", 1e-3), "milliamp": Unit("current", 1e-3), "milliamps": Unit("current", 1e-3),
    **dict.fromkeys(("volt", "volts", "vdc", "vrms"), Unit("voltage")),
    # Temperatures
    **dict.fromkeys(("degc", "celsius", "c"), Unit("temperature")),
    **dict.fromkeys(("k", "kelvin", "degk"), Unit("temperature", 1.0, -273.15)),
    **dict.fromkeys(("degf", "fahrenheit", "f"), Unit("temperature", 5 / 9, -160 / 9)),
    # Fractions of a rated value
    **dict.fromkeys(("%", "percent", "prozent", "pct", "perc", "%rated"), Unit("share", 1e-2)),
    **dict.fromkeys(("‰", "permille", "permill", "promille", "0.1%", "1/1000", "%o", "permil", "perthousand"),
                    Unit("share", 1e-3)),
    **dict.fromkeys(("1", "pu", "p.u.", "share"), Unit("share")),
}  # fmt: skip
"""Spellings without prefix, as returned by `_normal`; lower case unless the case matters."""

PREFIXES = {"": 1.0, "p": 1e-12, "n": 1e-9, "u": 1e-6, "m": 1e-3, "c": 1e-2, "d": 1e-1, "k": 1e3, "M": 1e6}
PREFIXED = {
    "rad": Unit("angle"), "m": Unit("length"), "s": Unit("time"), "Nm": Unit("torque"), "N": Unit("force"),
    "A": Unit("current"), "V": Unit("voltage"), "deg": Unit("angle", TURN / 360),
}  # fmt: skip
EVERY = {prefix + base: replace(unit, factor=unit.factor * scale)
         for base, unit in PREFIXED.items() for prefix, scale in PREFIXES.items()}  # fmt: skip
# N·mm is a torque whose prefix is at the metre.
TURNED_AROUND = {
    f"{a}N{b}m": Unit("torque", PREFIXES[a] * PREFIXES[b]) for a in PREFIXES for b in ("u", "m", "c", "k")
}
METRIC = {**EVERY, **TURNED_AROUND}
CASELESS = {
    written.lower(): written
    for written in ("Nm", "mNm", "uNm", "kNm", "cNm", "Ncm", "Nmm", "mN", "kN", "mA", "uA", "mV", "kV")
}
"""Units as they are written, by their form in a name or header with one case throughout."""
RATES = {"angle": "angular velocity", "length": "velocity", "counts": "count rate"}
SECOND_RATES = {"angle": "angular acceleration", "length": "acceleration"}
OF_SOMETHING = re.compile(r"%[A-Za-z_]{1,24}")
"""A fraction of a rated value: "% In", "% of rated torque"."""
NUMBER = re.compile(r"([0-9]*\.?[0-9]+(?:[eE][-+]?[0-9]+)?)\s*\*?\s*(.+)")


def parse_unit(text: str) -> Unit | None:
    """Return the SI conversion of a unit as written, or None if it is not a unit.

    It may have a factor and a minus sign: "0.25 um" is a count of a quarter of a micrometre, "-Nm" a torque with
    inverted sign; "--Nm" is invalid.
    """
    written = text.strip()
    if not written or len(written) > 40:
        return None
    if (
        written.startswith("-")
        and not written[1:].lstrip().startswith("-")
        and (turned := parse_unit(written[1:])) is not None
    ):
        return replace(turned, factor=-turned.factor)
    found = _plain(_normal(written))
    if found is None and (match := NUMBER.fullmatch(written)):
        inner = _plain(_normal(match[2]))
        scale = float(match[1])
        if inner is not None and 0.0 < scale < math.inf:
            found = replace(inner, factor=inner.factor * scale)
    return found


def in_its_case(text: str, kinds: tuple[str, ...]) -> str:
    """Return a unit of one of these kinds in its correct case ("NM" is N·m for a torque, but nm for a length), or
    empty."""
    for written in (text, CASELESS.get(_normal(text).lower(), "")):
        unit = parse_unit(written)
        if unit is not None and unit.kind in kinds:
            return written
    return ""


def may_be_unit(text: str) -> bool:
    """Whether this is a unit, possibly with the wrong case."""
    return parse_unit(text) is not None or _normal(text).lower() in CASELESS


def spellings(kinds: tuple[str, ...]) -> str:
    """Return the usual units of some kinds, for messages."""
    usual = {
        "time": "s, ms, us", "angle": "rad, deg, rev", "length": "m, mm, um", "angular velocity": "rad/s, deg/s, rpm",
        "velocity": "m/s, mm/s", "torque": "Nm, mNm, Nmm", "force": "N, mN", "current": "A, mA", "voltage": "V, mV",
        "temperature": "degC, K", "share": "percent, permille", "counts": "counts", "count rate": "counts/s",
        "electrical speed": "erpm", "angular acceleration": "rad/s2", "acceleration": "m/s2",
    }  # fmt: skip
    return ", ".join(usual[kind] for kind in kinds)


def _normal(text: str) -> str:
    """Return a normal form: no spaces or multiplication dots, u for micro, deg for °."""
    for old, new in (
        ("µ", "u"),
        ("μ", "u"),
        ("°", "deg"),
        ("º", "deg"),
        ("²", "2"),
        ("^", ""),
        ("**", ""),
        ("⁻¹", "-1"),
    ):
        text = text.replace(old, new)
    text = re.sub(r"(?<=[A-Za-z])[\s·*⋅•.\-]+(?=[A-Za-z])", "", text.strip())
    return text.replace(" ", "")


def _plain(text: str) -> Unit | None:
    """Return the unit of a normal form: as it is, then in lower case."""
    for candidate in (text, text.lower()):
        if candidate in METRIC:
            return METRIC[candidate]
        if candidate in PLAIN:
            return PLAIN[candidate]
        if (quotient := _quotient(candidate)) is not None:
            return quotient
    return PLAIN["%"] if OF_SOMETHING.fullmatch(text) else None


def _quotient(text: str) -> Unit | None:
    """Parse a rate: per second, minute or second squared."""
    match = re.fullmatch(r"(.+?)(?:/(s2|s/s|sec2|s|sec|min|ms|msec)|(s-2|s-1))", text)
    if match is None:
        return None
    below = match[2] or match[3]
    above = METRIC.get(match[1]) or PLAIN.get(match[1])
    if above is None or above.kind not in RATES:
        return None
    if below in ("s2", "s/s", "sec2", "s-2"):
        return Unit(SECOND_RATES[above.kind], above.factor) if above.kind in SECOND_RATES else None
    per = {"min": 60.0, "ms": 1e-3, "msec": 1e-3}.get(below, 1.0)
    return Unit(RATES[above.kind], above.factor / per)
