"""Maps of a torque over the angle as tables for firmware: int16 with a scale in C, moteus, ODrive, VESC.

Each says what it leaves: of the map itself (coarser points, steps of the numbers) and with what the map left of the
torque on places that were not fitted. `stickslip.exports.position_waves` has the harmonics.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from stickslip.core.errors import InputError
from stickslip.exports._text import text_in
from stickslip.exports.job import Export
from stickslip.machines.position_map import PositionMap

Array = np.ndarray[Any, np.dtype[np.float64]]

MOTEUS, BYTE = 1024, 127
ODRIVE = 3600
VESC = 1024
WORD = 32767
FINE = 65536
"""Angles at which a table is compared with its map."""


@dataclass(frozen=True)
class Left:
    """RMS of what a table leaves: of the map, and of the torque, `unit`."""

    of_the_map: float
    of_the_torque: float
    unit: str

    def __str__(self) -> str:
        """In one sentence."""
        said = (
            f"the table differs from its map by {self.of_the_map:.3g} {self.unit} RMS"
            if self.of_the_map
            else "the harmonics are those of the map"
        )
        if math.isnan(self.of_the_torque):
            return said
        return f"{said}; with what the map left on places not fitted, {self.of_the_torque:.3g} {self.unit} RMS remain"

    @property
    def sentence(self) -> str:
        """With a capital and a full stop."""
        said = str(self)
        return f"{said[0].upper()}{said[1:]}."


def c_table(found: PositionMap, name: str = "cogging", points: int = 1024) -> Export:
    """An int16 table with its scale and a function that reads it, linear between the points, in C.

    Parameters
    ----------
    found : PositionMap
        Torque or current; its unit is that of the scale.
    name : str
        What names in the file begin with.
    points : int
        Over a turn.

    Returns
    -------
    Export

    Raises
    ------
    InputError
        If the map is empty or holds for less than a turn, the name is none in C, or there are fewer than 2 points.
    """
    if not name.isidentifier() or not name.isascii():
        raise InputError(f"the name {name!r} is none in C; take letters, digits and _")
    values = _values(found, points)
    whole, scale = _steps(values, WORD)
    left = _left(found, whole * scale, held=False)
    rows = _rows(whole)
    unit = text_in("c", found.unit)
    text = f"""/* Torque over the angle, the same in both directions: what the drive must give, {unit}.
 * {text_in("c", str(left))}. */
#ifndef {name.upper()}_H
#define {name.upper()}_H

#include <math.h>
#include <stdint.h>

#define {name.upper()}_POINTS {points}
static const float {name}_scale = {_float(scale)}; /* {unit} for a step */
static const int16_t {name}_table[{name.upper()}_POINTS] = {{
{rows}
}};

/* At an angle in rad, 0 where the map has 0; linear between the points. */
static inline float {name}_at(float angle)
{{
    const float turns = angle * 0.159154943f;
    const float place = (turns - floorf(turns)) * {name.upper()}_POINTS;
    const int low = (int)place < {name.upper()}_POINTS ? (int)place : {name.upper()}_POINTS - 1;
    const int high = low + 1 < {name.upper()}_POINTS ? low + 1 : 0;
    const float part = place - (float)low;
    return {name}_scale * ((1.0f - part) * (float){name}_table[low] + part * (float){name}_table[high]);
}}

