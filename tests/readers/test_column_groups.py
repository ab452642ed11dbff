"""Text tables in which channels have times of their own: TwinCAT Scope, LabVIEW, merged logs of several rates."""

from __future__ import annotations

from itertools import zip_longest
from pathlib import Path

import numpy as np
import pytest

from stickslip.core.errors import InputError
from stickslip.core.record import Record
from stickslip.readers import open_table, read

FAST, SLOW = np.arange(400.0), 4.0 * np.arange(100)
"""Times of two rates, ms."""
POSITION = 30.0 * np.sin(2.0 * np.pi * 2.5e-3 * SLOW)
VELOCITY = 2.0 * np.pi * 2.5 * 30.0 * np.cos(2.0 * np.pi * 2.5e-3 * SLOW)
TORQUE = 12.0 * np.tanh(3.0 * np.cos(2.0 * np.pi * 2.5e-3 * FAST))
CHANNELS = {
    "ActPos": ("deg", 4, SLOW, POSITION),
    "ActVelo": ("deg/s", 4, SLOW, VELOCITY),
    "ActTorque": ("Nm", 1, FAST, TORQUE),
}
PROJECT = (
    ("Name", "scope_x"),
    ("File", "D:\\x.svdx"),
    ("Starttime of export", "133000000000000000", "Monday, 1 January 2024", "10:00:00.000"),
    ("Endtime of export", "133000000004000000", "Monday, 1 January 2024", "10:00:00.400"),
)


def scope(
    path: Path,
    order: tuple[str, ...],
    separator: str = "\t",
    decimal: str = ".",
    end: str = "",
    first: float = 0.0,
    ticks: float = 1.0,
) -> Path:
    """An export with a column of times for each channel, as TwinCAT Scope writes it."""
    rows = [separator.join(line) for line in PROJECT] + ["", ""]
    for key in ("Name", "SymbolComment", "SampleTime[ms]", "Port", "Unit"):
        row = list[str]()
        for name in order:
            unit, sample_time = CHANNELS[name][:2]
            said = {
                "Name": name,
                "SymbolComment": "",
                "SampleTime[ms]": sample_time,
                "Port": 501,
                "Unit": unit,
            }
            row += [key, str(said[key])]
        rows.append(separator.join(row))
    columns = [CHANNELS[name][2:] for name in order]
    body = zip_longest(*(zip(t, x, strict=True) for t, x in columns))
    for samples in [*body]:
        cells = [(f"{first + ticks * s[0]:.0f}", f"{s[1]:.4f}") if s else (" ", " ") for s in samples]
        while cells[-1] == (" ", " "):
            cells.pop()
        rows.append(separator.join(text.replace(".", decimal) for pair in cells for text in pair))
    path.write_text("\n".join(["\n".join(rows[:11]), "", *rows[11:]]) + "\n" + end, encoding="utf-8")
    return path


def codes(record: Record) -> list[str]:
    return [f["code"] for f in record.meta["reading"]["findings"]]


@pytest.mark.parametrize("order", [("ActTorque", "ActPos", "ActVelo"), ("ActPos", "ActVelo", "ActTorque")])
@pytest.mark.parametrize(
    ("separator", "decimal", "end"),
    [
        ("\t", ".", ""),
        ("\t", ",", "EOF\n"),
        (";", ",", ""),
        (",", ".", ""),
        (":", ".", ""),
        (":", ",", ""),
        (" ", ".", "EOF"),
    ],
)
def test_channels_of_two_rates_keep_their_values(tmp_path, order, separator, decimal, end):
    """The slower channels vanished, or the position had the torque's values."""
    table = open_table(scope(tmp_path / "scope.csv", order, separator, decimal, end))
    assert [(c.name, c.unit) for c in table.columns] == [(n, CHANNELS[n][0]) for n in order]
    for column in table.columns:
        _, _, times, values = CHANNELS[column.name]
        np.testing.assert_allclose(column.clock, 1e-3 * times, atol=1e-12)
        np.testing.assert_allclose(column.values, values, atol=5.1e-5)


