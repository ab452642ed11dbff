"""The one container for simulated and measured runs."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from stickslip.core.arguments import arguments_checked, constructor_named, insist_on_own
from stickslip.core.errors import InputError, suggestion
from stickslip.core.extras import needed
from stickslip.core.reprs import same
from stickslip.core.whole_files import draft_of

if TYPE_CHECKING:
    import pandas

Array = np.ndarray[Any, np.dtype[np.float64]]

FEWEST_CHANGES = 20
"""Changes of a position, and rows in which they differ from the one before, that determine an encoder's step."""
ZIP = b"PK"
"""How an .npz file begins."""


@constructor_named
@dataclass(frozen=True, eq=False)
class Record:
    """Channels over time, with their units and where they come from.

    Attributes
    ----------
    time : array, shape (n,)
        s, ascending; a time may occur twice where a signal jumps.
    channels : mapping of str to array, shape (n,)
    units : mapping of str to str
        The unit of every channel.
    meta : mapping
        What was run or measured, when, with which machine, versions and seed; metrics and energies of a
        simulation. Plain data: it is saved as JSON.

    Notes
    -----
    Two are equal where times, channels, units and meta are, NaN where NaN is.
    """

    time: Array
    channels: Mapping[str, Array]
    units: Mapping[str, str]
    meta: Mapping[str, Any] = field(default_factory=dict[str, Any])

    def __post_init__(self) -> None:
        insist_on_own(self, "record")
        for name, values in self.channels.items():
            if values.shape != self.time.shape:
                raise InputError(f"channel {name!r} has shape {values.shape}, time has {self.time.shape}")
            if name not in self.units:
                raise InputError(f"channel {name!r} has no unit; add it to `units`")

    def __getitem__(self, name: str) -> Array:
        if name == "time":
            return self.time
        try:
            return self.channels[name]
        except (KeyError, TypeError):
            raise InputError(f"no channel {name!r}; {suggestion(str(name), self.channels)}") from None

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Record):
            return NotImplemented
        return all(same(getattr(self, f.name), getattr(other, f.name)) for f in fields(Record))

    def __len__(self) -> int:
        return int(self.time.size)

    def __repr__(self) -> str:
        span = f", {self.time[0]:.6g} to {self.time[-1]:.6g} s" if len(self) else ""
        listed = ", ".join(f"{name} [{self.units[name]}]" for name in self.channels)
        return f"<Record: {len(self)} rows{span}; {listed}>"

    def _repr_html_(self) -> str:
        """The channels with their units and ranges in a notebook, and the metrics of a simulation."""
        rows = "".join(
            f"<tr><td>{escape(name)}</td><td>{escape(self.units[name])}</td>"
            + "".join(f"<td>{x:.4g}</td>" for x in _range(values))
            + "</tr>"
            for name, values in self.channels.items()
        )
        head = "".join(f"<th>{h}</th>" for h in ("channel", "unit", "least", "greatest"))
        span = f", {self.time[0]:.6g} to {self.time[-1]:.6g} s" if len(self) else ""
        metrics = cast("Mapping[str, float]", self.meta.get("metrics") or {})
        listed = ", ".join(f"{name} {value:.4g}" for name, value in metrics.items() if math.isfinite(value))
        more = f"<details><summary>metrics</summary>{escape(listed)}</details>" if listed else ""
        table = f"<table><thead><tr>{head}</tr></thead><tbody>{rows}</tbody></table>"
        return f"<div><b>Record</b>: {len(self)} rows{span}{table}{more}</div>"

    @arguments_checked
    def plot(self, *channels: str) -> Any:
        """Draw channels over time, one panel a unit, and the position error if the record has a reference.

        Parameters
        ----------
        *channels : str
            Names of channels; positions, velocities and torques, unless given.

        Returns
        -------
        matplotlib.figure.Figure
            A notebook shows it; its ``savefig("run.png")`` writes it.

        Raises
        ------
        InputError
            If the record has no such channel.
        """
        import stickslip

        return stickslip.record_figure(
            self, channels
        )  # the package knows the room that draws; records lie below it

    @arguments_checked
    def save(self, path: str | os.PathLike[str]) -> Path:
        """Write the record as .npz: arrays, and units and meta as JSON (no pickle). Returns the path.

        Raises
        ------
        InputError
            If it cannot be written there.
        """
        target = Path(path)
        header = json.dumps({"units": dict(self.units), "meta": dict(self.meta)})
        arrays: dict[str, Any] = {"time": self.time, **self.channels}
        with draft_of(target) as draft, draft.open("wb") as file:
            np.savez(file, __header__=np.array(header), **arrays)
        return target

    @classmethod
    @arguments_checked
    def load(cls, path: str | os.PathLike[str]) -> Record:
        """Read the record that `save` wrote to `path`, or the stream of a rig (`stickslip.core.stream`).

        Raises
        ------
        InputError
            If there is no such file, or it is not a record.
        """
        from stickslip.core import stream_file as stream
        from stickslip.core.config import refuse_endless

        refuse_endless(Path(path))

        try:
            with open(path, "rb") as file:
                begin = file.read(max(len(stream.MAGIC), len(ZIP)))
            if begin.startswith(stream.MAGIC):
                return cls(*stream.load(path))
            if not begin.startswith(ZIP):
                raise ValueError(
                    "what `save` writes is an .npz file; logs of other formats are for `ss.read`"
                )
            with np.load(path, allow_pickle=False) as data:
                units, meta = _header(str(data["__header__"]))
                values = {k: _real(k, data[k]) for k in data.files if k != "__header__"}
                return cls(values.pop("time"), values, units, meta)
        except FileNotFoundError:
            raise InputError(f"no record at {path}; check the path") from None
        except InputError:
            raise
        except Exception as error:  # NumPy, zip, zlib and JSON each raise their own on a damaged file
            raise InputError(f"{path} is not a record of this package ({error})") from None

    def to_pandas(self) -> pandas.DataFrame:
        """The channels as a data frame indexed by time.

        Raises
        ------
        InputError
            Without pandas, which `pip install 'stickslip[pandas]'` brings.
        """
        pandas = needed("pandas", "pandas", "to_pandas() needs")
        frame = pandas.DataFrame(dict(self.channels), index=pandas.Index(self.time, name="time"))
        frame.attrs.update(units=dict(self.units), meta=dict(self.meta))
        return frame


