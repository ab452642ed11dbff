"""Arduino: the C of a law as a library with an example, in single precision."""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from stickslip.core.messages import axis_unit
from stickslip.core.spec import Surroundings
from stickslip.exports import c99
from stickslip.exports._c import HEADERS
from stickslip.exports._text import render
from stickslip.exports.job import Check, Export, Job
from stickslip.exports.target import Target

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
        "x": x, "title": job.model.law.title,
        "surroundings": ", ".join(f"{u!r}f" for u in Surroundings()), "sample_time": 1e-3,
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
            "README.md": render("arduino_readme.md.j2", **values, **c99.about_substeps(job)),
        }
    )


AVR = ("avr-g++", "-mmcu=atmega328p", "-std=gnu++11", "-Os", "-Wall", "-Werror", "-ffunction-sections",
       "-fdata-sections", "-Wl,--gc-sections")  # fmt: skip
MAIN = "#include <Arduino.h>\n#include <Step.ino>\nint main() { setup(); for (;;) loop(); }\n"


def check(job: Job, export: Export) -> Check:
    """Compile library and example as the Arduino tools would, with g++ and avr-g++, and run the golden vectors."""
    return tried(export, job.name)


def tried(export: Export, x: str) -> Check:
    """The same of the library of that name."""
    if shutil.which("g++") is None:
        return Check(None, "g++ is not installed")
    with TemporaryDirectory() as folder:
        for name, content in {**export.files, "stub/Arduino.h": STUB, "main.cpp": MAIN}.items():
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
        board = ["-Istub", "-Isrc", "-Iexamples/Step", "main.cpp", f"src/{x}.cpp", "-lm", "-o", "board"]
        commands = [("g++", *FLAGS, *sketch), ("g++", *FLAGS, *vectors)]
        commands += [(*AVR, *board)] if shutil.which(AVR[0]) else []
        for command in commands:
            built = c99.run(command, folder)
            if built.returncode:
                return Check(False, f"{command[0]}: {built.stderr.strip().splitlines()[0]}")
        ran = c99.run(["./check"], folder)
        error = c99.worst_in(ran.stdout)
    tools = " and ".join(dict.fromkeys(command[0] for command in commands))
    said = f"{tools} compile it; at most {error:.3g} {axis_unit('N·m')} off the definition"
    return Check(ran.returncode == 0, said, {"g++": error})


TARGET = Target(
    "arduino",
    "Arduino library, single precision",
    write,
    check,
    around="position, load, temperature and time are yours to set in `u`",
    tried="g++, avr-g++ (ATmega328P) and arm-none-eabi-g++; not on a board",
    reserved=HEADERS,
)
