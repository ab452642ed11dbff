"""Does `stickslip recommend` keep its promise, from an ordinary log to the exported C on the machine?

    python benchmarks/promise.py --want 100 --out promise.jsonl     # goes on where it was left; a line of JSON an axis
    python benchmarks/promise.py --out promise.jsonl --only-sum

Every axis is one of `ordinary_logs.py`, of which the package knows nothing but a log: any torque column and rate,
moves, sine, staircase or tuning steps, and by chance cogging, backlash, a flexible drivetrain or friction that
differs by direction.
`identify` reads the log as it is; `recommend` is asked for a loop that a person would set on this axis
(P-PI cascade, PID or PD, at 1 kHz) and for a motion (production moves, slow sine, staircase); the setting is exported
as C, compiled, and added to the loop's torque on the generator's own machine. Printed is whether the part of the RMS
error that it takes away lies in the promised interval, and whether any setting is worse than none.

Where nothing is recommended, the same machine shows what a plain feedforward of the true numbers (inertia, Coulomb,
viscous, constant torque; gain 0.8) would have done: whether the refusal was right.
"""

from __future__ import annotations

import argparse
import ctypes
import json
import math
import os
import subprocess
import sys
import tempfile
import time
from collections import Counter
from contextlib import redirect_stderr, redirect_stdout
from io import StringIO
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parent))
for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ.setdefault(_name, "1")

import numba  # noqa: E402
import numpy as np  # noqa: E402

import ordinary_logs as logs  # noqa: E402

T = 1e-3
STEPS = round(T / logs.STEP)
HELD = 0.3
"""s at rest before the motion."""
TEST = 5.0
"""s of it, about."""
PLAIN = 0.8
"""Gain of the feedforward that a refusal is compared with."""


# ---- the machine -------------------------------------------------------------------------------------------------


@numba.njit(cache=True)
def advance(x, axis, orders, sizes, torque):
    """One sample of `ordinary_logs.simulate`'s machine; x: motor and load (position, velocity, bristle), torque."""
    jm, jl, stiff, damp, gap, offset, fc_up, fc_down, ratio, vs, sigma0, sigma1, sigma2, lag, at_load = axis[
        :15
    ]
    exponent = axis[15]
    h = 2e-5
    decay = math.exp(-h / lag) if lag > 0.0 else 0.0
    q, v, z, ql, vl, zl, actual = x
    for _ in range(50):
        actual = torque + (actual - torque) * decay
        z, contact = logs_bristle(
            z, v, fc_up if v > 0.0 else fc_down, ratio, vs, sigma0, sigma1, sigma2, exponent
        )
        contact *= 1.0 - at_load
        for i in range(orders.shape[0]):
            contact += sizes[i, 0] * math.sin(orders[i] * q + sizes[i, 1])
        spring = 0.0
        if jl > 0.0:
            twist = q - ql
            if twist > 0.5 * gap:
                spring = stiff * (twist - 0.5 * gap) + damp * (v - vl)
            elif twist < -0.5 * gap:
                spring = stiff * (twist + 0.5 * gap) + damp * (v - vl)
            zl, drag = logs_bristle(
                zl, vl, fc_up if vl > 0.0 else fc_down, ratio, vs, sigma0, sigma1, sigma2, exponent
            )
            vl += h * (spring - at_load * drag) / jl
            ql += h * vl
        v += h * (actual - contact - offset - spring) / jm
        q += h * v
    x[0], x[1], x[2], x[3], x[4], x[5], x[6] = q, v, z, ql, vl, zl, actual


logs_bristle = logs.bristle


def loop_torque(loop, m, y, r, rd, extra):
    """One sample of the drive's own controller; `m` is its memory."""
    v = (y - m["y"]) / T if m["started"] else 0.0
    keep = math.exp(-2.0 * math.pi * loop["filter"] * T) if loop["filter"] > 0.0 else 0.0
    m["v"] = keep * m["v"] + (1.0 - keep) * v if m["started"] else 0.0
    e = r - y
    if "kv" in loop:
        ev = loop["kv"] * e + loop["feed"] * rd - m["v"]
        if m["over"] * ev <= 0.0:
            m["sum"] += T * ev
        u = loop["kvp"] * ev + loop["kvi"] * m["sum"]
    else:
        if m["started"]:
            m["sum"] += 0.5 * T * (e + m["e"])
        u = loop["kp"] * e + loop["ki"] * m["sum"] + loop["kd"] * (rd - m["v"])
    m["y"], m["e"], m["started"] = y, e, True
    out = min(max(u + extra, -loop["limit"]), loop["limit"])
    m["over"] = u + extra - out
    return out


