"""Files that unpack to more than memory, or have more columns than any log: refused before they are read."""

from __future__ import annotations

import io
import json
import struct
import zipfile
import zlib
from pathlib import Path

import h5py
import numpy as np
import pyarrow as pa
import pyarrow.parquet
import pytest
import scipy.io

from stickslip.cli import main
from stickslip.core.errors import InputError
from stickslip.readers import limits, open_table

MANY = 200_000_000
"""Values: 1.6 GB as floats."""


def header(count: int) -> bytes:
    file = io.BytesIO()
    np.lib.format.write_array_header_1_0(
        file, {"descr": "<f8", "fortran_order": False, "shape": (count,)}
    )  # fmt: skip
    return file.getvalue()


def write_npz(path: Path, first: str = "") -> None:
    """An archive whose array begins as declared; what follows is not reached."""
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        if first:
            text = io.BytesIO()
            np.save(text, np.array("{}"))
            archive.writestr(first, text.getvalue())
        archive.writestr("time.npy", header(MANY) + bytes(1000))


def write_record(path: Path) -> None:
    write_npz(path, "__header__.npy")


def write_npy(path: Path) -> None:
    path.write_bytes(header(10**12) + bytes(80))


def write_hdf5(path: Path) -> None:
    with h5py.File(path, "w") as file:
        file.create_dataset("q", shape=(MANY,), dtype="f8", chunks=(10**6,), compression="gzip")


