"""From a sweep's TOML file to the runs and cases it asks for."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, cast

import numpy as np

from stickslip.core.config import Table, read_toml
from stickslip.core.errors import ConfigError, suggestion
from stickslip.identification.estimate import Estimate
from stickslip.identification.identified_file import Identified, identified_in, read_identified
from stickslip.simulation.metrics import METRICS
from stickslip.studies import plan as studies
from stickslip.studies.plan import Study
from stickslip.studies.planned_run import PlannedRun
from stickslip.studies.provenance import file_hash
from stickslip.sweeps.checked_numbers import check_numbers
from stickslip.sweeps.numbers import belongs, own_name, value_of
from stickslip.sweeps.ranges import usual
from stickslip.sweeps.sample import LEVEL, METHODS, Drawn, Spread, count_of

Array = np.ndarray[Any, np.dtype[np.float64]]
BUILT_IN = ("thesis-robustness", "thesis-gain")
BLOCK = 256
"""Cases in a file of the data set, at most."""
USUAL = ("position_rms_rad", "position_peak_rad", "velocity_rms_rad_s", "torque_rms_Nm")
MADE_BY = ("block.py", "measured.py", "metric_check.py")
"""What the numbers of a case come from, besides the engine."""
MOST_CASES = 1_000_000_000
MOST_SEED = 2**63
"""What files that hold it can say as a number"""


@dataclass(frozen=True)
class Sweep:
    """A sweep as its file describes it.

    Attributes
    ----------
    runs : sequence of PlannedRun
        Of the study; each is run in every case.
    drawn : Drawn
        The cases.
    metrics : tuple of str
    check : bool
        Whether every case is run again, with wrong steps or tighter, to flag those whose metrics are not sure
        (`stickslip.sweeps.metric_check`).
    study : Study
    config : mapping
        The sweep's TOML as read.
    source : Path
    files : mapping of str to Path
        Files it refers to, by the path as written.
    tuned, percentile
        What `stickslip.sweeps.tune` may choose, and the percentile over the cases that it judges by.
    left_out : tuple of str
        Estimates of the model that do not vary: they are not parameters of its law.
    sizes : tuple of int
        Cases in a block of every run; `BLOCK` where it is empty. The numbers are the same.
    """

    name: str
    title: str
    runs: Sequence[PlannedRun]
    drawn: Drawn
    metrics: tuple[str, ...]
    check: bool
    study: Study
    config: Mapping[str, Any]
    source: Path
    files: Mapping[str, Path]
    tuned: tuple[Spread, ...] = ()
    percentile: float = 95.0
    left_out: tuple[str, ...] = ()
    sizes: tuple[int, ...] = ()

    def size_of(self, run: int) -> int:
        """Cases in a block of a run."""
        return self.sizes[run] if self.sizes else BLOCK

    @property
    def blocks(self) -> list[tuple[int, int]]:
        """Run and first case of every block, in order."""
        starts = [range(0, self.drawn.cases, self.size_of(i)) for i in range(len(self.runs))]
        return [(i, at) for i, each in enumerate(starts) for at in each]

    @property
    def cases(self) -> int:
        """Closed loops in all."""
        return len(self.runs) * self.drawn.cases

    def fingerprint(self, run: int) -> str:
        """A hash of everything that determines the numbers of a run's cases."""
        content = [
            self.runs[run].fingerprint, asdict(self.drawn), self.metrics, self.check,
            *(file_hash(Path(__file__).with_name(name)) for name in MADE_BY),
        ]  # fmt: skip
        return hashlib.sha256(json.dumps(content, sort_keys=True, default=repr).encode()).hexdigest()

    def places(self, run: PlannedRun) -> dict[str, int]:
        """Which of the numbers drawn each number of a run that varies is, by the name that it has there."""
        found: dict[str, int] = {}
        for i, name in enumerate(self.drawn.names):
            own = own_name(run, name)
            # An inertia drawn under both names is, for each kind of axis, that of its own name.
            if belongs(run, name) and (own not in found or name == own):
                found[own] = i
        return found

    def varied(self, run: PlannedRun) -> list[str]:
        """The numbers that vary in a run, as the sweep's file names them."""
        return [self.drawn.names[i] for i in sorted(self.places(run).values())]

    def listed(self, run: PlannedRun, numbers: Array) -> Array:
        """The numbers drawn, NaN where the run has no such number, shape (n, names)."""
        kept = {*self.places(run).values(), *(i for i, n in enumerate(self.drawn.names) if n == LEVEL)}
        return np.where([i in kept for i in range(len(self.drawn.names))], numbers, np.nan)

    def values(self, run: PlannedRun, numbers: Array) -> dict[str, Array]:
        """What the numbers drawn are in a run, by name, shape (n,) or (n, elements); only those that it has."""
        out: dict[str, Array] = {}
        for name, i in self.places(run).items():
            column = numbers[:, i]
            if i < len(self.drawn.spreads) and self.drawn.spreads[i].factor:
                base = value_of(run, name)
                # A factor on a list multiplies every element.
                column = np.multiply.outer(column, np.asarray(base, dtype=np.float64))
            out[name] = np.ascontiguousarray(column, dtype=np.float64)
        return out


