"""Tasks of a worker on uploaded models, studies and rigs; their code runs only if this user has approved it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from stickslip.core.errors import CodeRefused, InputError
from stickslip.web import rig_tasks
from stickslip.web.projects import Item, written_whole
from stickslip.web.worker import Said, plain

Request = Mapping[str, Any]
METRICS = ("position_rms_rad", "position_peak_rad", "velocity_rms_rad_s", "torque_rms_Nm", "standstills")
"""Most runs of a study in the page's table; all are in its metrics.csv."""


def look(request: Request, say: Said) -> dict[str, Any]:
    """Load a model, study or rig, or return the code that needs approval."""
    item = Item(Path(request["folder"]))
    path = item.folder / str(request["file"])
    say({"tell": "reading"})
    try:
        if path.name == rig_tasks.MAIN:
            return rig_tasks.described(path)
        return model_of(item, path) if path.name == "model.toml" else study_of(path)
    except CodeRefused as refused:
        name = Path(refused.path).name
        try:
            text = refused.code.decode("utf-8")
        except UnicodeDecodeError:
            raise InputError(
                f"{name} is not UTF-8 text, so its code cannot be shown as it would run; save it as UTF-8"
            ) from None
        return {"state": "asks", "asks": {"name": name, "text": text}}


def model_of(item: Item, path: Path) -> dict[str, Any]:
    """Return the description of a model in a file for the page."""
    from stickslip.identification.identified_file import read_identified

    found = read_identified(path)
    if (
        item.folder / "result.json"
    ).is_file():  # it was identified in the project of which this one is a copy
        return {"state": "done"}
    law = found.model.law
    units = {f.name: found.unit(f.par.unit) for f in law.fields}
    meanings = {f.name: f.par.meaning for f in law.fields}
    result = {
        "model": found.model.as_dict(), "title": law.title or law.name, "units": units, "meanings": meanings,
        "estimates": [
            {"name": e.name, "unit": e.unit, "value": e.value, "lower": e.lower, "upper": e.upper,
             "identified": e.identified}
            for e in found.estimates
        ],
        "axis": found.axis.get("inertia") is not None, "registered": not found.law_file,
        "trajectory": found.trajectory is not None,
        "inertia": {"value": found.axis.get("inertia"), "unit": found.unit("kg·m²")},
    }  # fmt: skip
    written_whole(item.folder / "result.json", plain(result))
    return {"state": "done", "law": law.name, "verdict": "a file that was sent", "has_model": True}


def study_of(path: Path) -> dict[str, Any]:
    """Return a description of what a study or simulation runs."""
    from stickslip.studies.study import load, load_run
    from stickslip.verbs.kinds import kind_of

    if kind_of(path) == "simulation":
        planned = load_run(path)
        return {"state": "ready", "runs": 1, "runs_for": planned.duration}
    found = load(path)
    every = [*found.runs, *found.extras]
    return {"state": "ready", "runs": len(every), "runs_for": sum(p.duration for p in every)}


def run_sent(request: Request, say: Said) -> dict[str, Any]:
    """Run a study or a simulation; write result.json, and for a study its folder with a report."""
    from stickslip.verbs.kinds import kind_of

    item = Item(Path(request["folder"]))
    path = item.folder / str(request["file"])
    result = simulation(path) if kind_of(path) == "simulation" else study(path, item, say)
    written_whole(item.folder / "result.json", plain(result))
    return {"state": "done"}


def simulation(path: Path) -> dict[str, Any]:
    """Return channels and metrics of one closed loop."""
    from stickslip.web.bench_worker import simulated

    return {"simulation": simulated(path)}


def study(path: Path, item: Item, say: Said) -> dict[str, Any]:
    """Return the table of a study; its report is in the same folder."""
    from stickslip.report import write
    from stickslip.studies import study as studies

    def progress(done: int, of: int) -> None:
        say({"tell": f"{done} of {of} runs", "part": done / max(of, 1)})

    # Finished runs are kept in the folder: a cancelled study resumes from there.
    found = studies.run(studies.load(path), item.folder / "out", progress=progress)
    say({"tell": "drawing figures"})
    report = write(found)
    report.replace(item.folder / "report.html")
    runs = [
        {"key": r.key, "failure": r.failure, "metrics": [r.metrics.get(name) for name in METRICS]}
        for r in found
    ]
    return {"study": {"metrics": list(METRICS), "runs": runs}}


SENT_TASKS: dict[str, Callable[[Request, Said], dict[str, Any]]] = {"look": look, "run_sent": run_sent}
