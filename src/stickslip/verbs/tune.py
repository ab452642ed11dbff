"""Settings of a controller for an uncertain machine: the verb `tune`."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from stickslip.core.arguments import arguments_checked
from stickslip.core.errors import InputError
from stickslip.studies.files import claim_folder, copy_inputs
from stickslip.sweeps.plan import Sweep, load
from stickslip.sweeps.tune import Tuned
from stickslip.sweeps.tune import tune as search
from stickslip.sweeps.tuned_files import write
from stickslip.verbs.plain_given import file_of
from stickslip.verbs.study_given import sweep_tables


@arguments_checked
def tune(
    file: str | os.PathLike[str] | Sweep | Mapping[str, Any],
    folder: str | os.PathLike[str] | None = None,
    *,
    figures: bool = True,
    progress: Callable[[int, int], None] | None = None,
) -> tuple[Tuned, ...]:
    """Choose bandwidth, gain, filter, ... for a machine that is not quite what was believed.

    Found is, for every run of the study, the setting with the least percentile of the first metric over all cases.

    Parameters
    ----------
    file : path, Sweep or mapping
        A sweep's TOML file with a table [tune], or what `stickslip.sweeps.plan.load` made of it. Or the content of such
        a file as a mapping, as `sweep` takes it; the folder then keeps it in ``inputs/``.
    folder : path, optional
        Where tables and figures are written; nothing is written without it.
    figures : bool
        Whether the trade-off between the first two metrics is drawn.
    progress : callable, optional
        ``progress(tried, about)``; what it raises ends the search.

    Returns
    -------
    tuple of Tuned
        One a run: ``settings`` and ``metrics`` by name, before and after, and every setting tried.

    Raises
    ------
    InputError
        One line that names the key, its value and what is allowed.
    """
    with file_of(file, folder, "tune", sweep_tables) as (readable, shown):
        planned = tuning_of(readable, shown)
        out = None if folder is None else claim_folder(Path(folder), planned.name, "tune")
        if out is not None and shown:
            copy_inputs(out, [(planned.source.name, planned.source), *planned.files.items()])
    found = tuple(search(planned, run, progress) for run in planned.runs)
    if out is not None:
        for tuned in found:
            written(out, planned, tuned, figures)
    return found


def tuning_of(file: str | os.PathLike[str] | Sweep, shown: str = "") -> Sweep:
    """The sweep of a file with a table [tune]; messages call the file `shown`.

    Raises
    ------
    InputError
    """
    found = file if isinstance(file, Sweep) else load(os.fspath(file), shown=shown)
    if not found.tuned:
        name = found.name if isinstance(file, Sweep) else shown or os.fspath(file)
        raise InputError(f'{name} has no table [tune]; give at least one [tune."controller.bandwidth_hz"]')
    return found


def written(folder: Path, planned: Sweep, tuned: Tuned, figures: bool) -> list[Path]:
    """Write tables and the figure of one run."""
    files = write(folder, planned, tuned)
    if figures and len(planned.metrics) > 1:
        from stickslip.report.sweep_pictures import trade_off

        files.append(trade_off(folder / "figures" / f"trade-off-{tuned.run.controller}", planned, tuned))
    return files
