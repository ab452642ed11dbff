"""Python: one file without dependencies, for a colleague; its functions are the law's own."""

from __future__ import annotations

import ast
import keyword
import math
import subprocess
import sys
from collections.abc import Iterable, Mapping
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from stickslip.core.messages import axis_unit
from stickslip.core.spec import Field, Surroundings
from stickslip.exports._guard import guarded
from stickslip.exports._step_error import about_steps
from stickslip.exports._text import Code, in_units_of_axis, render, sources
from stickslip.exports.golden import PACE, as_csv, golden_around
from stickslip.exports.job import Check, Export, Job, counts_in
from stickslip.exports.target import Target
from stickslip.subset import law_layouts, named

SUBSTEPS = "`contact.step(v0, v1, dt, substeps=4)` divides a step, the velocity linear in between."


def write(job: Job) -> Export:
    """One module, golden vectors, and how to use it."""
    law, p = job.model.law, job.model.parameters
    entries = {"step": law.step, **({"steady": law.steady} if law.steady else {})}
    trees = guarded(named(entries, law_layouts(law)), "step")
    for tree in trees.values():
        count_by_constant(tree, counts_in(job.model))
        indent_docstring(tree)
    text = render(
        "python.py.j2",
        x=job.name,
        law=law,
        source=sources(law),
        counts={constant(n): size for n, size in counts_in(job.model).items()},
        parameters=[*assigned(law.fields, p._asdict())],
        states=[*cleared(law.state_fields)],
        around=[f"{name}={value!r}" for name, value in Surroundings()._asdict().items()],
        functions=[Code(ast.unparse(tree)) for tree in trees.values()],
        steady=law.steady is not None,
    )
    files = {f"{job.name}.py": text, "golden.csv": as_csv(golden_around(job.model, PACE))}
    return Export(
        {
            **files,
            "README.md": render(
                "python_readme.md.j2", **about_steps(job.model, SUBSTEPS), x=job.name, law=law
            ),
        }
    )


def constant(name: str) -> str:
    """The module's constant for a count: ``elements_`` is ``ELEMENTS``."""
    return name.strip("_").upper()


def count_by_constant(tree: ast.FunctionDef, counts: Iterable[str]) -> None:
    """Call the numbers of elements by the names of the module's constants."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Name) and node.id in counts:
            node.id = constant(node.id)


def indent_docstring(tree: ast.FunctionDef) -> None:
    """Indent the docstring, which the unparser leaves as it is, and write its units for the axis."""
    text = in_units_of_axis(ast.get_docstring(tree) or "")
    if text:
        assert isinstance(tree.body[0], ast.Expr)
        lines = ["    " + line if line else "" for line in text.splitlines()]
        tree.body[0].value = ast.Constant("\n".join(lines).strip() + ("\n    " if "\n" in text else ""))


def number(value: Any) -> str:
    """A number, or a list of them, as Python writes it."""
    return "math.inf" if value == math.inf else repr(value)


def assigned(fields: Iterable[Field], values: Mapping[str, Any]) -> Iterable[str]:
    """Arguments with their values and what they mean."""
    for f in fields:
        yield f"{f.name}={number(values[f.name])},  # {f.par.meaning}, {axis_unit(f.par.unit)}"


def cleared(fields: Iterable[Field]) -> Iterable[str]:
    """The same, at the start."""
    for f in fields:
        zero = f"[0.0] * {constant(f'{f.par.per}s_')}" if f.per_element else "0.0"
        yield f"{f.name}={zero},  # {f.par.meaning}, {axis_unit(f.par.unit)}"


def check(job: Job, export: Export) -> Check:
    """Run the file by itself, away from this package, on its golden vectors."""
    return alone(export, job.name, "golden.csv")


def alone(export: Export, name: str, vectors: str) -> Check:
    """Run the file of that name by itself, away from this package, on the golden vectors of that file."""
    with TemporaryDirectory() as folder:
        for file, content in export.files.items():
            Path(folder, file).write_text(str(content), encoding="utf-8")
        command = [sys.executable, "-I", f"{name}.py", vectors]
        done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    if done.returncode not in (0, 1) or not done.stdout:
        return Check(False, f"the file does not run: {done.stderr.strip().splitlines()[-1:]}")
    error = float(done.stdout)
    return Check(
        error == 0.0, f"at most {error:.3g} {axis_unit('N·m')} off the definition", {"python": error}
    )


TARGET = Target(
    "python",
    "Python, one file without dependencies",
    write,
    check,
    around="position, load and temperature are arguments of `step`, time runs by itself",
    tried="Python: every bit",
    reserved=frozenset(keyword.kwlist) | sys.stdlib_module_names,
)
