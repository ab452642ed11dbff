"""Friction of both joints of a double pendulum, from one irregularly sampled record of torques and angles.

    python examples/identify_double_pendulum.py [folder of the record]

The arm couples its joints, so that neither is an axis by itself. Its equations of motion are linear in their base
parameters (Khalil and Dombre 2002, chapter 12), which are found by least squares with each joint's Coulomb, viscous
and constant torque. The record moves freely under a known torque of a few hertz: what moves faster is caused by
torque that nobody measured (ripple, the belt), and would draw the inertia down, so only the band of the excitation is
used. What ripple lies in that band still does: take the inertias with a grain of salt, and the torque that is left
over (a fifth to a quarter) for what it is. The last third of the record is predicted, not fitted. Intervals count the
correlation of the residual.
"""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import Any

import numpy as np
from scipy import signal

from stickslip.identification.doctor import examine
from stickslip.identification.fit.profile import inverse_information, long_run
from stickslip.identification.regression.inverse import correlation_lags
from stickslip.readers.reading import read

BAND = 5.0  # Hz: the torques are sinusoids of 0.8 and 1.6 Hz, and this holds their third harmonics
FITTED = 2.0 / 3.0  # of the record
NAMES = ("a", "b", "d", "g1", "g2", "Fc1", "Fv1", "T1", "Fc2", "Fv2", "T2")
UNITS = ("kg·m²", "kg·m²", "kg·m²", "N·m", "N·m", "N·m", "N·m·s/rad", "N·m", "N·m", "N·m·s/rad", "N·m")


def joint(path: Path, number: int) -> Any:
    """The record of one joint; the other joint's columns are left out."""
    columns = {"position": f"pos{number}:rad", "velocity": f"vel{number}:rad/s", "torque": f"tau{number}:N·m"}
    return read(path, columns)


def in_band(x: Any, rate: float) -> Any:
    """Behind a zero-phase low-pass."""
    return signal.sosfiltfilt(signal.butter(4, BAND, fs=rate, output="sos"), x)


def motion(record: Any) -> tuple[Any, Any, Any, Any, float]:
    """Angle, velocity, acceleration and torque in the band, on even times, and their rate."""
    period = float(np.median(np.diff(record.time)))
    t = np.arange(record.time[0], record.time[-1], period)
    q, torque = (
        in_band(np.interp(t, record.time, record[name]), 1.0 / period)
        for name in ("position", "motor_torque")
    )
    v = np.gradient(q, period)
    return q, v, np.gradient(v, period), torque, 1.0 / period


def friction(v: Any, rate: float) -> list[Any]:
    """Columns of Coulomb, viscous and constant torque; the sign passes the same filter as the torque."""
    return [in_band(np.sign(v), rate), v, np.ones(v.size)]


def system(first: Any, second: Any) -> tuple[Any, Any]:
    """The linear system of both joints, shape (samples, 2, parameters), and the torques, shape (samples, 2).

    With a = I1 + m2 l1², b = m2 l1 r2, d = I2, g1 = (m1 r1 + m2 l1) g, g2 = m2 r2 g; angles from hanging down, the
    second one relative to the first.
    """
    q1, v1, a1, torque1, rate = motion(first)
    q2, v2, a2, torque2, _ = motion(second)
    none = np.zeros(q1.size)
    s2, c2, s12 = np.sin(q2), np.cos(q2), np.sin(q1 + q2)
    upper = [a1, (2.0 * a1 + a2) * c2 - s2 * (2.0 * v1 * v2 + v2**2), a1 + a2, np.sin(q1), s12]
    lower = [none, a1 * c2 + s2 * v1**2, a1 + a2, none, s12]
    rows1 = [*upper, *friction(v1, rate), none, none, none]
    rows2 = [*lower, none, none, none, *friction(v2, rate)]
    columns = np.stack([np.stack(rows1, axis=1), np.stack(rows2, axis=1)], axis=1)
    edge, step = int(rate / BAND), max(1, int(rate / (8.0 * BAND)))
    return columns[edge:-edge:step], np.stack([torque1, torque2], axis=1)[edge:-edge:step]


def main() -> dict[str, tuple[float, float]]:
    """Print what the doctor says, the parameters with 95 % intervals, and the error of the part not fitted."""
    data = os.environ.get("STICKSLIP_DATA", "../shared/data")
    folder = Path(sys.argv[1] if len(sys.argv) > 1 else f"{data}/double_pendulum")
    return identify(next(folder.glob("*_measured.csv")))


def identify(path: Path) -> dict[str, tuple[float, float]]:
    """Value and half-width of every parameter, and of the relative torque errors (half-width 0)."""
    found = [examine(joint(path, i)) for i in (1, 2)]
    for line in dict.fromkeys(f.line() for d in found for f in d.findings if f.code == "irregular-sampling"):
        print(f"doctor: {line}")
    columns, torque = system(found[0].record, found[1].record)
    border = int(FITTED * torque.shape[0])
    w = columns[:border].reshape(-1, len(NAMES))
    y = torque[:border].ravel()
    values, *_ = np.linalg.lstsq(w, y, rcond=None)
    residual = y - w @ values
    inverse, _ = inverse_information(w)
    lags = 2 * max(correlation_lags(residual[i::2]) for i in (0, 1)) + 1
    half = 1.96 * np.sqrt(np.diag(inverse @ long_run(w * residual[:, None], lags) @ inverse))
    out = {n: (float(v), float(h)) for n, v, h in zip(NAMES, values, half, strict=True)}
    for name, unit in zip(NAMES, UNITS, strict=True):
        value, width = out[name]
        verdict = "" if abs(value) > width else " (the data do not distinguish it from 0)"
        print(f"  {name:4s} {value:9.5f} ± {width:.5f} {unit}{verdict}")
    for label, part in (("fitted", slice(None, border)), ("not fitted", slice(border, None))):
        wrong = torque[part] - columns[part] @ values
        errors = np.linalg.norm(wrong, axis=0) / np.linalg.norm(torque[part], axis=0)
        out[label] = float(np.linalg.norm(wrong) / np.linalg.norm(torque[part])), 0.0
        print(f"relative torque error, {label}: joint 1 {errors[0]:.1%}, joint 2 {errors[1]:.1%}")
    return out


if __name__ == "__main__":
    main()
