"""The fuzzer of tests/fuzz, short, in a process of its own; and invented text by hypothesis."""

from __future__ import annotations

import importlib.util
import subprocess
import sys
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

FUZZER = Path(__file__).parents[1] / "fuzz" / "readers.py"


def test_damaged_files_of_every_format():
    """A crash of a C library ends the fuzzer, not the tests."""
    argv = [sys.executable, "-X", "faulthandler", str(FUZZER), "--minutes", "0.05", "--seed", "7"]
    done = subprocess.run(argv, capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0, done.stdout[-3000:] + done.stderr[-3000:]
    assert "'exit code 2'" in done.stdout


NUMBERS = st.one_of(
    st.floats().map(str),
    st.integers(-(10**20), 10**20).map(str),
    st.sampled_from(["", "nan", "-", "1,5", "x", "1e999", "true", "2024-05-01T12:00:00"]),
)
TABLES = st.tuples(
    st.lists(st.text(max_size=12), min_size=1, max_size=5),
    st.sampled_from([",", ";", "\t", " ", "|"]),
    st.lists(st.lists(NUMBERS, min_size=1, max_size=5), max_size=40),
).map(lambda t: "\n".join([t[1].join(t[0]), *(t[1].join(row) for row in t[2])]))


@pytest.fixture(scope="module")
def fuzzer():
    spec = importlib.util.spec_from_file_location("fuzz_readers", FUZZER)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize("suffix", [".csv", ".json"])
@settings(max_examples=40, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.one_of(st.binary(max_size=300), TABLES.map(lambda text: text.encode("utf-8", "replace"))))
def test_invented_text(tmp_path, fuzzer, suffix, data):
    path = tmp_path / f"file{suffix}"
    path.write_bytes(data)
    assert fuzzer.attempt(path, []) in (0, 2)
