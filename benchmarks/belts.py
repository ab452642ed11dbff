"""Whether a log tells a load behind a belt, and whether what is recommended for it keeps its promise.

    python benchmarks/belts.py [--first 0] [--count 24] [--jobs 2]        # a minute on two cores

Belts are drawn at random (6 to 28 Hz with the motor held, a motor of 0.2 to 0.65 of the inertia, friction anywhere
between motor and load) and moved in plain steps, in which nothing of the package takes part: a log under velocity
control to identify, then a PD loop of a fifth to a half of that frequency with the recommended feedforward and without.
"""

from __future__ import annotations

import argparse
import math
import os
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from typing import Any

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ.setdefault(_name, "1")

import numba  # noqa: E402
import numpy as np  # noqa: E402

import stickslip as ss  # noqa: E402
from stickslip.core.errors import StickslipError  # noqa: E402

STEP, EVERY = 5e-5, 20
"""s; steps in a sample."""
SEEN = 1e-3
"""Of the friction: noise of the torque's column."""


@dataclass(frozen=True)
class Belt:
    """A motor and a load on a belt: inertias, spring, friction of both, and of the loop that logs it."""

    inertia: float
    share: float
    held: float
    damping: float
    friction: float
    at_motor: float
    viscous: float

    @classmethod
    def drawn(cls, rng: np.random.Generator) -> Belt:
        """One at random."""
        inertia = math.exp(rng.uniform(math.log(2e-4), math.log(2e-3)))
        friction = inertia * rng.uniform(150.0, 400.0)
        return cls(
            inertia, rng.uniform(0.2, 0.65), rng.uniform(6.0, 28.0),
            math.exp(rng.uniform(math.log(0.015), math.log(0.1))), friction, rng.uniform(0.0, 1.0),
            friction * rng.uniform(2e-3, 1e-2),
        )  # fmt: skip

    @property
    def numbers(self) -> np.ndarray:
        """Inertias of motor and load, stiffness, damping, friction of both, viscous friction of each."""
        motor, load = self.share * self.inertia, (1.0 - self.share) * self.inertia
        stiffness = load * (2.0 * math.pi * self.held) ** 2
        damping = 2.0 * self.damping * math.sqrt(stiffness * motor * load / self.inertia)
        own = self.at_motor * self.friction
        return np.array([motor, load, stiffness, damping, own, self.friction - own, 0.5 * self.viscous])


@numba.njit
def moved(belt: Any, state: Any, torque: float) -> None:
    """One step of motor (position, velocity) and load under a torque."""
    motor, load, stiffness, damping, own, other, viscous = belt
    q, v, x, w = state
    spring = stiffness * (q - x) + damping * (v - w)
    v += STEP * (torque - spring - own * math.tanh(v / 0.05) - viscous * v) / motor
    w += STEP * (spring - other * math.tanh(w / 0.05) - viscous * w) / load
    state[0], state[1], state[2], state[3] = q + STEP * v, v, x + STEP * w, w


