"""Do parts of a real record give the same numbers? Halves, quarters and repeats, against plain inverse dynamics.

    python benchmarks/real_repeats.py [--only NAME] [--plain] [--jobs 2]

The records are those of the folder that STICKSLIP_DATA names (`../shared/data`; README there): EMPS, six axes of a
robot arm in two records, a brushless motor, a pendulum on a quasi-direct drive. Every part is identified by the
default and by plain inverse dynamics (`--inverse`); of all pairs of parts of one machine it prints

- how often two numbers that are both identified agree within the root of the summed squared half-widths,
- how many of the pairs that plain regression determines and repeats are identified,
- in how many sets every part has the same law,
- the force error over that of plain regression, on the part itself and on the others of its set.

The last line compares both rates with their bars. --plain estimates gross sliding alone, in about a second a part.
"""

from __future__ import annotations

import argparse
import gzip
import itertools
import math
import os
import sys
import time
from collections import defaultdict
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ.setdefault(_name, "1")

import numpy as np  # noqa: E402

from stickslip.core.errors import StickslipError  # noqa: E402
from stickslip.identification.axis import identify_axis  # noqa: E402
from stickslip.identification.experiment import Experiment  # noqa: E402
from stickslip.identification.regression.force_error import force_error_on, plain_error_on  # noqa: E402
from stickslip.identification.regression.inverse import inverse_dynamics  # noqa: E402
from stickslip.identification.sliding import estimate_sliding  # noqa: E402
from stickslip.machines.servo import ServoAxis  # noqa: E402

DATA = Path(os.environ.get("STICKSLIP_DATA", "../shared/data"))
NAMES = {"inertia": "inertia", "fc": "fc", "sigma2": "fv", "offset": "offset"}
"""Numbers that both estimate, and their names in the inverse dynamics."""
AGREE, IDENTIFIED = 0.93, 0.60
"""Bars: pairs that agree, and pairs that plain regression repeats and that are identified."""
MORE, QUANTILE = 1.05, 1.96
OFFSET, FACTOR, WIDEST = 0.1, 2.0, 1.0 / 3.0
"""Widest interval of an identified number: half-width of an offset over Fc; upper over lower of the others, which is
about a third of the value on either side."""
KUKA_GEARS = (1798 / 7, 1872 / 7, 757 / 3, 221.0, 5032 / 21, 206793 / 1340)
TORQUE_CONSTANT = 0.032  # N·m/A; of the brushless motor, between lines


@dataclass
class Part:
    """One part of a record, identified."""

    name: str
    own: dict[str, tuple[float, float, float, bool]] = field(default_factory=dict[str, Any])
    plain: dict[str, tuple[float, float]] = field(default_factory=dict[str, Any])
    law: str = ""
    failure: str = ""
    errors: list[tuple[float, float]] = field(default_factory=list[Any])
    """Force error, and that of plain regression: on the part itself, then on the others."""
    controlled: bool = False
    """Whether plain regression finds a friction below 0: the torque is what a controller makes of the velocity."""
    seconds: float = 0.0


# ---- records ---------------------------------------------------------------------------------------------------


def rows(path: Path) -> dict[str, np.ndarray]:
    """Columns of a compressed CSV."""
    with gzip.open(path, "rt") as file:
        names = file.readline().strip().split(",")
        table = np.loadtxt(file, delimiter=",")
    return dict(zip(names, table.T, strict=True))


def cut(experiment: Experiment, parts: int) -> list[Experiment]:
    """Equal parts, in the order of time."""
    edges = np.linspace(0, experiment.time.size, parts + 1).astype(int)
    return [
        replace(experiment, name=f"{experiment.name} {k + 1}/{parts}", time=experiment.time[a:b] - experiment.time[a],
                position=experiment.position[a:b], drive=None if experiment.drive is None else experiment.drive[a:b])
        for k, (a, b) in enumerate(itertools.pairwise(edges.tolist()))
    ]  # fmt: skip


def emps() -> Iterator[tuple[str, ServoAxis, list[Experiment]]]:
    """Motor and ball screw."""
    from scipy.io import loadmat

    data: Any = loadmat(DATA / "emps" / "DATA_EMPS.mat")
    t, q, u = (np.ascontiguousarray(data[k].ravel(), dtype=float) for k in ("t", "qm", "vir"))
    axis = ServoAxis(motion="linear", drive_gain=float(data["gtau"].item()), drive_side="load")
    whole = Experiment("emps", t, q, u, "voltage")
    for parts in (2, 4):
        yield f"emps {parts}", axis, cut(whole, parts)


