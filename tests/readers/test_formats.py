"""Every format: what is written is read back, number by number, with its units."""

from __future__ import annotations

import io
import json
from pathlib import Path

import h5py
import numpy as np
import pyarrow as pa
import pyarrow.parquet
import pytest
import scipy.io

from stickslip.core.errors import InputError
from stickslip.core.record import Record
from stickslip.readers import open_table, read
from stickslip.readers.reading import formats

N = 300
T = np.arange(N) * 1e-3
Q = 90.0 * np.sin(7.0 * T)  # deg
V = 630.0 * np.cos(7.0 * T)  # deg/s
M = 250.0 * np.sign(V) + V / 10.0  # mNm
NAMES = ("time", "position", "velocity", "torque")
UNITS = ("s", "deg", "deg/s", "mNm")
DATA = dict(zip(NAMES, (T, Q, V, M)))


def write_csv(path: Path) -> None:
    head = ",".join(f"{n} [{u}]" for n, u in zip(NAMES, UNITS))
    np.savetxt(path, np.stack(list(DATA.values()), axis=1), "%.17g", ",", header=head, comments="")


def write_mat5(path: Path) -> None:
    units = {"position_deg": Q, "velocity_deg_s": V, "torque_mNm": M}
    scipy.io.savemat(
        path, {"t": T[:, None], "log": {k: v[:, None] for k, v in units.items()}, "note": "rig 3"}
    )


def write_mat4(path: Path) -> None:
    units = {"t": T, "position_deg": Q, "velocity_deg_s": V, "torque_mNm": M}
    scipy.io.savemat(path, units, format="4")


def write_mat7(path: Path) -> None:
    """Compressed, as MATLAB's default is; signals in a structure of structures with cells."""
    signals = [{"Name": n, "Data": v, "unit": u} for n, v, u in zip(NAMES, DATA.values(), UNITS)]
    scipy.io.savemat(path, {"log": {"signals": np.array(signals, dtype=object)}}, do_compression=True)


def write_mat73(path: Path) -> None:
    """As MATLAB writes it: a user block that says what it is, datasets transposed, text as numbers."""
    with h5py.File(path, "w", userblock_size=512) as file:
        for name, values, unit in zip(("time", "position", "velocity", "torque"), DATA.values(), UNITS):
            file[f"{name}_{unit.replace('/', '_')}"] = values[None, :]
        file["note"] = np.array([[114], [105], [103]], dtype=np.uint16)
        file["note"].attrs["MATLAB_class"] = np.bytes_(b"char")
        file.create_group("#refs#")["a"] = np.arange(3.0)
    with path.open("r+b") as raw:
        raw.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(512))


def write_hdf5(path: Path) -> None:
    with h5py.File(path, "w") as file:
        group = file.create_group("axis")
        for name, values, unit in zip(NAMES, DATA.values(), UNITS):
            group[name] = values
            group[name].attrs["unit"] = unit
        group.attrs["motor"] = "M7"


def write_parquet(path: Path) -> None:
    fields = [pa.field(n, pa.float64(), metadata={"unit": u}) for n, u in zip(NAMES, UNITS)]
    pyarrow.parquet.write_table(pa.table(list(DATA.values()), schema=pa.schema(fields)), path)


def write_npz(path: Path) -> None:
    np.savez(path, **{f"{n}_{u.replace('/', '_')}": v for n, u, v in zip(NAMES, UNITS, DATA.values())})


def write_npy(path: Path) -> None:
    names = [f"{n} [{u}]" for n, u in zip(NAMES, UNITS)]
    np.save(path, np.rec.fromarrays(list(DATA.values()), names=names))


def write_samples(path: Path) -> None:
    names = ("timestamp", "position_deg", "velocity_deg_s", "torque_mNm")
    entries = [dict(zip(names, row)) for row in np.stack(list(DATA.values()), axis=1).tolist()]
    path.write_text(json.dumps({"mass": 0.49, "motor": "M7", "entries": entries}))


def write_columns(path: Path) -> None:
    path.write_text(json.dumps({f"{n} [{u}]": v.tolist() for n, u, v in zip(NAMES, UNITS, DATA.values())}))


def write_lines(path: Path) -> None:
    names = ("time", "position_deg", "velocity_deg_s", "torque_mNm")
    rows = np.stack(list(DATA.values()), axis=1).tolist()
    path.write_text("\n".join(json.dumps(dict(zip(names, row))) for row in rows))


def write_record(path: Path) -> None:
    names = ("position", "velocity", "motor_torque")
    Record(T, dict(zip(names, (Q, V, M))), dict(zip(names, UNITS[1:])), {"what": "test"}).save(path)


