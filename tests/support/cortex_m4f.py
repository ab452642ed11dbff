"""The exported C on an emulated Cortex-M4F: torques, bytes of code, instructions a step.

``python tests/export/cortex_m4f.py`` prints the table of docs/howto/export.md. Needs arm-none-eabi-gcc with newlib and
qemu-system-arm. QEMU counts instructions, not cycles.
"""

import shutil
import struct
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from stickslip.core.spec import Surroundings
from stickslip.exports import c99
from stickslip.exports.golden import golden
from stickslip.exports.job import Job
from stickslip.models import plugins
from stickslip.models.model import Model

HERE = Path(__file__).parents[1] / "export" / "cortex"
CORE = ("-mcpu=cortex-m4", "-mthumb", "-mfpu=fpv4-sp-d16", "-mfloat-abi=hard")
FLAGS = (*CORE, "-std=c99", "-O2", "-ffunction-sections", "-fdata-sections", "-Wdouble-promotion", "-Werror")
NEEDED = ("arm-none-eabi-gcc", "arm-none-eabi-size", "qemu-system-arm")
STEPS = 300
TICK = 40  # instructions of a tick: the board's clock of 25 MHz while each instruction takes 1 ns


def missing():
    """The tools that are not installed."""
    return [tool for tool in NEEDED if shutil.which(tool) is None]


def literal(x):
    """A float of C."""
    text = str(np.float32(x))
    return f"{text}f" if "." in text or "e" in text else f"{text}.0f"


def called(command, folder):
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr + done.stdout
    return done.stdout + done.stderr


def emulated(law):
    """Torques on the core and of plain Python, N·m; bytes of code and constants; instructions a step."""
    model = Model(law, **dict(law.example))
    vectors = golden(model, count=STEPS, seed=2)
    with TemporaryDirectory() as folder:
        for name, text in c99.write(Job(model, "x", single=True)).files.items():
            Path(folder, name).write_text(text)
        rows = ", ".join("{ " + ", ".join(map(literal, row[:4])) + " }" for row in zip(*vectors))
        around = ", ".join(f"{x!r}f" for x in Surroundings())
        Path(folder, "main.c").write_text(
            (HERE / "main.c.in").read_text().format(n=STEPS, rows=rows, around=around)
        )
        called(["arm-none-eabi-gcc", *FLAGS, "-c", "x.c"], folder)
        size = sum(int(n) for n in called(["arm-none-eabi-size", "x.o"], folder).splitlines()[1].split()[:2])
        sources = ["x.o", "main.c", str(HERE / "start.c")]
        link = [
            "-nostartfiles",
            "-T",
            str(HERE / "board.ld"),
            "-Wl,--gc-sections",
            "--specs=nosys.specs",
            "-lm",
        ]
        called(["arm-none-eabi-gcc", *FLAGS, *sources, *link, "-o", "run.elf"], folder)
        board = ["-M", "mps2-an386", "-nographic", "-icount", "shift=0", "-semihosting", "-kernel", "run.elf"]
        lines = called(["qemu-system-arm", *board], folder).split()
    *torques, stepping, idle = [int(line, 16) for line in lines if len(line) == 8]
    out = np.array([struct.unpack("f", struct.pack("I", word))[0] for word in torques], dtype=float)
    return out, vectors.torque, size, TICK * (stepping - idle) / (20 * STEPS)


def main():
    print("| law | code and constants, bytes | instructions a step |\n|---|---|---|")
    for name in sys.argv[1:] or ("coulomb", "stribeck_plain", "dahl", "lugre", "maxwell_slip", "gms"):
        _, _, size, instructions = emulated(plugins.law(name))
        print(f"| {name} | {size} | {instructions:.0f} |")


if __name__ == "__main__":
    main()
