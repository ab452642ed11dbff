"""MATLAB and Octave: functions of a law, tried in Octave."""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Iterable
from pathlib import Path
from tempfile import TemporaryDirectory

from stickslip.core.messages import axis_unit
from stickslip.core.spec import Field, Surroundings
from stickslip.exports._guard import guarded
from stickslip.exports._matlab import functions, local, safe, with_helpers
from stickslip.exports._step_error import about_steps
from stickslip.exports._text import render, summary, text_in
from stickslip.exports.golden import PACE, as_csv, golden_around
from stickslip.exports.job import Check, Export, Job, counts_in
from stickslip.exports.target import Target
from stickslip.subset import law_layouts, named

BOUND = 1e-12
"""Largest relative error in Octave, whose exp and power are not the C library's."""


SUBSTEPS = (
    "`[torque, z] = {x}_substeps(v0, v1, dt, count, z, p, u)` divides a step, the velocity linear in between."
)


def write(job: Job) -> Export:
    """One file a function, golden vectors and a script that checks them."""
    law = job.model.law
    files = {
        f"{job.name}_parameters.m": "\n".join(_parameters(job)),
        f"{job.name}_reset.m": "\n".join(_reset(job)),
        f"{job.name}_surroundings.m": "\n".join(_surroundings(job)),
    }
    for entry in ("step", "steady"):
        function = getattr(law, entry)
        if function is not None:
            trees = named({entry: function}, law_layouts(law))
            trees = guarded(trees, entry) if entry == "step" else trees
            files[f"{job.name}_{entry}.m"] = _file(job, entry, functions(trees))
    common = {"x": job.name, "law": law, "bound": repr(BOUND), "steady": law.steady is not None}
    return Export(
        {
            **files,
            f"{job.name}_substeps.m": render("matlab_substeps.m.j2", **common),
            f"{job.name}_check.m": render("matlab_check.m.j2", **common),
            "golden.csv": as_csv(golden_around(job.model, PACE)),
            "README.md": render(
                "matlab_readme.md.j2", **about_steps(job.model, SUBSTEPS.format(x=job.name)), **common
            ),
        }
    )


def _file(job: Job, entry: str, parts: list[tuple[str, str, list[str]]]) -> str:
    """One public function with the local ones that it calls."""
    *inner, (own_name, about, lines) = parts
    own, public = local(entry) + "(", f"{job.name}_{entry}("
    head = lines[0].replace(own, public, 1)
    if entry == "step":  # of every law alike, also of one without memory
        head = head.replace("[torque_]", "[torque_, z]")
    lines = [
        head,
        comment(summary(own_name, about)),
        comment(f"{job.model.law.title}. SI units."),
        *lines[1:],
    ]
    text = [*lines, ""]
    for name, doc, code in inner:
        text += [code[0], comment(summary(name, doc)), *code[1:], ""]
    return "\n".join(with_helpers(text))


def _parameters(job: Job) -> Iterable[str]:
    law, p = job.model.law, job.model.parameters
    yield f"function p = {job.name}_parameters()"
    yield comment(f"Identified parameters: {law.title}.")
    for f in law.fields:
        value = getattr(p, f.name)
        shown = f"[{', '.join(map(repr, value))}]" if f.per_element else repr(value)
        yield f"    p.{safe(f.name)} = {shown};  % {meaning_of(f)}"
    for name, size in counts_in(job.model).items():
        yield f"    p.{name.strip('_')} = {size};"
    yield "end\n"


def _reset(job: Job) -> Iterable[str]:
    law = job.model.law
    yield f"function z = {job.name}_reset()"
    yield "    % The contact at rest, without load."
    yield "    z = struct();"
    for f in law.state_fields:
        size = f"zeros(1, {law.elements_in(job.model.parameters)})" if f.per_element else "0.0"
        yield f"    z.{safe(f.name)} = {size};  % {meaning_of(f)}"
    yield "end\n"


def comment(text: str) -> str:
    """A line of a function that is a comment."""
    return f"    % {text_in('m', text)}"


def meaning_of(f: Field) -> str:
    """The meaning of a field and its unit, for the comment on its line."""
    return text_in("m", f"{f.par.meaning}, {axis_unit(f.par.unit)}")


def _surroundings(job: Job) -> Iterable[str]:
    yield f"function u = {job.name}_surroundings()"
    yield "    % What the contact depends on besides its velocity."
    for name, value in Surroundings()._asdict().items():
        yield f"    u.{name} = {value!r};"
    yield "end\n"


def check(job: Job, export: Export) -> Check:
    """Run the golden vectors in Octave."""
    return in_octave(export, job.name)


def in_octave(export: Export, x: str) -> Check:
    """Run the script that checks the export of that name in Octave."""
    tool = shutil.which("octave-cli") or shutil.which("octave")
    if tool is None:
        return Check(None, "Octave is not installed")
    with TemporaryDirectory() as folder:
        for name, content in export.files.items():
            Path(folder, name).write_text(str(content), encoding="utf-8")
        command = [tool, "--no-gui", "--norc", "--quiet", "--eval", f"{x}_check"]
        done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    try:
        error = float(done.stdout.split()[-1])
    except (IndexError, ValueError):
        return Check(False, f"Octave: {' '.join(done.stderr.split())[:300]}")
    return Check(
        error <= BOUND, f"Octave: {error:.3g} of the largest torque off the definition", {"octave": error}
    )


TARGET = Target(
    "matlab",
    "MATLAB and Octave functions",
    write,
    check,
    around="position, load, temperature and time are yours to set in `u`",
    tried="Octave",
)
