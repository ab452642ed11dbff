"""The fuzzer of tests/fuzz, short; and invented bytes and tables by hypothesis."""

from __future__ import annotations

import importlib.util
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

SPEC = importlib.util.spec_from_file_location(
    "fuzz_readers", Path(__file__).parents[1] / "fuzz" / "readers.py"
)
assert SPEC is not None
assert SPEC.loader is not None
fuzz = importlib.util.module_from_spec(SPEC)
SPEC.loader.exec_module(fuzz)


def test_damaged_files_of_every_format():
    assert fuzz.run(minutes=0.1, seed=7) == 0


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


@pytest.mark.parametrize("suffix", [".csv", ".json", ".mat"])
@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.one_of(st.binary(max_size=300), TABLES.map(lambda text: text.encode("utf-8", "replace"))))
def test_invented_files(tmp_path, suffix, data):
    path = tmp_path / f"file{suffix}"
    path.write_bytes(data)
    assert fuzz.attempt(path, []) in (0, 2)