def test_what_was_resampled_from_which_rate_is_noted(tmp_path):
    record = read(scope(tmp_path / "scope.csv", ("ActPos", "ActVelo", "ActTorque")))
    assert record.time[-1] == pytest.approx(0.396)
    np.testing.assert_allclose(record["motor_torque"], TORQUE[::4], atol=1e-4)
    (note,) = record.meta["reading"]["findings"]
    assert (
        "'ActTorque'), sampled every 1 ms, was interpolated linearly at the record's times, every 4 ms"
        in note["message"]
    )


def test_full_time_stamps_count_from_one_instant(tmp_path):
    """Each channel counted from its own first sample."""
    path = scope(tmp_path / "scope.csv", ("ActPos", "ActTorque"), first=133000000000000000, ticks=1e4)
    lines = path.read_text().splitlines()
    body = next(i for i, line in enumerate(lines) if line.startswith("1330"))
    later = [line.split("\t") for line in lines[body:]]
    # The torque's first three samples are missing.
    for row, after in zip(later, later[3:], strict=False):
        row[-2:] = after[-2:]
    path.write_text("\n".join([*lines[:body], *("\t".join(row) for row in later[:-3])]) + "\n")
    columns = {c.name: c for c in open_table(path).columns}
    assert columns["ActPos"].clock[0] == 0.0
    assert columns["ActTorque"].clock[0] == pytest.approx(3e-3, abs=1e-5)


def test_a_decimal_mark_that_is_the_separator_is_refused(tmp_path):
    with pytest.raises(
        InputError, match=r"line 12 has 8 cells, but the rows of keys above name 4 columns.*another sep"
    ):
        open_table(_commas(tmp_path))


def _commas(folder: Path) -> Path:
    rows = [f"{k},{k // 2},{5 * (k % 2)},{k},1,{k},{k},{k}" for k in range(20)]
    head = "\n".join(",".join(line) for line in PROJECT)
    keys = "Name,ActPos,Name,ActTorque\nSampleTime[ms],1,SampleTime[ms],1\nPort,1,Port,1\nUnit,deg,Unit,Nm\n"
    path = folder / "commas.csv"
    path.write_text(f"{head}\n\n\n{keys}\n" + "\n".join(rows) + "\n")
    return path


def test_one_channel_is_not_named_after_the_project(tmp_path):
    (column,) = open_table(scope(tmp_path / "scope.csv", ("ActTorque",), ";")).columns
    assert column.name == "ActTorque"


def test_several_channels_share_a_column_of_times(tmp_path):
    """With ExcludeDoubleTimestamp, and a name that has the separator in it."""
    rows = "\n".join(f"{k} {2 * k} {3 * k} {k} {4 * k}" for k in range(50))
    keys = (
        "Name act pos ActVelo Name ActTorque\nSampleTime[ms] 1 1 SampleTime[ms] 1\nPort 851 851 Port 851\n"
        "SymbolName MAIN.fActPos MAIN.fActVelo SymbolName MAIN.fActTorque\nUnit ° °/s (Speed) Unit (None)\n"
    )
    path = tmp_path / "scope.csv"
    path.write_text(
        f'Name "x"\n"Starttime of export" 133000000000000000\n\n{keys}\n{rows}\n', encoding="utf-8"
    )
    table = open_table(path)
    assert [(c.name, c.unit) for c in table.columns] == [
        ("MAIN.fActPos", "°"),
        ("MAIN.fActVelo", "°/s"),
        ("ActTorque", ""),
    ]
    assert [c.values[2] for c in table.columns] == [4.0, 6.0, 8.0]
    assert [f.code for f in table.findings] == ["renamed"]


def test_a_scale_that_may_not_be_applied_is_noted(tmp_path):
    rows = "\n".join(f"{k}\t{k}\t{k}\t{k}" for k in range(30))
    keys = "Name\tActPos\tName\tActTorque\nSampleTime[ms]\t1\tSampleTime[ms]\t1\nScaleFactor\t1\tScaleFactor\t0,1\n"
    (tmp_path / "scope.csv").write_text(f"{keys}\n{rows}\n")
    (note,) = open_table(tmp_path / "scope.csv").findings
    assert (
        "'ActTorque' (scalefactor 0,1): the file does not state whether the values are scaled" in note.message
    )


