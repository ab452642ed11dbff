"""What is in memory already: what is missing of it, what cannot be told, and times that need no name."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pandas
import pytest

import stickslip as ss

T = np.arange(0.0, 1.0, 1e-3)
LOG = {"t": T, "position": np.sin(T), "torque": np.cos(T)}


def structured(signals: dict[str, Any]) -> Any:
    made = np.ma.zeros(T.size, dtype=[(n, float) for n in LOG])
    for n, values in signals.items():
        made[n] = values
    return made


@pytest.mark.parametrize("name", LOG)
@pytest.mark.parametrize("kind", ["signals", "frame's mapping", "structured"])
def test_what_is_masked_is_missing(name: str, kind: str) -> None:
    """A masked 9e9 became a sample."""
    wild = LOG[name].copy()
    wild[500] = 9e9
    masked: Any = {**LOG, name: np.ma.MaskedArray(wild, mask=T[500] == T)}
    missing = {**LOG, name: np.where(T[500] == T, np.nan, wild)}
    if kind == "frame's mapping":
        masked, missing = (
            {"time [s]": d["t"], "q": d["position"], "tau": d["torque"]} for d in (masked, missing)
        )
    if kind == "structured":
        masked, missing = (structured(d) for d in (masked, missing))
    a, b = (ss.doctor(x) for x in (masked, missing))
    assert {f.code for f in a.findings} == {f.code for f in b.findings}
    assert "nan" in {f.code for f in a.findings}
    assert len(a.record) == T.size - 1


def test_masked_dates_and_points_are_missing() -> None:
    dates = np.ma.MaskedArray(
        np.datetime64("2024-01-01") + (1e6 * T).astype("timedelta64[us]"), mask=T[0] == T
    )
    read = ss.read(**{**LOG, "t": dates})
    assert np.isnan(read.time[0])
    assert np.allclose(np.diff(read.time[1:]), 1e-3)
    with pytest.raises(ss.InputError, match=r"position\[3\] = nan"):
        ss.Reference.table(T, np.ma.MaskedArray(LOG["position"], mask=T[3] == T))


@pytest.mark.parametrize("zone", [None, "Europe/Vienna"])
def test_an_index_of_dates_needs_no_name(zone: str | None) -> None:
    index = pandas.date_range("2024-01-01", periods=T.size, freq="ms", tz=zone)
    read = ss.read(pandas.DataFrame({"q": LOG["position"], "tau": LOG["torque"]}, index=index))
    assert np.allclose(np.diff(read.time), 1e-3, atol=1e-6)


def test_two_columns_of_one_name_are_refused() -> None:
    frame = pandas.DataFrame(np.stack([T, T, T, T], axis=1), columns=["t", "q", "q", "tau"])
    with pytest.raises(ss.InputError, match="2 columns are called 'q'"):
        ss.read(frame)


def test_true_and_false_are_no_numbers() -> None:
    with pytest.raises(ss.InputError, match="position is no array of numbers"):
        ss.read(**{**LOG, "position": T > 0.5})


def test_empty_arrays_are_called_so() -> None:
    with pytest.raises(ss.InputError, match=r"^t is empty"):
        ss.read(t=[], position=[], torque=[])


def test_the_short_name_of_the_time_is_known() -> None:
    frame = pandas.DataFrame({"a": T, "b": np.sin(T)})
    read = ss.read(frame, map={"t": "a", "position": "b"})
    assert np.array_equal(read.time, T)


def test_what_is_no_record_is_told_where_it_is_read(tmp_path: Path) -> None:
    """NumPy's advice was passed on, to allow code in the file."""
    file = tmp_path / "log.csv"
    file.write_text("t,q\n0,0\n")
    with pytest.raises(ss.InputError, match=r"is not a record .*`ss\.read`") as told:
        ss.Record.load(file)
    assert "pickle" not in str(told.value)
