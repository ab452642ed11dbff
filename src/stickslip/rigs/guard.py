"""The safety state of the loop by name, and the first reason to stop."""

from __future__ import annotations

import math
from contextlib import suppress

from stickslip.core.errors import (
    DriveFault,
    InputError,
    Interrupted,
    LimitCrossed,
    MeasurementFault,
    RigError,
    StickslipError,
)
from stickslip.core.stream import Stream
from stickslip.rigs.loop_sample import BOUNDS, MEASURED, REMEMBERED, SAFETY, Control
from stickslip.rigs.rig import LIMIT_UNITS, Limits
from stickslip.rigs.safety import (
    AGAINST,
    ASKED,
    CLOCK,
    FROZEN,
    IGNORED,
    LOST,
    NONE,
    OPPOSED,
    REASONS,
    RUNNING,
    STATUS,
    STILL,
    STOPPED,
    STOPPING,
    UNBOUNDED,
    Safety,
)  # fmt: skip

STATE = Safety._fields.index("state")
"""Every sample reads it, and an index takes a quarter of the time of a name."""
EXCHANGE, CONTROLLER = "exchange", "the controller"
"""Calls that may raise"""
KNOWN = ("started", "turns", "position", "velocity", "slow_velocity", "error")
"""State that one controller takes over from another: position and velocities, not the state of its laws"""


class Guard:
    """Safety of the current control.

    Parameters
    ----------
    control : Control

    Attributes
    ----------
    control : Control
    fault : BaseException or None
        The first reason to stop that the sample itself did not detect; at the end the error to report.
    """

    def __init__(self, control: Control) -> None:
        self.fault: BaseException | None = None
        self._source = ""
        self._late = False
        self._name(control)

    def _name(self, control: Control) -> None:
        # Created once, so a failing sample allocates nothing.
        self.control = control
        self._safety = control.safety.view(SAFETY)[0]
        self._measured = control.measured.view(MEASURED)[0]
        self._memory = control.memory.view(REMEMBERED)[0]

    @property
    def state(self) -> float:
        """RUNNING, STOPPING, STOPPED or ENDED (`stickslip.rigs.safety`)."""
        return self.control.safety[STATE]

    @property
    def torque(self) -> float:
        """The last torque command, N·m."""
        return float(self._safety["torque"])

    def take_over(self, control: Control, travel: float) -> None:
        """Continue with another controller from the state at the end of the last segment."""
        last, known = self.control, self._memory
        control.bounds.view(BOUNDS)["travel"] = min(travel, UNBOUNDED)
        control.measured[:] = last.measured
        control.safety[:] = last.safety
        self._name(control)
        if control is not last:
            for name in KNOWN:
                self._memory[name] = known[name]
            self._memory["open"] = 1.0
        self._safety["origin"] = self._measured["position"]
        self._safety["begun"] = 0.0
        if self.fault is None:
            self._safety["state"] = RUNNING

    def forget_speed(self) -> None:
        """Reset the speed between samples, because the axis may have moved meanwhile."""
        self._safety["started"] = self._memory["started"] = 0.0

    def pass_time(self, seconds: float) -> None:
        """Note a sample without a measurement."""
        self._measured["time"] += seconds

    # ---- stopping ------------------------------------------------------------------------------------------

    def ask(self, reason: BaseException, source: str = "") -> None:
        """Start to stop, unless already stopping; the first reason is reported, with the call that raised it."""
        s = self._safety
        if s["state"] == STOPPED or s["reason"] != NONE:
            return
        self.fault, self._source = reason, source
        s["state"], s["reason"] = STOPPING, ASKED

    def cut(self) -> None:
        """End without a ramp: the rig has been closed."""
        self._safety["state"], self._safety["torque"] = STOPPED, 0.0

    def begin_ramp(self) -> bool:
        """Start to ramp the torque down without a fault; return whether there is any."""
        s = self._safety
        if s["torque"] == 0.0 and s["state"] != STOPPING:
            return False
        s["state"] = STOPPING
        return True

    def end_ramp(self) -> bool:
        """Note that the torque is zero; return whether no fault has occurred meanwhile."""
        if self._safety["reason"] != NONE:
            self._safety["state"] = STOPPED
            return False
        self._safety["state"] = RUNNING
        self._memory["open"] = 1.0
        return True

    def at_last(self, fault: BaseException | None) -> None:
        """Note an error after the last sample; leaving the loop reports it, unless there was an earlier one."""
        if fault is None or fault is self.fault:
            return
        if self.fault is None:
            self.fault, self._late = fault, True
        elif isinstance(self.fault, RigError) and isinstance(fault, RigError):
            self.fault.args = (f"{self.fault}; {fault}",)

    def leave_untold(self) -> None:
        """Raise the fault when the loop is left, unless its block raises."""
        self._late = True

    @property
    def untold(self) -> BaseException | None:
        """The error to raise when the loop is left, if it has not been reported."""
        return self.fault if self._late or isinstance(self.fault, Interrupted) else None

    @property
    def ending(self) -> str:
        """Return how the run ended, for its record."""
        if self.fault is None:
            return "as planned"
        known = isinstance(self.fault, StickslipError)
        return str(self.fault) if known else f"{type(self.fault).__name__}: {self.fault}"

    def error(self, rig: str, limits: Limits, stream: Stream) -> BaseException:
        """Return the error to raise when the torque is zero."""
        s = self._safety
        at = float(s["time"])
        if self.fault is None:
            self.fault = crossed(rig, limits, int(s["reason"]), float(s["value"]), int(s["suspect"]), at)
        fault = self.fault = told(rig, self.fault, self._source)
        if isinstance(fault, RigError):
            if math.isnan(fault.time):
                fault.time = at
            if fault.record is None:
                with suppress(MemoryError):
                    fault.record = stream.record()
        return fault