def test_a_channel_of_words_and_two_channels_of_one_name(tmp_path):
    names = ("ActPos", "sState", "ActPos", "ActTorque")
    symbols = ("Axes.Axis1", "MAIN.s", "Axes.Axis2", "MAIN.m")
    head = "".join(
        "\t".join(f"{key}\t{text}" for text in texts) + "\n"
        for key, texts in (("Name", names), ("SymbolName", symbols), ("SampleTime[ms]", "1111"))
    )
    rows = "".join(f"{k}\t{k},5\t{k}\trun\t{k}\t{2 * k}\t{k}\t{3 * k}\n" for k in range(40))
    (tmp_path / "scope.csv").write_text(head + "\n" + rows)
    table = open_table(tmp_path / "scope.csv")
    assert [c.name for c in table.columns] == ["ActPos (Axes.Axis1)", "ActPos (Axes.Axis2)", "ActTorque"]
    assert [c.values[3] for c in table.columns] == [3.5, 6.0, 9.0]
    assert table.unread == {"sState": "run"}


# ---- LabVIEW ------------------------------------------------------------------------------------------------

N = 300
T = 5e-4 * np.arange(N)


@pytest.mark.parametrize("key", ["Channel name", "Name"])
@pytest.mark.parametrize(("unit", "step"), [(1.0, "0.0005"), (1e3, "0.0005")])
def test_keys_above_each_column_of_times(tmp_path, key, unit, step):
    """Both channels were called V; with the key Name the times were in ms."""
    keys = f"Timestamp,2020-01-01 10:00:00,Timestamp,2020-01-01 10:00:00\nInterval,{step},Interval,{step}\n"
    keys += f'{key},"Force",{key},"Travel"\nUnit,"V",Unit,"V"\n'
    rows = "".join(f"{unit * t:g},{np.sin(90 * t):.6f},{unit * t:g},{t - 3:.6f}\n" for t in T)
    (tmp_path / "daq.csv").write_text("\ufeff" + keys + rows, encoding="utf-8")
    force, travel = open_table(tmp_path / "daq.csv").columns
    assert [(c.name, c.unit) for c in (force, travel)] == [("Force", "V"), ("Travel", "V")]
    np.testing.assert_allclose(force.clock, T, atol=1e-9)
    np.testing.assert_allclose(travel.values, T - 3.0, atol=1e-6)


def test_channels_that_start_at_other_times(tmp_path):
    keys = "Timestamp,2020-01-01 10:00:00.000,Timestamp,2020-01-01 10:00:00.020\nInterval,0.0005,Interval,0.0005\n"
    keys += "Name,Position,Name,Torque\nUnit,mm,Unit,N\n"
    (tmp_path / "daq.csv").write_text(keys + "".join(f"{t:g},{t:.6f},{t:g},{2 * t:.6f}\n" for t in T))
    position, torque = open_table(tmp_path / "daq.csv").columns
    assert position.clock[0] == 0.0
    assert torque.clock[0] == pytest.approx(0.02)


def test_a_time_without_a_unit_is_noted(tmp_path):
    keys = "Name,Position,Name,Torque\nUnit,mm,Unit,N\n"
    (tmp_path / "log.csv").write_text(keys + "".join(f"{k},{k},{k},{2 * k}\n" for k in range(40)))
    table = open_table(tmp_path / "log.csv")
    assert table.columns[0].clock[-1] == pytest.approx(0.039)
    assert "ms was assumed, 0.001 s a sample" in table.findings[0].message


