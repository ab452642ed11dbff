"""The loop: in every sample compute a torque from setpoints and a controller, check limits, and record.

    with Loop(rig, path="run.stream") as loop:
        rows = loop.run(setpoints(1000, position=0.0, closed=1.0), controller)

It runs in real time, or as fast as possible if the rig's clock is not real. Whatever happens (a limit, an exception in
a controller or in the rig, a signal, a lost message, a full disk), the torque is ramped to zero within the rig's
declared time, the record is completed, the rig is closed, and one error states the reason.
"""

from __future__ import annotations

import math
import os
import sys
import threading
import time
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, suppress
from typing import Any, TypeVar, cast

import numpy as np

from stickslip.control.controller import Controller
from stickslip.core.errors import InputError, MessageLost, Overrun, RigError
from stickslip.core.messages import name_option
from stickslip.core.record import Record
from stickslip.core.stream import Stream
from stickslip.rigs.budget import BUDGET, Budget, Watch
from stickslip.rigs.declared import FIELDS, answer, blamed, checked, last_resort
from stickslip.rigs.guard import CONTROLLER, EXCHANGE, Guard, clock_fault
from stickslip.rigs.interrupts import Signals
from stickslip.rigs.loop_sample import COLUMNS, UNITS, Control, control_of
from stickslip.rigs.realtime import TIMES, Account, Pace, soft_real_time
from stickslip.rigs.rig import BlockRig, Limits, Measurement, Rig, Setpoint, insist_on_setpoints, setpoints
from stickslip.rigs.safety import RATE, STOPPED, STOPPING
from stickslip.rigs.step import Step

Array = np.ndarray[Any, np.dtype[np.float64]]
Result = TypeVar("Result")
PythonController = Callable[[Measurement, Setpoint], float]
"""A controller in Python: returns the torque, N·m, from measurement and setpoint, sample by sample."""

TORQUE, TIME = Setpoint._fields.index("torque"), Measurement._fields.index("time")
CLOSING, ABANDONED = 10.0, 1.0
"""Time that a rig may take to close, s: at the end, and from another thread while its exchange does not return"""
BLOCK = 50
"""Samples of one compiled block: signals are checked and rows committed after each block"""


