"""A map's harmonics as functions: structured text, a TwinCAT POU of it, a HAL component with its C.

Every order is a line, so that a drive's programmer sees what is given. A map that is a table has no harmonics and is
refused.
"""

from __future__ import annotations

from collections.abc import Iterator

from stickslip.core.errors import InputError
from stickslip.core.messages import name_option
from stickslip.exports._text import text_in
from stickslip.exports.job import Export
from stickslip.exports.position_tables import left_of, whole_turn
from stickslip.machines.position_map import PositionMap


def st_function(found: PositionMap, name: str = "cogging") -> Export:
    """A function of IEC 61131-3: the torque or current at an angle in rad.

    Parameters
    ----------
    found : PositionMap
    name : str
        Of the function.

    Returns
    -------
    Export

    Raises
    ------
    InputError
        If the map is a table, is empty or holds for less than a turn.
    """
    note = _checked(found, "st")
    head, body = _st_head(found, name, note), "\n".join(_st_body(found, name))
    return Export({f"{name}.st": f"{head}\n{body}\nEND_FUNCTION\n"}, (note,))


def twincat_pou(found: PositionMap, name: str = "cogging") -> Export:
    """The same function as a POU that TwinCAT 3 adds to a project as an existing item.

    Parameters
    ----------
    found : PositionMap
    name : str
        Of the function.

    Returns
    -------
    Export

    Raises
    ------
    InputError
        As `st_function`.
    """
    note = _checked(found, "beckhoff")
    text = f"""<?xml version="1.0" encoding="utf-8"?>
<TcPlcObject Version="1.1.0.1">
  <POU Name="{name}">
    <Declaration><![CDATA[{_st_head(found, name, note)}]]></Declaration>
    <Implementation>
      <ST><![CDATA[{chr(10).join(_st_body(found, name))}]]></ST>
    </Implementation>
  </POU>
</TcPlcObject>
"""
    return Export({f"{name}.TcPOU": text}, (note,))


def linuxcnc_waves(found: PositionMap, name: str = "cogging") -> Export:
    """A HAL component with the harmonics in C: pins ``position`` and ``output``.

    Parameters
    ----------
    found : PositionMap
    name : str
        Of the component.

    Returns
    -------
    Export

    Raises
    ------
    InputError
        As `st_function`.
    """
    note = _checked(found, "linuxcnc")
    unit = text_in("comp", found.unit)
    sums = "\n".join(
        f"    total += {c:.17g} * cos({n:.17g} * angle) + {s:.17g} * sin({n:.17g} * angle);"
        for n, c, s in _waves(found)
    )
    code = f"""/* {text_in("c", note)} */
static double {name}_map(double angle) /* rad; {unit} */
{{
    double total = 0.0;
{sums}
    return total;
}}
"""
    component = f"""component {name} "torque over the angle, the same in both directions, for feedforward";
description \"\"\"
What the drive must give at the given angle, in {unit} times output-scale. {text_in("comp", note)}
\"\"\";
pin in float position "position, times position-scale in rad, 0 where the map has 0";
pin in bit enable = 1 "while 0 the output is 0";
pin out float output "{unit} times output-scale";
param rw float position_scale = 1.0 "rad per unit of position";
param rw float output_scale = 1.0 "output per {unit}";
include "{name}_map.h";
function _ fp "read the map";
license "Dual BSD/GPL";
author "stickslip";
;;

FUNCTION(_) {{
    output = enable ? output_scale * {name}_map(position_scale * position) : 0.0;
}}
"""
    include = f"#include <math.h>\n{code}"
    return Export({f"{name}.comp": component, f"{name}_map.h": include}, (note,))


def _checked(found: PositionMap, target: str) -> str:
    """What the harmonics leave, as a sentence."""
    whole_turn(found)
    if found.table:
        raise InputError(
            f"{target} takes harmonics and this map is a table; take {name_option('to', 'c99')}, moteus, odrive or vesc"
        )
    return left_of(found).sentence


def _waves(found: PositionMap) -> Iterator[tuple[float, float, float]]:
    own = found.even
    return zip(own.order, own.cosine, own.sine, strict=True)


def _st_head(found: PositionMap, name: str, note: str) -> str:
    return f"""(* {text_in("TcPOU", note)} *)
FUNCTION {name} : LREAL (* {text_in("TcPOU", found.unit)} *)
VAR_INPUT
    angle : LREAL; (* rad, 0 where the map has 0 *)
END_VAR
VAR
    total : LREAL;
END_VAR"""


def _st_body(found: PositionMap, name: str) -> Iterator[str]:
    yield "total := 0.0;"
    for n, c, s in _waves(found):
        at = f"{_real(n)} * angle"
        yield f"total := total + ({_real(c)}) * COS({at}) + ({_real(s)}) * SIN({at});"
    yield f"{name} := total;"


def _real(value: float) -> str:
    """A number of the norm: always with a point."""
    text = f"{value:.17g}"
    mantissa, e, exponent = text.partition("e")
    return f"{mantissa if '.' in mantissa else mantissa + '.0'}{e}{exponent}"
