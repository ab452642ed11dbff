"""Cogging and friction's ripple recovered from virtual machines whose truth is known, and what compensating it brings.

    python benchmarks/cogging.py [--seeds 5] [--machine NAME ...] [--coverage 50] [--none 50]

For each machine: slow rotations on its rig, `identify_cogging`, error and correlation of the even part (cogging) and of
the odd part (ripple) over a turn; speed ripple and tracking error at a constant speed without and with the map found;
and over the seeds, how many of the 95 % intervals hold the truth. `--none 50`: how many of so many machines without
cogging and ripple, of each kind in turn (as it is, rigid, with four times the noise, with a sixteenth of the encoder's
counts), are said to have some. `--coverage 50`: intervals alone, on so many machines a seed each, whose phases the seed
draws and whose friction drifts and warms up; half the travel and no choice of the number of orders, so that a machine
takes seconds. `--first 5015`: seeds from there on, for runs in pieces.
"""

from __future__ import annotations

import argparse
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

import stickslip as ss
from stickslip.control.position import position_feedforward
from stickslip.core.record import Record
from stickslip.identification.cogging import identify_cogging
from stickslip.identification.cogging.fitting import fit
from stickslip.identification.cogging.orders import grid_of, moving_columns, path
from stickslip.identification.cogging.result import estimates_of
from stickslip.identification.cogging.rows import places_of
from stickslip.identification.estimate import Identification
from stickslip.machines.angle import AngleMap, harmonic_sum
from stickslip.machines.files import machine
from stickslip.machines.machine import Machine
from stickslip.machines.motor import Harmonics
from stickslip.machines.position_map import PositionMap
from stickslip.rigs.loop_sample import Control
from stickslip.rigs.procedures.base import perform
from stickslip.rigs.procedures.cogging import Cogging
from stickslip.rigs.virtual import VirtualRig

NOISIER, COARSER = 4.0, 16
"""Of the machines without cogging: how often noise and steps of the encoder are greater."""
MACHINES = ("thesis-dry", "thesis-grease", "direct-drive-24", "gear-50")
HERE = Path(__file__).parent
FRESH = 5000
"""First seed where nothing was chosen on the seeds before."""
EVERY = 8
"""Samples from one look at the contact to the next."""
CIRCLE = np.linspace(0.0, 2.0 * np.pi, 8000)
Values = np.ndarray[Any, np.dtype[np.float64]]


def named(name: str) -> Machine:
    """A machine of the package, or one of the test data."""
    files = {"direct-drive-24": "direct_drive_24.toml", "gear-50": "gear_50.toml"}
    return machine(HERE.parent / "tests" / "data" / files[name]) if name in files else machine(name)


def speeds_of(plant: Machine) -> tuple[float, ...]:
    """rad/s, before the procedure lowers them for the highest order."""
    return (0.9, 0.6, 0.4) if plant.name.startswith("thesis") else (0.6, 0.4)


def procedure_of(plant: Machine) -> Cogging:
    """A stiffer loop where cogging is larger than friction; the highest order is known: slots times gear."""
    if plant.name.startswith("thesis"):
        return Cogging(
            velocities=speeds_of(plant), inertia=plant.inertia, order=max(plant.cogging.order, default=24.0)
        )
    return Cogging(
        velocities=speeds_of(plant), inertia=plant.inertia, bandwidth=30.0, degrees=380.0,
        order=max(plant.cogging.order, default=168.0),
    )  # fmt: skip


class Watched(VirtualRig):
    """A virtual rig that tells the torque of its contact, before ripple and what drift and warmth make of it."""

    def __init__(self, plant: Machine) -> None:
        super().__init__(plant)
        self.seen: list[tuple[float, float]] = []

    def exchange_block(self, control: Control, setpoints: Values, rows: Values) -> int:
        """Samples of the loop in short blocks, after each of which the contact is looked at."""
        done, now = 0, self.laid.now
        while done < len(setpoints):
            part = slice(done, done + EVERY)
            count = super().exchange_block(control, setpoints[part], rows[part])
            done += count
            time = now["tick"] * self.sample_time + now["paused"]
            self.seen.append((float(time), float(now["friction"])))
            if count < len(rows[part]):
                break
        return done


def recorded(plant: Machine, degrees: float | None = None) -> tuple[Record, tuple[float, float]]:
    """Slow rotations, and the level at which friction's ripple acted in them, N·m: the mean of both directions, and
    half of what they differ by.

    It is the level at the speed that the axis had: the loop passes the encoder's steps on, and where friction falls
    with the velocity, friction over a speed that varies is less than at the mean speed (10 ppm behind the gear).
    """
    rig = Watched(plant)
    procedure = procedure_of(plant)
    record = perform(replace(procedure, degrees=degrees or procedure.degrees), rig).record
    places = places_of(record, "motor_torque")[0]
    time = places.time + record.time[0]
    seen, level = np.array(rig.seen).T
    torque: Values = changed(plant, record, time) * np.asarray(np.interp(time, seen, level), dtype=np.float64)
    forward, backward = (abs(float(np.mean(torque[places.direction == d]))) for d in (1.0, -1.0))
    return record, (0.5 * (forward + backward), 0.5 * (forward - backward))


