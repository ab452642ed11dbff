"""Arduino: the C of a law, or of a whole controller, as a library with an example, in single precision."""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from stickslip.export import c99
from stickslip.export._text import ascii_only, render
from stickslip.export.job import Check, Export, Job
from stickslip.export.target import Target
from stickslip.spec import Surroundings

__all__ = ["TARGET"]

STUB = """/* What the example needs of Arduino.h. */
#include <stdint.h>
inline uint32_t micros() { return 0; }
inline int analogRead(int) { return 0; }
struct Port { void begin(long) {} void println(double, int) {} operator bool() { return true; } };
static Port Serial;
"""
FLAGS = ("-std=c++11", "-O2", "-Wall", "-Wextra", "-Werror", "-ffp-contract=off")


def write(job: Job) -> Export:
    """Sources, an example, the library's properties, and the check of the C export."""
    single = replace(job, single=True)
    c = c99.write(single).files
    x = job.name
    values: dict[str, Any] = {
        "x": x, "title": ascii_only(job.model.law.title), "controller": job.controller is not None,
        "surroundings": ", ".join(f"{u!r}f" for u in Surroundings()),
        "sample_time": job.controller.sample_time if job.controller else 1e-3,
        "alone": job.controller is not None and c99.compensates_alone(job.controller),
    }  # fmt: skip
    return Export(
        {
            f"src/{x}.h": c[f"{x}.h"],
            f"src/{x}.cpp": str(c[f"{x}.c"]).replace(
                f"see {x}.h.", f"see {x}.h. C that C++ compilers read too."
            ),
            "examples/Step/Step.ino": render("arduino.ino.j2", **values),
            "library.properties": render("arduino.properties.j2", **values),
            f"extras/{x}_check.c": c[f"{x}_check.c"],
            "extras/golden.csv": c["golden.csv"],
            "README.md": render("arduino_readme.md.j2", **values),
        }
    )


def check(job: Job, export: Export) -> Check:
    """Compile library and example with g++ as the Arduino tools would, and run the golden vectors."""
    if shutil.which("g++") is None:
        return Check(None, "g++ is not installed")
    x = job.name
    with TemporaryDirectory() as folder:
        for name, content in {**export.files, "stub/Arduino.h": STUB}.items():
            path = Path(folder, name)
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(str(content))
        sketch = [
            "-Istub",
            "-Isrc",
            "-include",
            "Arduino.h",
            "-x",
            "c++",
            "-fsyntax-only",
            "examples/Step/Step.ino",
        ]
        vectors = ["-Isrc", f"src/{x}.cpp", "-x", "c++", f"extras/{x}_check.c", "-lm", "-o", "check"]
        for arguments in (sketch, vectors):
            built = c99.run(["g++", *FLAGS, *arguments], folder)
            if built.returncode:
                return Check(False, f"g++: {built.stderr.strip().splitlines()[0]}")
        ran = c99.run(["./check"], folder)
        error = float(ran.stdout or "nan")
    return Check(ran.returncode == 0, f"g++: at most {error:.3g} N·m off the definition", {"g++": error})


TARGET = Target(
    "arduino",
    "Arduino library, single precision",
    write,
    check,
    controller=True,
    tried="g++ and arm-none-eabi-g++; not on a board",
)
