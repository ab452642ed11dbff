"""Contents of a model.toml besides the law: estimates, correlation, axis, and the records it comes from."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, cast

import numpy as np

from stickslip.core.config import Table, read_toml
from stickslip.core.errors import InputError
from stickslip.core.messages import in_linear_units, name_file
from stickslip.identification.estimate import Estimate
from stickslip.identification.motion import Motion, motion_in
from stickslip.machines.identified import train_in
from stickslip.machines.two_inertias import TwoInertias
from stickslip.models.model import Model

Array = np.ndarray[Any, np.dtype[np.float64]]


@dataclass(frozen=True, eq=False)
class Identified:
    """An identified law with the other contents of its file.

    Attributes
    ----------
    path : Path
        Path of the file; only a name if no file was written.
    model : Model
    estimates : tuple of Estimate
        Empty in a file written by hand.
    correlation : array, shape (n, n)
    axis : mapping
        ``inertia`` and other numbers of the axis that the method determined.
    motion : str
        "rotary" or "linear".
    data : tuple of mapping
        ``file``, ``sha256``, ``rows``, ``sample_time`` (s, between its rows), ``position_step`` (rad or m, encoder step
        or rounding) of every record.
    misfit : mapping of str to float
    trajectory : Motion or None
        The motion of the record on which it was identified.
    speeds : mapping of str to array
        Quantiles (0, 0.1, ..., 1) of the recorded speeds, rad/s: "positive" and "negative"; empty if unknown.
    law_file : str
        Path of the law's file; empty if the law is registered.
    train : TwoInertias or None
        Motor and load behind a spring, if the record determined them.
    """

    path: Path
    model: Model
    estimates: tuple[Estimate, ...]
    correlation: Array
    axis: Mapping[str, Any] = field(default_factory=dict[str, Any])
    motion: str = "rotary"
    data: tuple[Mapping[str, Any], ...] = ()
    misfit: Mapping[str, float] = field(default_factory=dict[str, float])
    trajectory: Motion | None = None
    speeds: Mapping[str, Array] = field(default_factory=dict[str, Array])
    law_file: str = ""
    train: TwoInertias | None = None

    def unit(self, angular: str) -> str:
        """Return a unit of the angular system in the axis's own system."""
        return angular if self.motion == "rotary" else in_linear_units(angular)

    @property
    def sampled(self) -> tuple[float, str]:
        """Shortest time between rows of its records, s, and that record's file; 0 and "" if it is unknown."""
        return min(self._of_records("sample_time"), default=(0.0, ""))

    @property
    def position_step(self) -> tuple[float, str]:
        """Coarsest step of the positions in its records, rad (m), and that record's file; 0 and "" if none shows."""
        return max(self._of_records("position_step"), default=(0.0, ""))

    def _of_records(self, name: str) -> list[tuple[float, str]]:
        """Return a positive number of every record that has it, each with the record's file."""
        return [
            (float(value), str(d.get("file", "")))
            for d in self.data
            if isinstance(value := d.get(name), (int, float)) and 0.0 < value < math.inf
        ]

    @property
    def law_estimates(self) -> tuple[tuple[Estimate, ...], Array]:
        """The estimates of the law's own parameters, and their correlation."""
        names = {f.name for f in self.model.law.fields}
        places = [i for i, e in enumerate(self.estimates) if e.name.partition("[")[0] in names]
        return tuple(self.estimates[i] for i in places), self.correlation[np.ix_(places, places)]


def read_identified(path: str | os.PathLike[str]) -> Identified:
    """Read a file written by `stickslip.identification.model_file.write_model`.

    Raises
    ------
    InputError
        If there is no such file, it is not a model, or its tables are damaged.
    """
    return identified_in(read_toml(Path(path)))


def identified_in(table: Table) -> Identified:
    """Read a file's content like `read_identified`."""
    file = Path(table.document.name)
    model = Model.from_table(table)
    content = table.values
    try:
        estimates = tuple(
            Estimate(
                str(e["name"]), str(e["unit"]), str(e["name"]), float(e["value"]), float(e["std"]), float(e["lower"]),
                float(e["upper"]), bool(e["identified"]), str(e.get("verdict", "")),
            )
            for e in _tables(content, "estimates", file)
        )  # fmt: skip
        matrix = np.array(_table(content, "correlation", file).get("matrix", []), dtype=np.float64)
        matrix = matrix.reshape(len(estimates), len(estimates))
    except KeyError as error:
        raise InputError(
            f"{name_file(file)}: one of its estimates lacks {error}; identify the axis again"
        ) from None
    except (TypeError, ValueError, AttributeError) as error:
        raise InputError(
            f"{name_file(file)}: its estimates cannot be read ({error}); identify the axis again"
        ) from None
    axis = dict(_table(content, "axis", file))
    try:
        speeds = {
            k: np.abs(np.array(v, dtype=np.float64)) for k, v in _table(content, "speeds", file).items()
        }
    except (TypeError, ValueError) as error:
        raise InputError(
            f"{name_file(file)}: its speeds cannot be read ({error}); identify the axis again"
        ) from None
    return Identified(
        file, model, estimates, np.where(np.isfinite(matrix), matrix, np.eye(len(estimates))),
        axis, str(content.get("motion", "rotary")), tuple(_tables(content, "data", file)),
        {k: float(v) for k, v in _table(content, "misfit", file).items() if isinstance(v, (int, float))},
        motion_in(content, str(file)),
        speeds,
        str(table.document.folder / law) if (law := str(content["law"])).endswith(".py") else "",
        train_in(content, str(file)),
    )  # fmt: skip


def _table(content: Mapping[str, Any], name: str, file: Path) -> dict[str, Any]:
    """Return a table of a model's file; empty if it has none."""
    value: Any = content.get(name, {})
    if not isinstance(value, dict):
        raise InputError(
            f"{name_file(file)}: {name} = {value!r} must be a table [{name}]; identify the axis again"
        )
    return cast("dict[str, Any]", value)


def _tables(content: Mapping[str, Any], name: str, file: Path) -> list[dict[str, Any]]:
    """Return a list of tables of a model's file; empty if it has none."""
    value: Any = content.get(name, [])
    if not isinstance(value, list) or not all(isinstance(e, dict) for e in cast("list[Any]", value)):
        raise InputError(
            f"{name_file(file)}: {name} = {value!r} must be tables [[{name}]]; identify the axis again"
        )
    return cast("list[dict[str, Any]]", value)


def covariance(estimates: tuple[Estimate, ...], correlation: Array, logarithmic: list[bool]) -> Array:
    """Return the covariance of the estimates, of their logarithms where `logarithmic`."""
    from stickslip.identification.monte_carlo import log_spread

    std = np.array([
        log_spread(e) if log else (e.std if math.isfinite(e.std) else (e.upper - e.lower) / 3.92)
        for e, log in zip(estimates, logarithmic, strict=True)
    ])  # fmt: skip
    return std[:, None] * correlation * std[None, :]
