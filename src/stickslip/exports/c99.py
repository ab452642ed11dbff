"""C99: header and source of a law.

One definition feeds it: the functions of the law's file, printed by `stickslip.exports._c`. In double precision
and without contraction the code gives the bits of plain Python (tested); in single precision it is within
`SINGLE_BOUND` of the largest torque.
"""

from __future__ import annotations

import math
import shutil
import subprocess
from collections.abc import Iterable, Mapping, Sequence
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from stickslip.core.messages import axis_unit
from stickslip.core.spec import Field, Surroundings
from stickslip.exports._analysis import Facts, analyse, merged
from stickslip.exports._c import HEADERS, Dialect, functions, head, safe
from stickslip.exports._guard import guarded
from stickslip.exports._step_error import about_steps
from stickslip.exports._text import in_lines, render, sources, summary
from stickslip.exports.golden import (
    PACE,
    Golden,
    Surrounded,
    answered,
    as_csv,
    golden_around,
    room_beside_jumps,
)
from stickslip.exports.job import Check, Export, Job, counts_in
from stickslip.exports.nearest import read_by
from stickslip.exports.target import Target
from stickslip.subset import law_layouts, named

SINGLE_BOUND = 1e-2
"""Largest error of single precision, as a share of the largest torque: where a contact breaks away a step sooner or
later by rounding, it is the fall of the torque in that step."""

STRUCTURES = {
    "z": "state", "dz": "state", "g": "state", "p": "parameters", "u": "surroundings", "n": "settings", "m": "memory",
}  # fmt: skip
SURROUNDINGS = {
    "position": ("position", "rad"),
    "load": ("normal load over the one of the parameters", "-"),
    "temperature": ("temperature", "degC"),
    "time": ("time since the start", "s"),
    "applied": ("torque applied to the contact from outside", "N*m"),
}
"""Meaning and unit."""
FLAGS = ("-std=c99", "-O2", "-ffp-contract=off", "-fno-builtin", "-Wall", "-Wextra", "-Wpedantic", "-Wconversion",
         "-Wdouble-promotion", "-Werror")  # fmt: skip


def dialect_of(job: Job) -> Dialect:
    """How the C of this job is spelt."""
    return Dialect(job.name, job.single, STRUCTURES)


def translated(job: Job) -> dict[str, Any]:
    """The functions of the law as trees of the subset."""
    law = job.model.law
    # The public ones first: they have the right to their names.
    entries = {"_steady": law.steady, "_holding": law.holding, "_step": law.step}
    entries = {name: function for name, function in entries.items() if function}
    return guarded(merged(named(entries, law_layouts(law))))


def write(job: Job) -> Export:
    """Header, source, golden vectors, a program that checks them, and how to use it."""
    law, p, dialect = job.model.law, job.model.parameters, dialect_of(job)
    trees = translated(job)
    known = analyse(trees)
    public = [n for n in ("_step", "_steady", "_holding") if n in trees]
    written = functions(trees, known, dialect, public)
    about = {name: summary(name, doc) for name, doc, _ in written}
    vectors = golden_around(job.model, PACE)
    room = jumps_of(job, vectors)
    common: dict[str, Any] = {
        "substeps_head": substeps_head(dialect, known["_step"]), "step_arguments": known["_step"].arguments,
        "x": job.name, "X": job.name.upper(), "title": law.title, "real": dialect.real,
        "counts": {dialect.count(n): size for n, size in counts_in(job.model).items()},
        "source": sources(law),
        "equation": in_lines(law.equation),
        "surroundings": ", ".join(dialect.number(x) for x in Surroundings()),
        "moved": isinstance(vectors, Surrounded), "columns": len(vectors),
        "depends": read_by(job.model),
        "bound": SINGLE_BOUND if job.single else 0.0,
        "scale": scale_of(vectors.torque),
        "count": len(vectors.v0), "jumps": int((room > 0.0).sum()),
    }  # fmt: skip
    header = render(
        "c99.h.j2",
        **common,
        structures=list(structures(job, dialect)),
        public=[{"about": about[n], "head": head(n, known[n], dialect)} for n in public],
    )
    code = [{"about": about[name], "lines": lines} for name, _, lines in written]
    text = "\n".join(line for part in code for line in part["lines"])
    source = render(
        "c99.c.j2",
        **common,
        functions=code,
        small=[n for n in ("expm1f", "log1pf") if f"{n}(" in text],
        extremes=[n for n in ("min", "max") if f"{job.name}_{n}(" in text],
        identified=[*initial(law.fields, p._asdict(), dialect)],
        reset=[*cleared(law.state_fields, "z", dialect)],
    )
    columns = [*vectors, *([room] if job.single else [])]
    rows = [", ".join(repr(float(x)) for x in row) for row in zip(*columns)]
    table = [
        {"name": f.name, "value": getattr(p, f.name), "unit": axis_unit(f.par.unit), "meaning": f.par.meaning}
        for f in law.fields
    ]
    return Export(
        {
            f"{job.name}.h": header,
            f"{job.name}.c": source,
            f"{job.name}_check.c": render("c99_check.c.j2", **common, rows=rows),
            "golden.csv": as_csv(vectors),
            "README.md": render("c99_readme.md.j2", **common, **about_substeps(job), table=table),
        }
    )