def _range(values: Array) -> tuple[float, float]:
    """The least and the greatest finite value; NaN if there is none."""
    known = values[np.isfinite(values)]
    return (float(known.min()), float(known.max())) if known.size else (math.nan, math.nan)


def _header(text: str) -> tuple[dict[str, str], dict[str, Any]]:
    """Units and meta as `Record.save` writes them."""
    header: Any = json.loads(text)
    units, meta = header["units"], header["meta"]
    if not (isinstance(units, dict) and isinstance(meta, dict)):
        raise ValueError("its units or its meta are no table")
    named = cast("dict[str, Any]", units)
    if odd := [name for name, unit in named.items() if not isinstance(unit, str)]:
        raise ValueError(f"the unit of {odd[0]!r} is {named[odd[0]]!r}, which is no text")
    return named, cast("dict[str, Any]", meta)


def _real(name: str, values: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
    """The array, if it holds real numbers: no fields, texts, dates or complex numbers."""
    if values.dtype.kind not in "fiub":
        raise ValueError(f"{name!r} holds {values.dtype}, which are no real numbers")
    return values


def encoder_step(position: Array) -> float:
    """The step of which the position's changes from row to row are whole multiples, in its unit; 0 where there is none.

    Changes of up to 50 steps are looked at: those of a faster motion are known no better than the noise of one step.
    Changes that stay equal from row to row, as of a computed motion at constant speed, do not determine a step.
    """
    all_changes = np.abs(np.diff(position))
    changes = all_changes[all_changes > 1e-12 * float(np.max(np.abs(position), initial=1e-300))]
    if changes.size < FEWEST_CHANGES:
        return 0.0
    if np.count_nonzero(np.abs(np.diff(all_changes)) > 0.5 * float(np.min(changes))) < FEWEST_CHANGES:
        return 0.0
    step = float(np.min(changes))
    # The mean over the changes by one step is sharper than the smallest of them.
    step = float(np.mean(changes[changes < 1.5 * step]))
    multiples = changes[changes < 50.0 * step] / step
    return step if float(np.mean(np.abs(multiples - np.round(multiples)) < 0.02)) > 0.95 else 0.0


SAME_COUNTS = 2e-3
"""Share of a count by which the step in a log, a difference of rounded positions, may be off the encoder's."""


def counts_of_step(step: float, linear: bool = False) -> int:
    """Return the encoder counts per revolution (of a linear axis per 2 pi m) of a position step, rad (m).

    A count of an encoder is a power of 2 or some thousands per revolution, or a length of two digits, if the step is
    that close to one.
    """
    counts = 2.0 * math.pi / step
    if linear:
        near = float(f"{step:.2g}")
        return round(2.0 * math.pi / (near if abs(step - near) < SAME_COUNTS * near else step))
    for near in (2 ** round(math.log2(counts)) if counts >= 1.0 else 0, 1000 * round(counts / 1000.0)):
        if near and abs(counts - near) < SAME_COUNTS * near:
            return int(near)
    return round(counts)


def row_period(record: Record) -> float:
    """Usual time from one row to the next, s, to three digits; 0 where there are fewer than two rows."""
    return float(f"{float(np.median(np.diff(record.time))):.3g}") if record.time.size > 1 else 0.0
