"""The pictures of where compensators fail: runs of the bench, made again when this documentation is built."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
from pages import GENERATED, ROOT

from stickslip.control.block import ControlBlock
from stickslip.control.controller import Controller
from stickslip.core.record import Record
from stickslip.machines.contact import Contact
from stickslip.machines.machine import Machine
from stickslip.machines.motor import Harmonics
from stickslip.models.model import Model, Reference
from stickslip.report.plots import Curve, Panel, draw
from stickslip.report.styles import REFERENCE, Style
from stickslip.simulation.closed_loop import simulate
from stickslip.studies.bench import Planned, planned, read_bench

FOLDER = GENERATED / "compensators"
FAILS, WORKS = Style("#D55E00", "-", 1.2), Style("#0072B2", (0, (5, 1.5)), 1.2)
TIME = "time (s)"


@dataclass(frozen=True)
class Failure:
    """A picture: the runs by their keys on the bench and what the legend calls them, the one that fails first.

    ``shown`` are the signals of its panels, ``part`` the times, s.
    """

    page: str
    message: str
    runs: tuple[tuple[str, str], ...]
    shown: tuple[str, ...] = ("position",)
    part: tuple[float, float] = (0.0, 20.0)


FAILURES = (
    Failure(
        "disturbance_observer",
        "On the gear a step ends in a limit cycle of 9 mrad: the observer winds up against the contact as an integral "
        "does.",
        (("gear/believed/step/PD/ff-dob", "PD + feedforward + observer"),),
    ),
    Failure(
        "extended_state_observer",
        "With 16 bits the gear does not come to rest after a move of 0.2 rad: it jumps back and forth by 4 to 7 mrad.",
        (("gear/coarse/stop/PD/eso", "encoder of 16 bits"), ("gear/believed/stop/PD/eso", "of 20 bits")),
        ("error",), (1.0, 20.0),
    ),
    Failure(
        "lugre_observer",
        "Friction drops by 30 % at 0.4 s: what was believed is now too much, it pushes the axis on and swings it "
        "around the target.",
        (
            ("gear/drop/stop/PD/lugre-observer", "friction drops"),
            ("gear/believed/stop/PD/lugre-observer", "as believed"),
        ),
        ("error",), (0.0, 6.0),
    ),
    Failure(
        "dual_observer",
        "On the gear a step ends in a limit cycle of 9 to 15 mrad: the integral under it winds up against the contact, "
        "as it does alone.",
        (("gear/believed/step/PID/dual", "PID + dual observer"),),
    ),
    Failure(
        "friction_observer",
        "Friction 30 % below what is believed is overcompensated: the axis runs ahead, and the error is seven times as "
        "large.",
        (
            ("dry/weaker/high/PD/gms-observer", "friction 30 % weaker"),
            ("dry/believed/high/PD/gms-observer", "as believed"),
        ),
        ("error",), (0.0, 2.0),
    ),
    Failure(
        "coulomb_observer",
        "The slow sinusoid does not move the axis: what sticks teaches nothing, and the PD under it stays short of "
        "break-away.",
        (("dry/believed/low/PD/friedland-park", "PD + Coulomb observer"),),
        part=(0.0, 2.5),
    ),
    Failure(
        "scaled_feedforward",
        "On the gear the PID under it hunts by 14 mrad at rest: a scale changes nothing while the reference stands.",
        (("gear/believed/step/PID/scale", "PID + adapted scale"),),
    ),
    Failure(
        "least_squares_feedforward",
        "What the first samples of a step teach is wrong: the axis comes later than with a feedforward that learns "
        "nothing.",
        (
            ("dry/believed/step/PD/rls-dob", "least squares + observer"),
            ("dry/believed/step/PD/ff-dob", "fixed + observer"),
        ),
        part=(0.0, 1.5),
    ),
    Failure(
        "gradient_feedforward",
        "At rest the gain stays where the step has left it, and with it an error of 6 mrad.",
        (("gear/believed/step/PD/gradient", "PD + gradient gain"),),
        part=(0.0, 5.0),
    ),
    Failure(
        "adaptive_friction",
        "After a step of the reference its functions are 0, and so is their torque: the axis has hardly moved, and "
        "stays.",
        (("gear/believed/step/PD/makkar", "PD + Makkar's functions"),),
        part=(0.0, 5.0),
    ),
    Failure(
        "robust_adaptive",
        "With one more sample of delay the levels grow until the torque switches between its limits.",
        (("grease/late/stop/-/lee-kim", "Lee and Kim"),),
        ("error", "torque"), (0.0, 3.0),
    ),
    Failure(
        "sliding_modes",
        "The torque of super-twisting chatters from sample to sample, and the axis swings around the target for "
        "seconds.",
        (("dry/believed/step/-/twisting", "super-twisting"),),
        ("position", "torque"), (0.0, 4.0),
    ),
    Failure(
        "without_a_model",
        "The knocker brings the axis to the target and shakes it there for as long as the integral moves: by 2 mrad.",
        (("dry/believed/step/PID/knocker", "PID + knocker"), ("dry/believed/step/PID/none", "PID")),
        part=(0.0, 5.0),
    ),
)  # fmt: skip


def make() -> None:
    """Draw them, unless they and the package are as they were."""
    sources = b"".join(p.read_bytes() for p in sorted((ROOT / "src").rglob("*.py")))
    now, stamp = hashlib.sha256(sources + Path(__file__).read_bytes()).hexdigest(), FOLDER / ".stamp"
    if stamp.exists() and stamp.read_text() == now:
        return
    for failure in FAILURES:
        draw(FOLDER / failure.page, title_of(failure), failure.message, list(panels(failure)), 1.7)
    draw_learned_feedforward(FOLDER / "learned_feedforward")
    stamp.write_text(now)


def title_of(failure: Failure) -> str:
    """The run as the bench calls it."""
    return failure.runs[0][0].replace("/-/", "/")


def panels(failure: Failure) -> Sequence[Panel]:
    """One for each signal, with the same time."""
    records = [(ran(key), label) for key, label in failure.runs]
    return [panel(signal, records, failure.part) for signal in failure.shown]


def panel(signal: str, records: Sequence[tuple[Record, str]], part: tuple[float, float]) -> Panel:
    """The signal of every run; beside the positions the reference."""
    curves: list[Curve] = []
    for (record, label), style in zip(records, (FAILS, WORKS)):
        within = np.flatnonzero((record.time >= part[0]) & (record.time <= part[1]))
        y = {
            "position": 1e3 * record["position"], "error": 1e3 * (record["position_reference"] - record["position"]),
            "torque": record["torque_command"],
        }[signal]  # fmt: skip
        curves.append(Curve(record.time[within], y[within], label, style))
    if signal == "position":
        first = records[0][0]
        within = np.flatnonzero((first.time >= part[0]) & (first.time <= part[1]))
        reference = 1e3 * first["position_reference"][within]
        curves.append(Curve(first.time[within], reference, "reference", REFERENCE))
    unit = "torque (N·m)" if signal == "torque" else f"{signal} (mrad)"
    return Panel(curves, unit, TIME, part)


def ran(key: str) -> Record:
    """A run of the bench, every sample of it."""
    run = runs()[key]
    return simulate(
        run.machine, run.control, run.reference, run.duration, output=run.machine.sample_time, metered=False
    )


@cache
def runs() -> dict[str, Planned]:
    """The runs of the bench by their keys."""
    return {p.run.key: p for p in planned(read_bench())}


# ---- no run of the bench: over repetitions -------------------------------------------------------------------------

INERTIA, SAMPLES, REPETITIONS, LARGEST = 3.8623e-4, 2500, 10, 0.5
MESSAGE = (
    "An observer that is fed with the whole torque cancels the map, which grows to its bound: the error becomes 30 "
    "times as large. Fed with the residual, it leaves the map alone."
)


def draw_learned_feedforward(path: Path) -> None:
    """The error of every repetition, with the observer fed with the whole torque and with the residual."""
    repetition = np.arange(1.0, REPETITIONS + 1.0)
    curves = [
        Curve(repetition, repeated(fed_with), f"fed with the {fed_with}", style)
        for fed_with, style in (("whole", FAILS), ("residual", WORKS))
    ]
    panel = Panel(curves, "RMS error (mrad)", "repetition", (1.0, REPETITIONS), y_scale="log")
    draw(path, "cogging, ten repetitions", MESSAGE, [panel], 1.7)


def repeated(fed_with: str) -> np.ndarray:
    """RMS errors, mrad, on the thesis's axis with cogging of 0.05 N·m and order 126."""
    friction = Model("lugre", sigma0=3.5e4, sigma1=0.1, fs=0.335, fc=0.285, vs=0.01, sigma2=0.018)
    cogging = Harmonics((126.0,), (0.05,), (0.0,))
    machine = Machine("cogging", INERTIA, Contact(friction), cogging=cogging)
    zero = [0.0] * 64
    learner = ControlBlock(
        "learned_feedforward", lower=0.0, upper=0.2, samples=float(SAMPLES), rate=0.8, largest=LARGEST,
        forward=zero, backward=zero,
    )  # fmt: skip
    observer = ControlBlock(
        "disturbance_observer", None, {"fed_with": fed_with}, inertia=INERTIA, corner=200.0
    )
    loop = ControlBlock("pd", kp=6.1, kd=0.097)
    control = Controller(
        loop=loop, sample_time=1e-3, feedforward=learner, observer=observer, torque_limit=1.0
    )
    reference = Reference("sine", amplitude=0.1, frequency=0.4)
    record = simulate(machine, control, reference, 1e-3 * SAMPLES * REPETITIONS, metered=False)
    error = (record["position_reference"] - record["position"])[: SAMPLES * REPETITIONS]
    return 1e3 * np.sqrt(np.mean(error.reshape(REPETITIONS, SAMPLES) ** 2, axis=1))
