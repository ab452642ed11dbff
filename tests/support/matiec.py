"""Structured text compiled with iec2c (matiec), where that is installed, and run as C."""

import ctypes
import os
import shutil
import subprocess
from pathlib import Path

import numpy as np

PROGRAM = """#include <string.h>
#include "POUS.h"
TIME __CURRENT_TIME;
BOOL __DEBUG;
#include "POUS.c"
void run(long n, const double *velocity, const double *time, const double *position,
         const double *load, const double *temperature, double *out)
{{
    {block} b;
    memset(&b, 0, sizeof b); /* no variable is forced */
    {block}_init__(&b, 0);
    for (long i = 0; i < n; i++) {{
        __SET_VAR(b., VELOCITY,, velocity[i]);
        __SET_VAR(b., SAMPLE_TIME,, time[i]);
        __SET_VAR(b., POSITION,, position[i]);
        __SET_VAR(b., LOAD,, load[i]);
        __SET_VAR(b., TEMPERATURE,, temperature[i]);
        {block}_body__(&b);
        out[i] = __GET_VAR(b.TORQUE,);
    }}
}}
"""


def missing():
    """What is not installed of iec2c, its library (MATIEC_LIB, or lib beside it) and gcc."""
    return [name for name, found in (("iec2c", library()), ("gcc", shutil.which("gcc"))) if not found]


def library():
    """The folder of matiec's own library."""
    tool = shutil.which("iec2c")
    if tool is None:
        return None
    home = Path(tool).resolve().parent
    places = [os.environ.get("MATIEC_LIB"), home / "lib", home.parent / "lib" / "matiec", home.parent / "lib"]
    return next((Path(p) for p in places if p and Path(p, "ieclib.txt").exists()), None)


def translated(source, folder):
    """What iec2c says of a file of structured text; nothing where it takes it."""
    command = ["iec2c", "-I", str(library()), "-T", str(folder), str(source)]
    done = subprocess.run(command, capture_output=True, text=True)
    return "" if done.returncode == 0 else done.stderr + f"exit {done.returncode}"


def torques(block, folder, *inputs):
    """The torque of a translated function block, cycle by cycle, of velocity, time, position, load and temperature."""
    (folder / "run.c").write_text(PROGRAM.format(block=block.upper()))
    include = ["-I", str(library() / "C"), "-I", str(folder)]
    flags = ["-w", "-O1", "-ffp-contract=off", "-shared", "-fPIC"]
    subprocess.run(["gcc", *flags, *include, "run.c", "-lm", "-o", "run.so"], cwd=folder, check=True)
    out, array = np.empty(len(inputs[0])), ctypes.POINTER(ctypes.c_double)
    given = [np.ascontiguousarray(a, dtype=float) for a in inputs]
    ctypes.CDLL(str(folder / "run.so")).run(
        ctypes.c_long(out.size), *(a.ctypes.data_as(array) for a in (*given, out))
    )
    return out
