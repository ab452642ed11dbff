"""Functional mock-up units: variables, model descriptions, sources with a binary, and the archive.

FMI 2.0 and 3.0 (Modelica Association, co-simulation). The C of the law is that of `stickslip.exports.c99`; templates
add the functions of the interface. Types and functions are declared in our sources as the standard states them, so
that they compile without its headers.
"""

from __future__ import annotations

import functools
import io
import platform
import shutil
import subprocess
import sys
import uuid
import zipfile
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from stickslip.core.messages import in_linear_units
from stickslip.core.spec import Field, Surroundings
from stickslip.exports import c99
from stickslip.exports._analysis import fields_read
from stickslip.exports._c import safe
from stickslip.exports._text import Code, render
from stickslip.exports.job import Job

VERSIONS = {"2.0": "fmi2", "3.0": "fmi3"}
FLAGS = ("-std=c99", "-O2", "-ffp-contract=off", "-fno-builtin", "-fPIC", "-shared", "-fvisibility=hidden")
PLATFORMS = {"2.0": "linux64", "3.0": "x86_64-linux"}
BASE_UNITS = {
    "s": 's="1"', "rad": 'rad="1"', "rad/s": 'rad="1" s="-1"', "rad/s2": 'rad="1" s="-2"', "kg.m2": 'kg="1" m="2"',
    "N.m": 'kg="1" m="2" s="-2"', "degC": 'K="1" offset="273.15"', "1/K": 'K="-1"', "1/rad": 'rad="-1"',
    "N.m/rad": 'kg="1" m="2" s="-2" rad="-1"', "N.m.s/rad": 'kg="1" m="2" s="-1" rad="-1"',
    "m": 'm="1"', "m/s": 'm="1" s="-1"', "m/s2": 'm="1" s="-2"', "kg": 'kg="1"', "N": 'kg="1" m="1" s="-2"',
    "1/m": 'm="-1"', "N/m": 'kg="1" s="-2"', "N.s/m": 'kg="1" s="-1"',
}  # fmt: skip
"""Of the units of most laws; a unit without them is a name to the importer, and legal."""
SURROUNDINGS = {"position": "rad", "load": "", "temperature": "degC", "applied": "N.m"}
"""Inputs that a law may read, and their units; time is the importer's."""


@dataclass(frozen=True)
class Variable:
    """One real number of the unit.

    Attributes
    ----------
    name : str
    place : str
        Where it lies in the C structure of all values.
    causality : str
        "input", "output", "parameter" or "local".
    unit, meaning : str
    start : float or None
        None where it is calculated.
    lower, upper : float or None
    positive : bool
        Zero is excluded.
    reference : int
        Value reference.
    """

    name: str
    place: str
    causality: str
    unit: str
    meaning: str
    start: float | None = None
    lower: float | None = None
    upper: float | None = None
    positive: bool = False
    reference: int = 0

    @property
    def index(self) -> int:
        """Place among the variables, from 1."""
        return self.reference

    @property
    def variability(self) -> str:
        """Parameters are fixed when the first step begins."""
        return "fixed" if self.causality == "parameter" else "continuous"

    @property
    def initial(self) -> str:
        """Where the initial value comes from; inputs have no such attribute."""
        return {"parameter": "exact", "output": "calculated", "local": "calculated"}.get(self.causality, "")

    @property
    def limits(self) -> str:
        """Attributes ``min`` and ``max``; the standard's bounds include their ends."""
        low = 0.0 if self.positive else self.lower
        bounds = {"min": low, "max": self.upper}
        return Code("".join(f' {name}="{value!r}"' for name, value in bounds.items() if value is not None))

    @property
    def bounds(self) -> str:
        """The condition on a value x in C; empty without bounds."""
        parts = ["(x > 0.0)"] if self.positive else []
        parts += [f"(x >= {self.lower!r})"] if self.lower is not None and not self.positive else []
        parts += [f"(x <= {self.upper!r})"] if self.upper is not None else []
        return " && ".join(parts)


def unit_named(unit: str) -> str:
    """A unit in the letters of Modelica and most importers: ``N.m.s/rad``."""
    plain = "" if unit == "-" else unit
    for letter, other in (("·", "."), ("²", "2"), ("³", "3"), ("°C", "degC"), ("(", ""), (")", "")):
        plain = plain.replace(letter, other)
    return plain


