"""What compiled readers cannot be given: MAT files that break their format, HDF5 files that end or hang the process."""

from __future__ import annotations

import os
import struct
import time
from importlib.util import find_spec
from pathlib import Path

import h5py
import numpy as np
import pytest
import scipy.io

from stickslip.core.errors import InputError
from stickslip.readers import _guard, _mat_check, open_table


def saved(path: Path, **variables: object) -> bytearray:
    scipy.io.savemat(path, variables)
    return bytearray(path.read_bytes())


def patched(data: bytearray, at: int, code: str, value: int) -> bytes:
    out = bytearray(data)
    struct.pack_into(f"<{code}", out, at, value)
    return bytes(out)


# The array "x" of three numbers begins at byte 128: its tag, flags (136), dimensions (152), name (168), data (176).
BROKEN = [
    ("the variable's type", 128, "I", 3, "has type 3"),
    ("the variable's bytes", 132, "I", 10**6, "of which"),
    ("the flags' type", 136, "I", 7, "has type 7"),
    ("the flags' bytes", 140, "I", 4, "has no flags"),
    ("the class", 144, "B", 99, "class 99"),
    ("a dimension", 160, "i", -3, "negative dimension"),
    ("a larger dimension", 164, "i", 2**30, "dimensions say otherwise"),
    ("the type of the data", 176, "I", 8, "has type 8"),
    ("a type far outside the table", 176, "H", 60000, "has type 60000"),
    ("the bytes of the data", 180, "I", 2**31, "of which"),
    ("a small element of 5 bytes", 170, "H", 5, "of 4 at most"),
    ("the order of bytes", 126, "H", 0, "order of bytes"),
]


@pytest.mark.parametrize(("what", "at", "code", "value", "said"), BROKEN, ids=[b[0] for b in BROKEN])
def test_mat_files_that_break_their_format(tmp_path, what, at, code, value, said):
    path = tmp_path / "a.mat"
    data = saved(path, x=np.arange(3.0))
    _mat_check.check(bytes(data))
    path.write_bytes(patched(data, at, code, value))
    with pytest.raises(InputError, match=said) as caught:
        open_table(path)
    assert "a.mat" in str(caught.value)


def test_cells_structures_and_texts_are_checked_inside(tmp_path):
    inner = {"name": "axis", "cell": np.array([np.arange(4.0), "text", 1 + 2j], dtype=object), "flag": True}
    data = saved(tmp_path / "a.mat", outer={"inner": inner})
    _mat_check.check(bytes(data))
    # The longest name of a field is 32 bytes with its end: no end, no field.
    names = bytes(data).index(b"inner\x00")
    with pytest.raises(_mat_check.Damaged, match="without an end"):
        _mat_check.check(bytes(data[:names]) + b"n" * 32 + bytes(data[names + 32 :]))
    # A type deep inside that does not exist.
    at = bytes(data).index(np.arange(4.0).tobytes()) - 8
    with pytest.raises(_mat_check.Damaged, match="has type 77"):
        _mat_check.check(patched(data, at, "I", 77))


def test_the_check_takes_what_matlab_wrote():
    """SciPy's own test files, of MATLAB 5 to 7.4 on several machines: what SciPy reads, the check takes."""
    origin = find_spec("scipy.io").origin
    folder = Path(origin).parent / "matlab" / "tests" / "data"
    taken = 0
    for path in sorted(folder.glob("test*_[567]*.mat")):
        content = path.read_bytes()
        if 0 in content[:4] or b"\x89HDF" in content[:1024]:
            continue
        _mat_check.check(content)
        taken += 1
    if not taken:
        pytest.skip("SciPy is installed without its test files")
    assert taken > 40


def with_heap(path: Path) -> Path:
    with h5py.File(path, "w") as file:
        file["q"] = np.arange(10.0)
        file["q"].attrs["unit"] = "rad"
    return path


def test_an_hdf5_file_that_hangs_the_library_is_given_up(tmp_path, monkeypatch):
    path = with_heap(tmp_path / "a.h5")
    assert open_table(path).columns[0].unit == "rad"
    data = bytearray(path.read_bytes())
    heap = data.index(b"GCOL")
    # The first object becomes free space of 0 bytes: the library walks on by 0 for ever.
    struct.pack_into("<HHIQ", data, heap + 16, 0, 0, 0, 0)
    path.write_bytes(data)
    monkeypatch.setattr(_guard, "PATIENCE", 2.0)
    start = time.monotonic()
    with pytest.raises(InputError, match=r"a\.h5 is damaged|a\.h5 cannot be read"):
        open_table(path)
    assert time.monotonic() - start < 30.0


def test_a_call_answers_raises_or_says_how_it_ended():
    assert _guard.call(divmod, 7, 3, limit=30.0) == (2, 1)
    with pytest.raises(ZeroDivisionError):
        _guard.call(divmod, 7, 0, limit=30.0)
    with pytest.raises(_guard.Died, match="timed out after 1 s"):
        _guard.call(time.sleep, 20.0, limit=1.0)
    with pytest.raises(_guard.Died, match="crashed, exit code"):
        _guard.call(os.abort, limit=30.0)
    # Noise of a library is no part of the answer.
    assert _guard.call(print, "noise", limit=30.0) is None


def test_a_folder_has_the_time_that_its_files_need(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with (tmp_path / "bag.db3").open("wb") as file:
        file.truncate(400_000_000)
    monkeypatch.setattr(_guard, "call", lambda *_, limit, memory: limit)
    assert _guard.read_apart(len, tmp_path, library="rosbags") == 3.0 * _guard.PATIENCE
