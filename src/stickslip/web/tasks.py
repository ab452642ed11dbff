"""Tasks of a worker: the commands of the package on files of a project. `TASKS` lists them.

Every task gets the request and a function that reports progress to the page. It writes its results into the item's
folder and returns the data that the page shows immediately.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any, cast

from stickslip.core.errors import InputError
from stickslip.core.whole_files import draft_of
from stickslip.web.projects import Item, written_whole
from stickslip.web.rig_tasks import RIG_TASKS
from stickslip.web.sent_tasks import SENT_TASKS
from stickslip.web.worker import Said, plain

Request = Mapping[str, Any]
LONG = 300_000
"""Rows above which a log is shown before the doctor has finished, which takes ten seconds or more for a million rows"""


def read(request: Request, say: Said) -> dict[str, Any]:
    """Read an upload, examine it, and lay out its view."""
    from stickslip.verbs.doctor import doctor
    from stickslip.verbs.reading import Reading, columns_of, open_log
    from stickslip.web.views import lay_out

    item = Item(Path(request["folder"]))
    path = item.folder / str(request["file"])
    name = str(request["name"])
    reading = cast("Reading", dict(request["reading"]))
    say({"tell": "reading"})
    try:
        opened = open_log(path, reading)
    except InputError as error:
        problem = called(error, path, name)
        return {"readable": False, "problem": problem, **unread(columns_of, path)}
    record = opened.record
    record.meta["reading"]["file"] = name
    reading_said = record.meta["reading"]
    about = {
        "problem": "", "format": reading_said["format"], "sha256": reading_said["sha256"],
        "columns": [list(c) for c in opened.columns], "chosen": reading_said["columns"],
        "derived": dict(record.meta["derived"]), "view": lay_out(record, item.folder / "view"),
    }  # fmt: skip
    record.save(item.folder / "record.npz")
    if len(record) >= LONG:
        written_whole(item.folder / "result.json", plain({"planes": planes(record)}))
        say({"shown": {**about, "readable": False, "findings": [], "errors": 0}})
    say({"tell": f"{len(record)} rows read; the doctor looks at them"})
    found = doctor(record)
    written_whole(item.folder / "result.json", plain({"planes": planes(found.record)}))
    return {
        **about, "readable": True,
        "findings": [f.as_data() for f in found.findings],
        "errors": len(found.errors),
    }  # fmt: skip


def unread(columns_of: Callable[[Path], tuple[tuple[str, str], ...]], path: Path) -> dict[str, Any]:
    """Return the columns of a file that could not be read as a record, for the mapping form."""
    try:
        return {"columns": [list(c) for c in columns_of(path)]}
    except InputError:
        return {"columns": []}


def called(error: object, path: Path, name: str) -> str:
    """Return a message with the original name of a file."""
    return " ".join(str(error).replace(str(path), name).replace(path.name, name).split())


def planes(record: Any) -> list[dict[str, Any]]:
    """Return torque against velocity and against position."""
    from stickslip.readers.derive import with_velocity
    from stickslip.web.views import plane

    torque = next((c for c in ("motor_torque", "friction_torque", "current") if c in record.channels), None)
    if torque is None:
        return []
    if "velocity" not in record.channels and "position" in record.channels:
        with suppress(InputError):  # unevenly sampled
            record = with_velocity(record)
    out: list[dict[str, Any]] = []
    for name in ("velocity", "position"):
        if name in record.channels:
            cells = plane(record[name], record[torque])
            units = {"x_unit": record.units[name], "y_unit": record.units[torque]}
            out.append({"x_name": name, "y_name": torque, **units, **cells})
    return out


def identify(request: Request, say: Said) -> dict[str, Any]:
    """Identify from the records of some logs; write model.toml, report.html and result.json."""
    from stickslip.core.record import Record
    from stickslip.verbs.identify import identify as run

    item = Item(Path(request["folder"]))
    options = dict(request["options"])
    logs: list[Record] = []
    for log in request["logs"]:
        record = Record.load(Path(log["folder"]) / "record.npz")
        logs.append(record)
    names = {f"log {n}": str(log["name"]) for n, log in enumerate(request["logs"], 1)}
    found = run(*logs, progress=lambda line: say({"tell": line}), tell=lambda line: say({"tell": line}),
                **options)  # fmt: skip
    sources = tuple(replace(s, name=named(s.name, names)) for s in found.sources)
    found = replace(found, sources=sources)
    say({"tell": "writing the report"})
    if found.identification.model is not None:
        found.save(item.folder / "model.toml")
    found.report(item.folder / "report.html", "model.toml")
    answers = found.answers_with("model.toml")
    told = found.as_dict()
    result = {
        **told, "text": found.summary(),
        "answers": {
            "friction": answers.friction, "trust": answers.trust, "evidence": answers.evidence,
            "steps": [{"what": s.what, "command": s.command} for s in answers.steps],
            "told": answers.told,
        },
        "findings": [f.as_data() for f in found.findings],
        "pictures": [picture_data(p) for p in found.pictures],
        "axis": "inertia" in {e.name for e in (*found.identification.estimates, *found.identification.held)},
    }  # fmt: skip
    written_whole(item.folder / "result.json", plain(result))
    model = found.identification.model
    return {"law": model.law.name if model else "", "verdict": found.verdict, "has_model": model is not None}


def named(name: str, names: Mapping[str, str]) -> str:
    """Return the name of a source, with the name of its log in place of its number."""
    number = next((n for n in sorted(names, key=len, reverse=True) if name.startswith(n)), "")
    return names[number] + name.removeprefix(number) if number else name


def picture_data(picture: Any) -> dict[str, Any]:
    """Return a picture as plain numbers."""
    traces = [{"label": t.label, "kind": t.kind, "x": t.x, "y": t.y, "y2": t.y2} for t in picture.traces]
    said = {k: getattr(picture, k) for k in ("name", "title", "message", "x_label", "y_label", "x_scale")}
    return {**said, "traces": traces}


def recommend(request: Request, say: Said) -> dict[str, Any]:
    """Recommend a setting for a model; write recommended.toml and result.json."""
    from stickslip.verbs.recommend import recommend as run

    item = Item(Path(request["folder"]))

    def progress(done: int, of: int) -> None:
        say({"tell": f"{done} of {of} axes simulated", "part": done / max(of, 1)})

    found = run(Path(request["model"]), progress=progress, **request["options"])
    if found.chosen is not None:
        found.save(item.folder / "recommended.toml")
    unit = found.identified.unit
    units = {"velocity": unit("rad/s"), "torque": unit("N·m"), "inertia": unit("kg·m²")}
    if found.chosen is not None:
        units |= {f.name: unit(f.par.unit) for f in found.model.law.fields}
    written_whole(item.folder / "result.json", plain({**found.as_dict(), "text": str(found), "units": units}))
    words = found.chosen.setting.words if found.chosen else ""
    return {"chosen": found.chosen is not None, "words": words}


def compare(request: Request, say: Said) -> dict[str, Any]:
    """Compare two models."""
    from stickslip.verbs.compare import compare as run

    found = run(Path(request["first"]), Path(request["second"]))
    names = request["names"]
    text = {str(Path(request[k])): name for k, name in zip(("first", "second"), names, strict=True)}

    def said(line: str) -> str:
        for path, name in text.items():
            line = line.replace(path, name)
        return line

    picture = picture_data(found.picture)
    for trace in picture["traces"]:
        trace["label"] = said(trace["label"])
    data = found.as_dict()
    return {
        **data,
        "summary": said(data["summary"]),
        "notes": [said(n) for n in data["notes"]],
        "picture": picture,
    }


def export(request: Request, say: Said) -> dict[str, Any]:
    """Write a model or a setting for another machine, as one archive."""
    import zipfile

    from stickslip.verbs.export import export as run

    made = run(Path(request["source"]), str(request["to"]), **request["options"])
    folder = f"{made.name}-{made.target.name}"
    files = dict(made.files)
    if not any(name.lower().startswith("readme") for name in files):
        files["README.txt"] = readme(made)
    with (
        draft_of(Path(request["out"])) as draft,
        zipfile.ZipFile(draft, "w", zipfile.ZIP_DEFLATED) as archive,
    ):
        for name, content in files.items():
            archive.writestr(f"{folder}/{name}", content)
    return {"file": f"{folder}.zip", "files": list(files), "notes": list(made.notes)}


def readme(made: Any) -> str:
    """Return the README of an export without its own."""
    lines = [made.target.title, "", *(f"- {name}" for name in made.files), ""]
    return "\n".join([*lines, *(f"{note}." for note in made.notes), "Written by stickslip.", ""])


TASKS: dict[str, Callable[[Request, Said], dict[str, Any]]] = {
    "read": read, "identify": identify, "recommend": recommend, "compare": compare, "export": export,
    **RIG_TASKS, **SENT_TASKS,
}  # fmt: skip
