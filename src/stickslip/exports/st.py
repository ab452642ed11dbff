"""IEC 61131-3 structured text: a function block for a PLC or a drive."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from stickslip.core.messages import axis_unit
from stickslip.core.spec import Field, Surroundings
from stickslip.exports._guard import guarded
from stickslip.exports._hoist import hoisted
from stickslip.exports._st import Names, functions, number
from stickslip.exports._st_names import RESERVED, named_in_st, renamed
from stickslip.exports._step_error import about_steps
from stickslip.exports._text import Code, in_lines, render, sources, summary, text_in
from stickslip.exports.golden import PACE, as_csv, golden_around
from stickslip.exports.job import Export, Job, counts_in
from stickslip.exports.target import Target
from stickslip.subset import law_layouts, named

BLOCK = (
    "velocity",
    "sample_time",
    "position",
    "restart",
    "load",
    "temperature",
    "applied",
    "torque",
    "last_velocity",
    "elapsed",
    "started",
    "substeps",
    "count",
    "i",
    "slope",
    "p",
    "z",
    "u",
)
"""Variables of the function block, which has another name."""
SUBSTEPS = "The block's input `substeps` divides the step of a cycle, the velocity linear in between."
EXACT = ("expm1", "log1p")
"""Functions that the norm lacks, and that come along."""
STRUCTURES = {"z": "state", "p": "parameters", "u": "surroundings"}
NOTE = "taken by the compiler iec2c (matiec), run in our tests; not tried on a vendor's hardware"


def write(job: Job) -> Export:
    """One file with types, functions and the block; golden vectors; how to use it."""
    law, p = job.model.law, job.model.parameters
    x = named_in_st([job.name], RESERVED | set(BLOCK))[job.name]
    counts = counts_in(job.model)
    trees = hoisted(guarded(named({"_step": law.step}, law_layouts(law))))
    fields = [f.name for f in (*law.fields, *law.state_fields)]
    names = Names.of(trees, x, [*fields, *Surroundings._fields])
    word = names.words
    parts = functions(trees, names, STRUCTURES, counts)
    around = [f"{word[n]} : LREAL := {number(v)};" for n, v in Surroundings()._asdict().items()]
    values: dict[str, Any] = {
        "x": x,
        "file": f"{job.name}.st",
        "title": law.title,
        "equation": in_lines(law.equation),
        "source": sources(law),
        "parameters": [*declared(law.fields, p._asdict(), counts, word)],
        "states": [*declared(law.state_fields, {}, counts, word)],
        "around": around,
        "cleared": [*cleared("z", law.state_fields, counts, word)],
        "word": word,
        "step": names.functions["_step"],
        "arguments": [word[a.arg] for a in trees["_step"].args.args],
        "note": NOTE,
    }
    files = {
        f"{job.name}.st": render("st.st.j2", **values, functions=about(parts)),
        "golden.csv": as_csv(golden_around(job.model, PACE)),
        "README.md": render("st_readme.md.j2", **values, **about_steps(job.model, SUBSTEPS)),
    }
    return Export(files, (*renamed(job.name, x), NOTE))


def about(parts: Iterable[tuple[str, str, list[str]]]) -> list[dict[str, Any]]:
    """The functions as the template takes them."""
    return [
        {
            "about": f"{summary(of, doc)}{', to full precision near 0' if of.strip('_') in EXACT else ''}",
            "lines": lines,
        }
        for of, doc, lines in parts
    ]


def declared(
    fields: Sequence[Field], values: Mapping[str, Any], counts: Mapping[str, int], word: Mapping[str, str]
) -> Iterable[str]:
    """Fields of a structure with their meaning, and their values where there are any."""
    for f in fields:
        start, kind = "", "LREAL"
        if f.per_element:
            kind = f"ARRAY[0..{counts[f'{f.par.per}s_'] - 1}] OF LREAL"
        if values:
            value = values[f.name]
            start = f" := [{', '.join(map(number, value))}]" if f.per_element else f" := {number(value)}"
        meaning = text_in("st", f"{f.par.meaning}, {axis_unit(f.par.unit)}")
        yield Code(f"{word[f.name]} : {kind}{start}; (* {meaning} *)")
    if not fields:
        yield "none : LREAL;"


def cleared(
    owner: str, fields: Sequence[Field], counts: Mapping[str, int], word: Mapping[str, str]
) -> Iterable[str]:
    """Statements that put a structure to its start."""
    for f in fields:
        if f.per_element:
            yield from (f"{owner}.{word[f.name]}[{i}] := 0.0;" for i in range(counts[f"{f.par.per}s_"]))
        else:
            yield f"{owner}.{word[f.name]} := 0.0;"


TARGET = Target(
    "st",
    "IEC 61131-3 structured text, a function block",
    write,
    around="position, load, temperature and applied torque are inputs, time runs by itself",
    tried="iec2c (matiec) and gcc, a grammar of IEC 61131-3; no vendor's tool",
)