def jumps_of(job: Job, vectors: Golden | Surrounded) -> Any:
    """What single precision may differ by in each step beside a jump of the torque, N·m, shape (n,)."""
    if not job.single or job.model.law.continuous:
        return np.zeros(len(vectors.v0))
    bound = SINGLE_BOUND * float(scale_of(vectors.torque))
    around = vectors[5:] if isinstance(vectors, Surrounded) else None
    return room_beside_jumps(partial(answered, job.model, around=around), vectors, bound)


def substeps_head(dialect: Dialect, step: Facts) -> str:
    """The head of the function that divides a step."""
    given = head("_step", step, dialect).split(", ")
    return ", ".join([*given[:3], "int count", *given[3:]]).replace("_step(", "_substeps(", 1)


def about_substeps(job: Job) -> dict[str, Any]:
    """What a README says of the error of a step, and how the C divides one."""
    said = f"`{job.name}_substeps(v0, v1, dt, count, ...)` divides a step, the velocity linear in between."
    return about_steps(job.model, said)


def scale_of(torque: Any) -> str:
    """The largest torque, N·m, against which the bound of single precision counts."""
    return repr(float(max(abs(torque).max(), 1e-12)))


# ---- structures and their values ------------------------------------------------------------------------------


def structures(job: Job, dialect: Dialect) -> Iterable[Mapping[str, Any]]:
    """The structures of the header."""
    law = job.model.law
    yield structure("parameters", "Parameters of the law.", law.fields, dialect)
    yield structure("state", "What the contact remembers from step to step.", law.state_fields, dialect)
    yield surroundings("What the contact depends on besides its velocity.", dialect)


def surroundings(about: str, dialect: Dialect) -> Mapping[str, Any]:
    """The structure of what friction depends on."""
    around = [
        {"declared": f"{dialect.real} {name};", "meaning": _meaning_around(name)}
        for name in Surroundings._fields
    ]
    return {"name": "surroundings", "about": about, "fields": around}


def _meaning_around(name: str) -> str:
    """Return meaning and unit of a surrounding quantity."""
    meaning, unit = SURROUNDINGS.get(name, (name, ""))
    return f"{meaning}, {axis_unit(unit)}" if unit else meaning


def structure(name: str, about: str, fields: Sequence[Field], dialect: Dialect) -> Mapping[str, Any]:
    """One structure; C has no empty ones."""
    lines = [
        {
            "declared": f"{dialect.real} {safe(f.name)}{place_of(f, dialect)};",
            "meaning": f"{f.par.meaning}, {axis_unit(f.par.unit)}",
        }
        for f in fields
    ]
    return {
        "name": name,
        "about": about,
        "fields": lines or [{"declared": "char none;", "meaning": "this law has none"}],
    }


