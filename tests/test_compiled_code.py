"""Compiled code in the cache: what one process has compiled with other laws around it, another one reads alone."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np

import stickslip
from stickslip.jit import WIDTH, cache_folder, columns_times, kernel, loaded, pointer

HEAD = "from stickslip.jit import compile_entry, compile_inner\n"
INNER = "@compile_inner\ndef {}(v):\n    return {}\n"
ENTRY = "@compile_entry('steady')\ndef steady(v, p):\n    return {}\n"
READER = """
import sys
from stickslip.jit import loaded
for name, text in {files}:
    print(loaded(name, text).steady.ctypes(3.0, None))
print("stickslip._compiled.first" in sys.modules)
"""
LINKED = """
from stickslip.jit import loaded
module = loaded("third", {text!r})
print(*(type(found.library).__name__ for found in module._third.overloads.values()))
print(module.steady.ctypes(0.1, None))
"""


def told(program, cache):
    """What a process prints that keeps its compiled code there."""
    surroundings = {**os.environ, "STICKSLIP_CACHE": str(cache)}
    done = subprocess.run(
        [sys.executable, "-c", program], env=surroundings, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr[-500:]
    return done.stdout.strip()


def shared(number):
    """A file of two functions that every number's file holds, and an entry of its own."""
    inner = INNER.format("_half", "0.5 * v") + INNER.format("_part", "_half(v) + 1.0")
    return HEAD + inner + ENTRY.format(f"_part(v) * {number}")