def law_variables(job: Job) -> Iterable[Variable]:
    """Parameters and state of the law."""
    law, p = job.model.law, job.model.parameters
    elements = law.elements_in(p)
    sizes = {f.name: elements for f in law.state_fields if f.per_element}
    return field_variables(law.fields, p._asdict(), law.state_fields, sizes)


def field_variables(
    fields: Iterable[Field],
    values: Mapping[str, Any],
    states: Iterable[Field],
    sizes: Mapping[str, int],
    whose: str = ", of the contact",
) -> Iterable[Variable]:
    """Parameters with their values, and states, ``whose`` is said; those that are lists with their ``sizes``."""
    for f in fields:
        value: Any = values[f.name]
        for i, v in enumerate(value if f.per_element else (value,)):
            yield _of_field(f, "p", i, "parameter", float(v))
    for f in states:
        for i in range(sizes[f.name] if f.per_element else 1):
            yield _of_field(f, "z", i, "local", None, whose)


def _of_field(f: Field, owner: str, i: int, causality: str, start: float | None, whose: str = "") -> Variable:
    """The variable of a field, or of one of its elements (counted from 1, as the structured names are)."""
    name, place = f.name, f"{owner}.{safe(f.name)}"
    if f.per_element:
        name, place = f"{name}[{i + 1}]", f"{place}[{i}]"
    finite = {k: v for k, v in (("lower", f.par.lower), ("upper", f.par.upper)) if abs(v) < float("inf")}
    bounds: Mapping[str, Any] = {**finite, "positive": f.par.positive} if causality == "parameter" else {}
    return Variable(name, place, causality, unit_named(f.par.unit), f.par.meaning + whose, start, **bounds)


def surroundings_read(job: Job) -> Iterable[Variable]:
    """Inputs for what the law reads besides its velocity."""
    read = fields_read(c99.translated(job).values())
    defaults = Surroundings()._asdict()
    for name, unit in SURROUNDINGS.items():
        if name in read:
            yield Variable(name, f"u.{name}", "input", unit, c99.SURROUNDINGS[name][0], defaults[name])


def numbered(variables: Iterable[Variable], linear: bool = False) -> list[Variable]:
    """The variables with value references from 1, names that are each other's different, and the units of the axis."""
    out: list[Variable] = []
    taken = {"time"}
    for v in variables:
        name = v.name if v.name not in taken else f"contact.{v.name}"
        taken.add(name)
        unit = in_linear_units(v.unit) if linear else v.unit
        out.append(replace(v, name=name, unit=unit, reference=len(out) + 1))
    return out


@dataclass(frozen=True)
class Contents:
    """What a unit holds besides its interface.

    Attributes
    ----------
    name : str
    title : str
    sources : mapping of str to str
        ``NAME.c`` and ``NAME.h``.
    wholes : sequence of sequence of str
        For every parameter whose elements share a whole, where they lie in the C structure of all values.
    shared : str
        The names of these parameters.
    holding : bool
        Whether the sources have a function that says whether the contact holds.
    linear : bool
        Whether the axis moves along a line.
    """

    name: str
    title: str
    sources: Mapping[str, str]
    wholes: Sequence[Sequence[str]] = ()
    shared: str = ""
    holding: bool = False
    linear: bool = False


def contents_of(job: Job) -> Contents:
    """A law and its C."""
    x, law = job.name, job.model.law
    return Contents(
        x, law.title,
        {name: str(text) for name, text in c99.write(job).files.items() if name in (f"{x}.c", f"{x}.h")},
        wholes_of(law.fields, job.model.parameters._asdict()),
        ", ".join(f.name for f in law.fields if f.par.shares),
        "_holding" in c99.translated(job),
        job.linear,
    )  # fmt: skip


def units_of(
    contents: Contents, core: str, variables: Sequence[Variable], about: str, **more: Any
) -> tuple[dict[str, bytes], tuple[str, ...]]:
    """The unit of each version by its file's name (2.0 has the plain one, most importers read it), and what to say.

    The arguments are those of `archive`.
    """
    files: dict[str, bytes] = {}
    compiled = True
    for fmi, kind in VERSIONS.items():
        name = f"{contents.name}.fmu" if fmi == "2.0" else f"{contents.name}_{kind}.fmu"
        files[name], binary = archive(contents, fmi, core, variables, about, **more)
        compiled = compiled and binary
    missing = (
        "no compiler for Linux on x86-64 here, so the units hold sources only; `fmpy compile` builds them"
    )
    return files, () if compiled else (missing,)