@numba.njit
def logged(belt: Any, gain: float, integral: float, seconds: float) -> Any:
    """Time, position and torque of moves there and back at 20, 50 and 100 rad/s, shape (n, 3)."""
    rows = np.empty((int(seconds / STEP) // EVERY, 3))
    state, gone = np.zeros(4), 0.0
    for k in range(len(rows)):
        t = k * EVERY * STEP
        speed = 20.0 if int(t / 1.6) % 3 == 0 else (50.0 if int(t / 1.6) % 3 == 1 else 100.0)
        phase = (t % 0.8) / 0.8
        ramp = max(min(1.0, phase / 0.15, (0.9 - phase) / 0.15), 0.0)
        missing = (speed if t % 1.6 < 0.8 else -speed) * ramp - state[1]
        gone += missing * EVERY * STEP
        torque = gain * missing + integral * gone
        rows[k, 0], rows[k, 1], rows[k, 2] = t, state[0], torque
        for _ in range(EVERY):
            moved(belt, state, torque)
    return rows


@numba.njit
def followed(belt: Any, kp: float, kd: float, fed: Any, amplitude: float, frequency: float) -> float:
    """RMS error, rad, of a PD loop on 1 - cos behind its first period; `fed`: level, slope, inertia, offset."""
    state, last, total, count, turn = np.zeros(4), 0.0, 0.0, 0, 2.0 * math.pi * frequency
    for k in range(int(3.0 / frequency / STEP) // EVERY):
        t = k * EVERY * STEP
        wanted, speed = amplitude * (1.0 - math.cos(turn * t)), amplitude * turn * math.sin(turn * t)
        torque = kp * (wanted - state[0]) + kd * (speed - (state[0] - last) / (EVERY * STEP))
        torque += fed[0] * np.sign(speed) + fed[1] * speed + fed[3]
        torque += fed[2] * amplitude * turn * turn * math.cos(turn * t)
        last = state[0]
        if t > 1.0 / frequency:
            total, count = total + (wanted - last) ** 2, count + 1
        for _ in range(EVERY):
            moved(belt, state, torque)
    return math.sqrt(total / count)


def tried(seed: int) -> dict[str, Any]:
    """One belt: what the log told, what was promised, what came of it."""
    rng = np.random.default_rng(seed)
    belt = Belt.drawn(rng)
    gain = belt.inertia * 2.0 * math.pi * rng.uniform(3.0, 6.0)
    time, position, torque = logged(belt.numbers, gain, gain * rng.uniform(2.0, 8.0), 9.6).T.copy()
    torque += SEEN * belt.friction * rng.standard_normal(torque.size)
    units = {"position": "rad", "motor_torque": "N·m"}
    record = ss.Record(time, {"position": position, "motor_torque": torque}, units, {})
    bandwidth, amplitude, frequency = (
        belt.held * rng.uniform(0.2, 0.5),
        rng.uniform(2.0, 20.0),
        rng.uniform(0.3, 0.8),
    )
    out: dict[str, Any] = {"seed": seed, "belt": belt}
    try:
        model = ss.identify(record, law="coulomb")
        out["train"] = model.identified().train
        advice = ss.recommend(
            model, bandwidth=bandwidth, sample_time=1e-3, amplitude=amplitude, frequency=frequency
        ).recommendation
    except StickslipError as error:
        return out | {"refused": str(error)}
    if advice.chosen is None or advice.model is None or advice.chosen.setting.kind != "feedforward":
        return out
    own: Any = advice.model.parameters
    setting, gains = advice.chosen.setting, advice.gains
    fed = [setting.gain * own.fc, setting.gain * own.sigma2, setting.inertia_feedforward, setting.offset]
    alone, left = (
        followed(belt.numbers, gains["kp"], gains["kd"], np.array(f), amplitude, frequency)
        for f in ([0.0] * 4, fed)
    )
    return out | {"promised": advice.reduction, "reduction": 1.0 - left / alone}


def lines(results: list[dict[str, Any]]) -> Iterator[str]:
    """A line a belt, and what they come to."""
    told = [(r["belt"], r["train"]) for r in results if r.get("train")]
    for r in results:
        belt, train = r["belt"], r.get("train")
        said = f"{train.antiresonance:5.1f} Hz, motor {train.motor_share:.2f}" if train else "not told"
        kept = (
            "{:.1%} in [{:.1%}, {:.1%}]".format(r["reduction"], *r["promised"]) if "promised" in r else "none"
        )
        kept = r.get("refused", kept)[:60]
        yield f"{r['seed']:5d}: {belt.held:5.1f} Hz, motor {belt.share:.2f}: {said}; reduction {kept}"
    if told:
        held = sum(t.antiresonance_interval[0] <= b.held <= t.antiresonance_interval[1] for b, t in told)
        part = sum(t.motor_share_interval[0] <= b.share <= t.motor_share_interval[1] for b, t in told)
        off = np.array([abs(t.resonance * math.sqrt(b.share) / b.held - 1.0) for b, t in told])
        yield (
            f"told {len(told)} of {len(results)}; of these the frequency holds in {held}, the motor's part in {part}; "
            f"resonance off by {np.median(off):.1%} (median), {off.max():.1%} (worst)"
        )
    promised = [r for r in results if "promised" in r]
    good = sum(r["promised"][0] <= r["reduction"] <= r["promised"][1] for r in promised)
    less = sum(r["reduction"] < r["promised"][0] for r in promised)
    worse = sum(r["reduction"] < 0.0 for r in promised)
    yield f"promised {len(promised)}: {good} hold, {less} are below, {worse} worse than none"


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--first", type=int, default=0, help="seed of the first")
    parser.add_argument("--count", type=int, default=24)
    parser.add_argument("--jobs", type=int, default=os.cpu_count())
    args = parser.parse_args()
    with ProcessPoolExecutor(args.jobs) as pool:
        results = list(pool.map(tried, range(args.first, args.first + args.count)))
    print(*lines(results), sep="\n")


if __name__ == "__main__":
    main()
