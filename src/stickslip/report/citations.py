"""Find the references of names, files and records in references.bib."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any

import stickslip
from stickslip.core.config import refuse_endless
from stickslip.core.errors import InputError
from stickslip.core.record import Record
from stickslip.core.spec import Law
from stickslip.models import plugins
from stickslip.studies.plan import Study, load, load_run
from stickslip.studies.planned_run import PlannedRun

INTEGRATORS = {"adaptive": ("dormand1980", "sommeijer1998"), "auto": ("dormand1980", "sommeijer1998")}
"""References of the integrators' methods."""
THESIS = "thesis"
ENTRY = re.compile(r"^@\w+\{([^,\s]+),.*?^\}", re.MULTILINE | re.DOTALL)


def bibliography() -> dict[str, str]:
    """Return the entries of references.bib by key."""
    text = Path(stickslip.__file__).with_name("references.bib").read_text(encoding="utf-8")
    return {match[1]: match[0] for match in ENTRY.finditer(text)}


def citing(keys: Iterable[str]) -> str:
    """Return BibTeX of the package and of the entries.

    Parameters
    ----------
    keys : iterable of str
        In any order; duplicates are allowed.

    Raises
    ------
    InputError
        If there is no such entry; your own law may cite works that are not in the package's bibliography.
    """
    known = bibliography()
    missing = sorted(set(keys) - set(known))
    if missing:
        raise InputError(
            f"{', '.join(missing)} not in the package's references.bib; see the source of the law"
        )
    return "\n\n".join([itself(), *(known[key] for key in sorted(set(keys)))])


def itself() -> str:
    """Return the package's own entry."""
    return (
        f"@software{{stickslip,\n  title   = {{stickslip: friction of servo axes}},\n"
        f"  version = {{{stickslip.__version__}}},\n  note    = {{Python package, BSD-3-Clause}}\n}}"
    )


def cited_by(things: Sequence[str]) -> set[str]:
    """Return the keys of the references used by laws, TOML files, records, manifests or folders of studies.

    Parameters
    ----------
    things : sequence of str
        Names of laws, paths of law files, "thesis", paths of TOML files, of records (.npz), of manifest.json or of its
        folder.

    Raises
    ------
    InputError
        If a thing is none of these.
    """
    return {key for thing in things for key in _keys(thing)}


def _keys(thing: str) -> Iterator[str]:
    path = Path(thing)
    if thing in plugins.law_names() or thing.endswith(".py"):
        yield from _of_law(plugins.law(thing))
    elif thing == THESIS:
        yield THESIS
        yield from _of_study(load(thing))
    elif path.suffix == ".toml":
        yield from _of_toml(path)
    elif path.suffix == ".npz":
        yield from _of_record(Record.load(path))
    elif path.is_dir() or path.name == "manifest.json":
        yield from _of_study(_study_in(path if path.is_dir() else path.parent))
    else:
        raise InputError(
            f"{thing!r} is not a law, TOML file, record (.npz), manifest.json or folder of a study; `stickslip laws` "
            "lists the laws"
        )


def _of_law(law: Law) -> Iterator[str]:
    for source in law.source:
        yield THESIS if source.startswith("thesis") else source


def _of_toml(path: Path) -> Iterator[str]:
    refuse_endless(path)
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise InputError(f"cannot read {path} ({reason}); check the path") from None
    # A study names several controllers, a single run has one.
    if re.search(r"^\[controllers\b", text, re.MULTILINE):
        yield from _of_study(load(path))
    else:
        yield from _of_runs([load_run(path)])


def _of_study(study: Study) -> Iterator[str]:
    yield from _of_runs([*study.runs, *study.extras])
    for response in study.responses:
        yield from INTEGRATORS["adaptive"]
        for model in response.models.values():
            yield from _of_law(model.law)


def _of_runs(runs: Sequence[PlannedRun]) -> Iterator[str]:
    for run in runs:
        yield from _of_law(run.axis.friction.law)
        for model in run.control.frictions.values():
            yield from _of_law(model.law)
        yield from INTEGRATORS.get(run.numerics.integrator, ())


def _of_record(record: Record) -> Iterator[str]:
    for part in ("friction", "compensator", "model"):
        name = record.meta.get(part, {}).get("law")
        if name in plugins.law_names():
            yield from _of_law(plugins.law(name))
    yield from INTEGRATORS.get(record.meta.get("integrator", ""), ())


def _study_in(folder: Path) -> Study:
    try:
        manifest: dict[str, Any] = json.loads((folder / "manifest.json").read_text(encoding="utf-8"))
        inputs = manifest["inputs"]
        copies = {entry["written"]: folder / entry["copy"] for entry in inputs}
        return load(folder / inputs[0]["copy"], copies)
    except (OSError, ValueError, KeyError, IndexError):
        raise InputError(
            f"no manifest of a study in {folder}; give a folder that `stickslip study` wrote"
        ) from None
