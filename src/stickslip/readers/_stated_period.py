"""The sampling period that lines above a table state, such as ``Sampling Rate:,8,Milli-Seconds``."""

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
"""Keys of such a line, their letters alone in lower case: a trace's or a measurement's time is how long it took."""
AMOUNT = re.compile(r"([0-9]+(?:[.,][0-9]+)?(?:[eE][-+]?[0-9]+)?)\s*([A-Za-zµμ][A-Za-zµμ -]*)")
HERTZ = {"hz": 1.0, "khz": 1e3, "mhz": 1e6}


def is_period(text: str) -> bool:
    """Whether a text is a time with its unit, or a rate."""
    return math.isfinite(_seconds(text))


def stated_period(constants: Mapping[str, float | str]) -> tuple[str, str, float] | None:
    """Key, value as written, and the period in s that it states; None where no line states one with its unit."""
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
    """The period that a text such as "8 ms" or "1 kHz" states; NaN where it states none."""
    match = AMOUNT.fullmatch(text.strip())
    amount = float(match[1].replace(",", ".")) if match is not None else 0.0
    if match is None or not amount > 0.0:
        return math.nan
    if (rate := HERTZ.get(match[2].strip().lower())) is not None:
        return 1.0 / (amount * rate)
    unit = parse_unit(match[2])
    return amount * unit.factor if unit is not None and unit.kind == "time" else math.nan
