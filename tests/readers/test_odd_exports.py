"""Text tables as tools of drives export them: quoted commas, points between thousands, times of day, counters."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from stickslip.core.errors import InputError
from stickslip.core.record import Record
from stickslip.readers import read
from stickslip.readers._cells import cell

N = 200
T = np.arange(N) * 2e-3
Q = 40.0 * np.sin(9.0 * T)  # mm
M = 1.5 * np.cos(9.0 * T)  # N·m or N


def loaded(tmp_path: Path, text: str) -> Record:
    path = tmp_path / "log.csv"
    path.write_text(text, encoding="utf-8")
    return read(path)


def test_decimal_commas_in_quotes_between_commas(tmp_path):
    """Was said to hold no table of numbers."""
    rows = [f'"{t:.4f}";"{q:.5f}";"{m:.3f}"'.replace(".", ",").replace(";", ",") for t, q, m in zip(T, Q, M)]
    record = loaded(tmp_path, '"Zeit, s","Position, mm","Kraft, N"\n' + "\n".join(rows))
    np.testing.assert_allclose(record.time, T, atol=1e-9)
    np.testing.assert_allclose(record["position"], 1e-3 * Q, atol=1e-8)
    np.testing.assert_allclose(record["motor_torque"], M, atol=1e-3)


@pytest.mark.parametrize(
    ("text", "decimal", "value"),
    [
        ("1.234,5", ",", 1234.5), ("-1.234.567,25", ",", -1234567.25), ("1'234.5", ".", 1234.5),
        ("1,234.5", ".", 1234.5), ("1.234", ",", 1.234), ("1.2345,6", ",", None), ("12,34.5", ".", None),
        ("08:00:01.5", ".", 28801.5), ("8:00:01,5", ",", 28801.5), ("25:00:00", ".", None),
    ],
)  # fmt: skip
def test_what_a_cell_holds(text, decimal, value):
    assert cell(text, decimal) == value


def test_points_between_thousands(tmp_path):
    """Rows from the second second on were missing, and the log was to be made again."""

    def said(x: float) -> str:
        return f"{x:,.1f}".replace(",", " ").replace(".", ",").replace(" ", ".")

    rows = [f"{said(1e4 * t)};{said(100.0 * q)};{m:.3f}".replace(";-0.", ";-0,") for t, q, m in zip(T, Q, M)]
    rows = [r.rsplit(";", 1)[0] + ";" + r.rsplit(";", 1)[1].replace(".", ",") for r in rows]
    record = loaded(tmp_path, "Zeit [ms];Position [µm];Kraft [N]\n" + "\n".join(rows))
    np.testing.assert_allclose(record.time, 10.0 * T, atol=1e-9)
    np.testing.assert_allclose(record["position"], 1e-4 * Q, atol=1e-7)
    assert not record.meta["reading"]["findings"]


def counted(counts, torque):
    """A log of counts and torques, as two formats write them."""
    rows = [f"{1e3 * t:.0f};{counts.format(round(1e2 * q))};{torque.format(m)}" for t, q, m in zip(T, Q, M)]
    return "Zeit [ms];Position [µm];Moment [N]\n" + "\n".join(rows)


def test_points_between_thousands_of_whole_numbers(tmp_path):
    """1.234 was read as 1.234 beside 12,3: a thousandth, in the rows above 999 alone."""
    text = counted("{:,}", "{:.1f}").replace(".", "!").replace(",", ".").replace("!", ",")
    record = loaded(tmp_path, text)
    np.testing.assert_allclose(record["position"], 1e-6 * np.round(1e2 * Q), atol=1e-12)
    np.testing.assert_allclose(record["motor_torque"], np.round(M, 1), atol=1e-9)
    (finding,) = record.meta["reading"]["findings"]
    assert finding["code"] == "thousands"
    assert "in column 2 was read as 1" in finding["message"]


def test_commas_between_thousands_of_whole_numbers(tmp_path):
    record = loaded(tmp_path, counted("{:,}", "{:.1f}"))
    np.testing.assert_allclose(record["position"], 1e-6 * np.round(1e2 * Q), atol=1e-12)
    np.testing.assert_allclose(record["motor_torque"], np.round(M, 1), atol=1e-9)


def test_points_and_commas_that_nothing_tells_apart_are_refused(tmp_path):
    rows = [f"{1e3 * t:.0f};{5 + t:.3f};{7 + t:.3f}".rsplit(".", 1) for t in T]
    text = "Zeit [ms];Position [mm];Kraft [N]\n" + "\n".join(",".join(r) for r in rows)
    with pytest.raises(InputError, match=r"'5.000' in column 2 and '7,000' .* nothing tells which"):
        loaded(tmp_path, text)
    one = "Zeit [ms];Kraft [N];Position [mm]\n0;0,5;1.5\n" + "\n".join(f"{i};0,5;{i},5" for i in range(1, 40))
    with pytest.raises(InputError, match=r"'1.5' in column 3 and '1,5'"):
        loaded(tmp_path, one)


@pytest.mark.parametrize("begin", [8 * 3600, 86400 - 0.1])
def test_times_of_day_are_in_seconds_and_go_on_at_midnight(tmp_path, begin):
    """The column of times was not even named."""
    rows = []
    for t, q in zip(T, Q):
        s = round(begin + t, 3) % 86400
        rows.append(f"{int(s // 3600):02d}:{int(s // 60 % 60):02d}:{s % 60:06.3f},{q:.5f}")
    record = loaded(tmp_path, "Time,Position [mm]\n" + "\n".join(rows))
    np.testing.assert_allclose(record.time - record.time[0], T, atol=1e-6)
    assert next(c for c in record.meta["reading"]["columns"] if c["channel"] == "time")["source"] == "file"


def test_dates_state_their_unit(tmp_path):
    """Their unit was "assumed", and the result doubted for it."""
    rows = [f"2026-11-27 08:00:{t:06.3f};{q:.5f}" for t, q in zip(T, Q)]
    record = loaded(tmp_path, "Timestamp;Position [mm]\n" + "\n".join(rows))
    np.testing.assert_allclose(record.time, T, atol=1e-6)
    assert {c["source"] for c in record.meta["reading"]["columns"]} == {"file", "name"}


@pytest.mark.parametrize("lost", [0, 2])
def test_a_counter_of_times_is_counted_on(tmp_path, lost):
    """The record went on for -57 s."""
    ticks = (65436 + np.arange(N)) % 65536
    keep = np.abs(np.arange(N) - 100) >= lost
    rows = [f"{k},{q:.5f}" for k, q in zip(ticks[keep], Q[keep])]
    record = loaded(tmp_path, "ms,Position [mm]\n" + "\n".join(rows))
    np.testing.assert_allclose(record.time, 1e-3 * (65436 + np.arange(N)[keep]))
    assert [f["code"] for f in record.meta["reading"]["findings"]] == ["time-wrap"]


def test_a_time_that_goes_back_otherwise_is_left_as_it_is(tmp_path):
    rows = [f"{k % 100},{q:.5f}" for k, q in enumerate(Q)]
    record = loaded(tmp_path, "ms,Position [mm]\n" + "\n".join(rows))
    assert record.time[100] == 0.0


def test_a_scope_s_pairs_below_lines_about_the_scope(tmp_path):
    """The project's name was taken for the channels'."""
    rows = [f"{1e3 * t:.3f}\t{q:.5f}\t{1e3 * t + 0.75:.3f}\t{m:.3f}" for t, q, m in zip(T, Q, M)]
    head = "Name\tProject Axis 1\nFile\ta.svdx\n\nTime (ms)\tAxis 1.ActPos (mm)\tTime (ms) \tAxis 1.ActForce (N)\n"
    record = loaded(tmp_path, head + "\n".join(rows))
    np.testing.assert_allclose(record["position"], 1e-3 * Q, atol=1e-8)
    assert record["motor_torque"][5] == pytest.approx(np.interp(T[5], T + 0.75e-3, M), abs=2e-3)
