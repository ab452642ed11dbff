"""IEC 61131-3 structured text: a function block for a PLC or a drive."""

from __future__ import annotations

import textwrap
from collections.abc import Iterable, Sequence
from typing import Any

from stickslip.export._st import functions, safe
from stickslip.export._text import ascii_only, first_line, render
from stickslip.export.golden import as_csv, golden
from stickslip.export.job import Export, Job, counts_in
from stickslip.export.target import Target
from stickslip.spec import Field, Surroundings
from stickslip.subset import law_layouts, named

__all__ = ["TARGET"]

STRUCTURES = {"z": "state", "p": "parameters", "u": "surroundings"}
NOTE = (
    "the grammar is checked and the statements are evaluated in our tests; not tried on a vendor's hardware"
)


def write(job: Job) -> Export:
    """One file with types, functions and the block; golden vectors; how to use it."""
    law, p, x = job.model.law, job.model.parameters, job.name
    elements = law.elements_in(p)
    parts = functions(named({"_step": law.step}, law_layouts(law)), x, STRUCTURES, counts_in(job.model))
    around = [f"{safe(n)} : LREAL := {v!r};" for n, v in Surroundings()._asdict().items()]
    values: dict[str, Any] = {
        "x": x,
        "title": ascii_only(law.title),
        "equation": textwrap.wrap(ascii_only(law.equation), 110, break_long_words=False),
        "source": ascii_only("; ".join(law.source)),
        "parameters": [*_declared(law.fields, p, elements)],
        "states": [*_declared(law.state_fields, None, elements)] or ["none : LREAL;"],
        "around": around,
        "cleared": [*_cleared(law.state_fields, elements)],
        "note": NOTE,
    }
    code = [
        {
            "about": ascii_only(first_line(doc)) or f"{name.strip('_')}, to full precision near 0",
            "lines": lines,
        }
        for name, doc, lines in parts
    ]
    files = {
        f"{x}.st": render("st.st.j2", **values, functions=code),
        "golden.csv": as_csv(golden(job.model)),
        "README.md": render("st_readme.md.j2", **values),
    }
    return Export(files, (NOTE,))


def _declared(fields: Sequence[Field], p: Any, elements: int) -> Iterable[str]:
    """Fields of a structure with their meaning, and their values where there are any."""
    for f in fields:
        size = len(getattr(p, f.name)) if p is not None and f.per_element else elements
        kind = f"ARRAY[0..{size - 1}] OF LREAL" if f.per_element else "LREAL"
        start = ""
        if p is not None:
            value = getattr(p, f.name)
            start = f" := [{', '.join(map(repr, value))}]" if f.per_element else f" := {value!r}"
        meaning = ascii_only(f"{f.par.meaning}, {f.par.unit}")
        yield f"{safe(f.name)} : {kind}{start.replace('e', 'E')}; (* {meaning} *)"


def _cleared(fields: Sequence[Field], elements: int) -> Iterable[str]:
    """Statements that put the state to rest."""
    for f in fields:
        if f.per_element:
            yield from (f"z.{safe(f.name)}[{i}] := 0.0;" for i in range(elements))
        else:
            yield f"z.{safe(f.name)} := 0.0;"


TARGET = Target(
    "st",
    "IEC 61131-3 structured text, a function block",
    write,
    tried="a grammar of IEC 61131-3, an evaluator; no vendor's tool",
)