def kuka() -> Iterator[tuple[str, ServoAxis, list[Experiment]]]:
    """Joints of a robot arm; the nominal torques of gravity and of the other joints are taken off."""
    axis = ServoAxis(drive_side="load")
    records = {k: rows(DATA / "kuka_kr300" / f"record_{k}.csv.gz") for k in "AB"}
    for j, gear in enumerate(KUKA_GEARS, 1):
        whole: list[Experiment] = []
        for k, r in records.items():
            others = r[f"nom_g{j}_Nm"] + r[f"nom_c{j}_Nm"] + r[f"nom_offdiag{j}_Nm"]
            torque = r[f"tau{j}_motor_Nm"] * gear - others
            whole.append(Experiment(f"kuka {j}{k}", r["t_s"], r[f"q{j}_rad"], torque))
        yield f"kuka {j} AB", axis, whole
        for t in whole:
            yield f"{t.name} 2", axis, cut(t, 2)


def laas() -> Iterator[tuple[str, ServoAxis, list[Experiment]]]:
    """A brushless motor whose cogging is larger than its friction, under speed and current control."""
    axis = ServoAxis(drive_side="load")
    r = rows(DATA / "laas_cogging" / "acceleration.csv.gz")
    whole = Experiment(
        "laas acceleration", r["t_s"] - r["t_s"][0], r["theta_rad"], TORQUE_CONSTANT * r["iq_A"]
    )
    for parts in (2, 4):
        yield f"laas acceleration {parts}", axis, cut(whole, parts)
    r = rows(DATA / "laas_cogging" / "speed_a.csv.gz")
    whole = Experiment("laas speed", r["t_s"], r["theta_rad"], TORQUE_CONSTANT * r["iq_A"])
    yield "laas speed 2", axis, cut(whole, 2)
    for k, half in enumerate(cut(whole, 2)):
        yield f"laas speed {k} 2", axis, cut(half, 2)


def pendulum() -> Iterator[tuple[str, ServoAxis, list[Experiment]]]:
    """A pendulum on a quasi-direct drive."""
    axis = ServoAxis(gravity="pendulum", drive_side="load")
    both: list[Experiment] = []
    for name, end in (("swingup_500hz", math.inf), ("energy_shaping_200hz", 3.9)):
        r = rows(DATA / "qdd_pendulum" / f"{name}.csv.gz")
        used = r["t_s"] < end
        both.append(Experiment(name, r["t_s"][used], r["theta_rad"][used], r["torque_Nm"][used]))
    yield "pendulum both", axis, both
    for t in both:
        yield f"pendulum {t.name} 2", axis, cut(t, 2)


# ---- parts -----------------------------------------------------------------------------------------------------


def identified(task: tuple[str, ServoAxis, list[Experiment], int, bool]) -> Part:
    """One part by the default and by plain regression."""
    _, axis, experiments, place, sliding_alone = task
    experiment = experiments[place]
    others = [t for k, t in enumerate(experiments) if k != place]
    part, begin = Part(experiment.name), time.process_time()
    try:
        plain = inverse_dynamics([experiment], axis)
        part.plain = {
            n: (plain[p], QUANTILE * float(plain.robust_std[plain.names.index(p)]))
            for n, p in NAMES.items() if plain.has(p)
        }  # fmt: skip
        part.controlled = any(part.plain[n][0] < -part.plain[n][1] for n in ("fc", "sigma2"))
    except StickslipError as error:
        plain, part.failure = None, f"plain: {error}"
    try:
        if sliding_alone:
            numbers = estimate_sliding([experiment], axis).numbers
            level = abs(numbers["fc"].value)
            for n in NAMES:
                x = numbers[n]
                good = x.half <= OFFSET * level if n == "offset" else 0.0 < x.upper <= FACTOR * x.lower
                part.own[n] = (x.value, x.lower, x.upper, good)
        else:
            result = identify_axis([experiment], axis)
            part.law = result.model.law.name
            part.own = {
                e.name: (e.value, e.lower, e.upper, e.identified) for e in result.estimates if e.name in NAMES
            }
            values = {e.name: e.value for e in result.estimates}
            for on in ([experiment], *([o] for o in others)):
                if plain is not None:
                    part.errors.append(
                        (
                            force_error_on(on, axis, result.model, values, plain.cutoff),
                            plain_error_on(on, axis, plain),
                        )
                    )
    except StickslipError as error:
        part.failure += f"own: {error}"
    part.seconds = time.process_time() - begin
    return part


def apart(a: Sequence[float], b: Sequence[float]) -> bool:
    """Whether two values with their half-widths contradict each other."""
    return abs(a[0] - b[0]) > math.hypot(a[1], b[1])


def plainly(name: str, part: Part) -> bool:
    """Whether plain regression's number would be identified by its own interval."""
    value, width = part.plain[name]
    return width <= (OFFSET * abs(part.plain["fc"][0]) if name == "offset" else WIDEST * value)


def half(own: Sequence[float]) -> tuple[float, float]:
    """Value and half-width."""
    return own[0], 0.5 * (own[2] - own[1])


