"""Modelica: a package with the functions of a law and models of a contact.

``Contact`` carries any law, by the law's own step at every sample. A law whose torque jumps at rest also comes as
``Axis``, an inertia that it holds and releases with an event at every start and stop, so that no solver has to step
over the jump.
"""

from __future__ import annotations

import importlib
import importlib.util
import math
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from stickslip.core.messages import axis_unit
from stickslip.core.spec import Field, Surroundings
from stickslip.exports._analysis import merged
from stickslip.exports._guard import guarded
from stickslip.exports._modelica import KEYWORDS, functions, safe
from stickslip.exports._step_error import about_steps
from stickslip.exports._text import Code, in_lines, render, sources, text_in
from stickslip.exports.golden import PACE, as_csv, golden_around
from stickslip.exports.job import Check, Export, Job, counts_in
from stickslip.exports.target import Target
from stickslip.subset import law_layouts, named

Array = np.ndarray[Any, np.dtype[np.float64]]
NOTE = (
    "grammar, functions and the number of equations are checked in our tests (pymoca), Axis is run in rumoca, and "
    "Contact where the law has no state; not tried in Dymola or OpenModelica"
)


SUBSTEPS = "A shorter `samplePeriod` makes shorter steps."


def write(job: Job) -> Export:
    """The package, golden vectors, and how to use it."""
    law, p = job.model.law, job.model.parameters
    events = law.holding is not None and law.steady is not None and not law.state_fields
    # The public ones first: they have the right to their names.
    entries: dict[str, Any] = {"steady": law.steady} if law.steady else {}
    entries |= {"holding": law.holding} if events else {}
    trees = guarded(merged(named({**entries, "step": law.step}, law_layouts(law))), "step")
    parts = functions(trees, counts_in(job.model))
    heads = {name: lines for name, _, lines in parts}
    values: dict[str, Any] = {
        "x": job.name,
        "title": law.title,
        "equation": in_lines(law.equation),
        "source": sources(law),
        "parameters": [*declared(law.fields, p, law.elements_in(p))],
        "states": [*declared(law.state_fields, None, law.elements_in(p))] or none_taken(heads),
        "around": [f"Real {safe(n)}(start = {v!r}, fixed = true);" for n, v in Surroundings()._asdict().items()],
        "rest": ", ".join(f"{safe(n)} = {v!r}" for n, v in Surroundings()._asdict().items()),
        "functions": [[*map(Code, lines)] for _, _, lines in parts],
        "step": called("step", heads["step"], "last, velocity, elapsed, z, p, u"),
        "remembers": takes_state(heads["step"]),
        "holds_state": takes_state(heads.get("holding", ())),
        "outputs": "(torque, z)" if any("output State" in line for line in heads["step"]) else "torque",
        "events": events,
        "hold": [called("holding", heads["holding"], f"{side}, z, p, u") for side in ("1.0", "-1.0")] if events else [],
        "note": NOTE,
    }  # fmt: skip
    files = {
        f"{job.name}.mo": render("modelica.mo.j2", **values),
        "golden.csv": as_csv(golden_around(job.model, PACE)),
        "README.md": render("modelica_readme.md.j2", **about_steps(job.model, SUBSTEPS), **values),
    }
    return Export(files, (NOTE,))


def takes_state(head: Sequence[str]) -> bool:
    """Whether a function has the state among its arguments."""
    return any(line.split()[:2] == ["input", "State"] for line in head)


def none_taken(heads: Mapping[str, Sequence[str]]) -> list[str]:
    """The record of a law that remembers nothing, where its functions take one: never assigned, therefore bound."""
    taken = any(" State " in line for lines in heads.values() for line in lines)
    return [Code('Real none = 0.0 "this law has none";')] if taken else []


def called(name: str, head: Sequence[str], given: str) -> str:
    """A call of a function with those of the arguments that it takes."""
    order = {"step": ("v0", "v1", "dt", "z", "p", "u"), "holding": ("direction", "z", "p", "u")}[name]
    taken = {line.split()[2].rstrip(";").removesuffix("_in") for line in head if line.startswith("  input")}
    names = dict(zip(order, given.split(", ")))
    return f"{name}({', '.join(value for key, value in names.items() if safe(key) in taken or key in taken)})"