WRITERS = [
    ("a.csv", write_csv),
    ("a.mat", write_mat5),
    ("b.mat", write_mat73),
    ("c.mat", write_mat4),
    ("d.mat", write_mat7),
    ("a.h5", write_hdf5),
    ("a.parquet", write_parquet),
    ("a.npz", write_npz),
    ("a.npy", write_npy),
    ("a.json", write_samples),
    ("b.json", write_columns),
    ("a.jsonl", write_lines),
    ("r.npz", write_record),
]


@pytest.mark.parametrize(("name", "write"), WRITERS, ids=[f"{w.__name__[6:]}" for _, w in WRITERS])
def test_round_trip(tmp_path, name, write):
    path = tmp_path / name
    write(path)
    record = read(path)
    assert dict(record.units) == {"position": "rad", "velocity": "rad/s", "motor_torque": "N·m"}
    np.testing.assert_allclose(record.time, T, rtol=0, atol=1e-15)
    np.testing.assert_allclose(record["position"], np.deg2rad(Q), rtol=1e-14, atol=1e-15)
    np.testing.assert_allclose(record["velocity"], np.deg2rad(V), rtol=1e-14, atol=1e-15)
    np.testing.assert_allclose(record["motor_torque"], M * 1e-3, rtol=1e-14, atol=1e-15)
    assert record.meta["reading"]["findings"] == []
    assert len(record.meta["reading"]["sha256"]) == 64
    json.dumps(record.meta)
    # A record of a record is the same.
    again = read(record.save(tmp_path / "again.npz"))
    assert all(np.array_equal(again[c], record[c]) for c in ("time", *record.channels))


@pytest.mark.parametrize(("name", "write"), WRITERS, ids=[f"{w.__name__[6:]}" for _, w in WRITERS])
@pytest.mark.parametrize("share", [0.0, 0.02, 0.5, 0.98])
def test_a_file_cut_off_gets_one_line(tmp_path, name, write, share):
    """Reading ends with a record (of text, a row may be missing) or with one line, never otherwise."""
    write(tmp_path / name)
    whole = (tmp_path / name).read_bytes()
    (tmp_path / name).write_bytes(whole[: int(share * len(whole))])
    said = complaint(tmp_path / name)
    assert "\n" not in said
    assert not said or name in said or "column" in said


def complaint(path: Path) -> str:
    """What the package says against a file; any other exception is a failure."""
    try:
        read(path)
    except InputError as error:
        return str(error)
    return ""


def test_constants_are_kept(tmp_path):
    write_samples(tmp_path / "a.json")
    assert read(tmp_path / "a.json").meta["reading"]["constants"] == {"mass": 0.49, "motor": "M7"}
    write_mat73(tmp_path / "b.mat")
    assert read(tmp_path / "b.mat").meta["reading"]["constants"] == {"note": "rig"}


def test_the_content_tells_the_format_not_the_name(tmp_path):
    for name, write in WRITERS:
        if name.endswith((".csv", ".jsonl", ".npy", ".parquet", ".h5")):
            write(tmp_path / "log.dat")
            assert len(read(tmp_path / "log.dat")) == N


def test_formats_are_named_once():
    names = [f.name for f in formats()]
    assert len(set(names)) == len(names)
    assert all(f.suffixes and f.title for f in formats())


# ---- text ---------------------------------------------------------------------------------------------------


def table(tmp_path: Path, text: str, encoding: str = "utf-8") -> Path:
    path = tmp_path / "log.csv"
    path.write_bytes(text.encode(encoding))
    return path


ROWS = [(0.0, 1.5, -2.25), (0.001, 1.75, -2.5), (0.002, 2.0, -2.75), (0.003, 2.25, -3.0)]


def rows(delimiter: str, comma: bool = False) -> str:
    text = "\n".join(delimiter.join(f"{x:.6f}" for x in row) for row in ROWS)
    return text.replace(".", ",") if comma else text


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "cp1252"])
@pytest.mark.parametrize(
    ("delimiter", "comma"),
    [
        (",", False),
        (";", False),
        (";", True),
        ("\t", False),
        ("\t", True),
        ("  ", False),
        ("  ", True),
        ("|", False),
    ],
)
@pytest.mark.parametrize("newline", ["\n", "\r\n"])
def test_dialects(tmp_path, delimiter, comma, encoding, newline):
    head = delimiter.join(("Zeit_s", "Winkel_°", "Drehmoment_Nm"))
    path = table(tmp_path, f"{head}\n{rows(delimiter, comma)}\n".replace("\n", newline), encoding)
    record = read(path)
    np.testing.assert_allclose(record["position"], np.deg2rad([r[1] for r in ROWS]))
    np.testing.assert_allclose(record["motor_torque"], [r[2] for r in ROWS])


