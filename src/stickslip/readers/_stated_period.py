"""Find the sampling period in the lines above a table, such as ``Sampling Rate:,8,Milli-Seconds``."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping

from stickslip.readers._names import IN_BRACKETS
from stickslip.readers._units import parse_unit

SAYS = re.compile(
    r"(?:sampling|sample|scan|trace|logging|recording|abtast|mess|aufzeichnungs)"
    r"(?:period|rate|interval|cycle|frequency|periode|intervall|frequenz|takt|zyklus)"
    r"|(?:sampling|sample|abtast)(?:time|zeit)"
)
"""Keys of such a line, letters only, in lower case. The time of a trace or measurement is its duration, so it is not
one."""
AMOUNT = re.compile(r"([0-9]+(?:[.,][0-9]+)?(?:[eE][-+]?[0-9]+)?)\s*([A-Za-zµμ][A-Za-zµμ -]*)")
HERTZ = {"hz": 1.0, "khz": 1e3, "mhz": 1e6}


def is_period(text: str) -> bool:
    """Whether a text is a time with its unit, or a rate."""
    return math.isfinite(_seconds(text))


def stated_period(constants: Mapping[str, float | str]) -> tuple[str, str, float] | None:
    """Return key, value as written, and the period in s; None if no line states one with its unit."""
    for name, value in constants.items():
        key = re.sub(r"[^a-zäöü]", "", IN_BRACKETS.sub("", name.rsplit(".", 1)[-1]).lower())
        if not SAYS.fullmatch(key):
            continue
        unit = match[1] if (match := IN_BRACKETS.search(name)) is not None else ""
        text = value if isinstance(value, str) else f"{value:g} {unit}"
        period = _seconds(text)
        if math.isfinite(period):
            return name, text, period
    return None


def _seconds(text: str) -> float:
    """Return the period in s of a text such as "8 ms" or "1 kHz"; NaN if there is none."""
    match = AMOUNT.fullmatch(text.strip())
    amount = float(match[1].replace(",", ".")) if match is not None else 0.0
    if match is None or not amount > 0.0:
        return math.nan
    if (rate := HERTZ.get(match[2].strip().lower())) is not None:
        return 1.0 / (amount * rate)
    unit = parse_unit(match[2])
    return amount * unit.factor if unit is not None and unit.kind == "time" else math.nan
