"""The guarded sample: limits, reasons, the ramp; compiled and in plain Python alike."""

from __future__ import annotations

import math
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stickslip.control.compensator import Feedback
from stickslip.control.composition import Settings
from stickslip.control.controller import Controller
from stickslip.control.linear import pd, pid
from stickslip.core.spec import Surroundings
from stickslip.models.model import Model
from stickslip.rigs import safety
from stickslip.rigs.loop_sample import COLUMNS, NAMES, control_of, decide, finished
from stickslip.rigs.rig import Limits, Measurement, Setpoint
from stickslip.rigs.safety import REASONS, RUNNING, STOPPED, guarded_by

T = 1e-3
TIME = safety.Safety._fields.index("time")
LIMITS = Limits(
    torque=1.0, speed=50.0, position=(-2.0, 2.0), temperature=80.0, following_error=0.5, stop_time=0.02
)
GOOD = Measurement(0.0, 0.1, 0.2, 0.2, 25.0, 0.0)
UNMEASURED = GOOD._replace(torque=math.nan)
HOLD = Setpoint(position=0.1, closed=1.0)
PD = Controller(pd(19.8, 0.17), torque_limit=1.0, sample_time=T)


def run(control, y: Measurement, w: Setpoint):
    control.measured[:] = y
    control.measured[0] = T + control.safety[TIME] if y.time == GOOD.time else y.time  # each call is a sample
    row = np.zeros(len(COLUMNS))
    return decide(control, np.array(w), row), dict(zip(COLUMNS, row))


CROSSINGS = [
    ("position", GOOD._replace(position=2.1), Setpoint(position=2.1, closed=1.0)),
    ("speed", GOOD._replace(position=0.2), HOLD._replace(position=0.2)),
    ("torque", GOOD._replace(torque=1.3), HOLD),
    ("torque", GOOD._replace(sensor=-1.3), HOLD),
    ("torque", GOOD, Setpoint(torque=-1.01)),
    ("temperature", GOOD._replace(temperature=80.1), HOLD),
    ("temperature", GOOD._replace(temperature=math.nan), HOLD),
    ("following error", GOOD, HOLD._replace(position=0.61)),
    ("following error", GOOD, HOLD._replace(position=math.nan)),
    ("not a number", GOOD._replace(position=math.nan), HOLD),
    ("not a number", GOOD, Setpoint(torque=math.nan)),
    ("not a number", GOOD, HOLD._replace(velocity=math.nan)),
    ("the rig's fault", GOOD._replace(status=0x7500), HOLD),
    ("the rig's fault", GOOD._replace(status=math.nan), HOLD),
]


@pytest.mark.parametrize(("reason", "y", "w"), CROSSINGS)
@pytest.mark.parametrize("held", [0.9, -0.9, 0.0, 1.0])
def test_every_limit_ramps_to_zero_within_the_declared_time(reason, y, w, held):
    control = control_of(PD, LIMITS, T)
    torque, _ = run(control, GOOD, Setpoint(torque=held))
    assert torque == held
    sent = []
    torque, row = run(control, y, w)
    sent.append(torque)
    assert REASONS[int(row["reason"])] == reason
    while not finished(control):
        # Nothing that comes later prolongs the ramp, nor changes its reason.
        torque, row = run(control, y._replace(position=math.nan), Setpoint(torque=math.inf))
        sent.append(torque)
        assert len(sent) < 100
    assert REASONS[int(row["reason"])] == reason
    assert sent[-1] == 0.0
    # The last command that is not zero is followed by zero within the declared time.
    assert (len(sent) - 1) * T <= LIMITS.stop_time - T + 1e-12
    steps = np.abs(np.diff([held, *sent]))
    assert steps.max(initial=0.0) <= LIMITS.torque / 20 * (1 + 1e-6)
    assert all(abs(b) <= abs(a) for a, b in zip([held, *sent], sent, strict=False))
    assert run(control, GOOD, HOLD)[0] == 0.0, "a stopped loop stays stopped"


def test_within_the_limits_the_controller_has_its_way():
    control = control_of(PD, LIMITS, T)
    rng = np.random.default_rng(1)
    position = 0.1
    for _ in range(500):
        position += 1e-4 * rng.standard_normal()
        torque, row = run(control, GOOD._replace(position=position), HOLD)
        assert row["state"] == RUNNING
        assert abs(torque) <= 1.0
    assert abs(torque) > 0.0