def declared(fields: Sequence[Field], p: Any, elements: int) -> Iterable[str]:
    """Components of a record with their meaning; parameters with their values, what is assigned with where it starts.

    A binding would be an equation, and what a model assigns has that of its algorithm.
    """
    for f in fields:
        size = len(getattr(p, f.name)) if p is not None and f.per_element else elements
        array = f"[{size}]" if f.per_element else ""
        meaning = text_in("mo", f"{f.par.meaning}, {axis_unit(f.par.unit)}")
        if p is None:
            each = "each " if f.per_element else ""
            yield Code(f'Real {safe(f.name)}{array}({each}start = 0.0, {each}fixed = true) "{meaning}";')
            continue
        value = getattr(p, f.name)
        shown = "{" + ", ".join(map(repr, value)) + "}" if f.per_element else repr(value)
        yield Code(f'Real {safe(f.name)}{array} = {shown} "{meaning}";')


# ---- the check -------------------------------------------------------------------------------------------------

DURATION, STEP = 1.0, 1e-4
"""s, of the trial of an axis, and of our own integration."""
BOUND = 1e-3
"""Largest error of the velocity, of the largest velocity: the solver's tolerance and our steps."""
TRIAL = """
model Trial
  {x}.Axis axis(inertia = {inertia!r});
equation
  axis.drive = {drive!r}*sin(20.0*time);
end Trial;
"""


def check(job: Job, export: Export) -> Check:
    """Simulate the axis with events in rumoca, where that is installed, and compare it with our own steps."""
    text = str(export.files[f"{job.name}.mo"])
    if "model Axis" not in text:
        return Check(None, f"this law comes without an axis to simulate; {NOTE}")
    if importlib.util.find_spec("rumoca") is None:
        return Check(None, "rumoca is not installed (pip install rumoca)")
    rumoca: Any = importlib.import_module("rumoca")
    law, p = job.model.law, job.model.parameters
    assert law.holding is not None
    drive = 1.8 * max(law.holding(1.0, law.state(p), p, Surroundings()), 1e-3)
    inertia = drive / 100.0
    with TemporaryDirectory() as folder:
        Path(folder, "trial.mo").write_text(text + TRIAL.format(x=job.name, inertia=inertia, drive=drive))
        try:
            model = rumoca.Session().load(str(Path(folder, "trial.mo")), model="Trial")
            result = model.simulate(t=(0.0, DURATION), dt=0.01)
        except rumoca.RumocaError as error:
            kind = None if "unsupported" in str(error) else False
            return Check(kind, f"rumoca: {' '.join(str(error).split())[:200]}")
    velocity = np.asarray(dict(zip(result.names, result.to_numpy()))["axis.velocity"])
    expected = held_and_released(job, inertia, drive)
    error = float(np.max(np.abs(np.interp(np.asarray(result.time), expected[0], expected[1]) - velocity)))
    share = error / float(np.max(np.abs(expected[1])))
    return Check(
        share <= BOUND, f"rumoca: velocity {share:.2g} of its largest off our own steps", {"rumoca": share}
    )


def held_and_released(job: Job, inertia: float, amplitude: float) -> tuple[Array, Array]:
    """Times, s, and velocities, rad/s, of the trial: midpoint steps; at rest what the contact withstands holds it."""
    law, p = job.model.law, job.model.parameters
    assert law.holding is not None
    assert law.steady is not None
    hold, steady, z, around = law.holding, law.steady, law.state(p), Surroundings()
    time = np.arange(0.0, DURATION + 0.5 * STEP, STEP)
    velocity, v = np.zeros(time.size), 0.0

    def rate(t: float, v: float, side: float) -> float:
        return (amplitude * math.sin(20.0 * t) - steady(side * max(side * v, 1e-12), p)) / inertia

    for i, t in enumerate(time[:-1]):
        drive = amplitude * math.sin(20.0 * t)
        side = math.copysign(1.0, v if v != 0.0 else drive)
        if v != 0.0 or side * drive > hold(side, z, p, around):
            middle = v + 0.5 * STEP * rate(t, v, side)
            v = v + STEP * rate(t + 0.5 * STEP, middle, side)
            v = 0.0 if v * side <= 0.0 else v
        velocity[i + 1] = v
    return time, velocity


TARGET = Target(
    "modelica",
    "Modelica package",
    write,
    check,
    around="position, load and temperature are inputs and time the simulation's in Contact; in Axis they stand still, "
    "as its parameter u",
    tried="pymoca, an evaluator; in rumoca Axis, and Contact of laws without state",
    reserved=frozenset({*KEYWORDS, "Modelica"}),
)
