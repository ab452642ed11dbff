"""The result of `stickslip.analyse.stability`, and its report."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from stickslip.analyse.presliding_loop import Axis, Drive, Poles
from stickslip.machines.drivetrain import Drivetrain, LinearContact

Array = np.ndarray[Any, np.dtype[np.float64]]

MOST_GAIN = 3.0
TIMES = np.geomspace(1e-4, 4e-3, 33)
"""Sample times of the map, s."""
FILTERS = np.geomspace(2.0, 300.0, 33)
"""Filter corners of the map, Hz."""
GAINS = np.linspace(0.0, 1.5, 31)
"""Gains of the maps."""


@dataclass(frozen=True)
class Cycle:
    """A limit cycle: frequency (Hz) and amplitude at the encoder (rad); infinite if the motion grows without limit."""

    frequency: float
    amplitude: float


@dataclass(frozen=True)
class Margins:
    """Stability margins of one compensator.

    Attributes
    ----------
    name : str
        Empty: no compensation.
    law : LinearContact
        The compensator's law at the small amplitude.
    filter_hz : float
        Corner of the filter at its input, Hz; 0 for none.
    at_one : Poles
        Least stable pole with gain 1.
    gain : float
        The loop is stable for all gains from 0 to this; NaN if it is unstable without compensation.
    static : float
        The gain at which the stiffness is zero.
    softer : float
        Relative loss of contact stiffness that the loop tolerates with gain 1; NaN if it is unstable.
    counts : float
        The loop with gain 1 is stable for all factors on the measured angle from 0 to this; above 4/pi the encoder's
        quantisation causes no limit cycle; NaN if it is unstable.
    cycle : Cycle or None
        Limit cycle of an unstable loop with gain 1; None if it is stable.
    """

    name: str
    law: LinearContact
    filter_hz: float
    at_one: Poles
    gain: float
    static: float
    softer: float
    counts: float
    cycle: Cycle | None

    def line(self) -> str:
        """Return a row of the table."""
        sieve = f"{self.filter_hz:g} Hz" if self.filter_hz else "none"
        pole = f"{self.at_one.growth:+9.1f}/s at {self.at_one.frequency:5.1f} Hz"
        end = ""
        if self.cycle:
            end = "grows on" if math.isinf(self.cycle.amplitude) else f"{_angle(self.cycle.amplitude)}"
            if math.isfinite(self.cycle.amplitude):
                end += f" at {self.cycle.frequency:.0f} Hz"
        verdict = "stable" if self.at_one.stable else "unstable"
        return (
            f"{self.name or 'none':<10}{sieve:>8}{self.law.stiffness:>9.1f}{self.law.damping:>11.4g}  {verdict:<9}"
            f"{pole}  {end:<20}{_number(self.gain):>6}{_number(self.static):>8}{_share(self.softer):>8}"
            f"{_number(self.counts):>8}"
        ).rstrip()


HEADER = (
    f"{'law':<10}{'filter':>8}{'N·m/rad':>9}{'N·m·s/rad':>11}  {'with gain 1':<32}{'ends in':<20}"
    f"{'gain':>6}{'static':>8}{'softer':>8}{'counts':>8}"
)


def _angle(amplitude: float) -> str:
    return f"{1e6 * amplitude:.0f} µrad" if amplitude < 1e-3 else f"{1e3 * amplitude:.3g} mrad"


def _number(value: float) -> str:
    if math.isnan(value):
        return "-"
    return f">{MOST_GAIN:g}" if value >= MOST_GAIN else f"{value:.2f}"


def _share(value: float) -> str:
    return "-" if math.isnan(value) else f"{100.0 * value:.0f} %"


@dataclass(frozen=True)
class SafeGain:
    """A gain and a filter (Hz, 0 for none) for a compensator, and the least stable pole with them."""

    name: str
    gain: float
    filter_hz: float
    poles: Poles


@dataclass(frozen=True, eq=False)
class Map:
    """One compensator's loop over gain and sample time, or gain and filter.

    ``growth`` (1/s) and ``frequency`` (Hz) of the least stable pole, shape (gains, sample times or filters).
    """

    name: str
    growth: Array
    frequency: Array


@dataclass(frozen=True, eq=False)
class Stability:
    """The margins of every compensator on one axis and drive.

    Attributes
    ----------
    axis : Axis
    drive : Drive
        Without its law and gain.
    drivetrain : Drivetrain
        With the contact at the small amplitude.
    linear_limit : float
        The linear controller alone is stable up to this factor on its bandwidth; NaN if at none.
    margins : tuple of Margins
        The first without compensation.
    over_time, over_filter : mapping of str to array
        Gain margin at `TIMES` and, with a filter, at `FILTERS`.
    recommended : mapping of str to SafeGain or None
        None if no setting is safe.
    time_map, filter_map : Map
        Maps of the stiffest compensator: `GAINS` over `TIMES` without filter, and over `FILTERS`.
    """

    axis: Axis
    drive: Drive
    drivetrain: Drivetrain
    linear_limit: float
    margins: tuple[Margins, ...]
    over_time: Mapping[str, Array]
    over_filter: Mapping[str, Array]
    recommended: Mapping[str, SafeGain | None]
    time_map: Map
    filter_map: Map

    @property
    def linear(self) -> Margins:
        """Margins without compensation."""
        return self.margins[0]

    def as_dict(self) -> dict[str, Any]:
        """Return plain data."""
        return {
            "drivetrain": asdict(self.drivetrain), "drive": asdict(self.drive),
            "visible_stiffness": self.drivetrain.visible,
            "amplitude": self.axis.amplitude, "linear_limit": self.linear_limit,
            "margins": [asdict(m) for m in self.margins],
            "sample_times": TIMES.tolist(), "filters": FILTERS.tolist(),
            "gain_over_sample_time": {k: v.tolist() for k, v in self.over_time.items()},
            "gain_over_filter": {k: v.tolist() for k, v in self.over_filter.items()},
            "recommended": {k: asdict(r) if r else None for k, r in self.recommended.items()},
        }  # fmt: skip

    def lines(self) -> list[str]:
        """Return the lines of the report."""
        d = self.drive
        limit = (
            "at no bandwidth"
            if math.isnan(self.linear_limit)
            else f"up to {self.linear_limit:.2f} times its bandwidth"
        )
        return [
            f"motion of {_angle(self.axis.amplitude)}; contact as the encoder sees it {self.drivetrain.visible:.1f} "
            f"N·m/rad, k_p {d.gains.kp:.4g}; {1e3 * d.sample_time:g} ms, {d.delay:g} samples late",
            f"the linear controller alone is stable {limit}",
            "",
            HEADER,
            *(m.line() for m in self.margins),
            "",
            *(self._advice(name, found) for name, found in self.recommended.items()),
        ]

    def _advice(self, name: str, found: SafeGain | None) -> str:
        if found:
            sieve = f"a filter of {found.filter_hz:g} Hz" if found.filter_hz else "no filter"
            pole = f"{found.poles.growth:+.1f}/s at {found.poles.frequency:.1f} Hz"
            return f"{name}: gain {found.gain:g} with {sieve} keeps its margins ({pole})"
        if not self.linear.at_one.stable:
            return f"{name}: the linear controller alone is unstable; lower its bandwidth first"
        return f"{name}: no gain from 0.5 to 1 keeps its margins with any filter from 2 Hz; use feedforward"
