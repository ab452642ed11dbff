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


NOW = pandas.date_range("2024-01-01", periods=T.size, freq="ms")
DATES = {
    "datetime64[ns]": NOW.to_numpy(),
    "datetime64[us]": NOW.to_numpy().astype("datetime64[us]"),
    "index": NOW,
    "series": pandas.Series(NOW),
    "time zone": pandas.Series(NOW).dt.tz_localize("Europe/Vienna"),
    "objects": np.array(list(NOW), dtype=object),
    "datetime": [date.to_pydatetime() for date in NOW],
    "list of datetime64": list(NOW.to_numpy()),
    "texts": NOW.astype(str).to_numpy(),
    "timedelta64": NOW.to_numpy() - NOW.to_numpy()[0],
}


WAYS = [
    (way, kind)
    for way in ("arrays", "mapping", "frame")
    for kind in DATES
    if (way, kind) != ("arrays", "texts")
]


@pytest.mark.parametrize(("given", "kind"), WAYS)
def test_dates_of_every_kind_are_times(given: str, kind: str) -> None:
    dates: Any = DATES[kind]
    signals = {"position": LOG["position"], "torque": LOG["torque"]}
    table: Any = {"time": dates, **signals, "other": T}
    read = ss.read(t=dates, **signals) if given == "arrays" else ss.read(
        table if given == "mapping" else pandas.DataFrame(table)
    )  # fmt: skip
    assert np.allclose(read.time - read.time[0], T, atol=1e-6)
    assert ss.doctor(read).errors == ()


def test_only_the_time_may_be_dates() -> None:
    with pytest.raises(ss.InputError, match="position is of dates, which only the time may be"):
        ss.read(t=T, position=NOW, torque=LOG["torque"])


@pytest.mark.parametrize(
    "thing", [np.array(None), np.array(1.0), np.array("text"), np.array((1.0, 2.0), "f8,f8")]
)
def test_an_array_without_rows_is_no_log(thing: Any) -> None:
    for call in (ss.read, ss.doctor, ss.identify):
        with pytest.raises(ss.InputError, match="log"):
            call(thing)
    for name in ("t", "position", "torque"):
        with pytest.raises(ss.InputError, match=name):
            ss.read(**{**LOG, name: thing})


def test_an_array_around_a_mapping_is_that_mapping() -> None:
    assert len(ss.read(np.array(dict(LOG), dtype=object))) == T.size


def test_a_number_that_no_float_holds_is_infinite_or_refused() -> None:
    large = [10**400, *LOG["position"][1:]]
    with pytest.raises(ss.InputError, match="position has a number beyond"):
        ss.read(**{**LOG, "position": large})
    found = ss.doctor({**LOG, "position": large, "other": T}).findings
    assert any(f.code == "nan" and f.message.startswith("position has 1 ") for f in found)


def of_itself(kind: str) -> Any:
    mapping: dict[str, Any] = {"a": 1.0}
    mapping["b"] = mapping
    items: list[Any] = [1.0]
    items.append(items)
    array: Any = np.array([1.0, None], dtype=object)
    array[1] = array
    return {"mapping": mapping, "list": items, "array": array, "samples": [{"t": 0.0, "x": mapping}]}[kind]


@pytest.mark.parametrize("kind", ["mapping", "list", "array", "samples"])
def test_what_contains_itself_is_refused(kind: str) -> None:
    whole = [of_itself(kind)] if kind != "array" else []  # an array has no names
    for data in (*whole, {"time": T, "q": LOG["position"], "tau": of_itself(kind)}):
        with pytest.raises(ss.InputError, match="contains itself"):
            ss.doctor(data)
    with pytest.raises(ss.InputError, match="position"):
        ss.read(t=T, position=of_itself(kind), torque=LOG["torque"])


def test_containers_in_containers_come_to_an_end() -> None:
    wide: Any = [1.0, "x"]
    for _ in range(10):
        wide = [wide] * 60
    with pytest.raises(ss.InputError, match="at most"):
        ss.read({"time": T, "q": wide})


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