class Loop:
    """Runs a rig; a context manager that arms it and disarms it at the end.

    Parameters
    ----------
    rig : Rig
    path : path or None
        File of the record (`stickslip.core.stream`), which must not exist yet; None keeps it in memory.
    meta : mapping
        Entries for the record's meta.
    limits : Limits or None
        Tighter limits than the rig's.
    realtime : bool or None
        Run in real time. None: if the rig's clock is real, which requires it.
    without_watchdog : bool
        Arm a rig without a watchdog: nothing removes its torque if this process dies.
    budget : float
        Delay behind the clock at which a Python controller stops the loop, s; only in real time.

    Raises
    ------
    InputError
        If the limits are wider than the rig's, it declares no watchdog, or the budget is invalid.
    RigError
        From `run` and on entry: a failure of the rig or of the record.
    """

    def __init__(
        self,
        rig: Rig,
        *,
        path: str | os.PathLike[str] | None = None,
        meta: Mapping[str, Any] | None = None,
        limits: Limits | None = None,
        realtime: bool | None = None,
        without_watchdog: bool = False,
        budget: float = BUDGET,
    ) -> None:
        self.rig = checked(rig)
        self.limits = rig.limits.narrowed(limits) if limits else rig.limits
        self.realtime = rig.capabilities.real_clock if realtime is None else realtime
        if rig.capabilities.real_clock and not self.realtime:
            raise InputError(f"{rig.name}: its clock is real; it cannot run as fast as it can")
        if rig.capabilities.watchdog is None and not without_watchdog:
            raise InputError(
                f"{rig.name}: no watchdog is declared, so nothing removes its torque if this process dies; "
                f"give it one, or arm it with {name_option('without_watchdog', True)}"
            )
        if not budget > 0.0:
            raise InputError(f"budget = {budget:g} s must be greater than 0")
        self._budget = budget
        self._pace = Pace(rig.sample_time)
        self._stream: Stream | None = None
        self._path, self._meta = path, dict(meta or {})
        self._controls: dict[int, tuple[Any, Control]] = {}
        self._guard = Guard(self.prepare(None))
        self._signals = Signals()
        self._undo = ExitStack()
        self._scratch = np.zeros(len(COLUMNS))
        self._setpoint = np.zeros(len(Setpoint._fields))
        self._step = Step(self._guard.control)
        self._watch = Watch()
        self._exchange: Callable[[float], Any] = self.rig.exchange
        self._answered = True

    # ---- arming and disarming ------------------------------------------------------------------------------

    def __enter__(self) -> Loop:
        with ExitStack() as undo:
            self._signals.hear(undo)
            self._step.rehearse()  # compiles the functions of the loop before anything moves
            if self.realtime:
                self._pace.granted = undo.enter_context(soft_real_time())
            # The record's thread inherits this one's priority: it keeps the interpreter's lock for some µs.
            self._stream = Stream(
                UNITS, self._path, self._described(), self._absent(), paced=self.realtime, batch=BLOCK
            )
            undo.callback(self._end_record)
            self._watch = Watch()
            undo.enter_context(self._watch.running())
            undo.callback(self._disarm)
            if self.realtime and math.isfinite(self.limits.answer_time):
                self._exchange = self._watched(undo)
            with self._signals.at_once():
                self._guard.control.measured[:] = answer(self.rig, "open", self.rig.open)
            self._undo = undo.pop_all()
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, _: object) -> None:
        with self._undo:
            self._guard.at_last(error)
            try:
                self._ramp_down()
            except (RigError, InputError):
                self._guard.leave_untold()
            self._hear()  # a signal between two runs
        self._hear()  # or during closing of the record
        if kind is None and (fault := self._guard.untold) is not None:
            raise fault

    def _hear(self) -> None:
        if self._signals.number and self._guard.fault is None:
            self._guard.fault = self._signals.error

    def _disarm(self) -> None:
        budget = Budget(0.0, CLOSING, self._unclosed, self._abandon)
        try:
            with self._watch.over(budget), self._signals.at_the_second(), blamed(self.rig, "close"):
                budget.call(self.rig.close)
        except (RigError, InputError) as error:
            self._guard.at_last(error)

    def _unclosed(self, took: float) -> RigError:
        return MessageLost(
            f"{self.rig.name}: close has not returned for {took:.3g} s; its torque command was zero, and "
            f"{last_resort(self.rig)}"
        )

    def _watched(self, undo: ExitStack) -> Callable[[float], Any]:
        """`Rig.exchange`, watched."""
        budget = Budget(
            (1.0 + RATE) * self.rig.sample_time, self.limits.answer_time, self._unanswered, self._give_up,
            lenient=not self.rig.capabilities.real_clock,
        )  # fmt: skip
        undo.enter_context(self._watch.over(budget))
        return lambda torque: budget.call(self.rig.exchange, torque)

    def _unanswered(self, took: float) -> RigError:
        return MessageLost(
            f"{self.rig.name}: exchange took {1e3 * took:.3g} ms in a sample of {1e3 * self.rig.sample_time:.3g} ms, "
            f"at a command of {self._guard.torque:.4g} N·m, and is more than its answer_time of "
            f"{1e3 * self.limits.answer_time:.3g} ms behind the clock; check the connection, or increase "
            "answer_time in [rig.limits]"
        )

    def _give_up(self, error: RigError) -> None:
        """Close the rig while its exchange does not return, because no ramp can be sent through it."""
        self._guard.ask(error)
        self._guard.cut()
        closing = threading.Thread(target=self._close_quietly, name="close", daemon=True)
        closing.start()
        closing.join(ABANDONED)
        closed = "the rig was closed meanwhile" + (
            ", but close has not returned either" if closing.is_alive() else ""
        )
        error.args = (f"{error}; {closed}; if its torque still acts, {last_resort(self.rig)}",)
        self._answered = True  # reported
        self._abandon(error)

    def _close_quietly(self) -> None:
        with suppress(Exception):  # closed once more at the end, where its errors are reported
            self.rig.close()

    def _abandon(self, error: RigError) -> None:
        """Abandon a call of the rig that does not return; report it if that is impossible."""
        self._signals.release()
        if not self._signals.interrupt(error):
            print(f"stickslip: {error}", file=sys.stderr, flush=True)

    def _described(self) -> dict[str, Any]:
        plain = self.limits.plain()
        return {"rig": self.rig.name, "sample_time": self.rig.sample_time, "limits": plain, **self._meta}

    def _absent(self) -> list[str]:
        able = self.rig.capabilities
        lacks = {"sensor_torque": not able.torque_sensor, "temperature": not able.temperature}
        return [name for name, missing in lacks.items() if missing]

    def _end_record(self) -> None:
        if self._stream is not None:
            self._stream.close({"loop": self.account().plain(), "ended": self._guard.ending})
            self._guard.at_last(self._stream.fault)  # the file may fail only at its end
            self._stream.discard()  # if the rig did not open

    # ---- running -------------------------------------------------------------------------------------------

    def prepare(self, controller: Controller | PythonController | None) -> Control:
        """Compile a `controller`, preferably before the rig is armed: an armed one has no torque meanwhile."""
        if id(controller) not in self._controls:
            compiled = None if callable(controller) else controller
            control = self.meanwhile(lambda: control_of(compiled, self.limits, self.rig.sample_time))
            self._controls[id(controller)] = (controller, control)
        return self._controls[id(controller)][1]

    def run(
        self,
        setpoints: Array,
        controller: Controller | PythonController | None = None,
        *,
        travel: float = math.inf,
    ) -> Array:
        """Run a segment.

        Parameters
        ----------
        setpoints : array, shape (n, 5)
            A `Setpoint` per sample (`stickslip.rigs.rig.setpoints`).
        controller : Controller, callable or None
            None: only the torques of the setpoints.
        travel : float
            Displacement at which the segment ends early, without a fault, rad.

        Returns
        -------
        array, shape (m, columns)
            The rows of `stickslip.rigs.loop_sample.COLUMNS`, m <= n.

        Raises
        ------
        InputError
            If setpoints have another shape or are not finite.
        RigError
            After the torque was ramped to zero, with the reason.
        """
        stream = self._open_stream()
        if setpoints.ndim == 2 and setpoints.shape[1] == len(Setpoint._fields) - 1:
            setpoints = np.column_stack([setpoints, np.zeros(len(setpoints))])  # without an acceleration
        insist_on_setpoints(setpoints)
        self._take_over(self.prepare(controller), travel)
        begin = stream.count
        self._pace.restart()
        table = np.ascontiguousarray(setpoints, dtype=np.float64)
        python = controller if callable(controller) else None
        if self.rig.capabilities.blocks and not self.realtime and python is None:
            self._in_blocks(stream, table)
        else:
            self._by_samples(stream, table, python)
        if self._guard.state == STOPPING:
            self._ramp(stream)
        if self._guard.state == STOPPED:
            raise self._error(stream)
        return stream.rows(begin, stream.count)

    def pause(self, seconds: float) -> Measurement:
        """Ramp the torque to zero and wait `seconds`; nothing is recorded meanwhile."""
        self._open_stream()
        self._ramp_down()
        if self.rig.capabilities.real_clock:
            self._rest(seconds)
        else:
            measured = self._guard.control.measured
            before = float(measured[TIME])
            with self._signals.at_once():
                measured[:] = answer(self.rig, "pause", lambda: self.rig.pause(seconds))
            if not measured[TIME] >= before:
                measured[TIME], after = before, float(measured[TIME])
                self._guard.ask(clock_fault(self.rig.name, after - before, "during a pause"))
                self._guard.cut()
                raise self._error(self._open_stream())
            self._guard.forget_speed()
        return Measurement(*self._guard.control.measured)

    def meanwhile(self, work: Callable[[], Result]) -> Result:
        """Do `work` (compile, identify) with zero torque; a rig with a real clock gets its samples meanwhile.

        Returns
        -------
        The result of `work`.
        """
        if self._stream is None or not self.rig.capabilities.real_clock:
            return work()
        self._ramp_down()
        with ThreadPoolExecutor(1) as pool:
            future = pool.submit(work)
            while not future.done():
                self._rest(0.01)
        return future.result()

    def account(self) -> Account:
        """Return the timing statistics of the loop."""
        return self._pace.account()

    def record(self) -> Record:
        """Return the record so far."""
        return self._open_stream().record()

    def _rest(self, seconds: float) -> None:
        """Run samples with zero torque that are not recorded; limits are checked."""
        count = max(1, round(seconds / self.rig.sample_time))
        self._take_over(self.prepare(None), math.inf)
        self._pace.restart()
        self._by_samples(None, setpoints(count), None)
        if self._guard.state == STOPPED:
            raise self._error(self._open_stream())

    def _open_stream(self) -> Stream:
        if self._stream is None:
            raise InputError("the loop is not armed; use it in a `with` statement")
        return self._stream

    def _take_over(self, control: Control, travel: float) -> None:
        """Go on from where the last segment left the axis, with another controller."""
        self._guard.take_over(control, travel)
        self._step = Step(control)

    # ---- samples -------------------------------------------------------------------------------------------

    def _by_samples(self, stream: Stream | None, setpoints: Array, python: PythonController | None) -> None:
        """Run sample by sample through `Rig.exchange`."""
        times = self._pace.room(len(setpoints))
        place, stride = setpoints.ctypes.data, setpoints.strides[0]
        with ExitStack() as undo:
            undo.enter_context(self._pace.counting())
            ask = None if python is None else self._within_budget(stream, python, undo)
            for k in range(len(setpoints)):
                if ask is None:
                    self._sample(stream, place + k * stride, times[k])
                else:
                    self._ask_python(ask, setpoints[k])
                    if self._guard.state != STOPPED:
                        self._sample(stream, self._setpoint.ctypes.data, times[k])
                if self._guard.state >= STOPPED:
                    return

    def _within_budget(
        self, stream: Stream | None, python: PythonController, undo: ExitStack
    ) -> PythonController:
        """Return the controller, monitored in real time."""
        if not self.realtime or math.isinf(self._budget):
            return python

        def take_over(reason: BaseException) -> None:
            self._guard.ask(reason)
            self._ramp(stream)
            self._signals.release()

        period = self.rig.sample_time

        def overrun(took: float) -> Overrun:
            return Overrun(
                f"the controller took {1e3 * took:.3g} ms in a sample of {1e3 * period:.3g} ms and is more than its "
                f"budget of {1e3 * self._budget:.3g} ms behind the clock; make it faster, or "
                "increase the budget of Loop"
            )

        budget = Budget(period, self._budget, overrun, take_over, lenient=self._guard.torque == 0.0)
        undo.enter_context(self._watch.over(budget))
        return lambda measured, setpoint: budget.call(python, measured, setpoint)

    def _sample(self, stream: Stream | None, setpoint: int, times: Any) -> None:
        """Run one sample: control, record, wait, exchange. No exception leaves it: each is a reason to stop."""
        begin = time.perf_counter_ns()
        row = self._row(stream)
        if self._signals.number:
            self._signals.quieten()
            self._guard.ask(self._signals.error)
        before = time.thread_time_ns()
        torque = self._step.decide(setpoint, row)
        between = time.thread_time_ns()
        times[2] = between - before
        if self.realtime:
            self._step.idle()
            times[3] = time.thread_time_ns() - between
        if stream is not None and row != self._scratch.ctypes.data:
            stream.commit()
        times[1] = time.perf_counter_ns() - begin
        if self.realtime:
            if stream is not None:
                stream.spare()
            times[0] = self._pace.wait(self._step.rehearse)
        measured = self._guard.control.measured
        try:
            self._answered = False
            found: object = cast(object, self._exchange(torque))
            # A single number would be used for all.
            if not isinstance(found, tuple) or len(found) != FIELDS:  # type: ignore[reportUnknownArgumentType]
                raise RigError(f"{self.rig.name}: exchange gave {found!r}; it must give a Measurement")
            measured[:] = found
            self._answered = True
        except BaseException as error:  # any exception: the torque goes to zero first
            self._guard.pass_time(self.rig.sample_time)
            self._guard.ask(error, EXCHANGE)

    def _row(self, stream: Stream | None) -> int:
        """Return the address of the sample's row; without space the sample is not recorded and the loop stops."""
        if stream is not None:
            if stream.fault is not None:
                self._guard.ask(stream.fault)
            try:
                return stream.place()
            except RigError as error:
                self._guard.ask(error)
        return self._scratch.ctypes.data

    def _ask_python(self, python: PythonController, setpoint: Array) -> None:
        """Return the setpoint plus the torque of a Python controller."""
        self._setpoint[:] = setpoint
        try:
            self._setpoint[TORQUE] += python(Measurement(*self._guard.control.measured), Setpoint(*setpoint))
        except BaseException as error:
            self._guard.ask(error, CONTROLLER)

    def _in_blocks(self, stream: Stream, setpoints: Array) -> None:
        """Run in compiled blocks through `BlockRig.exchange_block`."""
        rig = cast(BlockRig, self.rig)
        done = 0
        while done < len(setpoints) and self._guard.state < STOPPED and not self._signals.number:
            if stream.fault is not None:
                break
            try:
                rows = stream.room(min(BLOCK, len(setpoints) - done))
                count = rig.exchange_block(self._guard.control, setpoints[done : done + len(rows)], rows)
            except BaseException as error:
                self._guard.ask(error, EXCHANGE)
                return
            stream.commit(count)
            done += count
        if self._signals.number:
            self._signals.quieten()
            self._guard.ask(self._signals.error)
        if stream.fault is not None:
            self._guard.ask(stream.fault)

    # ---- stopping ------------------------------------------------------------------------------------------

    def _ramp(self, stream: Stream | None) -> None:
        """Run samples until the torque is zero; the ramp is the compiled one, so its length is bounded."""
        self._setpoint[:] = 0.0
        times = np.zeros(len(TIMES), dtype=np.int64)
        while self._guard.state != STOPPED:
            self._sample(stream, self._setpoint.ctypes.data, times)

    def _ramp_down(self) -> None:
        """Ramp the torque down without a fault: before a pause and at the end."""
        if self._guard.state == STOPPED:
            return
        if self._guard.begin_ramp():
            self._ramp(self._stream)
        if not self._guard.end_ramp():
            raise self._error(self._open_stream())

    def _error(self, stream: Stream) -> BaseException:
        """Return the error to raise once the torque command is zero, with a warning if the rig has not answered it."""
        error = self._guard.error(self.rig.name, self.limits, stream)
        if not self._answered and isinstance(error, RigError):
            self._answered = True  # reported
            error.args = (
                f"{error}; the rig has not answered the command of 0 N·m: if its torque still acts, "
                f"{last_resort(self.rig)}",
            )
        return error
