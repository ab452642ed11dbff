"""Traces of CODESYS V3 and ctrlX, saved as CSV: the variables one below the other, each with its own times."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from stickslip.core.errors import InputError
from stickslip.readers import open_table, read

T = np.arange(60)
POSITION, TORQUE = 30.0 * np.sin(0.3 * T), 12.0 * np.sign(np.cos(0.3 * T))
KEYS = "Version; 0x03050000\nName; App.TraceX\nIecTaskName; Motion\nEveryNCycles; 1\nBufferEntries; 61\n"


def trace(
    path: Path, step: int = 10, flags: str = "", decimal: str = ".", every: int = 1, encoding: str = "utf-8"
) -> Path:
    """A trace of two variables; the torque has every so many samples."""
    text = "[key]; [value]\n" + KEYS + flags
    for i, (name, values, n) in enumerate((("GVL.fPosAct", POSITION, 1), ("GVL.fTrqAct", TORQUE, every))):
        text += f"{i}.Variable; {name}\n{i}.Class; 14\n{i}.GraphColor; 4282811060\n{i}.Data; \n"
        rows = [
            f"; {step * k}; {x:.4f}".replace(".", decimal) for k, x in zip(T[::n], values[::n], strict=True)
        ]
        text += "".join(f"{row}\r\n" for row in rows)
    path.write_bytes(text.encode(encoding))
    return path


@pytest.mark.parametrize("decimal", [".", ","])
@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16"])
def test_variables_are_channels(tmp_path, decimal, encoding):
    """ "No column is known to be a channel among 0.Data, column 2, column 3"."""
    record = read(trace(tmp_path / "x.trace.csv", decimal=decimal, encoding=encoding))
    np.testing.assert_allclose(record.time, 0.01 * T)
    np.testing.assert_allclose(record["position"], POSITION, atol=1e-4)
    np.testing.assert_allclose(record["motor_torque"], TORQUE, atol=1e-4)
    (note,) = record.meta["reading"]["findings"]
    assert note["message"] == "the trace states no unit of its times: ms was assumed, 0.01 s a sample"


@pytest.mark.parametrize(
    ("step", "flags", "period"),
    [
        (1000, "Flags; 32\n", 1e-3),
        (1000, "Flags; 36\n", 1e-3),
        (4, "Flags; 16\n", 4e-3),
        (1000, "", 1e-3),
        (2, "", 2e-3),
    ],
)
def test_flags_state_the_unit_of_the_times(tmp_path, step, flags, period):
    record = read(trace(tmp_path / "log.csv", step, flags))
    assert np.median(np.diff(record.time)) == pytest.approx(period)
    assert bool(record.meta["reading"]["findings"]) != bool(flags)


def test_a_slower_variable_is_resampled(tmp_path):
    record = read(trace(tmp_path / "log.csv", every=3))
    assert len(record) == 60
    (note,) = [f for f in record.meta["reading"]["findings"] if f["code"] == "resampled"]
    assert "sampled every 30 ms" in note["message"]


def test_a_second_recording_is_another_column(tmp_path):
    path = trace(tmp_path / "log.csv")
    text = path.read_text().replace("; 300; ", "; 5; ", 1)
    path.write_text(text)
    names = [c.name for c in open_table(path).columns]
    assert names == ["GVL.fPosAct", "GVL.fPosAct (2)", "GVL.fTrqAct"]


def test_words_and_other_lines(tmp_path):
    path = trace(tmp_path / "log.csv")
    more = "2.Variable; GVL.sState\n2.Data; \n; 0; 'run'\n; 10; 'run'\n3.Variable; GVL.none\n3.Data; \nCursor1; 12\n"
    path.write_text(path.read_text() + more)
    table = open_table(path)
    assert len(table.columns) == 2
    assert table.unread == {"GVL.sState": "'run'"}
    assert any("'GVL.none'" in f.message for f in table.findings)


def test_a_sample_without_a_time_is_refused(tmp_path):
    path = trace(tmp_path / "log.csv")
    path.write_text(path.read_text() + "; x; 4\n")
    with pytest.raises(InputError, match=r"log.csv, line 135: no time in 'x'"):
        read(path)
