"""Trends of Studio 5000 and tables put together: clocks with milliseconds apart, stated periods, headers repeated."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from stickslip.core.errors import InputError
from stickslip.readers import read
from stickslip.readers._cells import cell
from stickslip.readers._stated_period import stated_period

N = 300
MS = 122 + 8 * np.arange(N)
Q, TAU = np.sin(0.016 * np.arange(N)), np.cos(0.016 * np.arange(N))
ABOVE = 'Controller Name:,"Line4"\nSampling Rate:,8,Milli-Seconds\nStart Time:,02/12/2024 10:15:22;122\n\n'


def trend(path: Path, sign: str = ";", clock: bool = True) -> Path:
    """A trend as Studio 5000 writes it, with this sign before the milliseconds, or without its clock."""
    time = ['"Time",', *(f"10:15:{22 + m // 1000:02d}{sign}{m % 1000:03d}," for m in MS)]
    time = time if clock else [""] * (N + 1)
    rows = [f"Data,02/12/2024,{t}{q:.4f},{m:.4f}" for t, q, m in zip(time[1:], Q, TAU, strict=True)]
    header = f'"Header:","Date",{time[0]}"Position [rad]","Torque [Nm]"'
    path.write_text(ABOVE + "\n".join([header, *rows]) + "\n")
    return path


@pytest.mark.parametrize("sign", [";", ":", ".", ","])
def test_a_trends_clock_is_read_with_its_milliseconds(tmp_path, sign):
    """With a semicolon the file was said to have no column 'Time'; with a comma its milliseconds were the position."""
    record = read(trend(tmp_path / "trend.csv", sign), ["time=Time"])
    np.testing.assert_allclose(record.time - record.time[0], 8e-3 * np.arange(N), atol=1e-9)
    np.testing.assert_allclose(record["position"], Q, atol=1e-4)


@pytest.mark.parametrize(
    ("text", "seconds"),
    [
        ("10:15:22;122", 36922.122), ("10:15:22:122", 36922.122), ("10:15:22,122", 36922.122),
        ("10:15:22;7", 36922.007), ("10:15:22.5", 36922.5), ("10:15:22", 36922.0), ("10:15:22;1220", None),
        ("10:15:22;", None),
    ],
)  # fmt: skip
def test_signs_before_milliseconds(text, seconds):
    assert cell(text, ".") == (None if seconds is None else pytest.approx(seconds, abs=1e-9))


def test_whole_seconds_beside_a_column_of_three_digits_stay_apart(tmp_path):
    rows = [f"10:15:{k:02d},{100 + k},{k % 7}" for k in range(60)]
    (tmp_path / "log.csv").write_text("Time,Position [deg],Torque [Nm]\n" + "\n".join(rows) + "\n")
    record = read(tmp_path / "log.csv")
    np.testing.assert_allclose(np.degrees(record["position"]), 100.0 + np.arange(60))


def test_a_column_of_words_is_there_and_cannot_be_read(tmp_path):
    with pytest.raises(InputError, match=r"map=..time.: .date..: column 'Date' holds neither numbers nor a clock "
                                         r"that can be read, first '02/12/2024'; choose from Time, "):  # fmt: skip
        read(trend(tmp_path / "trend.csv"), ["time=date"])
    (tmp_path / "log.jsonl").write_text(
        "".join(f'{{"t": {k}, "q": {k * k}, "state": "RUN"}}\n' for k in range(9))
    )
    with pytest.raises(
        InputError, match="column 'state' holds neither numbers nor a clock that can be read, first 'R"
    ):
        read(tmp_path / "log.jsonl", ["position=state"])
    with pytest.raises(InputError, match="the file has no column 'stat'"):
        read(tmp_path / "log.jsonl", ["position=stat"])


def test_a_period_that_the_header_states_is_the_remedy(tmp_path):
    path = trend(tmp_path / "trend.csv", clock=False)
    with pytest.raises(
        InputError, match=r"give sample_time=0\.008, as the header says \(Sampling Rate: 8 Milli-Seconds\)"
    ):
        read(path)
    assert read(path, sample_time=0.008).time[-1] == pytest.approx(0.008 * (N - 1))


@pytest.mark.parametrize(
    ("key", "value", "period"),
    [
        ("Sampling period", "3.555 ms", 3.555e-3), ("Sample Time [us]", 250.0, 2.5e-4),
        ("Abtastzeit", "2,5 ms", 2.5e-3),
        ("Sampling frequency", "4 kHz", 2.5e-4), ("Sample rate", 1000.0, None), ("Trace time", "10 s", None),
        ("Sampling period", "3.5 Nm", None), ("Sampling period", "0 ms", None),
    ],
)  # fmt: skip
def test_what_states_a_period(key, value, period):
    found = stated_period({"Date": "12 s", key: value})
    assert (found and found[2]) == (None if period is None else pytest.approx(period))


def test_a_header_that_stands_again_among_the_rows_is_one_note(tmp_path):
    """One line of text was six warnings, and a row."""
    rows = [
        f"{0.002 * k:.3f};{q:.5f};{m:.4f}".replace(".", ",")
        for k, (q, m) in enumerate(zip(Q, TAU, strict=True))
    ]
    header = "Zeit [s];Position [rad];Drehmoment [Nm]"
    (tmp_path / "log.csv").write_text("\n".join([header, *rows[:100], header, *rows[100:]]) + "\n")
    record = read(tmp_path / "log.csv")
    (finding,) = record.meta["reading"]["findings"]
    assert (finding["level"], finding["code"], finding["where"]) == (
        "note",
        "repeated-header",
        "before row 101",
    )
    np.testing.assert_allclose(record.time, 0.002 * np.arange(N), atol=1e-9)
    np.testing.assert_allclose(record["position"], Q, atol=1e-5)


def test_rows_without_a_number_are_samples_still(tmp_path):
    """Without a clock the rows are counted: those of missing values above the first number are no header."""
    text = "position,torque\n,\n" + "".join(f"{k},{k % 7}\n" for k in range(60)) + ",\n" + "60,4\n61,5\n"
    (tmp_path / "log.csv").write_text(text)
    assert len(read(tmp_path / "log.csv", sample_time=0.1)) == 63