def test_units_in_a_row_of_their_own_below_metadata(tmp_path):
    text = "Rig: 3\nDate: 2024-05-01\n\nt;q;iq\n[ms];[rev];[mA]\n" + rows(";", comma=True)
    record = read(table(tmp_path, text))
    np.testing.assert_allclose(record.time, [0.0, 1e-6, 2e-6, 3e-6])
    np.testing.assert_allclose(record["position"], [2 * np.pi * r[1] for r in ROWS])
    np.testing.assert_allclose(record["current"], [1e-3 * r[2] for r in ROWS])
    assert record.meta["reading"]["constants"]["Rig"] == 3.0


def test_comments_quotes_and_a_delimiter_at_the_end(tmp_path):
    text = '# "time [s]","position [rad]","torque [N·m]",\n' + "\n".join(
        f'"{a}","{b}","{c}",' for a, b, c in ROWS
    )
    record = read(table(tmp_path, text))
    np.testing.assert_allclose(record["motor_torque"], [r[2] for r in ROWS])


def test_dates_become_seconds(tmp_path):
    text = "timestamp,position\n" + "\n".join(f"2024-05-01 12:00:00.{i:03d},{i}" for i in range(5))
    record = read(table(tmp_path, text))
    np.testing.assert_allclose(record.time, np.arange(5) * 1e-3, atol=1e-6)
    assert record.meta["reading"]["time_origin"] == pytest.approx(1714564800.0)


@pytest.mark.parametrize(("factor", "start"), [(1e-3, 1.7e12), (1e-6, 1.7e15), (1e-9, 1.7e18)])
def test_times_since_1970_are_told_by_their_size(tmp_path, factor, start):
    ticks = start + np.round(np.arange(5) / factor * 0.01)
    text = "timestamp,position\n" + "\n".join(f"{t:.0f},{i}" for i, t in enumerate(ticks))
    np.testing.assert_allclose(read(table(tmp_path, text)).time, np.arange(5) * 0.01, atol=1e-6)


@pytest.mark.parametrize(("delimiter", "comma"), [(",", False), (";", True), ("\t", False)])
def test_a_column_of_words_is_left_out_and_told(tmp_path, delimiter, comma):
    """The state of the drive, as most of them log it."""
    rows = [[f"{t:.6f}", "RUN" if t < 0.2 else "STOP", f"{q:.6f}", f"{m:.6f}"] for t, q, m in zip(T, Q, M)]
    if comma:
        rows = [[cell.replace(".", ",") for cell in row] for row in rows]
    lines = ["exported by a drive", delimiter.join(("time [s]", "state", "position [deg]", "torque [mNm]"))]
    path = tmp_path / "log.csv"
    path.write_text("\n".join([*lines, *(delimiter.join(row) for row in rows)]) + "\n", encoding="utf-8")
    table = open_table(path)
    assert [c.name for c in table.columns] == ["time [s]", "position [deg]", "torque [mNm]"]
    assert np.allclose(table.columns[1].values, Q, atol=1e-6)
    assert [f.message for f in table.findings] == [
        "left out as they hold words, not numbers: 'state' (first 'RUN')"
    ]


def test_rows_with_more_empty_cells_than_numbers_are_a_table(tmp_path):
    path = tmp_path / "sparse.csv"
    path.write_text("time [s],position [rad],a,b,c\n" + "".join(f"{0.1 * i:.1f},{i},,,\n" for i in range(9)))
    assert read(path)["position"][8] == 8.0


def test_missing_cells_are_nan_and_words_are_told(tmp_path):
    record = read(table(tmp_path, "time,position\n0,1\n1,\n2,NaN\n3,oops\n4,5\n"))
    assert np.isnan(record["position"]).tolist() == [False, True, True, True, False]
    (finding,) = record.meta["reading"]["findings"]
    assert finding["code"] == "not-a-number"
    assert finding["where"] == "row 4"


SCOPE = """Name\tScope Project\tx
File\tC:\\rig.tcscopex\tx
Starttime of export\t133000000000000000\tx

Name\tActPos\tName\tActTorque
SymbolName\tAxes.Axis 1.ActPos\tSymbolName\tAxes.Axis 1.ActTorque
Data-Type\tREAL64\tData-Type\tREAL64
SampleTime[ms]\t2\tSampleTime[ms]\t4
Unit\t°\tUnit\tNm

"""


