"""Does `stickslip recommend` keep its promise? Random axes, loops and motions, simulated by plain code of its own with
the exported C in the loop.

    python benchmarks/promise.py --axes 100 --seed 0

Every axis is LuGre friction with a constant torque beside it, and by chance a flexible train, cogging, backlash and a
current loop, of which the package knows nothing. Its loop runs at 1 kHz (P-PI cascade, PID or PD) on an encoder of 2^18
with a torque limit. What was identified is the truth perturbed within its intervals. `recommend` is asked for this loop
and motion; the setting is exported as C, compiled, and added to the loop's torque. Printed is whether the part of the
RMS error that it takes away lies in the promised interval, and whether any setting is worse than none.

The simulator takes steps of 10 us (semi-implicit Euler; bristles implicit) and shares no code with the package.
"""

from __future__ import annotations

import argparse
import ctypes
import json
import math
import subprocess
import sys
import tempfile
import time
from contextlib import redirect_stdout
from io import StringIO
from pathlib import Path
from typing import Any

import numba
import numpy as np
import tomli_w

T = 1e-3
SUBSTEPS = 100
COUNTS = 2**18
JM, JL, K, D, GAP, S0, S1, S2, FS, FC, VS, OFFSET, COG, ORDER, PHASE, LAG, SIZE = range(17)
PLAY = (0.005, 0.02)
"""Backlash: rad, at most this part of the motion's amplitude."""


# ---- the machine -------------------------------------------------------------------------------------------------


@numba.njit(cache=True)
def advance(x, p, torque):
    """One sample: x holds motor and load (position, velocity), bristle, and the lagging torque."""
    h = 1e-3 / 100
    for _ in range(100):
        x[5] += (torque - x[5]) * (h / p[15] if p[15] > h else 1.0)
        flexible = p[2] > 0.0
        v = x[3] if flexible else x[1]
        g = (p[9] + (p[8] - p[9]) * math.exp(-((v / p[10]) ** 2))) / p[5]
        before = x[4]
        x[4] = (x[4] + h * v) / (1.0 + h * abs(v) / g)
        friction = p[5] * x[4] + p[6] * (x[4] - before) / h + p[7] * v
        cog = p[12] * math.cos(p[13] * x[0] + p[14])
        if flexible:
            twist = x[0] - x[2]
            half = 0.5 * p[4]
            beyond = twist - min(max(twist, -half), half)
            shaft = p[2] * beyond + (p[3] * (x[1] - x[3]) if beyond != 0.0 or half == 0.0 else 0.0)
            x[1] += h / p[0] * (x[5] + cog - shaft)
            x[3] += h / p[1] * (shaft - friction - p[11])
            x[2] += h * x[3]
        else:
            x[1] += h / (p[0] + p[1]) * (x[5] + cog - friction - p[11])
        x[0] += h * x[1]


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


def ran(p, loop, wanted, helper=None):
    """Positions of the motor at every sample, rad."""
    x, m = np.zeros(6), {"y": 0.0, "v": 0.0, "e": 0.0, "sum": 0.0, "over": 0.0, "started": False}
    count = 2.0 * math.pi / COUNTS
    out = np.empty(len(wanted))
    if helper:
        helper.begin()
    for k, (r, rd, rdd) in enumerate(wanted.tolist()):
        out[k] = x[0]
        y = count * math.floor(x[0] / count + 0.5)
        extra = helper.torque(y, r, rd, rdd) if helper else 0.0
        advance(x, p, loop_torque(loop, m, y, r, rd, extra))
    return out


# ---- random axes, loops, motions ---------------------------------------------------------------------------------


def between(rng, low, high):
    return float(math.exp(rng.uniform(math.log(low), math.log(high))))


def axis_of(rng, kinds):
    p = np.zeros(SIZE)
    inertia, fc = between(rng, 2e-4, 5e-3), between(rng, 0.1, 2.0)
    p[JM], p[JL] = 0.5 * inertia, 0.5 * inertia
    p[FC], p[FS] = fc, fc * float(rng.uniform(1.05, 1.5))
    p[VS], p[S2] = between(rng, 0.02, 0.3), fc * between(rng, 0.005, 0.1)
    p[S0] = p[FS] / between(rng, 2e-4, 3e-3)
    p[S1] = 0.6 * math.sqrt(p[S0] * inertia)
    p[OFFSET] = fc * float(rng.uniform(-0.4, 0.4))
    p[ORDER], p[PHASE] = float(rng.choice([4, 6, 12, 24])), float(rng.uniform(0.0, 6.28))
    if "cogging" in kinds:
        p[COG] = fc * float(rng.uniform(0.02, 0.1))
    if "flexible" in kinds or "backlash" in kinds:
        f = between(rng, 80.0, 250.0)
        p[K] = (2.0 * math.pi * f) ** 2 * p[JM] * p[JL] / inertia
        p[D] = 0.06 * math.sqrt(p[K] * p[JM] * p[JL] / inertia)
    if "backlash" in kinds:
        p[GAP] = 1.0  # of `PLAY`
    if "current" in kinds:
        p[LAG] = 3e-4
    return p