def truth_of(plant: Machine, levels: tuple[float, float]) -> tuple[Values, Values]:
    """Even part (cogging, and what friction's ripple differs by between the directions) and odd part on `CIRCLE`."""
    both, apart = levels
    cogging = np.array([plant.cogging.at(x) for x in CIRCLE])
    ripple = np.array([plant.contact.ripple.at(x) for x in CIRCLE])
    return apart * ripple - cogging, both * ripple


def compared(found: Values, true: Values) -> str:
    """Error of the RMS and correlation of two parts without their means."""
    a, b = found - found.mean(), true - true.mean()
    if np.std(b) == 0.0:
        return "no truth"
    return (
        f"error {100.0 * np.std(a - b) / np.std(b):5.2f} % of RMS, correlation {np.corrcoef(a, b)[0, 1]:.5f}"
        if np.std(a) > 0.0
        else "nothing found"
    )


def odd_of(result: Identification) -> Values:
    """Friction over the angle without what a lag with direction explains."""
    own, angle = result.details["map"], result.details.get("angle")
    return own.ripple(CIRCLE) if angle is None else own.friction * harmonic_sum(angle.ripple, CIRCLE)


def amplitudes_of(plant: Machine, level: float) -> dict[str, float]:
    """True amplitudes of cogging and of friction's ripple by the names of their estimates, N·m."""
    waves = plant.contact.ripple
    true = {f"even[{n:g}]": a for n, a in zip(plant.cogging.order, plant.cogging.amplitude, strict=True)}
    return true | {f"odd[{n:g}]": a * level for n, a in zip(waves.order, waves.amplitude, strict=True)}


def held(result: Identification, true: dict[str, float]) -> dict[str, bool]:
    """Whether the interval of each amplitude of cogging and of friction's ripple holds the truth; an order that was not
    found does not."""
    own = {e.name: e for e in result.estimates}
    return {n: n in own and own[n].lower <= a <= own[n].upper for n, a in true.items()}


def drawn(plant: Machine, seed: int) -> Machine:
    """The machine with phases of cogging and ripple that a seed draws."""
    rng = np.random.default_rng(1000 + seed)

    def turned(waves: Harmonics) -> Harmonics:
        return replace(waves, phase=tuple(rng.uniform(-math.pi, math.pi, len(waves.order)).tolist()))

    contact = replace(plant.contact, ripple=turned(plant.contact.ripple))
    return replace(plant, seed=seed, cogging=turned(plant.cogging), contact=contact)


def changed(plant: Machine, record: Record, time: Values) -> Values:
    """Factor that drift and warmth put on friction at some times of a record."""
    drift, heat = plant.contact.drift, plant.contact.heat
    late = np.maximum(time - drift.begin, 0.0)
    warm = np.exp(heat.coefficient * (np.interp(time, record.time, record["temperature"]) - heat.reference))
    return (1.0 - drift.change * np.expm1(-late / drift.time)) * warm


def covered(name: str, seeds: range) -> None:
    """Print how many intervals of amplitudes hold the truth, over drawn machines."""
    hits, sure, off = dict[str, int](), dict[str, list[float]](), dict[str, list[float]]()
    for seed in seeds:
        plant = drawn(named(name), seed)
        record, (level, _) = recorded(plant, degrees=380.0)
        places = places_of(record, "motor_torque")[0]
        moving = moving_columns(places)
        found = fit(places, path(places, grid_of(places), moving), moving)
        own = {e.name: e for e in estimates_of(found, "N·m", None, ())}
        for term, true in amplitudes_of(plant, level).items():
            e = own.get(term)
            hits[term] = hits.get(term, 0) + (e is not None and e.lower <= true <= e.upper)
            sure.setdefault(term, []).append(math.nan if e is None else e.std / true)
            off.setdefault(term, []).append(math.nan if e is None else (e.value - true) / e.std)
    each = ", ".join(
        f"{k} {v} (std {1e6 * float(np.nanmedian(sure[k])):.0f} ppm, mean error {float(np.nanmean(off[k])):+.1f} std)"
        for k, v in hits.items()
    )
    total, asked = sum(hits.values()), len(seeds) * len(hits)
    print(
        f"{name}: {total} of {asked} intervals hold the truth, {100.0 * total / asked:.1f} % ({each})",
        flush=True,
    )