def lvm(path: Path, columns: str, decimal: str = ".") -> Path:
    """A measurement file of LabVIEW."""
    blank = "\t" if columns == "Multi" else ""
    head = (
        f"LabVIEW Measurement\t\nWriter_Version\t2\nReader_Version\t2\nSeparator\tTab\nX_Columns\t{columns}\n"
        f"Date\t2016/12/12\n***End_of_Header***\t\n\t\nChannels\t2\t\t\t\nSamples\t{N}\t{blank}{N}\t\n"
        f"Y_Unit_Label\tmm\t{blank}N\t{blank}\nX_Dimension\tTime\t{blank}Time\t\nX0\t0.0E+0\t{blank}0.0E+0\t\n"
        f"Delta_X\t0.0005\t{blank}0.0005\t\n***End_of_Header***\t\t\t\n"
        + (
            "X_Value\tPosition\tX_Value\tTorque\tComment\n"
            if blank
            else "X_Value\tPosition\tTorque\tComment\n"
        )
    )
    rows = ""
    for t in T:
        x = "" if columns == "No" else f"{t:.6f}"
        again = f"\t{t:.6f}" if blank else ""
        rows += f"{x}\t{1e3 * t:.6f}{again}\t{np.cos(90 * t):.6f}\n"
    path.write_text((head + rows).replace(".", decimal) if decimal != "." else head + rows)
    return path


@pytest.mark.parametrize("columns", ["One", "Multi", "No"])
@pytest.mark.parametrize("decimal", [".", ","])
def test_measurement_files_of_labview(tmp_path, columns, decimal):
    record = read(lvm(tmp_path / "log.lvm", columns, decimal))
    np.testing.assert_allclose(record.time, T, atol=1e-9)
    np.testing.assert_allclose(record["position"], T, atol=1e-8)
    assert record.units["motor_torque"] == "N"


# ---- plain tables -------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "header",
    ["Time [s],Position [deg],Time [s],Torque [Nm]", "t_pos,Position [deg],t_tau,Torque [Nm]",
     "ActPos Time,ActPos [deg],ActTorque Time,ActTorque [Nm]", "x1,Position [deg],x2,Torque [Nm]"],
)  # fmt: skip
@pytest.mark.parametrize("fast_first", [True, False])
def test_columns_of_times_in_a_row_of_names(tmp_path, header, fast_first):
    """Of rows that are blank where the slower channel has ended."""
    pairs = [(1e-3 * SLOW, POSITION), (1e-3 * FAST, TORQUE)]
    names = header.split(",")
    if fast_first:
        pairs, names = pairs[::-1], [*names[2:], *names[:2]]
    rows = []
    for samples in zip_longest(*(zip(t, x, strict=True) for t, x in pairs)):
        row = ",".join(f"{s[0]:.3f},{s[1]:.5f}" if s else "," for s in samples)
        rows.append(row.rstrip(",") if fast_first else row)
    (tmp_path / "log.csv").write_text("\n".join([",".join(names), *rows]) + "\n")
    record = read(tmp_path / "log.csv")
    np.testing.assert_allclose(record.time, 1e-3 * SLOW, atol=1e-9)
    np.testing.assert_allclose(np.rad2deg(record["position"]), POSITION, atol=1e-5)
    np.testing.assert_allclose(record["motor_torque"], TORQUE[::4], atol=1e-5)


def test_blank_cells_between_slower_samples(tmp_path):
    """One column of times, and a row for each sample of any channel."""
    rows = [
        f"{1e-3 * t:.3f},{POSITION[k // 4]:.5f},{x:.5f}" if k % 4 == 0 else f"{1e-3 * t:.3f},,{x:.5f}"
        for k, (t, x) in enumerate(zip(FAST, TORQUE, strict=True))
    ]
    (tmp_path / "log.csv").write_text("time [s],position [deg],torque [Nm]\n" + "\n".join(rows) + "\n")
    record = read(tmp_path / "log.csv")
    np.testing.assert_allclose(record.time, 1e-3 * SLOW, atol=1e-9)
    np.testing.assert_allclose(record["motor_torque"], TORQUE[::4], atol=1e-5)
    assert codes(record) == ["resampled"]


def test_a_slow_temperature_leaves_the_other_channels_as_they_are(tmp_path):
    rows = [f"{k},{'' if k == 7 else k},{k},{20 + 0.1 * k if k % 10 == 0 else ''}" for k in range(101)]
    (tmp_path / "log.csv").write_text(
        "time [ms],position [rad],torque [Nm],temp [degC]\n" + "\n".join(rows) + "\n"
    )
    record = read(tmp_path / "log.csv")
    assert np.flatnonzero(np.isnan(record["position"])).tolist() == [7]
    np.testing.assert_allclose(record["temperature"], 20.0 + 0.1 * np.arange(101))