def scurve(way, top, ramp):
    """Position, velocity, acceleration of one move with smooth (sin²) acceleration, every sample."""
    accelerating = min(ramp, way / top)
    cruise = way / top - accelerating
    t = T * np.arange(1, math.ceil((2.0 * accelerating + cruise) / T) + 1)

    def part(s):  # velocity over top, in a ramp of unit length
        s = np.clip(s, 0.0, 1.0)
        return s - np.sin(2.0 * math.pi * s) / (2.0 * math.pi)

    v = top * (part(t / accelerating) - part((t - accelerating - cruise) / accelerating))
    x = np.cumsum(v) * T
    return x * (way / x[-1]), v * (way / x[-1])


def motion_of(rng):
    """Name and (n, 3): a production cycle, a slow sine, a staircase of speeds, or small steps."""
    name = str(rng.choice(["moves", "sine", "staircase", "short"]))
    if name == "sine":
        a, f = between(rng, 0.05, 2.0), between(rng, 0.2, 1.0)
        t = T * np.arange(round(2.0 / f / T))
        x = a * (1.0 - np.cos(2.0 * math.pi * f * t))
        v = 2.0 * math.pi * f * a * np.sin(2.0 * math.pi * f * t)
    else:
        xs, vs, here = [np.zeros(200)], [np.zeros(200)], 0.0
        top, ramp = between(rng, 1.0, 20.0), between(rng, 0.03, 0.15)
        for i in range(4):
            speed = {"moves": top, "staircase": top * 0.3 ** (i // 2), "short": 0.3 * top}[name]
            way = {"moves": top * 0.4, "staircase": speed * 0.5, "short": 0.1}[name] * float(
                rng.uniform(0.7, 1.3)
            )
            x, v = scurve(way, speed, ramp)
            side = -1.0 if i % 2 else 1.0
            xs += [here + side * x, np.full(250, here + side * way)]
            vs += [side * v, np.zeros(250)]
            here += side * way
        x, v = np.concatenate(xs), np.concatenate(vs)
    return name, np.stack([x, v, np.gradient(v, T)], axis=1)


def loop_of(rng, p, wanted, kinds):
    """Gains of a loop that a person would have set on this axis."""
    inertia = p[JM] + p[JL]
    kind = str(rng.choice(["P-PI", "PID", "PD"]))
    w = 2.0 * math.pi * between(rng, 5.0, 15.0 if p[K] == 0.0 else 8.0)
    need = (
        inertia * np.max(np.abs(wanted[:, 2])) + p[FS] + abs(p[OFFSET]) + p[S2] * np.max(np.abs(wanted[:, 1]))
    )
    loop = {"filter": float(rng.choice([0.0, 150.0, 300.0])), "limit": float(need * rng.uniform(1.3, 3.0))}
    if kind == "P-PI":
        loop |= {"kv": w / 2.0, "kvp": 2.0 * w * inertia, "feed": float(rng.choice([0.0, 1.0, 1.0]))}
        loop["kvi"] = loop["kvp"] * w / 3.0
    elif kind == "PID":
        loop |= {"kp": 3.0 * inertia * w * w, "ki": inertia * w**3, "kd": 3.0 * inertia * w}
    else:
        loop |= {"kp": inertia * w * w, "ki": 0.0, "kd": 2.0 * inertia * w}
    return kind, loop


# ---- what was identified -----------------------------------------------------------------------------------------


def model_file(rng, path, p, wanted):
    """The truth perturbed within its intervals, as `stickslip identify` writes it."""
    law = str(rng.choice(["lugre", "stribeck", "coulomb"]))
    truth = {"fs": p[FS], "fc": p[FC], "vs": p[VS], "sigma2": p[S2], "sigma0": p[S0], "sigma1": p[S1]}
    spread = {"fs": 0.03, "fc": 0.015, "vs": 0.15, "sigma2": 0.05, "sigma0": 0.7, "sigma1": 0.7}
    if law == "stribeck":
        truth["k"], spread["k"] = 10.0 * p[FS] / p[VS], 0.7
    names = {"lugre": ["sigma0", "sigma1", "sigma2", "fs", "fc", "vs"], "stribeck": ["k", "fs", "fc", "vs", "sigma2"],
             "coulomb": ["fc", "sigma2"]}[law]  # fmt: skip
    estimates, parameters = [], {}
    truth |= {"inertia": p[JM] + p[JL]}
    spread |= {"inertia": 0.02}
    for name in ["inertia", *names]:
        s = spread[name]
        value = truth[name] * math.exp(s * float(rng.standard_normal()))
        if name == "fs":
            value = max(value, 1.001 * parameters.get("fc", 0.0))
        lower, upper = value * math.exp(-1.96 * s), value * math.exp(1.96 * s)
        estimates.append({"name": name, "unit": "", "value": value, "std": s * value, "lower": lower, "upper": upper,
                          "identified": s < 0.17})  # fmt: skip
        if name != "inertia":
            parameters[name] = value
    if "fs" in parameters:
        parameters["fs"] = max(parameters["fs"], 1.001 * parameters["fc"])
    s = 0.01 * p[FC]
    offset = p[OFFSET] + s * float(rng.standard_normal())
    estimates.append({"name": "offset", "unit": "N·m", "value": offset, "std": s, "lower": offset - 1.96 * s,
                      "upper": offset + 1.96 * s, "identified": True})  # fmt: skip
    step = 8
    points = wanted[::step]
    n = len(estimates)
    content = {
        "format": "stickslip-model-1", "law": law, "method": "axis", "motion": "rotary", "notes": [],
        "measure_next": [], "parameters": parameters,
        "axis": {"inertia": estimates[0]["value"], "offset": offset},
        "misfit": {"drive_rms": math.hypot(p[COG] / math.sqrt(2.0), 0.02 * p[FC])},
        "estimates": estimates,
        "correlation": {"names": [e["name"] for e in estimates], "matrix": np.eye(n).tolist()},
        "trajectory": {"source": "log", "time": (T * step * np.arange(len(points))).tolist(),
                       "position": points[:, 0].tolist(), "velocity": points[:, 1].tolist()},
    }  # fmt: skip
    path.write_text(tomli_w.dumps(content), encoding="utf-8")
    return law


# ---- the package -------------------------------------------------------------------------------------------------


def stickslip(*words):
    """A verb of the command line; its output."""
    from stickslip.cli import parser_of

    said = StringIO()
    args = parser_of(list(words[:1])).parse_args([str(w) for w in words])
    with redirect_stdout(said):
        code = args.run(args)
    if code:
        raise RuntimeError(f"{words}: {code}")
    return said.getvalue()


class Helper:
    """The exported C, compiled."""

    def __init__(self, folder: Path) -> None:
        accelerates = "wanted_acceleration" in (folder / "axis.h").read_text()
        (folder / "glue.c").write_text(
            '#include <string.h>\n#include "axis.h"\n'
            "static axis_settings n; static axis_memory m; static axis_state z; static axis_parameters p;\n"
            "static axis_surroundings u;\n"
            "void begin(void) { memset(&u, 0, sizeof u); u.load = 1.0; u.temperature = 20.0; axis_init(&p);\n"
            "axis_controller_init(&n); axis_controller_reset(&m, &z); }\n"
            "double torque(double y, double r, double v, double a) { (void)a; return axis_sample(y, r, v, "
            f"{'a, ' if accelerates else ''}&n, &m, &z, &p, &u); }}\n"
        )  # fmt: skip
        library = folder / "axis.so"
        command = [
            "gcc",
            "-std=c99",
            "-O2",
            "-shared",
            "-fPIC",
            "axis.c",
            "glue.c",
            "-o",
            str(library),
            "-lm",
        ]
        subprocess.run(command, cwd=folder, check=True, capture_output=True)
        self.library = ctypes.CDLL(str(library))
        self.begin = self.library.begin
        self.torque = self.library.torque
        self.torque.restype, self.torque.argtypes = ctypes.c_double, [ctypes.c_double] * 4


def asked(model: Path, loop: dict[str, float], out: Path, more: list[str]) -> dict[str, Any]:
    """What is recommended for this loop and the motion of the log."""
    names = ("kv", "kvp", "kvi", "feed") if "kv" in loop else ("kp", "ki", "kd")
    given = {n: loop[n] for n in (*names, "filter", "limit")}
    if "kp" in loop:
        given["kr"] = loop["kd"]
    text = ",".join(f"{k}={float(v)!r}" for k, v in given.items())
    return json.loads(
        stickslip(
            "recommend", model, "--loop", text, "--counts-per-rev", COUNTS, "--out", out, "--json", *more
        )
    )


def rms(x):
    return math.sqrt(float(np.mean(np.square(x))))


def one(seed: int, more: list[str]) -> dict[str, Any]:
    """One axis: what was promised, and what came."""
    rng = np.random.default_rng([16, seed])
    kinds = [k for k in ("flexible", "cogging", "backlash", "current") if rng.uniform() < 0.3]
    p = axis_of(rng, kinds)
    name, wanted = motion_of(rng)
    p[GAP] *= min(PLAY[0], PLAY[1] * 0.5 * np.ptp(wanted[:, 0]))
    kind, loop = loop_of(rng, p, wanted, kinds)
    found: dict[str, Any] = {
        "seed": seed,
        "machine": "+".join(kinds) or "clean",
        "motion": name,
        "loop": kind,
    }
    with tempfile.TemporaryDirectory() as folder:
        model, out = Path(folder) / "axis.toml", Path(folder) / "recommended.toml"
        found["law"] = model_file(rng, model, p, wanted)
        begin = time.perf_counter()
        try:
            advice = asked(model, loop, out, more)
        except Exception as error:  # refused: said, and counted
            return found | {"refused": str(error)}
        found["seconds"] = time.perf_counter() - begin
        alone = rms(wanted[:, 0] - ran(p, loop, wanted))
        if advice["chosen"] is None:
            return found | {"refused": next(n for n in advice["notes"] if "No comp" in n), "alone": alone}
        stickslip("export", out, "--to", "c99", "--compensator", "recommended", "--name", "axis", "--out",
                  Path(folder) / "c")  # fmt: skip
        after = rms(wanted[:, 0] - ran(p, loop, wanted, Helper(Path(folder) / "c")))
    low, high = advice["reduction"]
    reduction = 1.0 - after / alone
    chosen = advice["chosen"]
    return found | {
        "alone": alone, "low": low, "high": high, "reduction": reduction, "holds": low <= reduction <= high,
        "worse": after > alone, "what": f"{chosen['law']} {chosen['kind']} {chosen['gain']:g}",
    }  # fmt: skip


def main() -> int:
    """Print one line an axis and the sum."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--axes", type=int, default=100)
    parser.add_argument("--seed", type=int, default=0, help="of the first axis")
    parser.add_argument("--out", type=Path, help="write all as JSON")
    args, more = parser.parse_known_args()
    rows = []
    for seed in range(args.seed, args.seed + args.axes):
        r = one(seed, more)
        rows.append(r)
        head = f"{seed:>3} {r['machine']:<26}{r['motion']:<10}{r['loop']:<5}{r.get('law', ''):<9}"
        if "refused" in r:
            print(f"{head} nothing: {r['refused'][:90]}", flush=True)
            continue
        mark = "" if r["holds"] else "  MISSED" + (" WORSE" if r["worse"] else "")
        print(f"{head} {100 * r['reduction']:>6.1f} %  promised {100 * r['low']:>5.1f} to {100 * r['high']:>5.1f} %  "
              f"{r['what']:<25}{r['seconds']:>5.1f} s{mark}", flush=True)  # fmt: skip
    told = [r for r in rows if "low" in r]
    held, worse = sum(r["holds"] for r in told), sum(r["worse"] for r in told)
    print(f"\n{held} of {len(told)} reductions lie in the promised interval; {worse} settings are worse than none; "
          f"{len(rows) - len(told)} of {len(rows)} axes get no compensator")  # fmt: skip
    if told:
        width = float(np.median([r["high"] - r["low"] for r in told]))
        print(f"median reduction {100 * float(np.median([r['reduction'] for r in told])):.0f} %, "
              f"median width of the interval {100 * width:.0f} points")  # fmt: skip
    if args.out:
        args.out.write_text(json.dumps(rows, indent=1), encoding="utf-8")
    return 0 if told and held >= 0.9 * len(told) and not worse else 1


if __name__ == "__main__":
    sys.exit(main())