def archive(
    contents: Contents, fmi: str, core: str, variables: Sequence[Variable], about: str, **more: Any
) -> tuple[bytes, bool]:
    """One unit as the bytes of its file, and whether it holds a binary.

    Parameters
    ----------
    contents : Contents
    fmi : {"2.0", "3.0"}
    core : str
        Template of the values and of a step.
    variables : sequence of Variable
    about : str
        Description.
    **more
        For the template.
    """
    kind, x, c_files = VERSIONS[fmi], contents.name, dict(contents.sources)
    sources = [f"{x}.c", f"{x}_{kind}.c"]
    units = [
        {"name": u, "base": Code(BASE_UNITS.get(u, ""))}
        for u in sorted({"s", *(v.unit for v in variables)} - {""})
    ]
    values: dict[str, Any] = {
        "x": x, "fmi": fmi, "core": core, "variables": variables, "about": about, "sources": sources, "units": units,
        "title": contents.title, "surroundings": ", ".join(repr(u) for u in Surroundings()),
        "wholes": contents.wholes, "shared": contents.shared, "holding": contents.holding, **more,
    }  # fmt: skip
    described = render(f"fmu_{kind}.xml.j2", token="", **values)
    token = str(uuid.uuid5(uuid.NAMESPACE_URL, described + "".join(map(str, c_files.values()))))
    c_files[f"{x}_{kind}.c"] = render(f"fmu_{kind}.c.j2", token=token, **values)
    files: dict[str, str | bytes] = {
        "modelDescription.xml": render(f"fmu_{kind}.xml.j2", token=token, **values),
        **{f"sources/{name}": text for name, text in c_files.items()},
    }
    if fmi == "3.0":
        files["sources/buildDescription.xml"] = render("fmu_build.xml.j2", **values)
    binary = _compiled(x, c_files, sources)
    if binary:
        files[f"binaries/{PLATFORMS[fmi]}/{x}.so"] = binary
    return _zipped(files), bool(binary)


def wholes_of(fields: Iterable[Field], values: Mapping[str, Any]) -> list[list[str]]:
    """For every parameter whose elements share a whole, where they lie in the C structure of all values."""
    return [
        [f"p.{safe(f.name)}[{i}]" for i in range(len(values[f.name]))]
        for f in fields
        if f.par.shares and f.per_element
    ]


def _compiled(name: str, files: Mapping[str, str], sources: Sequence[str]) -> bytes | None:
    """The shared library for Linux on x86-64; None elsewhere, or without a compiler."""
    compiler = shutil.which("gcc") or shutil.which("cc")
    if compiler is None or sys.platform != "linux" or platform.machine() != "x86_64":
        return None
    own, *interface = sources
    with TemporaryDirectory() as folder:
        for each, text in files.items():
            Path(folder, each).write_text(text)
        # What does not depend on the version of the interface.
        shared = {each: text for each, text in files.items() if each not in interface}
        Path(folder, "own.o").write_bytes(_object(compiler, own, tuple(shared.items())))
        command = [compiler, *FLAGS, "own.o", *interface, "-lm", "-o", f"{name}.so"]
        subprocess.run(command, cwd=folder, check=True, capture_output=True)
        return Path(folder, f"{name}.so").read_bytes()


@functools.lru_cache(maxsize=4)
def _object(compiler: str, source: str, files: Iterable[tuple[str, str]]) -> bytes:
    """A source compiled, with the files that lie beside it: once for the units of both versions."""
    with TemporaryDirectory() as folder:
        for each, text in files:
            Path(folder, each).write_text(text)
        command = [compiler, *FLAGS, "-c", source, "-o", "own.o"]
        subprocess.run(command, cwd=folder, check=True, capture_output=True)
        return Path(folder, "own.o").read_bytes()


def _zipped(files: Mapping[str, str | bytes]) -> bytes:
    """A zip file, the same bytes from the same files."""
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as target:
        for name, content in files.items():
            entry = zipfile.ZipInfo(name, (1980, 1, 1, 0, 0, 0))
            entry.compress_type = zipfile.ZIP_DEFLATED
            entry.external_attr = 0o644 << 16
            target.writestr(entry, content)
    return out.getvalue()