def load(sweep: str | Path, moved: Mapping[str, Path] | None = None, shown: str = "") -> Sweep:
    """Read a sweep: the path of a TOML file, or the name of one that ships with the package.

    Parameters
    ----------
    sweep : str or Path
    moved : mapping of str to Path, optional
        Where files that the sweep and its study refer to lie now, by the path as written.
    shown : str
        How messages call the file; its path unless given.

    Raises
    ------
    ConfigError
        One line that names the key, its value and what is allowed.
    """
    name = str(sweep)
    path = Path(__file__).with_name(f"{name}.toml") if name in BUILT_IN else Path(sweep)
    if name not in BUILT_IN and path.suffix != ".toml" and not path.exists():
        raise ConfigError(
            f"unknown sweep {name!r}; "
            + suggestion(name, BUILT_IN, f"give the path of a TOML file, or one of {', '.join(BUILT_IN)}")
        )
    table = read_toml(path, f"{name}.toml" if name in BUILT_IN else shown, moved)
    with table:
        return _sweep(path.stem, path, table, moved or {})


def _sweep(name: str, path: Path, table: Table, moved: Mapping[str, Path]) -> Sweep:
    study = _study(name, path, table, moved)
    only = table.texts("only", _names(study)) if table.has("only") else []
    runs = studies.select([*study.runs, *study.extras], only)
    if not runs:
        raise table.error("only", "selects no run of the study")
    tolerance = table.positive("tolerance", "rad", 1e-7)
    runs = [replace(r, numerics=replace(r.numerics, tolerance=tolerance, output=r.duration)) for r in runs]
    metrics = table.texts("metrics", METRICS) if table.has("metrics") else list(USUAL)
    check = table.flag("check", True)
    drawn, left_out = _drawn(table, {r.axis.friction.law.name for r in runs})
    tuned = _spreads(table, "tune", drawn.method, runs) if table.has("tune") else []
    if both := {s.name for s in tuned} & {s.name for s in drawn.spreads}:
        raise ConfigError(
            f"{table.label('tune')}: {min(both)} varies too ([vary]); a number is either chosen or uncertain: leave "
            "it out of one of them"
        )
    title = table.text("title", _title(name, study, drawn, tuned))
    percentile = table.positive("percentile", "%", 95.0) if tuned else 95.0
    if percentile > 100.0:
        raise table.error("percentile", "must be at most 100 %")
    found = Sweep(
        name, title, runs, drawn, tuple(metrics), check, study, table.values, path, dict(table.document.files),
        tuple(tuned), percentile, left_out,
    )  # fmt: skip
    check_numbers(found, table)
    return found


def _title(name: str, study: Study, drawn: Drawn, tuned: Sequence[Spread]) -> str:
    """What a sweep without a title of its own does; its figures name the numbers."""

    def counted(count: int, word: str) -> str:
        return f"{count} {word}{'' if count == 1 else 's'}"

    varied = f"{counted(sum(n != LEVEL for n in drawn.names), 'parameter')} of study {study.name} varied"
    own = f"{counted(len(tuned), 'setting')} tuned, " if tuned else ""
    return f"{name}: {own}{varied}"


def _study(name: str, path: Path, table: Table, moved: Mapping[str, Path]) -> Study:
    """What ``study`` is: a study that ships with the package, a file, or a table with the content of one."""
    if isinstance(table.values.get("study"), dict):
        return studies.study_in(name, path, table.table("study"))
    if not table.has("study"):
        raise ConfigError(
            f"{table.label('study')} is missing; give the name of a study that ships with the package "
            f"({', '.join(studies.BUILT_IN)}), the path of a study's file, or a table [study] with the content of one"
        )
    named = table.text("study")
    if named in studies.BUILT_IN:
        return studies.load(named)
    return studies.load(table.document.locate(named), moved)


def _names(study: Study) -> list[str]:
    runs = [*study.runs, *study.extras]
    return list(dict.fromkeys(getattr(r, family) for family in studies.FAMILIES for r in runs))


# ---- what varies ---------------------------------------------------------------------------------------------


