"""A study over many cases: the verb `sweep`."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from stickslip.core.arguments import arguments_checked, constructor_checked
from stickslip.core.errors import InputError
from stickslip.core.extras import needed
from stickslip.core.messages import name_option
from stickslip.core.resources import insist_on_jobs
from stickslip.identification.estimate import silent
from stickslip.sweeps import dataset, execute
from stickslip.sweeps.gains import too_few
from stickslip.sweeps.plan import MOST_CASES, Sweep, load
from stickslip.sweeps.sample import LEVEL
from stickslip.sweeps.summary import summarise, summary_lines, unvaried, write_summary
from stickslip.verbs.plain_given import file_of, insist_on_folder
from stickslip.verbs.study_given import sweep_tables

if TYPE_CHECKING:
    import pandas

Array = np.ndarray[Any, np.dtype[np.float64]]
SHOWN = 12
"""Runs that a printed result shows, at most."""


@constructor_checked
@dataclass(frozen=True, eq=False, repr=False)
class SweepResult:
    """A finished sweep.

    Attributes
    ----------
    sweep : stickslip.sweeps.plan.Sweep
    folder : Path
        Where the data set, manifest.json and summary.csv are.
    rows : sequence of mapping
        One a run: its slip rule, reference, friction and controller, the numbers that varied in it (``varied``) and
        those that it does not have (``not_varied``), cases, flagged ones, percentiles of every metric
        (``position_rms_rad_p95``), and what flagged means (``flagged_means``).
    manifest : mapping
        What was run, with which versions, and how long it took.
    files : tuple of Path
        The summary, the manifest, with the extra `parquet` the table of all cases, and the figures.
    """

    sweep: Sweep
    folder: Path
    rows: Sequence[Mapping[str, Any]]
    manifest: Mapping[str, Any]
    files: tuple[Path, ...]

    @arguments_checked
    def columns(self, row: int = 0) -> Mapping[str, Array]:
        """What every case of a run varied and gave, by name, shape (cases,).

        First the numbers that vary in the run, as drawn (factors where the file gives factors), then the sweep's
        metrics, NaN where a case has none, and ``flagged``.

        Parameters
        ----------
        row : int
            Of `rows`.

        Raises
        ------
        InputError
            If there is no such row.
        """
        if not 0 <= row < len(self.sweep.runs):
            raise InputError(f"columns: row = {row} must be from 0 to {len(self.sweep.runs) - 1}")
        run, drawn = self.sweep.runs[row], self.sweep.drawn
        names = [*self.sweep.varied(run), *([LEVEL] if drawn.nested else []), *self.sweep.metrics, "flagged"]
        return dataset.read(self.folder, self.sweep, run, names)

    def to_pandas(self) -> pandas.DataFrame:
        """`rows` as a data frame.

        Raises
        ------
        InputError
            Without pandas, which `pip install 'stickslip[pandas]'` brings.
        """
        pandas = needed("pandas", "pandas", "to_pandas() needs")
        return pandas.DataFrame([dict(row) for row in self.rows])

    def __repr__(self) -> str:
        said = f"<SweepResult: {self.sweep.name}, {sum(r['cases'] for r in self.rows)} closed loops in {self.folder}"
        lines = summary_lines(self.rows[:SHOWN], self.sweep.metrics[0])
        more = (
            [f"and {len(self.rows) - SHOWN} more runs: rows, or to_pandas()"]
            if len(self.rows) > SHOWN
            else []
        )
        return "\n".join([said, *(f"  {line}" for line in [*lines, *more])]) + ">"

    def _repr_html_(self) -> str:
        """A table in a notebook: percentiles of the first metric."""
        metric, heads = self.sweep.metrics[0], ("5 %", "50 %", "95 %", "worst", "cases")
        head = "".join(f"<th>{escape(h)}</th>" for h in (metric, *heads))
        body = ""
        for row in self.rows:
            name = "/".join(str(row[part]) for part in ("slip_rule", "reference", "friction", "controller"))
            cells = [f"{row[f'{metric}_p{p}']:.4g}" for p in (5, 50, 95, 100)] + [str(row["cases"])]
            body += f"<tr><td>{escape(name)}</td>" + "".join(f"<td>{c}</td>" for c in cells) + "</tr>"
        notes = "".join(f"<p>{escape(line)}</p>" for line in unvaried(self.rows))
        return f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>{notes}"


@arguments_checked
def sweep(
    file: str | os.PathLike[str] | Sweep | Mapping[str, Any],
    folder: str | os.PathLike[str] | None = None,
    *,
    cases: int | None = None,
    jobs: int = 0,
    processes: bool = False,
    scheduler: str = "",
    figures: bool = True,
    progress: Callable[[int, int], None] | None = None,
    tell: Callable[[str], None] = silent,
) -> SweepResult:
    """Run a study over many cases: numbers varied on a grid, by Sobol or Latin points, or within identified intervals.

    Finished blocks are kept in the folder: the same call goes on where another was interrupted.

    Parameters
    ----------
    file : path, Sweep or mapping
        A TOML file, "thesis-robustness" or "thesis-gain", or what `stickslip.sweeps.plan.load` gave. Or the content of
        such a file as a mapping, in which ``study`` may be a mapping as `study` takes it, and ``model`` what `identify`
        returned. The folder keeps all this as a file in ``inputs/``.
    folder : path, optional
        Where to write; sweep-NAME here unless given. A sweep given as a mapping needs it, and has its name.
    cases : int, optional
        Another number of cases than the file's.
    jobs : int
        Blocks at a time; 0: one a core.
    processes : bool
        Processes instead of threads.
    scheduler : str
        URL of a Dask scheduler, tcp://host:8786, whose workers run it.
    figures : bool
        Whether figures are drawn.
    progress : callable, optional
        ``progress(finished, all)``
    tell : callable
        Is told what a reader of the results must know.

    Returns
    -------
    SweepResult

    Raises
    ------
    InputError
        One line that names the key, its value and what is allowed.
    """
    if jobs < 0:
        raise InputError(f"jobs = {jobs} must be at least 0; 0, or none, is one block a core")
    insist_on_jobs(jobs or 1)
    insist_on_folder(file, folder, "sweep")
    with file_of(file, folder, "sweep", sweep_tables) as (readable, shown):
        planned = sweep_of(readable, cases, shown)
        out = Path(folder) if folder is not None else Path(f"sweep-{planned.name}")
        execute.ready(planned, scheduler)
        manifest = execute.run(
            planned, out, jobs, "processes" if processes else "threads", scheduler, progress, tell
        )
        if shown:
            planned = _kept(planned, out)
    rows = summarise(out, planned)
    if why := too_few(planned.drawn):
        tell(why)
    files = [write_summary(out, planned, rows), out / "manifest.json"]
    files += [table for table in [out / "cases.parquet"] if table.exists()]
    if figures:
        from stickslip.report.sweep_pictures import draw

        files += draw(out, planned)
    return SweepResult(planned, out, rows, manifest, tuple(files))


def _kept(planned: Sweep, folder: Path) -> Sweep:
    """The sweep, its file that of the folder: the one that it was read from goes."""
    source = folder / "inputs" / planned.source.name
    own = planned.study.source == planned.source
    return replace(
        planned, source=source, study=replace(planned.study, source=source) if own else planned.study
    )


def sweep_of(file: str | os.PathLike[str] | Sweep, cases: int | None = None, shown: str = "") -> Sweep:
    """The sweep of a file, with another number of cases; messages call the file `shown`.

    Raises
    ------
    InputError
        If the file is not a sweep's, or the number cannot be.
    """
    found = file if isinstance(file, Sweep) else load(os.fspath(file), shown=shown)
    name = found.name if isinstance(file, Sweep) else shown or os.fspath(file)
    if found.tuned:
        run = "run `ss.tune(...)`" if shown else f"run `stickslip tune {name}`"
        raise InputError(f"{name} has a table [tune]; {run}")
    if cases is None:
        return found
    if cases < 1:
        raise InputError(f"{name_option('cases', cases)} must be at least 1")
    if found.drawn.method == "grid":
        raise InputError(
            f"{name_option('cases', cases)}: {name} is a grid, whose points make its {found.drawn.cases} cases; "
            "change `points` or `values` in it, or its `method` to sobol"
        )
    if cases > MOST_CASES:
        raise InputError(f"{name_option('cases', cases)} are too many; keep below {MOST_CASES}")
    return replace(found, drawn=replace(found.drawn, cases=cases))
