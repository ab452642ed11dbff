"""LinuxCNC: a realtime HAL component of a law, around the functions of the C99 target.

The functions come in by ``include`` before the macros that halcompile makes of the pins' names, so that neither can
disturb the other. Pins and syntax as in halcompile of LinuxCNC 2.9.
"""

from __future__ import annotations

import shutil
import subprocess
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from stickslip.exports import c99
from stickslip.exports._c import KEYWORDS
from stickslip.exports._step_error import about_steps
from stickslip.exports._text import render
from stickslip.exports.job import Check, Export, Job
from stickslip.exports.target import Target

WORDS = frozenset({
    "author", "component", "description", "examples", "function", "include", "license", "modparam", "notes", "option",
    "param", "pin", "see_also", "type", "variable",
})  # fmt: skip
"""Of halcompile, besides those of C."""
NOTE = "run in our tests against the golden vectors; not tried on a machine"


SUBSTEPS = "The parameter `substeps` divides the step of a period, the velocity linear in between."


def law_job(job: Job) -> Job:
    """The C inside: halcompile makes NAME.c of NAME.comp, so that the law's file has another name."""
    return replace(job, name=f"{job.name}_law", settings={})


def write(job: Job) -> Export:
    """The component, the C that it includes with its golden vectors, and how to use it."""
    inner = law_job(job)
    code = dict(c99.write(inner).files)
    del code["README.md"]
    values: dict[str, Any] = {
        "x": job.name, "law": inner.name, "title": job.model.law.title,
        "hal": job.name.replace("_", "-"), "note": NOTE,
    }  # fmt: skip
    files = {f"{job.name}.comp": render("linuxcnc.comp.j2", **values), **code}
    return Export(
        {**files, "README.md": render("linuxcnc_readme.md.j2", **values, **about_steps(job.model, SUBSTEPS))},
        (NOTE,),
    )


def check(job: Job, export: Export) -> Check:
    """The C against its golden vectors, and the component compiled by halcompile where that is installed."""
    inner = law_job(job)
    values = c99.check(inner, export)
    tool = shutil.which("halcompile")
    if not values.passed or tool is None:
        missing = "" if tool else "; halcompile is not installed (linuxcnc-uspace-dev)"
        return Check(values.passed, values.text + missing, values.numbers)
    with TemporaryDirectory() as folder:
        for name, content in export.files.items():
            Path(folder, name).write_text(str(content), encoding="utf-8")
        command = [tool, "--compile", f"{job.name}.comp"]
        done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
        built = Path(folder, f"{job.name}.so").exists()
    if done.returncode or not built:
        return Check(False, f"halcompile: {' '.join((done.stdout + done.stderr).split())[-300:]}")
    return Check(True, f"{values.text}; halcompile builds the component", values.numbers)


TARGET = Target(
    "linuxcnc",
    "LinuxCNC HAL component",
    write,
    check,
    around="position, load and temperature are pins, time runs by itself, no torque is applied from outside",
    tried="halcompile of LinuxCNC 2.9, gcc; not on a machine",
    reserved=frozenset(KEYWORDS) | WORDS,
)