def ran(machine, loop, wanted, helper=None):
    """Positions of the motor at every sample, rad."""
    x = np.zeros(7)
    m = {"y": 0.0, "v": 0.0, "e": 0.0, "sum": 0.0, "over": 0.0, "started": False}
    out = np.empty(len(wanted))
    if helper:
        helper.begin()
    for k, (r, rd, rdd) in enumerate(wanted.tolist()):
        out[k] = x[0]
        y = machine.encoder * math.floor(x[0] / machine.encoder)
        extra = helper.torque(y, r, rd, rdd) if helper else 0.0
        advance(x, machine.axis, machine.orders, machine.sizes, loop_torque(loop, m, y, r, rd, extra))
    return out


# ---- loops and motions -------------------------------------------------------------------------------------------


def between(rng, low, high):
    """Log-uniform."""
    return float(math.exp(rng.uniform(math.log(low), math.log(high))))


def motion_of(kind, rng, machine):
    """Position, velocity and acceleration of a motion from rest to rest, every sample, shape (n, 3)."""
    if kind == "sine":
        f = between(rng, 0.2, 0.8)
        a = rng.uniform(0.05, 0.3) * machine.fastest / (2.0 * math.pi * f)
        t = T * np.arange(round(max(2.0, round(TEST * f)) / f / T))
        x = a * (1.0 - np.cos(2.0 * math.pi * f * t))
        v = 2.0 * math.pi * f * a * np.sin(2.0 * math.pi * f * t)
    else:
        path = logs.motion(kind, rng, machine.fastest, machine.acceleration, TEST, T)
        still = np.flatnonzero((path[1:, 1] == 0.0) & (path[:-1, 1] != 0.0))
        x, v = path[: still[-1] + 2, 0], path[: still[-1] + 2, 1]
    rest = round(HELD / T)
    x, v = np.concatenate([np.zeros(rest), x]), np.concatenate([np.zeros(rest), v])
    return np.stack([x, v, np.gradient(v, T)], axis=1)


def loop_of(kind, rng, log):
    """Gains that a person would have set on this axis."""
    inertia, stiff = log.truth["inertia"], log.machine.axis[1] == 0.0
    w = 2.0 * math.pi * between(rng, 5.0, 15.0 if stiff else 8.0)
    loop = {"filter": float(rng.choice([0.0, 150.0, 300.0])), "limit": float(log.machine.limit)}
    if kind == "P-PI":
        loop |= {"kv": w / 2.0, "kvp": 2.0 * w * inertia, "feed": float(rng.choice([0.0, 1.0, 1.0]))}
        loop["kvi"] = loop["kvp"] * w / 3.0
    elif kind == "PID":
        loop |= {"kp": 3.0 * inertia * w * w, "ki": inertia * w**3, "kd": 3.0 * inertia * w}
    else:
        loop |= {"kp": inertia * w * w, "ki": 0.0, "kd": 2.0 * inertia * w}
    return loop


# ---- the package -------------------------------------------------------------------------------------------------


class Refused(Exception):
    """A verb of the command line that ends with what is wrong."""


def stickslip(*words):
    """A verb of the command line; its output."""
    from stickslip.cli import main

    said, wrong = StringIO(), StringIO()
    with redirect_stdout(said), redirect_stderr(wrong):
        code = main([str(w) for w in words])
    if code:
        raise Refused(f"{words[0]}: {wrong.getvalue().strip().splitlines()[-1]}")
    return said.getvalue()


class Exported:
    """The exported C, compiled."""

    def __init__(self, folder: Path) -> None:
        (folder / "glue.c").write_text(
            '#include <string.h>\n#include "axis.h"\n'
            "static axis_settings n; static axis_memory m; static axis_state z; static axis_parameters p;\n"
            "static axis_surroundings u;\n"
            "void begin(void) { memset(&u, 0, sizeof u); u.load = 1.0; u.temperature = 20.0; axis_init(&n, &p);\n"
            "axis_reset(&m, &z); }\n"
            "double torque(double y, double r, double v, double a)\n"
            "{ return axis_sample(y, r, v, a, &n, &m, &z, &p, &u); }\n"
        )  # fmt: skip
        library = folder / "axis.so"
        command = [
            "gcc", "-std=c99", "-O2", "-shared", "-fPIC", "axis.c", "glue.c", "-o", str(library), "-lm",
        ]  # fmt: skip
        subprocess.run(command, cwd=folder, check=True, capture_output=True)
        self.library = ctypes.CDLL(str(library))
        self.begin = self.library.begin
        self.torque = self.library.torque
        self.torque.restype, self.torque.argtypes = ctypes.c_double, [ctypes.c_double] * 4