def test_lost_samples_are_no_slower_channel(tmp_path):
    lost = np.random.default_rng(0).random(FAST.size) < 0.4
    rows = [f"{1e-3 * t:.3f},{t:.1f},{'' if gone else t:}" for t, gone in zip(FAST, lost, strict=True)]
    (tmp_path / "log.csv").write_text("time [s],position [deg],torque [Nm]\n" + "\n".join(rows) + "\n")
    record = read(tmp_path / "log.csv")
    assert np.count_nonzero(np.isnan(record["motor_torque"])) == np.count_nonzero(lost)


def test_a_sample_time_restates_every_clock(tmp_path):
    record = read(scope(tmp_path / "scope.csv", ("ActPos", "ActTorque")), sample_time=0.008)
    np.testing.assert_allclose(record["motor_torque"], TORQUE[::4], atol=1e-4)


@pytest.mark.parametrize("blank", ["NaN", "", "nan"])
@pytest.mark.parametrize("rows", [1, 3, 20])
def test_the_header_above_rows_that_lack_most_values(tmp_path, blank, rows):
    """The last of these rows was taken for the header."""
    names = "time [s],Axis A Position [rad],B,C,D,E,Axis A Torque [Nm]"
    lines = [f"{0.05 * k:.2f},{k}," + ",".join([blank] * 5) for k in range(rows)]
    lines += [f"{0.05 * k:.2f},{k},1,2,3,4,{0.5 * k}" for k in range(rows, 60)]
    (tmp_path / "log.csv").write_text("\n".join([names, *lines]) + "\n")
    record = read(tmp_path / "log.csv")
    assert record["position"][0] == 0.0
    assert np.isnan(record["motor_torque"]).sum() == rows
    assert record["motor_torque"][-1] == 29.5


def test_the_header_above_rows_without_any_number(tmp_path):
    rows = ["NaN,NaN"] * 4 + [f"{k},{2 * k}" for k in range(40)]
    (tmp_path / "log.csv").write_text("position [rad],torque [Nm]\n" + "\n".join(rows) + "\n")
    record = read(tmp_path / "log.csv", sample_time=0.01)
    assert np.isnan(record["position"]).sum() == 4
    assert record["motor_torque"][-1] == 78.0


def test_blank_cells_between_blanks_shift_no_value(tmp_path):
    """The torque of such a row was read as the position."""
    rows = [
        f"{0.01 * k:.2f} {k}.5 {2 * k}.5" if k % 7 else f"{0.01 * k:.2f}      {2 * k}.5" for k in range(60)
    ]
    (tmp_path / "log.txt").write_text("t[s] pos[deg] torque[Nm]\n" + "\n".join(rows) + "\n")
    record = read(tmp_path / "log.txt")
    gone = np.arange(60) % 7 == 0
    assert np.isnan(record["position"]).tolist() == gone.tolist()
    assert codes(record) == ["short-row"]


def test_a_separator_at_the_end_of_every_line(tmp_path):
    path = scope(tmp_path / "scope.csv", ("ActTorque", "ActPos"), ";", ",")
    path.write_text("".join(f"{line};\n" if line else "\n" for line in path.read_text().splitlines()))
    table = open_table(path)
    assert [c.name for c in table.columns] == ["ActTorque", "ActPos"]
    assert not table.findings


def test_a_comma_between_thousands_is_no_decimal_sign(tmp_path: Path) -> None:
    rows = ["Name\tActPos\tName\tActTorque", "SampleTime[ms]\t1\tSampleTime[ms]\t1", "Unit\tdeg\tUnit\tNmm"]
    rows += [f"{k}\t{0.5 * k:.1f}\t{k}\t1,{234 + k}" for k in range(20)]
    file = tmp_path / "scope.csv"
    file.write_text("\n".join(rows) + "\n")
    table = open_table(file)
    assert table.columns[1].values[:2].tolist() == [1234.0, 1235.0]
    assert "thousands" in {finding.code for finding in table.findings}
