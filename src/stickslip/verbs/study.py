"""Controllers compared over machines, references and friction models: the verb `study`."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from stickslip.core.arguments import arguments_checked
from stickslip.core.errors import InputError
from stickslip.core.messages import name_option
from stickslip.studies import study as studies
from stickslip.studies.bench import is_bench
from stickslip.studies.plan import Study, load, select
from stickslip.studies.result import StudyResult
from stickslip.verbs.plain_given import file_of, insist_on_folder
from stickslip.verbs.study_given import study_tables


@arguments_checked
def study(
    file: str | os.PathLike[str] | Study | Mapping[str, Any],
    folder: str | os.PathLike[str] | None = None,
    *,
    only: Sequence[str] = (),
    jobs: int = 1,
    seeds: int | None = None,
    ablation: bool = True,
    report: bool = True,
    progress: Callable[[int, int], None] | None = None,
) -> StudyResult:
    """Run every controller of a study on every machine, reference and friction model, and judge them by their metrics.

    Finished runs are kept in the folder: the same call goes on where another was interrupted.

    Parameters
    ----------
    file : path, Study or mapping
        A TOML file, "thesis", "imperfections" or "thesis-rig", or what `stickslip.studies.plan.load` gave. Or the
        content of such a file as a mapping, in which objects may stand for its tables::

            {
                "axis": ss.RigidAxis(4e-4, friction),  # or "machines": {"mill": ss.Machine(...)}
                "references": {"move": (ss.Reference("scurve", ...), 1.0)},  # and the duration, s
                "controllers": {"PD": ss.Controller(...), "PID": {"gains": ss.pid(...)}},
            }

        ``friction`` and ``laws`` take `Model`, each of them what `identify` or `recommend` returned where it has one.
        The folder keeps all this as a file in ``inputs/``.
    folder : path, optional
        Where to write records, tables, manifest.json and report.html; study-NAME here unless given. A study given as a
        mapping needs it, and has its name.
    only : sequence of str
        Parts of the names of the runs that are wanted, such as ("low", "FF-lugre"); all unless given.
    jobs : int
        Runs at a time.
    seeds : int, optional
        Of a study of experiments: further angles of the start that every run begins at.
    ablation : bool
        Of a study of experiments: whether runs with one imperfection less are run too.
    report : bool
        Whether figures and report.html are written.
    progress : callable, optional
        ``progress(finished, all)``

    Returns
    -------
    StudyResult
        Of the runs that were asked for: names, metrics, files, and `StudyResult.to_pandas`.

    Raises
    ------
    InputError
        One line that names the key, its value and what is allowed.
    """
    if not all(part.strip() for part in only):
        raise InputError(f"only = {list(only)!r} has an empty part; give names like 'low', 'step'")
    wanted = [part.strip() for part in only]
    insist_on_folder(file, folder, "study")
    with file_of(file, folder, "study", study_tables) as (readable, shown):
        planned = study_of(readable, seeds, ablation, shown)
        out = Path(folder) if folder is not None else Path(f"study-{planned.name}")
        result = studies.run(planned, out, wanted or None, jobs, progress)
    if report:
        from stickslip.report import write

        write(result)
    return chosen(result, planned, wanted)


def study_of(
    file: str | os.PathLike[str] | Study, seeds: int | None = None, ablation: bool = True, shown: str = ""
) -> Study:
    """The study of a file, its experiments with other seeds or without ablation; messages call the file `shown`.

    Raises
    ------
    InputError
        If the file is not a study's, or a number cannot be.
    """
    if seeds is not None and seeds < 0:
        raise InputError(f"{name_option('seeds', seeds)} must be 0 or more")
    given: dict[str, Any] = {} if seeds is None else {"seeds": seeds}
    if not ablation:
        given["ablation"] = False
    if isinstance(file, Study):
        if given:
            raise InputError(
                f"{' and '.join(sorted(given))} cannot be given beside a study that is loaded; give the file's path"
            )
        return file
    if is_bench(os.fspath(file)):
        raise InputError(
            f"{shown or os.fspath(file)} is a bench of compensators, not a study; run `stickslip study "
            f"{'FILE' if shown else os.fspath(file)}` (Python: stickslip.studies.bench.run_bench)"
        )
    return load(os.fspath(file), given=given, shown=shown)


def chosen(result: StudyResult, planned: Study, only: Sequence[str]) -> StudyResult:
    """The runs that were asked for: the folder may hold more of the study."""
    keys = {p.key for p in select([*planned.runs, *planned.extras], only)}
    return replace(
        result,
        runs=[r for r in result.runs if r.key in keys],
        extras=[r for r in result.extras if r.key in keys],
    )