def test_twincat_scope_groups_have_clocks_of_their_own(tmp_path):
    body = "\n".join(
        f"{2 * i}\t{1.5 * i}\t{4 * i}\t{0.5 * i}" if i < 50 else f"{2 * i}\t{1.5 * i}" for i in range(100)
    )
    record = read(table(tmp_path, SCOPE + body.replace(".", ",") + "\nEOF\n"))
    np.testing.assert_allclose(record.time, np.arange(100) * 2e-3)
    np.testing.assert_allclose(record["position"], np.deg2rad(1.5 * np.arange(100)))
    # Torque is sampled every 4 ms and read between its samples.
    np.testing.assert_allclose(record["motor_torque"][:99], 0.25 * np.arange(99))
    assert [f["code"] for f in record.meta["reading"]["findings"]] == ["resampled"]


def test_twincat_scope_with_full_time_stamps(tmp_path):
    body = "\n".join(
        f"{133000000000000000 + 10000 * i}\t{i}\t{133000000000000000 + 10000 * i}\t{2 * i}" for i in range(20)
    )
    record = read(table(tmp_path, "Name\tActPos\tName\tActTorque\n" + body))
    np.testing.assert_allclose(record.time, np.arange(20) * 1e-3, atol=1e-9)


def test_numbered_times_beside_values(tmp_path):
    body = "\n".join(f"{i * 1e-3:.4f},{i},{i * 1e-3:.4f},{2 * i}" for i in range(20))
    record = read(table(tmp_path, "time1,position,time2,torque\n" + body))
    np.testing.assert_allclose(record["motor_torque"], 2.0 * np.arange(20))


# ---- what is refused ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (b"", "is empty"),
        (b"hello world\nno numbers here\n", "holds no table of numbers"),
        (b"{", "is not JSON"),
        (b"[1, 2", "holds no table"),
        (b'{"a": "text"}', "no columns of numbers"),
        (b"\x00\x01\x02\x03" * 50, "no format that is known"),
        (b"\x93NUMPY\x01\x00", "cannot be read as NumPy"),
        (b"\x89HDF\r\n\x1a\nrubbish", "cannot be read as HDF5"),
        (b"PAR1rubbish", "cannot be read as Parquet"),
        (b"MATLAB 5.0 MAT-file" + b" " * 200, "no MAT file"),
        (b"[" * 100000, "table of numbers"),
        (b'{"a":' * 100000, "nested too deeply"),
    ],
)
def test_files_that_are_none(tmp_path, content, said):
    path = tmp_path / "file.csv"
    path.write_bytes(content)
    with pytest.raises(InputError, match=said) as caught:
        read(path)
    assert "file.csv" in str(caught.value)


def test_no_file_and_a_folder(tmp_path):
    with pytest.raises(InputError, match="check the path"):
        read(tmp_path / "none.csv")
    with pytest.raises(InputError, match="is a folder, and no ROS bag; give a file in it"):
        read(tmp_path)


def test_pickles_are_refused(tmp_path):
    buffer = io.BytesIO()
    np.save(buffer, np.array([{"a": 1}], dtype=object), allow_pickle=True)
    (tmp_path / "a.npy").write_bytes(buffer.getvalue())
    with pytest.raises(InputError, match="without objects"):
        open_table(tmp_path / "a.npy")


@pytest.mark.parametrize(
    ("name", "stated", "factor"),
    [
        ("time_s", True, 1.0),
        ("t_s", True, 1.0),
        ("sec", True, 1.0),
        ("time_ms", True, 1e-3),
        ("t", False, 1.0),
    ],
)
def test_a_time_column_whose_name_ends_in_its_unit_states_it(tmp_path, name, stated, factor):
    path = tmp_path / "log.csv"
    path.write_text(f"{name},q_rad\n" + "".join(f"{i},{0.1 * i}\n" for i in range(1, 40)))
    record = read(path)
    column = next(c for c in record.meta["reading"]["columns"] if c["channel"] == "time")
    assert (column["source"] == "name") == stated
    assert record.time[-1] - record.time[0] == pytest.approx(38.0 * factor)


@pytest.mark.parametrize("header", ["t,s,v,torque", "t,s,torque", "s,t,q,torque"])
def test_a_column_s_is_not_taken_for_the_time_beside_a_t(tmp_path, header):
    path = tmp_path / "log.csv"
    row = ",".join(["{0}"] * len(header.split(",")))
    path.write_text(f"{header}\n" + "".join(row.format(0.1 * i) + "\n" for i in range(40)))
    with pytest.raises(InputError, match=r"time may be any of .*; say which, such as map={\"time\": "):
        read(path)
