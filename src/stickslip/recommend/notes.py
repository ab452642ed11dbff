"""What the user must know beside a recommended setting."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from stickslip.control.linear import Cascade
from stickslip.identify.identified_file import Identified
from stickslip.machines.machine import Machine
from stickslip.machines.rigid import RigidAxis
from stickslip.recommend.candidate_run import Drive, Trial
from stickslip.recommend.candidates import Bench, Candidate, resistance

MOSTLY = 0.8
"""Part of the error from which on a lag is most of it."""
ALLOWANCE, BETTER = 1.4, 2.0
"""Factors on the error left, upwards and downwards, for resonances, backlash, cogging and the like, which a machine has
or has not: so the promise held in `benchmarks/promise.py`."""


def axes_left_out(bench: Bench, others: Bench, found: Identified) -> Iterator[str]:
    """Of the axes that the intervals allow, those that the user's own loop would not hold."""
    count = bench.left_out + others.left_out
    if count:
        held = len(bench.plants) + len(others.plants) - 2
        unsure = [e.name for e in found.estimates if not e.identified]
        why = f" (not identified: {', '.join(unsure)})" if unsure else ""
        yield (
            f"{count} of {count + held} axes sampled from the intervals{why} were left out: this loop alone does not "
            "hold them, and is taken to hold the machine."
        )


def lag_of(alone: Trial, drive: Drive) -> Iterator[str]:
    """Whether most of the error is the lag of a cascade without velocity feedforward, which no friction makes."""
    gains = (drive.controller or drive).gains
    if not isinstance(gains, Cascade) or gains.feed >= 1.0:
        return
    lag = (1.0 - gains.feed) / gains.kv * alone.moving["speed_rms_rad_s"]
    if lag > MOSTLY * alone.moving["position_rms_rad"]:
        yield (
            f"Most of the error is no friction's: without velocity feedforward (feed = {gains.feed:g}) the "
            "position lags behind by the velocity over kv; feed the velocity forward first."
        )


def weak_on(plants: Sequence[RigidAxis], drive: Drive) -> str:
    """On how many axes the friction is above the torque limit; empty where on none."""
    count = sum(resistance(plant.friction, drive) >= drive.torque_limit for plant in plants)
    return f"{count} of {len(plants)}" if count else ""


def notes_on(
    found: Identified,
    chosen: Candidate | None,
    candidates: Sequence[Candidate],
    weak: str = "",
    machine: Machine | None = None,
) -> Iterator[str]:
    """What the user must know."""
    if weak:
        limit = "the torque limit of the drive lies below their friction"
        yield f"On {weak} axes {limit}, though not below that of the best estimate: they do not follow."
    if float(found.axis.get("gravity", 0.0) or 0.0):
        yield (
            "The pendulum's weight is not part of the setting: the error that it makes is in the numbers above. Less "
            "is left once gravity sin(q - gravity_angle) of the model is added to the drive's torque."
        )
    unknown = [e.name for e in found.estimates if not e.identified]
    if not found.law_estimates[0]:
        yield "The law has no intervals: only its best estimate was simulated, and nothing is said about its error."
    elif unknown:
        static = ", fs up to twice fc" if any(n.startswith("fs") for n in unknown) else ""
        if any(n.startswith("sigma2") for n in unknown):
            static += ", sigma2 down to none, and it is fed forward at the lower end of its interval"
        yield (
            f"Not identified: {', '.join(unknown)}; the sampled axes cover at most a factor of 9 to each side for them"
            f"{static}."
        )
    if chosen is None:
        reasons = sorted({r for c in candidates for r in c.refused}) or ["none reduces the error by 5 %"]
        yield f"No compensator is recommended: {', '.join(reasons)}."
        # Of those that go beyond the best estimate, which is simulated first.
        left = [c.errors[0] for c in candidates if len(c.errors) > 1 and c.errors[0] < 1.0]
        if unknown and left:
            yield (
                f"On the best estimate {100.0 * min(left):.0f} % of the error would be left; other axes that the "
                f"record allows decide, since it does not tell {', '.join(unknown)}: what to record for them stands in "
                "the model file (measure_next)."
            )
        return
    stiffer = [c for c in candidates if c.setting.kind == "feedback" and c.setting.gain == 1.0 and c.unsafe]
    if stiffer:
        yield f"Feedback at gain 1 is not safe: {', '.join(stiffer[0].unsafe)}."
    if abs(float(found.axis.get("offset", 0.0))) > 0.0:
        offset = f"{float(found.axis['offset']):.4g} {found.unit('N·m')}"
        yield (
            f"A constant torque of {offset} acts in addition to friction: it is part of what is recommended, "
            "simulated and "
            "exported."
        )
    simulated = (
        "Simulated with a rigid axis, a current loop, up to a sample of delay, friction that comes late as "
        "behind an elastic drivetrain, and torques over the position as large as the model's misfit; resonances, "
        "backlash and noise in the current are not in it (in place of noise a feedback is pushed at rest): for them"
    )
    if machine is not None:
        simulated = (
            f"Simulated on the machine {machine.name}, with its resonances, delay, amplifier, encoder and noise, and "
            "friction that comes late as behind backlash; what the machine's file leaves out is not in it: for that"
        )
    yield (
        f"{simulated} the interval takes the error left as up to {ALLOWANCE:g} times as large and down to {BETTER:g} "
        "times as small."
    )