def motion(plant: Machine, result: Identification) -> str:
    """Speed ripple and tracking error at a constant speed, by what factor smaller with both parts of the map.

    The friction feedforward is the identified level, without and with its ripple. The speed lets the strongest order
    pass at half the loop's bandwidth at most: beyond, the inertia carries it.
    """
    found: PositionMap = result.details["map"]
    angle: AngleMap = result.details["angle"]
    gains = ss.place("PD", inertia=plant.inertia, bandwidth=12.0, damping=1.0)
    loop = ss.ControlBlock("pd", kp=gains.kp, kd=gains.kd)
    strongest = found.even.order[int(np.argmax(found.even.amplitude))]
    speed = min(1.0, 2.0 * math.pi * 6.0 / strongest)
    # Half a sample of hold, the lag of the current loop, and the machine's delay.
    bandwidth = plant.amplifier.bandwidth
    lag = 1.0 / (2.0 * math.pi * bandwidth) if math.isfinite(bandwidth) else 0.0
    lead = (0.5 + plant.delay) * plant.sample_time + lag
    friction = ss.Model("coulomb", fc=found.friction)
    sizes: list[tuple[float, float]] = []
    for model, more in (
        (friction, []),
        (angle.on(friction), [position_feedforward(found, angle="reference", lead=lead)]),
    ):
        blocks = [ss.ControlBlock("friction_feedforward", model), *more]
        drive = ss.Controller(
            loop=loop, sample_time=plant.sample_time, feedforward=blocks, torque_limit=plant.limits["torque"]
        )
        record = ss.simulate(plant, drive, ss.Reference("ramp", velocity=speed), duration=9.0)
        late = record.time > 2.0
        error = (record["position_reference"] - record["position"])[late]
        # Over 10 ms: counts of the encoder would hide the rest.
        velocity = np.convolve(record["position"], [0.1] + 19 * [0.0] + [-0.1], "valid") / (
            2.0 * plant.sample_time
        )
        sizes.append((float(np.std(velocity[late[20:]])), float(np.std(error))))
    return (
        f"at {speed:.3g} rad/s speed ripple / {sizes[0][0] / sizes[1][0]:.2f}, "
        f"tracking error / {sizes[0][1] / sizes[1][1]:.2f}"
    )


def judged(name: str, seeds: int) -> None:
    """Print how close, how sure and of what use the parts of one machine are."""
    plant, hits = named(name), dict[str, int]()
    for seed in range(seeds):
        # Friction that drifts has no true level; all else stays.
        one = replace(plant, seed=seed).without("drift", "temperature")
        record, levels = recorded(one)
        result = identify_cogging([record])
        for term, hit in held(result, amplitudes_of(one, levels[0])).items():
            hits[term] = hits.get(term, 0) + hit
        if seed == 0:
            even, odd = truth_of(one, levels)
            print(f"{name}: cogging {compared(result.details['map'].beside(CIRCLE), even)}")
            print(f"{name}: ripple {compared(odd_of(result), odd)}")
            print(f"{name}: {motion(one, result)}", flush=True)
    listed = ", ".join(f"{k} {v}" for k, v in hits.items())
    print(
        f"{name}: {sum(hits.values())} of {seeds * len(hits)} intervals of amplitudes hold the truth ({listed})",
        flush=True,
    )


def plain(name: str, number: int, seed: int) -> Machine:
    """A machine without cogging and ripple: in turn as it is, rigid, with more noise, with a coarse encoder."""
    own = replace(named(name).without("position", "cogging"), seed=seed)
    amplifier, encoder = own.amplifier, own.encoder
    noisy = replace(amplifier, current_noise=NOISIER * amplifier.current_noise)
    coarse = replace(encoder, counts=encoder.counts // COARSER)
    return (
        own, own.without("flexibility", "encoder-mode"), replace(own, amplifier=noisy), replace(own, encoder=coarse),
    )[number % 4]  # fmt: skip


def main() -> None:
    """Print a line for each machine."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--machine", action="append", choices=MACHINES)
    parser.add_argument("--none", type=int, default=0, metavar="COUNT")
    parser.add_argument("--coverage", type=int, default=0, metavar="COUNT")
    parser.add_argument("--first", type=int, default=FRESH, metavar="SEED")
    args = parser.parse_args()
    for name in () if args.none else args.machine or MACHINES:
        if args.coverage:
            covered(name, range(args.first, args.first + args.coverage))
        else:
            judged(name, args.seeds)
    if args.none:
        said = dict.fromkeys(args.machine or MACHINES, 0)
        for i in range(args.none):
            name = list(said)[i % len(said)]
            own = plain(name, i // len(said), args.first + i)
            record = perform(procedure_of(own), VirtualRig(own)).record
            said[name] += bool(identify_cogging([record]).details["fit"].terms)
            print(
                f"machines without cogging and ripple: {sum(said.values())} of {i + 1} are said to have some {said}",
                flush=True,
            )


if __name__ == "__main__":
    main()
