"""From an identified model to a setting that is safe to switch on: by simulating the axes that the data allow.

A compensator that gives more than the friction there is pushes the axis: around rest it limit-cycles (thesis 3.2.3).
The true friction is unknown but for the model's intervals, so every candidate (law, feedforward or feedback, gain) is
run on axes drawn from them, along a slow sinusoid and to a stop, as a drive runs it: sampled, counted, held, limited.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass, field, replace
from typing import Any

import numpy as np

from stickslip.control.compensators.feedback import Feedback
from stickslip.control.compensators.feedforward import Feedforward
from stickslip.control.controller import Controller
from stickslip.control.linear import place
from stickslip.errors import InputError, ParameterError, SimulationError
from stickslip.identify.draws import draw_models, sliding_torque
from stickslip.identify.identified_file import Identified
from stickslip.machines.rigid import RigidAxis
from stickslip.model import Model, Reference
from stickslip.simulation.closed_loop import simulate

__all__ = ["Candidate", "Drive", "Recommendation", "recommend"]

GAINS = (0.5, 0.7, 0.8, 0.9, 1.0)
BEYOND = (1.1, 1.25, 1.5)
"""Gains above 1, for the margin only."""
KINDS = {"feedforward": Feedforward, "feedback": Feedback}
BUSY = 1.0
"""Reversals per second beyond those of the linear controller alone from which an axis hunts."""
LIVELIER, ROUGH = 3.0, 0.1
"""Rough is a velocity above 50 Hz beyond so many times the linear controller's and this part of the reference's RMS."""
WORTH = 0.95
"""A compensator that leaves more than this part of the error is not worth its risk."""
NEAR = 1.1
"""Errors within this factor of the best are alike; the lower gain is then taken."""


@dataclass(frozen=True)
class Drive:
    """The drive that will run it, and the motion that matters.

    Attributes
    ----------
    bandwidth, damping : float
        Of the position loop's poles, Hz and -; the PD is placed with the model's inertia.
    sample_time : float
        s
    encoder_counts : float
        Per revolution (2 pi); 0 measures exactly.
    torque_limit : float
        N·m
    amplitude, frequency : float
        Of the slow sinusoid, rad and Hz; the way to the stop has the length of the amplitude.
    """

    bandwidth: float = 10.0
    damping: float = 1.0
    sample_time: float = 1e-3
    encoder_counts: float = 0.0
    torque_limit: float = math.inf
    amplitude: float = 0.1
    frequency: float = 0.5

    def __post_init__(self) -> None:
        for name in ("bandwidth", "damping", "sample_time", "torque_limit", "amplitude", "frequency"):
            if not getattr(self, name) > 0.0:
                raise ParameterError(f"drive: {name} = {getattr(self, name):g} must be greater than 0")
        if self.bandwidth * self.sample_time > 0.1:
            raise ParameterError(
                f"drive: bandwidth = {self.bandwidth:g} Hz is more than a tenth of the sample rate "
                f"{1.0 / self.sample_time:g} Hz; take a lower one, or a shorter sample time"
            )


@dataclass(frozen=True)
class Candidate:
    """One setting and what it did on every axis.

    Attributes
    ----------
    law, kind : str
    gain : float
    errors : tuple of float
        RMS position error along the sinusoid over that of the linear controller alone, one per axis; the best
        estimate first. The first axis on which it is not safe is the last.
    unsafe : tuple of str
        Why it is not safe to switch on; empty where it is.
    """

    law: str
    kind: str
    gain: float
    errors: tuple[float, ...]
    unsafe: tuple[str, ...]

    @property
    def worst(self) -> float:
        """The greatest remaining part of the error."""
        return max(self.errors)


@dataclass(frozen=True, eq=False)
class Recommendation:
    """What to switch on.

    Attributes
    ----------
    chosen : Candidate or None
        None: switch no compensator on.
    model : Model or None
        The law to run, with its parameters.
    gains : mapping
        Of the PD.
    linear_error : float
        RMS error of the linear controller alone on the best estimate, rad.
    margin : float
        Lowest gain tried at which some axis is no longer safe, over the chosen one; infinite where none was found.
    lead : float
        s, by which the feedforward looks ahead of the reference.
    deadband : float
        rad/s, below which a feedback's velocity counts as zero.
    candidates : tuple of Candidate
    axes : int
        How many were simulated.
    notes : tuple of str
    """

    chosen: Candidate | None
    model: Model | None
    gains: dict[str, float]
    linear_error: float
    margin: float
    lead: float
    deadband: float
    candidates: tuple[Candidate, ...]
    axes: int
    notes: tuple[str, ...] = ()
    drive: Drive = field(default_factory=Drive)

    def as_dict(self) -> dict[str, Any]:
        """Plain data."""
        return {
            "chosen": asdict(self.chosen) if self.chosen else None,
            "model": self.model.as_dict() if self.model else None, "gains": self.gains,
            "linear_error_rms": self.linear_error, "margin": self.margin, "lead_s": self.lead,
            "deadband": self.deadband, "axes": self.axes, "notes": list(self.notes), "drive": asdict(self.drive),
            "candidates": [asdict(c) for c in self.candidates],
        }  # fmt: skip


@dataclass(frozen=True, eq=False)
class Trial:
    """Metrics of one axis under one controller: along the sinusoid, and to a stop."""

    moving: dict[str, float]
    stopping: dict[str, float]


def recommend(
    found: Identified, drive: Drive, *, inertia: float | None = None, axes: int = 6, seed: int = 0,
    progress: Callable[[int, int], None] = lambda done, of: None,
) -> Recommendation:  # fmt: skip
    """Choose law, structure and gain.

    Parameters
    ----------
    found : Identified
    drive : Drive
    inertia : float, optional
        kg·m², where the model has none.
    axes : int
        Besides the best estimate, drawn from the model's intervals.
    seed : int
        Of the draws.
    progress : callable
        Called with the runs that are done and all of them.

    Returns
    -------
    Recommendation

    Raises
    ------
    InputError
        If there is no inertia, or the linear controller alone cannot be simulated.
    """
    j = inertia if inertia is not None else found.axis.get("inertia")
    if j is None or not float(j) > 0.0:
        raise InputError(f"{found.path} holds no inertia; give --inertia in {found.unit('kg·m²')}")
    plants = list(plants_of(found, float(j), axes, seed))
    linear = Controller(
        place("PD", float(j), drive.bandwidth, drive.damping), None, drive.torque_limit, drive.sample_time,
        drive.encoder_counts,
    )  # fmt: skip
    laws = laws_of(found.model)
    total, done = 1 + 2 * len(laws) * len(GAINS) + len(BEYOND), 0
    alone = [run(p, linear, drive) for p in plants]
    if isinstance(alone[0], str):
        raise InputError(f"the linear controller alone: {alone[0]}")
    candidates: list[Candidate] = []
    for name, model in laws.items():
        for kind in KINDS:
            for gain in GAINS:
                candidates.append(judged(name, model, kind, gain, plants, alone, linear, drive))
                done += 1
                progress(done, total)
    chosen = chosen_of(candidates)
    margin = math.inf
    if chosen:
        higher = [
            c for c in candidates if (c.law, c.kind) == (chosen.law, chosen.kind) and c.gain > chosen.gain
        ]
        for gain in BEYOND:
            higher.append(
                judged(chosen.law, laws[chosen.law], chosen.kind, gain, plants, alone, linear, drive)
            )
            candidates.append(higher[-1])
        margin = min((c.gain / chosen.gain for c in higher if c.unsafe), default=math.inf)
    progress(total, total)
    resolution = 2.0 * math.pi / drive.encoder_counts / drive.sample_time if drive.encoder_counts else 0.0
    return Recommendation(
        chosen, laws[chosen.law] if chosen else None, dict(linear.gains._asdict()), alone[0].moving["position_rms_rad"],
        margin, 0.5 * drive.sample_time if chosen and chosen.kind == "feedforward" else 0.0,
        resolution if chosen and chosen.kind == "feedback" else 0.0, tuple(candidates), len(plants),
        tuple(notes_on(found, chosen, candidates, drive)), drive,
    )  # fmt: skip


def plants_of(found: Identified, inertia: float, count: int, seed: int) -> Iterator[RigidAxis]:
    """The best estimate, and axes drawn from the intervals."""
    yield RigidAxis(inertia, found.model)
    for model, named in draw_models(found.model, found.estimates, found.correlation, count, seed):
        yield RigidAxis(named.get("inertia", inertia), model)


def laws_of(model: Model) -> dict[str, Model]:
    """The law itself, and Coulomb with viscous friction through its sliding curve: what every drive can run."""
    laws = {model.law.name: model}
    if model.law.name == "coulomb" or not model.law.steady:
        return laws
    scale = float(model.law.velocity_scale(model.parameters)) if model.law.velocity_scale else 0.1
    # Beyond the Stribeck effect, which Coulomb's law does not have.
    v = np.linspace(5.0, 50.0, 20) * scale
    slope, level = (float(x) for x in np.polyfit(v, sliding_torque(model, v), 1))
    if level > 0.0:
        laws["coulomb"] = Model("coulomb", fc=level, sigma2=max(slope, 0.0))
    return laws


def run(plant: RigidAxis, controller: Controller, drive: Drive) -> Trial | str:
    """Both motions; the reason where one cannot be run to its end."""
    way, speed = drive.amplitude, 2.0 * math.pi * drive.amplitude * drive.frequency
    slow = Reference("sine", amplitude=drive.amplitude, frequency=drive.frequency)
    stop = Reference("scurve", distance=way, velocity=speed, acceleration=10.0 * speed, jerk=400.0 * speed)
    travel = way / speed + 0.2
    try:
        out = [
            dict(simulate(plant, controller, reference, duration, time_step=min(5e-4, drive.sample_time), output=0.01)
                 .meta["metrics"])
            for reference, duration in ((slow, 2.0 / drive.frequency), (stop, 2.0 * travel + 1.0))
        ]  # fmt: skip
    except SimulationError as error:
        return str(error)
    return Trial(*out)


def judged(
    name: str, model: Model, kind: str, gain: float, plants: Sequence[RigidAxis], alone: Sequence[Trial | str],
    linear: Controller, drive: Drive,
) -> Candidate:  # fmt: skip
    """One setting on every axis, up to the first on which it is not safe."""
    controller = replace(linear, compensator=KINDS[kind](model, gain))
    errors: list[float] = []
    unsafe: list[str] = []
    for plant, before in zip(plants, alone, strict=True):
        if unsafe:
            break
        after = run(plant, controller, drive)
        if isinstance(after, str) or isinstance(before, str):
            errors.append(math.inf)
            unsafe.append(after if isinstance(after, str) else "the linear controller alone fails")
            continue
        errors.append(after.moving["position_rms_rad"] / before.moving["position_rms_rad"])
        unsafe += dangers(before, after, drive)
    return Candidate(name, kind, gain, tuple(errors), tuple(dict.fromkeys(unsafe)))


def dangers(before: Trial, after: Trial, drive: Drive) -> Iterator[str]:
    """What a compensator makes worse than the linear controller alone."""
    if after.stopping["second_half_reversals_per_s"] > before.stopping["second_half_reversals_per_s"] + BUSY:
        yield "limit cycle at rest"
    name = "reversals_beyond_reference_per_s"
    if after.moving[name] > max(before.moving[name], 0.0) + BUSY:
        yield "oscillates in motion"
    rough = "velocity_above_50Hz_rms_rad_s"
    speed = 2.0 * math.pi * drive.frequency * drive.amplitude / math.sqrt(2.0)
    if after.moving[rough] > max(LIVELIER * before.moving[rough], ROUGH * speed):
        yield "rough motion"
    if after.moving["position_rms_rad"] > before.moving["position_rms_rad"]:
        yield "a larger error than without it"


def chosen_of(candidates: Sequence[Candidate]) -> Candidate | None:
    """The safe candidate with the least worst error; among those alike the lowest gain, feedforward first."""
    safe = [c for c in candidates if not c.unsafe and c.worst <= WORTH]
    if not safe:
        return None
    least = min(c.worst for c in safe)
    return min(
        (c for c in safe if c.worst <= NEAR * least), key=lambda c: (c.kind == "feedback", c.gain, c.worst)
    )


def notes_on(
    found: Identified, chosen: Candidate | None, candidates: Sequence[Candidate], drive: Drive
) -> Iterator[str]:  # fmt: skip
    """What the user must know."""
    unknown = [e.name for e in found.estimates if not e.identified]
    if not found.estimates:
        yield "The model has no intervals: only its best estimate was simulated, and nothing is said about its error."
    elif unknown:
        yield f"Not identified: {', '.join(unknown)}; the axes drawn cover at most a factor of 9 to each side for them."
    if chosen is None:
        reasons = sorted({r for c in candidates for r in c.unsafe}) or ["none reduces the error by 5 %"]
        yield f"No compensator is recommended: {', '.join(reasons)}."
        return
    stiffer = [c for c in candidates if c.kind == "feedback" and c.gain == 1.0 and c.unsafe]
    if stiffer:
        yield f"Feedback at gain 1 is not safe: {', '.join(stiffer[0].unsafe)}."
    if chosen.kind == "feedforward":
        yield "The lead is half a sample, by which the held torque lags; it was computed, not simulated."
    elif drive.encoder_counts:
        yield (
            "The deadband is one count per sample, the least speed the encoder tells; it was computed, not simulated."
        )
    if abs(float(found.axis.get("offset", 0.0))) > 0.0:
        offset = f"{float(found.axis['offset']):.4g} {found.unit('N·m')}"
        yield f"A constant torque of {offset} acts beside friction and was left out here: feed it forward too."
    yield "Simulated with a rigid axis: resonances and delays of the drive beyond one sample are not in it."