def test_code_that_shares_a_function_with_another_file_is_read_alone(tmp_path):
    """The function is compiled once, for the first file; the second one's code is read without that file."""
    surroundings = {**os.environ, "STICKSLIP_CACHE": str(tmp_path)}
    files = [("first", shared(2.0)), ("second", shared(4.0))]
    for which, printed in ((files, ["5.0", "10.0", "True"]), (files[1:], ["10.0", "False"])):
        line = [sys.executable, "-c", READER.format(files=which)]
        done = subprocess.run(line, env=surroundings, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr[-500:]
        assert done.stdout.split() == printed
    (kept,) = tmp_path.iterdir()
    assert len(list(kept.rglob("*.nbc"))) == len(files)


def test_what_entries_alone_call_has_no_machine_code_of_its_own(tmp_path):
    """It lies in the entry's, which answers as plain Python does; what is read from the cache compiles none of it."""
    text = HEAD + INNER.format("_third", "v / 3.0") + ENTRY.format("_third(v) + 1.0")
    program = LINKED.format(text=text)
    answer = str(0.1 / 3.0 + 1.0)
    assert told(program, tmp_path).split() == ["Linked", answer]
    assert told(program, tmp_path).split() == [answer]


def test_one_text_of_a_function_calls_what_stands_in_its_own_file():
    """Files whose functions read alike, but for one that another calls: each computes its own."""
    middle, entry = INNER.format("_part", "_half(v) + 1.0"), ENTRY.format("_part(v)")
    results = {}
    for factor in (0.5, 0.25, 0.5, -0.0, 0.0):
        text = HEAD + INNER.format("_half", f"{factor} * v") + middle + entry
        module = loaded(f"half_{str(factor).replace('.', '_').replace('-', 'm')}", text)
        results[factor] = module.steady.ctypes(2.0, None)
        assert results[factor] == factor * 2.0 + 1.0
    assert len(results) == 3


def test_functions_of_one_text_are_compiled_once():
    one, other = loaded("once", shared(8.0)), loaded("twice", shared(16.0))
    assert one._part is other._part
    assert one._half is other._half


LAW = """
from stickslip.jit import compiled_law
from stickslip.models.plugins import law
compiled_law(law("coulomb"))
"""


def test_a_changed_engine_leaves_the_compiled_laws_as_they_are(tmp_path):
    """They call nothing of it: after a change most of what a kept cache holds is good."""
    package = tmp_path / "stickslip"
    shutil.copytree(Path(stickslip.__file__).parent, package)
    program = f"import sys; sys.path.insert(0, {str(tmp_path)!r}){LAW}"
    kept = []
    for change in ("", "# another engine"):
        with (package / "simulation" / "metrics.py").open("a") as file:
            file.write(change)
        told(program, tmp_path / "cache")
        kept.append({file: file.stat().st_mtime_ns for file in tmp_path.glob("cache/**/*.nbc")})
    assert kept[0]
    assert kept[0] == kept[1]


TIDY = """
import sys
import numpy as np
from stickslip.simulation.biquads import zero_phase
zero_phase(np.zeros((2, 6)), np.zeros((2, 2)), np.zeros(10))
print("numba.np.arraymath" in sys.modules)
"""


def test_reading_compiled_code_loads_nothing_that_compiles(tmp_path):
    """numba's implementations of all of NumPy, for which it imports SciPy, take a third of a second a process."""
    assert [told(TIDY, tmp_path) for _ in ("compiles", "reads")] == ["True", "False"]


def test_compiled_code_is_found_where_package_and_cache_have_moved(tmp_path):
    """A kept cache, another checkout: what names compiled code is its text and its place in the package."""
    here = tmp_path / "here" / "cache"
    assert told(TIDY, here) == "True"
    shutil.copytree(Path(stickslip.__file__).parent, tmp_path / "there" / "stickslip")
    here.rename(tmp_path / "there" / "cache")
    moved = f"import sys; sys.path.insert(0, {str(tmp_path / 'there')!r}){TIDY}"
    assert told(
        f"{moved}\nimport stickslip; print(stickslip.__file__)", tmp_path / "there" / "cache"
    ).split() == [
        "False",
        str(tmp_path / "there" / "stickslip" / "__init__.py"),
    ]


SIMULATED = """
import sys
import stickslip as ss
axis = ss.RigidAxis(inertia=1e-3, friction=ss.Model("coulomb", fc=0.1))
controller = ss.Controller(ss.place("PD", inertia=1e-3, bandwidth=20.0))
ss.simulate(axis, controller, ss.Reference("sine", amplitude=0.01, frequency=0.4), duration=0.1)
print("numba.np.arraymath" in sys.modules)
"""


def test_a_simulation_loads_nothing_that_compiles_either():
    cache = cache_folder().parent
    told(SIMULATED, cache)  # may compile
    assert told(SIMULATED, cache) == "False"


NAMES = """
import hashlib
from stickslip import jit
from stickslip.models import plugins
from stickslip.jit import entries
from stickslip.laws import LAWS
from stickslip.simulation.recorded_input.branchless import NotStraight, Trace
from stickslip.simulation.recorded_input.segments import source

class Named(Exception):
    pass

def named(name, text):
    print(name)
    raise Named

entries.loaded = named
for law in map(plugins.law, LAWS):
    try:
        jit.compiled_law(law)
    except Named:
        pass
    try:
        parameters = law.parameters(dict(law.example))
        text = source(law, Trace(law.pack(parameters)))
        print(law.name, hashlib.sha256(text.encode()).hexdigest())
    except NotStraight:
        pass
"""


def test_a_text_is_the_same_in_every_process():
    """It names the file of its compiled code: in the order of a set, every process would compile anew."""
    told = set()
    for seed in ("1", "2", "3"):
        surroundings = {**os.environ, "PYTHONHASHSEED": seed}
        done = subprocess.run(
            [sys.executable, "-c", NAMES], env=surroundings, capture_output=True, text=True, check=False
        )
        assert done.returncode == 0, done.stderr[-500:]
        told.add(done.stdout)
    (names,) = told
    assert len(names.split()) > 20


@kernel()
def summed(columns, factors, out):
    """For the test below."""
    columns_times(pointer(columns, 0), pointer(factors, 0), factors.size, pointer(out, 0))


def test_columns_are_summed_one_after_another():
    rng = np.random.default_rng(5)
    columns, factors, out = rng.normal(size=(13, WIDTH)), rng.normal(size=13), np.full(WIDTH, np.nan)
    summed(columns.ravel(), factors, out)
    for i in range(WIDTH):
        total = 0.0
        for column, factor in zip(columns.tolist(), factors.tolist(), strict=True):
            total += column[i] * factor
        assert out[i] == total