class Plain:
    """Feedforward of the true numbers."""

    def __init__(self, log: logs.Log) -> None:
        self.truth = log.truth

    def begin(self) -> None:
        """It has no memory."""

    def torque(self, y, r, v, a):
        """N·m"""
        t = self.truth
        return t["inertia"] * a + PLAIN * (t["fc"] * float(np.sign(v)) + t["sigma2"] * v) + t["offset"]


def identified(log: logs.Log, folder: Path) -> dict[str, Any]:
    """The model of the log, as a user gets it; what is called identified, and its error in parts of the truth."""
    from stickslip.identification.identified_file import read_identified

    if not (folder / "model.toml").exists():
        table = log.frame()
        np.savetxt(
            folder / "log.csv", np.column_stack(list(table.values())), fmt="%.9g", delimiter=",",
            header=",".join(table), comments="", encoding="utf-8",
        )  # fmt: skip
        stickslip("identify", folder / "log.csv", "--no-report", "--out", folder / "model.toml")
    found = read_identified(folder / "model.toml")
    errors = {
        e.name: (e.value - log.truth[e.name]) / (log.truth["fc"] if e.name == "offset" else log.truth[e.name])
        for e in found.estimates if e.identified and e.name in log.truth
    }  # fmt: skip
    return {"law": found.model.law.name, "errors": {k: round(v, 4) for k, v in errors.items()}}


def asked(
    loop: dict[str, float], wanted: Any, log: logs.Log, folder: Path, more: list[str]
) -> dict[str, Any]:
    """What is recommended for this loop and motion."""
    np.savetxt(
        folder / "motion.csv", np.column_stack([T * np.arange(len(wanted)), wanted[:, 0]]), fmt="%.9g", delimiter=",",
        header="time [s],position [rad]", comments="",
    )  # fmt: skip
    names = ("kv", "kvp", "kvi", "feed") if "kv" in loop else ("kp", "ki", "kd")
    given = {n: loop[n] for n in (*names, "filter", "limit")}
    if "kp" in loop:
        given["kr"] = loop["kd"]
    text = ",".join(f"{k}={float(v)!r}" for k, v in given.items())
    counts = round(2.0 * math.pi / log.machine.encoder)
    return json.loads(
        stickslip(
            "recommend", folder / "model.toml", "--loop", text, "--motion", folder / "motion.csv", "--counts-per-rev",
            counts, "--sample-time", T, "--out", folder / "recommended.toml", "--force", "--json", *more,
        )
    )  # fmt: skip


def rms(x):
    """Root mean square."""
    return math.sqrt(float(np.mean(np.square(x))))


def case(seed: int) -> tuple[logs.Log, str, dict[str, float], str, Any]:
    """Log, kind of loop and its gains, kind of motion and its points."""
    rng = np.random.default_rng([16, seed])
    column, rate, moves, imperfection, by = (
        x[int(rng.integers(len(x)))]
        for x in (logs.COLUMNS, logs.RATES, logs.MOTIONS, logs.IMPERFECTIONS, logs.LOOPS)
    )
    log = logs.draw(70_000 + seed, column, rate, by, moves, imperfection)
    kind = str(rng.choice(["P-PI", "PID", "PD"]))
    name = str(rng.choice(["production", "sine", "staircase"]))
    return log, kind, loop_of(kind, rng, log), name, motion_of(name, rng, log.machine)


def one(seed: int, more: list[str], keep: Path | None = None) -> dict[str, Any]:
    """One axis: what was promised, and what came."""
    log, kind, loop, name, wanted = case(seed)
    found: dict[str, Any] = {**log.about, "seed": seed, "logged": log.about["motion"], "by": log.about["loop"],
                             "loop": kind, "motion": name}  # fmt: skip
    alone = rms(wanted[:, 0] - ran(log.machine, loop, wanted))
    found |= {"alone": alone}
    with tempfile.TemporaryDirectory() as temporary:
        folder = (keep or Path(temporary)).resolve() / str(seed)
        folder.mkdir(parents=True, exist_ok=True)
        begin = time.process_time()
        try:
            found |= identified(log, folder)
            found["identify_s"], begin = time.process_time() - begin, time.process_time()
            advice = asked(loop, wanted, log, folder, more)
            found["recommend_s"] = time.process_time() - begin
            if advice["chosen"] is None:
                raise Refused(next(n for n in advice["notes"] if "No comp" in n))
        except Refused as why:
            plain = rms(wanted[:, 0] - ran(log.machine, loop, wanted, Plain(log)))
            return found | {"refused": str(why), "plain": 1.0 - plain / alone}
        stickslip("export", folder / "recommended.toml", "--to", "c99", "--compensator", "recommended",
                  "--name", "axis", "--out", folder / "c", "--force")  # fmt: skip
        after = rms(wanted[:, 0] - ran(log.machine, loop, wanted, Exported(folder / "c")))
    low, high = advice["reduction"]
    reduction, chosen = 1.0 - after / alone, advice["chosen"]
    return found | {
        "low": low, "high": high, "reduction": reduction, "holds": low <= reduction <= high, "worse": after > alone,
        "what": f"{chosen['law']} {chosen['kind']} {chosen['gain']:g}", "errors_there": chosen["errors"],
    }  # fmt: skip