def print_figures(sets: dict[str, list[Part]]) -> bool:
    """Print every part, then the four figures; return whether both bars are met."""
    agree: dict[str, list[bool]] = defaultdict(list)
    plain_agree: dict[str, list[bool]] = defaultdict(list)
    kept: dict[str, list[bool]] = defaultdict(list)
    stable: list[bool] = []
    ratios: dict[str, list[tuple[float, str, bool]]] = {"training": [], "held out": []}
    for name, parts in sets.items():
        print(f"\n{name}: {', '.join(p.law or '-' for p in parts)}")
        for p in parts:
            said = " ".join(
                f"{n} {x[0]:.4g} [{x[1]:.4g}, {x[2]:.4g}]{'' if x[3] else ' NOT'}"
                for n, x in sorted(p.own.items())
            )
            print(f"  {p.name}: {said} {p.failure} ({p.seconds:.1f} s)")
            print(
                "      plain " + " ".join(f"{n} {x[0]:.4g}±{x[1]:.2g}" for n, x in sorted(p.plain.items())),
                end="",
            )
            print("  force error / plain: " + " ".join(f"{100 * a:.2f}/{100 * b:.2f}" for a, b in p.errors))
            for k, (a, b) in enumerate(p.errors):
                if math.isfinite(a / b):
                    ratios["training" if k == 0 else "held out"].append((a / b, p.name, p.controlled))
        if all(p.law for p in parts):
            stable.append(len({p.law for p in parts}) == 1)
        for a, b in itertools.combinations(parts, 2):
            for n in NAMES:
                both_plain = all(n in x.plain and plainly(n, x) for x in (a, b))
                repeats = both_plain and not apart(a.plain[n], b.plain[n])
                if both_plain:
                    plain_agree[n].append(repeats)
                if n not in a.own or n not in b.own:
                    if repeats:
                        kept[n].append(False)
                    continue
                both = a.own[n][3] and b.own[n][3]
                if both:
                    agree[n].append(not apart(half(a.own[n]), half(b.own[n])))
                    if not agree[n][-1]:
                        print(f"  APART {n}: {a.name}, {b.name}")
                if repeats:
                    kept[n].append(both)
    print()
    for title, of in (("agree", agree), ("plain agrees", plain_agree), ("identified", kept)):
        every = [x for xs in of.values() for x in xs]
        print(f"{title:18s} {100 * np.mean(every):5.1f} % of {len(every)}: " + ", ".join(
            f"{n} {sum(xs)}/{len(xs)}" for n, xs in of.items()))  # fmt: skip
    rates = [np.mean([x for xs in of.values() for x in xs] or [True]) for of in (agree, kept)]
    good = bool(rates[0] >= AGREE and rates[1] >= IDENTIFIED)
    print(
        f"{'PASS' if good else 'FAIL'}: {rates[0]:.1%} agree (bar {AGREE:.0%}), {rates[1]:.1%} identified "
        f"(bar {IDENTIFIED:.0%})"
    )
    values = [x[3] for parts in sets.values() for p in parts for x in p.own.values()]
    print(f"values identified: {100 * np.mean(values):.1f} % of {len(values)}")
    if stable:
        print(f"law the same in {sum(stable)} of {len(stable)} sets")
    for title, of in ratios.items():
        if of:
            worst = sorted(of)[::-1]
            over = [x for x in worst if x[0] > MORE]
            print(f"force error over {MORE} of plain, {title}: {len(over)} of {len(of)}, "
                  f"{sum(c for _, _, c in over)} of them where plain's friction is below 0; "
                  f"{', '.join(f'{x:.2f} ({n})' for x, n, _ in over[:8])}")  # fmt: skip
    return good


def main() -> int:
    """Identify every part and print the figures; exit code 1 if a bar is missed."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--only", default="", help="only sets whose name contains this")
    parser.add_argument("--plain", action="store_true", help="gross sliding alone")
    parser.add_argument("--jobs", type=int, default=2)
    given = parser.parse_args()
    if not DATA.is_dir():
        sys.exit(f"no records at {DATA}; name their folder by STICKSLIP_DATA")
    tasks: list[tuple[str, ServoAxis, list[Experiment], int, bool]] = []
    for records in (emps, kuka, laas, pendulum):
        for name, axis, experiments in records():
            if given.only in name:
                tasks += [(name, axis, experiments, k, given.plain) for k in range(len(experiments))]
    with ProcessPoolExecutor(given.jobs) as pool:
        parts = list(pool.map(identified, tasks))
    sets: dict[str, list[Part]] = defaultdict(list)
    for task, part in zip(tasks, parts, strict=True):
        sets[task[0]].append(part)
    return 0 if print_figures(dict(sets)) else 1


if __name__ == "__main__":
    sys.exit(main())