def _drawn(table: Table, laws: set[str]) -> tuple[Drawn, tuple[str, ...]]:
    """The cases, and the model's estimates that do not vary; `laws` are those of the runs' friction."""
    method = table.choice("method", METHODS, "sobol")
    spreads = _spreads(table, "vary", method) if table.has("vary") else []
    estimates, correlation, left_out = _estimates(table, laws)
    if not spreads and not estimates:
        raise ConfigError(f'{table.label("vary")} is missing; give at least one [vary."friction.fs"]')
    if method == "grid":
        if estimates:
            raise table.error("method", "cannot draw from a model's intervals; choose sobol or latin")
        cases = count_of(spreads)
        if table.has("cases"):
            raise table.error("cases", "is what the points of a grid make; leave it out")
    else:
        cases = _whole(table, "cases")
    if cases > MOST_CASES:
        raise ConfigError(f"{table.label()}: {cases} cases are too many; keep below {MOST_CASES}")
    seed = _whole(table, "seed", 1, least=0)
    if seed >= MOST_SEED:
        raise ConfigError(f"{table.label('seed')} = {seed} has more than 63 bits; give a number below 2**63")
    nested = table.flag("nested", False)
    if nested and (method == "grid" or not spreads):
        raise table.error("nested", "needs ranges and the method sobol or latin")
    return Drawn(method, tuple(spreads), cases, seed, estimates, correlation, nested), left_out


def _spreads(table: Table, key: str, method: str, runs: Sequence[PlannedRun] = ()) -> list[Spread]:
    """The numbers of a table of ranges; one that names none has the usual range of the `runs`."""
    family, found = table.table(key), list[Spread]()
    for name in family.values:
        with family.table(name) as t:
            own = t.values or not any(belongs(run, name) for run in runs)
            with t.blamed():
                found.append(_spread(name, t, method) if own else usual(runs, name))
    return found


def _whole(table: Table, key: str, default: int | None = None, least: int = 1) -> int:
    value = table.number(key, "", default, least)
    if value != int(value):
        raise table.error(key, "must be a whole number")
    return int(value)


def _spread(name: str, table: Table, method: str) -> Spread:
    given = [key for key in ("scale", "range", "values") if table.has(key)]
    if len(given) != 1:
        raise ConfigError(f"{table.label()}: give one of scale = [0.7, 1.3], range = [...] or values = [...]")
    key = given[0]
    listed = Table({key: table.values[key]}, table.document, table.path).rest()[key]
    if not isinstance(listed, list) or not listed:
        raise table.error(
            key, f"must be {'a list of numbers' if key == 'values' else 'two numbers, [low, high]'}"
        )
    numbers = cast("list[float]", listed)
    factor = key == "scale" or (
        key == "values" and table.choice("of", ("value", "factor"), "value") == "factor"
    )
    if key == "values":
        if method != "grid":
            raise table.error(key, f"belongs to a grid; give scale or range for method {method!r}")
        return Spread(name, min(numbers), max(numbers), factor, values=tuple(map(float, numbers)))
    if len(numbers) != 2:
        raise table.error(key, "must be two numbers, [low, high]")
    if not numbers[0] < numbers[1]:
        raise table.error(key, "is empty; give [low, high] with low below high")
    logarithmic = table.choice("steps", ("linear", "logarithmic"), "linear") == "logarithmic"
    if logarithmic and numbers[0] <= 0.0:
        raise table.error(key, "has no logarithm; give positive numbers")
    points = _whole(table, "points") if method == "grid" else 0
    return Spread(name, float(numbers[0]), float(numbers[1]), factor, points, logarithmic=logarithmic)


def _identified(table: Table) -> Identified:
    """What ``model`` is: a model's file, or a table with the content of one."""
    if isinstance(table.values["model"], dict):
        return identified_in(table.table("model"))
    return read_identified(table.document.locate(table.text("model")))


def _estimates(
    table: Table, laws: set[str]
) -> tuple[tuple[Estimate, ...], tuple[tuple[float, ...], ...], tuple[str, ...]]:
    """What `model = "model.toml"` says is uncertain: the law's parameters and the inertia; and what else it holds."""
    if not table.has("model"):
        return (), (), ()
    found = _identified(table)
    law = {f.name for f in found.model.law.fields}
    own = [i for i, e in enumerate(found.estimates) if e.name.partition("[")[0] in law]
    if own and found.model.law.name not in laws:
        named = repr(table.values["model"]) if isinstance(table.values["model"], str) else "..."
        raise table.error(
            "model",
            f"holds law {found.model.law.name}, and the friction of the runs is of law {', '.join(sorted(laws))}, "
            f"which has other parameters; take a study with [friction.NAME] law = {{model = {named}}}",
        )
    kept = sorted([*own, *(i for i, e in enumerate(found.estimates) if e.name == "inertia")])
    left_out = tuple(e.name for i, e in enumerate(found.estimates) if i not in kept)
    if not kept:
        raise table.error(
            "model", "has no estimates with intervals; give a file that `stickslip identify` wrote"
        )
    if left_out and not own:
        raise table.error(
            "model",
            f"has intervals of no parameter of its law {found.model.law.name} (it has {', '.join(left_out)}), so that "
            "the inertia alone would vary; identify the law, or name the inertia in [vary]",
        )
    matrix = found.correlation[np.ix_(kept, kept)]
    rows = tuple(tuple(map(float, row)) for row in matrix)
    return tuple(found.estimates[i] for i in kept), rows, left_out