def place_of(f: Field, dialect: Dialect) -> str:
    """The size of an array; nothing for a number."""
    return f"[{dialect.count(f'{f.par.per}s_')}]" if f.per_element else ""


def given(fields: Sequence[Field], values: Mapping[str, Any], owner: str, dialect: Dialect) -> Iterable[str]:
    """Assignments of numbers to a structure's fields."""
    for f in fields:
        numbers = values[f.name] if f.per_element else [values[f.name]]
        for i, x in enumerate(numbers):
            place = f"[{i}]" if f.per_element else ""
            yield f"{owner}->{safe(f.name)}{place} = {dialect.number(float(x))};"
    if not fields:
        yield f"{owner}->none = 0;"


def initial(
    fields: Sequence[Field], values: Mapping[str, Any], dialect: Dialect
) -> Iterable[Mapping[str, str]]:
    """The initial value of each field of a constant structure, and its meaning."""
    for f in fields:
        value = values[f.name]
        numbers = ", ".join(dialect.number(float(x)) for x in (value if f.per_element else (value,)))
        about = f"{f.name}: {f.par.meaning}, {axis_unit(f.par.unit)}"
        yield {"value": f"{{ {numbers} }}" if f.per_element else numbers, "about": about}
    if not fields:
        yield {"value": "0", "about": "this law has none"}


def cleared(fields: Sequence[Field], owner: str, dialect: Dialect) -> Iterable[str]:
    """Assignments of zero to every field of a structure."""
    zero = dialect.number(0.0)
    for f in fields:
        if f.per_element:
            count = dialect.count(f"{f.par.per}s_")
            yield f"for (int i = 0; i < {count}; i++) {{ {owner}->{safe(f.name)}[i] = {zero}; }}"
        else:
            yield f"{owner}->{safe(f.name)} = {zero};"
    if not fields:
        yield f"{owner}->none = 0;"


# ---- the check -------------------------------------------------------------------------------------------------


def check(job: Job, export: Export) -> Check:
    """Compile with every compiler at hand, warnings as errors, and run the golden vectors."""
    return checked(export, job.name)


def checked(export: Export, name: str) -> Check:
    """Compile NAME.c with NAME_check.c and run it."""
    compilers = [c for c in ("gcc", "clang") if shutil.which(c)]
    if not compilers:
        return Check(None, "neither gcc nor clang is installed")
    errors: dict[str, float] = {}
    with TemporaryDirectory() as folder:
        for file, content in export.files.items():
            Path(folder, file).write_text(str(content))
        for compiler in compilers:
            sources = [f"{name}.c", f"{name}_check.c"]
            built = run([compiler, *FLAGS, *sources, "-lm", "-o", "check"], folder)
            if built.returncode:
                return Check(False, f"{compiler}: {built.stderr.strip().splitlines()[0]}")
            ran = run(["./check"], folder)
            errors[compiler] = worst_in(ran.stdout)
            if ran.returncode:
                return Check(
                    False, f"{compiler}: {errors[compiler]:.3g} {axis_unit('N·m')} off the definition", errors
                )
    worst = max(errors.values())
    return Check(
        True, f"{' and '.join(compilers)}: at most {worst:.3g} {axis_unit('N·m')} off the definition", errors
    )


def worst_in(printed: str) -> float:
    """The largest of the errors that the check printed, N·m; NaN if one is, or there are none."""
    found = [float(x) for x in printed.split()]
    return max(found) if found and not any(map(math.isnan, found)) else math.nan


def run(command: Sequence[str], folder: str) -> subprocess.CompletedProcess[str]:
    """Run a tool in a folder."""
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)


TARGET = Target(
    "c99",
    "C99 header and source",
    write,
    check,
    precision=True,
    around="position, load, temperature and time are yours to set in `u`",
    tried="gcc, clang: every bit",
    reserved=HEADERS,
)