def crossed(rig: str, limits: Limits, reason: int, value: float, suspect: int, at: float) -> RigError:
    """Return the error that the guarded sample detected: the limit, the `value` that crossed it, cause and time."""
    where = f"at t = {at:.3f} s; the torque was ramped to zero"
    name = REASONS[reason]
    if reason == CLOCK:
        return clock_fault(rig, value, f"in one sample {where}")
    if (found := contradiction(limits, reason, value)) is not None:
        what, remedy = found
        return MeasurementFault(f"{rig}: {what} {where}; {remedy}")
    if reason == STATUS:
        shown = f"0x{int(value):04X}" if math.isfinite(value) else f"{value:g}, which is not a number,"
        return DriveFault(f"{rig} reports fault {shown} {where}")
    if limit := limits.text(name):
        return LimitCrossed(
            f"{name} = {value:g} {LIMIT_UNITS[name]} is beyond its limit {limit} {where}{SUSPECTED.get(suspect, '')}"
        )
    if math.isfinite(value):
        return LimitCrossed(f"an input of the controller, or the torque it computed, is {name} {where}")
    return LimitCrossed(f"position or torque is {value:g}, {name}, {where}")


def clock_fault(rig: str, step: float, where: str) -> MeasurementFault:
    """Return the error for a clock that does not advance with the samples."""
    return MeasurementFault(
        f"{rig}: its time changes by {step:.6g} s {where}; it must increase by the sample time in every sample; "
        "correct the rig's clock"
    )


WIRING = "check the current loop, the sign and the torque constant; a rig that measures no torque returns NaN"
SUSPECTED = {
    IGNORED: f"; before, the measured torque did not follow the command: {WIRING}",
    AGAINST: "; before, the axis accelerated against the torque: check signs and delays of position and torque",
}
"""Possible causes of a crossed limit"""


def contradiction(limits: Limits, reason: int, value: float) -> tuple[str, str] | None:
    """Return the fault in a rig's answers (`stickslip.rigs.safety`) and its remedy; None for other reasons."""
    waited = f"for {limits.answer_time:g} s (limit answer_time)"
    found = {
        STILL: (
            f"the position has not changed {waited} under {value:.4g} N·m, which must move the axis",
            "check encoder, brake and end stops; if the axis may stand still under this torque, "
            "increase standstill_torque in [rig.limits]",
        ),
        FROZEN: (
            f"no reading has changed {waited} while the torque command did",
            "check the connection: the rig repeats an old measurement",
        ),
        IGNORED: (
            f"the measured torque, {value:.4g} N·m on average, does not follow the command {waited}",
            WIRING,
        ),
        LOST: (
            f"the {'torque sensor' if value else 'motor torque'} has been NaN {waited} after it was measured",
            "check the sensor and its connection",
        ),
        OPPOSED: (
            f"the torque sensor reads {value:.4g} N·m against the torque with which the motor drives the axis",
            "check whether its reading is frozen; otherwise invert its sign",
        ),
    }
    return found.get(reason)


def told(rig: str, fault: BaseException, source: str) -> BaseException:
    """Return the error for an exception that stopped a run; errors of rigs and users, and the user's exits, are
    unchanged.

    A rig that exits (`SystemExit`, `KeyboardInterrupt`) has failed; signals are handled by the loop itself.
    """
    if isinstance(fault, (RigError, InputError)) or not (isinstance(fault, Exception) or source == EXCHANGE):
        return fault
    raised = f"{source or 'the loop'} raised {type(fault).__name__}: {fault}".rstrip(": ")
    error = RigError(f"{rig}: {raised}; the torque was ramped to zero")
    error.__cause__ = fault
    return error