def write_mat(path: Path) -> None:
    """Version 5: zeros, stored in a byte each and compressed."""
    count = MANY // 2
    inner = struct.pack("<IIII", 6, 8, 6, 0) + struct.pack("<IIii", 5, 8, 1, count)
    inner += struct.pack("<II", 1, 1) + b"q" + bytes(7) + struct.pack("<II", 2, count)
    engine = zlib.compressobj(1)
    packed = engine.compress(struct.pack("<II", 14, len(inner) + count) + inner)
    for _ in range(count // 10**7):
        packed += engine.compress(bytes(10**7))
    packed += engine.flush()
    head = b"MATLAB 5.0 MAT-file".ljust(124) + b"\x00\x01IM"
    path.write_bytes(head + struct.pack("<II", 15, len(packed)) + packed)


def write_parquet(path: Path) -> None:
    table = pa.table({"q": pa.array(np.zeros(10**7))})
    with pyarrow.parquet.ParquetWriter(path, table.schema) as writer:
        for _ in range(6):
            writer.write_table(table)


def write_keys(path: Path) -> None:
    """Every sample has a key of its own: 4500 x 4500 x 2 cells."""
    path.write_text(json.dumps([{f"k{i}": 1.0} for i in range(4500)] + [{"k0": 1.0}] * 10_000))


BOMBS = [
    ("a.npz", write_npz), ("r.npz", write_record), ("a.npy", write_npy), ("a.h5", write_hdf5), ("a.mat", write_mat),
    ("a.parquet", write_parquet), ("a.json", write_keys),
]  # fmt: skip


@pytest.mark.parametrize(("name", "write"), BOMBS, ids=[f"{n}-{w.__name__[6:]}" for n, w in BOMBS])
def test_a_file_that_unpacks_to_too_much_is_refused(tmp_path, capsys, name, write):
    path = tmp_path / name
    write(path)
    assert main(["doctor", str(path)]) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert "of memory" in said
    assert "export only" in said


def test_what_compresses_well_is_still_read(tmp_path):
    """A hundred times smaller than in memory is no bomb."""
    path = tmp_path / "a.npz"
    np.savez_compressed(path, t=np.arange(10**6) * 1e-3, q=np.zeros(10**6))
    assert path.stat().st_size < 16e6 / 4
    assert open_table(path).columns[1].values.size == 10**6


def wide_csv(path: Path) -> None:
    path.write_text("\n".join(",".join("1" for _ in range(20_000)) for _ in range(30)))


def long_line(path: Path) -> None:
    path.write_text("t,q\n0,1\n" + "1" * 2_000_000 + "\n" + "1,2\n" * 30)


def wide_json(path: Path) -> None:
    path.write_text(json.dumps({f"k{i}": [1.0, 2.0] for i in range(20_000)}))


def many_values(path: Path) -> None:
    path.write_text(json.dumps({f"k{i}": 1.0 for i in range(200_000)}))


def wide_parquet(path: Path) -> None:
    pyarrow.parquet.write_table(pa.table({f"c{i}": [1.0] for i in range(6000)}), path)


def wide_hdf5(path: Path) -> None:
    with h5py.File(path, "w") as file:
        for i in range(6000):
            file[f"c{i}"] = [1.0]


def wide_npz(path: Path) -> None:
    np.savez(path, **{f"c{i}": np.zeros(3) for i in range(6000)})


def wide_mat(path: Path) -> None:
    scipy.io.savemat(path, {f"c{i}": np.zeros(3) for i in range(6000)})


WIDE = [
    ("a.csv", wide_csv), ("b.csv", long_line), ("a.json", wide_json), ("b.json", many_values),
    ("a.parquet", wide_parquet), ("a.h5", wide_hdf5), ("a.npz", wide_npz), ("a.mat", wide_mat),
]  # fmt: skip


@pytest.mark.parametrize(("name", "write"), WIDE, ids=[w.__name__ for _, w in WIDE])
def test_more_columns_than_a_log_has_are_refused(tmp_path, name, write):
    path = tmp_path / name
    write(path)
    with pytest.raises(InputError, match=r"at most \d+ are read|more than \d+ groups") as caught:
        open_table(path)
    assert name in str(caught.value)
    assert len(str(caught.value)) < 500


def test_short_rows_do_not_make_a_large_table(tmp_path, monkeypatch):
    """A wide header sample and a million rows of one cell: 72 GB as a table."""
    monkeypatch.setattr(limits, "memory_for", lambda size: 10**7)
    (tmp_path / "a.csv").write_text("1,2,3,4,5,6,7,8,9,10\n" * 500 + "1,2,3,4,5,6,7,8,9\n" * 100_000)
    with pytest.raises(InputError, match="unpacks to"):
        open_table(tmp_path / "a.csv")


# ---- other files --------------------------------------------------------------------------------------------


def test_data_in_other_files_is_left_out_and_reported(tmp_path):
    """An HDF5 file read any file of the user's as its own samples."""
    (tmp_path / "secret.txt").write_bytes(b"0123456789" * 10)
    with h5py.File(tmp_path / "other.h5", "w") as file:
        file["q"] = np.arange(50.0)
    with h5py.File(tmp_path / "log.h5", "w") as file:
        file["t"], file["q_rad"] = np.arange(50.0) * 1e-3, np.arange(50.0)
        file["link"] = h5py.ExternalLink("other.h5", "/q")
        file["own_link"], file["root"] = h5py.SoftLink("/q_rad"), h5py.SoftLink("/")
        file.create_dataset("raw", shape=(50,), dtype="u1", external=[(str(tmp_path / "secret.txt"), 0, 50)])
        for name, source in (("virtual", "other.h5"), ("own_virtual", ".")):
            layout = h5py.VirtualLayout(shape=(50,), dtype="f8")
            layout[:] = h5py.VirtualSource(source, "q" if source != "." else "q_rad", shape=(50,))
            file.create_virtual_dataset(name, layout)
    table = open_table(tmp_path / "log.h5")
    assert {c.name for c in table.columns} == {"t", "q_rad", "own_link", "own_virtual"}
    said = [f.message for f in table.findings]
    assert all(any(repr(name) in text for text in said) for name in ("link", "raw", "virtual"))
    assert len(said) == 3


@pytest.mark.parametrize("kind", ["path", "link"])
def test_a_bag_with_a_file_outside_its_folder_is_refused(tmp_path, kind):
    (tmp_path / "other.db3").write_bytes(b"SQLite format 3\0")
    bag = tmp_path / "bag"
    bag.mkdir()
    named = "../other.db3" if kind == "path" else "bag.db3"
    (bag / "metadata.yaml").write_text(f"rosbag2_bagfile_information:\n  relative_file_paths:\n  - {named}\n")
    if kind == "link":
        (bag / "bag.db3").symlink_to(tmp_path / "other.db3")
    with pytest.raises(InputError, match=rf"{named}' is outside its folder"):
        open_table(bag)