@settings(max_examples=60)
@given(st.data())
def test_compiled_and_plain_python_agree_bit_for_bit(data):
    """The kernel is the text: the same samples, whatever they are, give the same commands."""
    friction = Model("dahl", sigma0=3.5e4, fc=0.285)
    helper = data.draw(st.sampled_from([None, Feedback(friction), Feedback(friction, filter_hz=10.0)]))
    controller = Controller(pd(5.0, 0.05), helper, torque_limit=0.9, sample_time=T)
    control = control_of(controller, LIMITS, T)
    composed = controller
    sample = guarded_by(composed.functions)

    def fields(names, values):
        return SimpleNamespace(**dict(zip(names, map(float, values))))

    b, s = fields(safety.Bounds._fields, control.bounds), fields(safety.Safety._fields, control.safety)
    n, m = fields(Settings._fields, control.settings), fields(NAMES, control.memory)
    z, p = composed.state(), composed.parameters
    u = SimpleNamespace(**Surroundings()._asdict())
    small = st.floats(-0.2, 0.2)
    count = data.draw(st.integers(1, 30))
    position = 0.0
    for k in range(count):
        position += data.draw(small) * 0.1
        y = GOOD._replace(time=(k + 1) * T, position=position, torque=data.draw(st.floats(-1.4, 1.4)))
        w = Setpoint(
            data.draw(small), data.draw(small), data.draw(small), data.draw(st.sampled_from([0.0, 1.0]))
        )
        plain = sample(
            SimpleNamespace(**y._asdict()),
            SimpleNamespace(**w._asdict()),
            b,
            s,
            n,
            m,
            z,
            p,
            u,
        )
        torque, row = run(control, y, w)
        assert torque == plain
        assert row["state"] == s.state
        assert row["reason"] == s.reason


def takes_over(controller, last: float, own: float, before: Setpoint) -> tuple[list[float], list[float]]:
    """Torques of a controller that closes the loop at a step of 0.02 rad, and those it gives where none was before."""
    taking, alone = control_of(controller, LIMITS, T), control_of(controller, LIMITS, T)
    alone.memory[NAMES.index("open")] = 0.0
    run(taking, UNMEASURED, before._replace(torque=last))
    closed = HOLD._replace(position=0.12, torque=own)
    return [run(taking, UNMEASURED, closed)[0] for _ in range(150)], [
        run(alone, UNMEASURED, closed)[0] for _ in range(150)
    ]


@pytest.mark.parametrize("last", [0.0, 0.3, -0.6])
@pytest.mark.parametrize("own", [0.0, 0.1])
def test_a_controller_begins_at_the_last_command_and_only_the_difference_fades(last, own):
    taken, alone = takes_over(PD, last, own, Setpoint())
    assert abs(alone[0] - last) > 0.05
    left = (np.array(taken) - alone) / (last - alone[0])
    assert taken[0] == pytest.approx(last, abs=1e-12)
    assert left[:100] == pytest.approx(1.0 - np.arange(100) / 100, abs=1e-9)
    assert left[101:] == pytest.approx(0.0, abs=1e-12)


def test_an_integral_takes_over_whole():
    taken, _ = takes_over(Controller(pid(19.8, 100.0, 0.17), torque_limit=1.0), -0.2, 0.0, Setpoint())
    assert taken[0] == pytest.approx(-0.2, abs=1e-12)
    assert np.diff(taken) == pytest.approx(np.full(149, 100.0 * 0.02 * T), abs=1e-9)


@pytest.mark.parametrize("closed", [0.0, 1.0])
def test_torques_of_a_procedure_are_never_altered(closed):
    """No controller: what the setpoints give is commanded, bit for bit, closed or open."""
    control = control_of(None, LIMITS, T)
    for torque in (0.3, -0.5, 0.0, 0.7, 0.7, -0.1):
        assert run(control, GOOD, HOLD._replace(torque=torque, closed=closed))[0] == torque


def test_a_segment_ends_at_its_travel_without_a_fault():
    control = control_of(None, LIMITS, T, travel=0.05)
    for position in (0.1, 0.13, 0.149):
        assert run(control, GOOD._replace(position=position), Setpoint(torque=0.3))[0] == 0.3
        assert not finished(control)
    torque, row = run(control, GOOD._replace(position=0.151), Setpoint(torque=0.3))
    assert torque == 0.3
    assert finished(control)
    assert row["state"] != STOPPED
    assert row["reason"] == 0.0