#endif
"""
    return Export({f"{name}.h": text}, (left.sentence,))


def moteus(found: PositionMap, name: str = "moteus_cogging") -> Export:
    """Console commands that write ``motor.cogging_dq_scale`` and ``motor.cogging_dq_comp`` of a moteus controller.

    1024 int8 over a turn of the commutation encoder, linear between them, times a scale in A of q current.

    Parameters
    ----------
    found : PositionMap
        In A, over the angle of the commutation encoder.
    name : str
        Of the file.

    Returns
    -------
    Export

    Raises
    ------
    InputError
        If the map is not in A, is empty or holds for less than a turn.
    """
    _in_unit(found, "A", "moteus adds a current")
    whole, scale = _steps(_values(found, MOTEUS), BYTE)
    left = _left(found, whole * scale, held=False)
    lines = [f"conf set motor.cogging_dq_scale {scale:.9g}"]
    lines += [f"conf set motor.cogging_dq_comp.{i} {int(x)}" for i, x in enumerate(whole)]
    return Export({f"{name}.cfg": "\n".join([*lines, "conf write", ""])}, (left.sentence,))


def odrive(found: PositionMap, name: str = "odrive_cogging_map") -> Export:
    """``cogging_map`` of ODrive's open firmware: 3600 values over a turn of the encoder's index, held between them.

    The firmware's interface does not expose the array: it is for a build of one's own, where it takes the place of what
    the calibration fills.

    Parameters
    ----------
    found : PositionMap
        In N·m (firmware 0.5) over the angle from the index.
    name : str
        Of the file.

    Returns
    -------
    Export

    Raises
    ------
    InputError
        If the map is not in N·m, is empty or holds for less than a turn.
    """
    _in_unit(found, "N·m", "ODrive adds a torque")
    # A value holds from its angle to the next: that of the middle is the nearest.
    values = _values(found, 2 * ODRIVE)[1::2]
    left = _left(found, values, held=True)
    rows = "\n".join(
        "    " + ", ".join(_float(x) for x in values[i : i + 8]) + "," for i in range(0, ODRIVE, 8)
    )
    text = f"/* {text_in('c', str(left))}. */\nstatic const float cogging_map[{ODRIVE}] = {{\n{rows}\n}};\n"
    return Export({f"{name}.h": text}, (left.sentence,))


def vesc(found: PositionMap, name: str = "cogging") -> Export:
    """A LispBM program for a VESC: the table as bytes of int16, high byte first, and a function that reads it.

    Its firmware adds no map by itself: a program that commands the current adds ``(NAME-at (get-encoder))`` to it.

    Parameters
    ----------
    found : PositionMap
        In A, over the angle of the selected encoder.
    name : str
        What names in the program begin with.

    Returns
    -------
    Export

    Raises
    ------
    InputError
        If the map is not in A, is empty or holds for less than a turn.
    """
    _in_unit(found, "A", "the VESC adds a current")
    whole, scale = _steps(_values(found, VESC), WORD)
    left = _left(found, whole * scale, held=False)
    data = whole.astype(">i2").tobytes()
    rows = "\n".join("    " + " ".join(str(x) for x in data[i : i + 24]) for i in range(0, len(data), 24))
    text = f"""; {text_in("c", str(left))}.
; Add ({name}-at (get-encoder)) to the current that your program commands, A.

(def {name}-points {VESC})
(def {name}-scale {scale:.12f}) ; A for a step
(def {name}-table [
{rows}
])

(defun {name}-point (i)
    (* {name}-scale (bufget-i16 {name}-table (* 2 (mod i {name}-points)))))

; At an angle in degrees, 0 to 360; linear between the points.
(defun {name}-at (degrees)
    (let ((place (* degrees {VESC / 360.0:.12f})))
        (let ((low (to-i place)))
            (let ((part (- place low)))
                (+ (* (- 1.0 part) ({name}-point low)) (* part ({name}-point (+ low 1))))))))
"""
    return Export({f"{name}.lisp": text}, (left.sentence,))


def left_of(found: PositionMap) -> Left:
    """What the map itself leaves, where nothing is lost in writing it."""
    return Left(0.0, found.residual, found.unit)


def whole_turn(found: PositionMap) -> None:
    """Refuse a map without orders, or of less than a turn.

    Raises
    ------
    InputError
    """
    if not found.table and not found.even.order:
        raise InputError("the map holds no order; there is nothing to export")
    if found.upper - found.lower < 0.999 * 2.0 * math.pi:
        raise InputError(
            f"the map holds from {found.lower:.4g} to {found.upper:.4g} rad only; identify a whole turn"
        )


def _values(found: PositionMap, points: int) -> Array:
    whole_turn(found)
    if points < 2:
        raise InputError(f"a table of {points} points holds no map; give 2 or more")
    return found.sampled(points)


def _in_unit(found: PositionMap, unit: str, why: str) -> None:
    if found.unit != unit:
        factor = "1.0 / K_t" if unit == "A" else "K_t"
        raise InputError(f'{why}, the map is in {found.unit}; give found.scaled({factor}, "{unit}")')


def _steps(values: Array, largest: int) -> tuple[Array, float]:
    """Whole numbers up to `largest`, and their scale."""
    scale = float(np.max(np.abs(values))) / largest
    return np.round(values / scale), scale


def _left(found: PositionMap, values: Array, *, held: bool) -> Left:
    """What a table leaves, held or linear between its points."""
    place = np.arange(FINE) / FINE
    points = values.size
    if held:
        said = values[np.floor(place * points).astype(np.intp)]
    else:
        said = np.interp(place, np.arange(points + 1) / points, np.append(values, values[0]))
    own = float(np.sqrt(np.mean((found.beside(2.0 * math.pi * place) - said) ** 2)))
    return Left(own, math.hypot(own, found.residual), found.unit)


def _rows(whole: Array) -> str:
    """Twelve numbers a line."""
    return "\n".join(
        "    " + ", ".join(f"{int(x)}" for x in whole[i : i + 12]) + "," for i in range(0, whole.size, 12)
    )


def _float(value: float) -> str:
    text = f"{float(value):.9g}"
    return f"{text}f" if any(c in text for c in ".en") else f"{text}.0f"
