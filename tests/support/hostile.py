"""Fifty files that somebody might send to harm a reader, or by accident: name and content of each."""

from __future__ import annotations

import gzip
import io
import json
import pickle
import struct
import zipfile
import zlib

import numpy as np

NAMES = (
    "../../../../tmp/evil.csv", "..\\..\\evil.csv", "/etc/passwd", "C:\\Windows\\win.ini", "a/b/c.csv", "con.csv",
    "x\x00.csv", "x\n.csv", ".hidden", "", "." * 300 + ".csv", "é\u202etxt.exe", "<script>alert(1)</script>.csv",
    "log.csv; rm -rf ~", "$(touch evil).csv", "~root/x.csv", "%2e%2e%2fx.csv", "nul", "upload.csv", "about.json",
)  # fmt: skip
"""Names of a file that itself is harmless."""

FILES = (
    "bomb.npz", "nested.npz", "slip.npz", "pickle.npy", "pickle.npz", "pickle.csv", "huge_shape.npy",
    "negative_shape.npy", "objects.npy", "gzip.csv", "zip.csv", "latin.csv", "utf16.csv", "nul.csv",
    "random.csv", "wide.csv", "long_line.csv", "one_cell.csv", "formula.csv", "inf.csv", "overflow.csv",
    "cut.mat", "fake.h5", "fake.parquet", "fake.tdms", "fake.mf4", "fake.bag", "deep.json", "entities.json",
    "law.toml",
)  # fmt: skip
"""Names of `contents`, which takes seconds to make: the tests that are collected need the names alone."""


class Evil:
    """What pickle would run."""

    def __reduce__(self) -> tuple[object, tuple[str]]:
        import os

        return os.system, ("touch /tmp/stickslip-was-here",)


def zipped(*members: tuple[str, bytes]) -> bytes:
    """An archive."""
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in members:
            archive.writestr(name, content)
    return out.getvalue()


def npy(shape: str, dtype: str = "<f8") -> bytes:
    """The header of a NumPy array of that shape, and nothing behind it."""
    header = f"{{'descr': '{dtype}', 'fortran_order': False, 'shape': {shape}, }}".ljust(117) + "\n"
    return b"\x93NUMPY\x01\x00" + struct.pack("<H", len(header)) + header.encode()


def saved(array: object, pickled: bool = False) -> bytes:
    """An .npy file."""
    out = io.BytesIO()
    np.save(out, np.array(array, dtype=object if pickled else None), allow_pickle=pickled)
    return out.getvalue()


class Repeated:
    """Deflates the same bytes once: after a full flush nothing refers to what stands before."""

    def __init__(self) -> None:
        self.deflate, self.known = zlib.compressobj(wbits=-zlib.MAX_WBITS), dict[bytes, bytes]()

    def compress(self, data: bytes) -> bytes:
        if data not in self.known:
            self.known[data] = self.deflate.compress(data) + self.deflate.flush(zlib.Z_FULL_FLUSH)
        return self.known[data]

    def flush(self) -> bytes:
        return self.deflate.flush()


def bomb() -> bytes:
    """An .npz of 4 GB of zeros in 4 MB."""
    out = io.BytesIO()
    zeros = bytes(2**24)
    with (
        zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as archive,
        archive.open("time.npy", "w", force_zip64=True) as f,
    ):
        f._compressor = Repeated()  # 1 s of compressing, not 13
        f.write(npy("(536870912,)"))
        for _ in range(256):
            f.write(zeros)
    return out.getvalue()


def contents() -> dict[str, bytes]:
    """Files that are not what they seem, by `FILES`."""
    many = ",".join(f"c{i}" for i in range(2000)).encode()
    rows = b"".join(b"%d,1e308,-1e308\n" % i for i in range(500))
    return {
        "bomb.npz": bomb(),
        "nested.npz": zipped(("a.npz", zipped(("b.npz", bytes(10**7))))),
        "slip.npz": zipped(("../../../evil.npy", saved([1.0, 2.0]))),
        "pickle.npy": saved([Evil()], pickled=True),
        "pickle.npz": zipped(("time.npy", saved([Evil()], pickled=True))),
        "pickle.csv": pickle.dumps(Evil()),
        "huge_shape.npy": npy("(1000000000000000,)"),
        "negative_shape.npy": npy("(-5,)"),
        "objects.npy": npy("(5,)", "|O"),
        "gzip.csv": gzip.compress(bytes(10**8)),
        "zip.csv": zipped(("log.csv", b"0," * 10**7)),
        "latin.csv": "Zeit;Größe\r\n1,0;ü\r\n".encode("latin-1"),
        "utf16.csv": "time,position,torque\n0,1,2\n".encode("utf-16"),
        "nul.csv": bytes(10**6),
        "random.csv": np.random.default_rng(1).bytes(10**5),
        "wide.csv": many + b"\n" + b",".join([b"1"] * 2000) + b"\n",
        "long_line.csv": b"time,position,torque\n" + b"9" * 10**7,
        "one_cell.csv": b'"' + b"a" * 10**6,
        "formula.csv": b"time,position,torque\n=cmd|'/c calc'!A1,1,2\n",
        "inf.csv": b"time,position,torque\n" + b"1e999,-inf,nan\n" * 500,
        "overflow.csv": b"time [s],position [rad],torque [Nm]\n" + rows,
        "cut.mat": b"MATLAB 5.0 MAT-file" + bytes(109) + struct.pack("<HHII", 0x100, 0x4D49, 15, 2**31),
        "fake.h5": b"\x89HDF\r\n\x1a\n" + np.random.default_rng(2).bytes(5000),
        "fake.parquet": b"PAR1" + bytes(1000) + b"PAR1",
        "fake.tdms": b"TDSm" + bytes(1000),
        "fake.mf4": b"MDF     4.10    " + bytes(2000),
        "fake.bag": b"#ROSBAG V2.0\n" + bytes(1000),
        "deep.json": b"[" * 200000 + b"]" * 200000,
        "entities.json": json.dumps({"time": "x" * 10**6}).encode(),
        "law.toml": b'format = "stickslip-model-1"\nlaw = "/tmp/evil.py"\n[parameters]\n',
    }  # fmt: skip