# ---- what comes out ----------------------------------------------------------------------------------------------


def line(r: dict[str, Any]) -> str:
    """One axis."""
    head = (
        f"{r['seed']:>4} {r['imperfection']:<10}{r['column']:<10}{r['rate']:>5} {r['logged']:<11}"
        f"{r.get('law', '-'):<10}{r['loop']:<5}{r['motion']:<11}"
    )
    if "refused" in r:
        return f"{head} nothing: {r['refused'][:100]} (plain feedforward: {100 * r['plain']:.0f} %)"
    mark = "" if r["holds"] else "  MISSED" + (" WORSE" if r["worse"] else "")
    return (
        f"{head}{100 * r['reduction']:>6.1f} %  promised {100 * r['low']:>6.1f} to {100 * r['high']:>5.1f} %  "
        f"{r['what']:<25}{r['recommend_s']:>5.1f} s{mark}"
    )


def summed_up(rows: list[dict[str, Any]]) -> int:
    """How many promises held, by what; why nothing was recommended. Returns the exit code."""
    told = [r for r in rows if "low" in r]
    held, worse = sum(r["holds"] for r in told), sum(r["worse"] for r in told)
    print(f"\n{held} of {len(told)} reductions lie in the promised interval; {worse} settings are worse than none; "
          f"{len(rows) - len(told)} of {len(rows)} axes get no compensator")  # fmt: skip
    if told:
        width = float(np.median([r["high"] - r["low"] for r in told]))
        print(f"median reduction {100 * float(np.median([r['reduction'] for r in told])):.0f} %, median width of the "
              f"interval {100 * width:.0f} points; {np.median([r['recommend_s'] for r in told]):.1f} s")  # fmt: skip
    for key in ("imperfection", "column", "rate", "logged", "law", "loop", "motion"):
        parts = [
            f"{v} {sum(r['holds'] for r in of)}/{len(of)}"
            for v in sorted({str(r.get(key)) for r in told}) if (of := [r for r in told if str(r.get(key)) == v])
        ]  # fmt: skip
        print(f"  {key}: {', '.join(parts)}")
    for why, count in Counter(r["refused"].split(":")[0][:60] for r in rows if "refused" in r).most_common():
        of = [r["plain"] for r in rows if r.get("refused", "").startswith(why)]
        print(f"  {count} nothing: {why}; a plain feedforward of the true numbers would take away "
              f"{100 * min(of):.0f} to {100 * max(of):.0f} %")  # fmt: skip
    return 0 if told and held >= 0.9 * len(told) and not worse else 1


def main() -> int:
    """Go on until so many axes got a setting; print one line an axis and the sum."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--want", type=int, default=100, help="axes with a setting")
    parser.add_argument("--first", type=int, default=0, help="seed of the first axis")
    parser.add_argument("--every", type=int, default=1, help="every so many seeds (to share the work)")
    parser.add_argument("--seeds", type=int, nargs="+", default=[], help="these alone")
    parser.add_argument("--minutes", type=float, default=math.inf, help="begin no axis after these")
    parser.add_argument(
        "--out", type=Path, required=True, help="a line of JSON an axis; what it holds is not done again"
    )
    parser.add_argument(
        "--keep", type=Path, help="folder for the files of every axis; a model that is there stands"
    )
    parser.add_argument("--only-sum", action="store_true")
    args, more = parser.parse_known_args()
    rows = [json.loads(r) for r in args.out.read_text().splitlines()] if args.out.exists() else []
    if not args.only_sum:
        known, seed, begin = {r["seed"] for r in rows}, args.first, time.monotonic()
        todo = iter(args.seeds)
        while sum("low" in r for r in rows) < args.want and time.monotonic() - begin < 60.0 * args.minutes:
            if args.seeds and (seed := next(todo, -1)) < 0:
                break
            if seed not in known:
                rows.append(one(seed, more, args.keep))
                with args.out.open("a", encoding="utf-8") as file:
                    file.write(json.dumps(rows[-1]) + "\n")
                print(line(rows[-1]), flush=True)
            seed += args.every
    else:
        print("\n".join(line(r) for r in sorted(rows, key=lambda r: r["seed"])))
    return summed_up(rows)


if __name__ == "__main__":
    sys.exit(main())
