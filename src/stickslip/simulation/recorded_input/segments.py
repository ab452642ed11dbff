"""A record followed in segments side by side: the observer's corrections of `recorded_input.Course`, ten times as fast.

Where an axis slides at speed, an observer and a contact forget within a fraction of a second how they began. There a
record is cut, each segment begins a while before its cut, and `LANES` of them run in vectors of the machine
(`recorded_input.simd_batch`). The law's own ``step`` takes part without branches (`branchless`); laws that cannot be
written so, and axes with backlash, a pendulum or harmonics, are left to `recorded_input.Course`.
"""

from __future__ import annotations

import ast
import functools
import math
import threading
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from stickslip.core.spec import Law, Surroundings
from stickslip.jit import compiled_lanes, flat
from stickslip.simulation import root
from stickslip.simulation.recorded_input import simd_batch
from stickslip.simulation.recorded_input.branchless import Assumption, Name, NotStraight, Trace, traced
from stickslip.simulation.recorded_input.simd_batch import Numbers
from stickslip.simulation.recorded_input.simulation import Drive, Mechanics, reads_load
from stickslip.simulation.recorded_input.step import LEAST
from stickslip.simulation.root import ROOT
from stickslip.subset import law_layouts, lower

Array = np.ndarray[Any, np.dtype[np.float64]]
Mask = np.ndarray[Any, np.dtype[np.bool_]]

LANES = 8
LONGEST = 0.5
"""Part of a record beyond which its longest segment, `Segments.longest`, is too long for lanes to be worth it."""
INLINED = frozenset(
    {
        "start", "look", "first_stage", "second_stage", "take_states", "take_other_rise", "accept", "beyond", "pull",
        "look_back",
    }
)  # fmt: skip
"""Functions that run for all lanes at once."""
KEPT = {"x": "x", "last": "last", "f_last": "f_last", "other": "other", "phase": "phase", "inverse": "rise"}
"""What the root finder keeps of every lane, and under which name."""


# ---- the program -----------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Program:
    """A law's compiled text, or None where it has none, and the parameters that it holds for."""

    assumptions: frozenset[Assumption]
    follow: Any

    def fits(self, parameters: Sequence[float]) -> bool:
        """Whether it holds for these."""
        return all(a.fits(parameters) for a in self.assumptions)


_programs: dict[int, tuple[Law, list[Program]]] = {}
_lock = threading.Lock()


def program_for(law: Law, parameters: Sequence[float]) -> Program:
    """The program of a law with such parameters, compiled on first use."""
    with _lock:
        _, programs = _programs.setdefault(id(law), (law, []))
        for program in programs:
            if program.fits(parameters):
                return program
        trace = Trace(parameters)
        try:
            follow = compiled_lanes(source(law, trace)).follow_lanes
        except NotStraight:
            follow = None
        programs.append(Program(frozenset(trace.assumptions), follow))
        return programs[-1]


def source(law: Law, trace: Trace) -> str:
    """The specialised text.

    Raises
    ------
    NotStraight
        If the law's functions cannot be written as straight lines.
    """
    count = len(law.pack_state(law.state(law.parameters(dict(law.example)))))
    text = [
        "import math",
        "import numpy as np",
        "from stickslip.jit import compile_inlined, compile_lanes, exponential, exponential_less_one",
        "from stickslip.jit import pointer, record_at, select",
        f"LANES, STATES, HOLDS = {LANES}, {count}, {law.holding is not None}",
    ]
    constants, functions = engine_text()
    text += constants
    text += written(law, "step", {"v0": Name("v"), "v1": Name("v"), "dt": Name("h")}, "law", "v, h", trace)
    if law.holding is not None:
        text += written(law, "holding", {"direction": Name("direction")}, "withstood", "direction", trace)
    return "\n".join([*text, *root_finder(), *functions]) + "\n"


@functools.cache
def engine_text() -> tuple[list[str], list[str]]:
    """Return the constants and the functions of `recorded_input.simd_batch`; those `INLINED` run for all lanes at
    once."""
    text = Path(simd_batch.__file__).read_text(encoding="utf-8")
    tree = ast.parse(text.partition("from __future__ import annotations")[2])
    constants = [ast.unparse(node) for node in tree.body if isinstance(node, ast.Assign)]
    functions: list[str] = []
    for node in tree.body:
        if isinstance(node, ast.FunctionDef):
            functions.append("@compile_inlined" if node.name in INLINED else "@compile_lanes")
            functions.append(ast.unparse(bare(node)))
    return constants, functions


def bare(node: ast.FunctionDef) -> ast.FunctionDef:
    """Return a function without its docstring and annotations."""
    for argument in node.args.args:
        argument.annotation = None
    node.returns = None
    if isinstance(node.body[0], ast.Expr):
        node.body = node.body[1:]
    return node


@functools.cache
def root_finder() -> tuple[str, ...]:
    """The lines of `stickslip.simulation.root.improve`. What is written without branches rises like no power."""
    given = {"enough": Name("enough"), "rounding": Name("rounding"), "least": LEAST}
    start = [Name(KEPT[f]) if f in KEPT else given.get(f, 0.0) for f in ROOT.scalars]
    arrays: dict[Any, Any] = {("r", i): value for i, value in enumerate(start)}
    trace = Trace(())
    functions = lower({"_improve_": root.improve}, {"r": ROOT})
    result = traced(functions, "_improve_", {"r": "r", "f": Name("f")}, arrays, trace)
    lines = [f"{name} = w.{name}" for name in KEPT.values()]
    lines += trace.lines
    lines += [f"w.{name} = {arrays['r', ROOT.scalars.index(f)]}" for f, name in KEPT.items()]
    head = "def searched(w, f, enough, rounding):"
    return ("@compile_inlined", head, *(f"    {line}" for line in [*lines, f"return {result}"]))


def written(
    law: Law, entry: str, arguments: dict[str, Name], name: str, signature: str, trace: Trace
) -> list[str]:
    """The lines of one of the law's functions; it reads the states in BASE and leaves them in TRIAL."""
    functions = lower({f"_{entry}_": getattr(law, entry)}, law_layouts(law))
    count = len(law.pack_state(law.state(law.parameters(dict(law.example)))))
    arrays: dict[Any, Any] = {("p", i): Name(f"p[{i}]") for i in range(len(trace.parameters))}
    arrays |= {("z", i): Name(f"z{i}") for i in range(count)}
    arrays |= {("u", i): x for i, x in enumerate(Surroundings())}
    arrays["u", Surroundings._fields.index("load")] = Name("load")
    del arrays["u", Surroundings._fields.index("position")]
    own = Trace(trace.parameters, assumptions=trace.assumptions)
    given = {**arguments, "z": "z", "p": "p", "u": "u"}
    result = traced(functions, f"_{entry}_", given, arrays, own)
    lines = ["z = pointer(w, 0)", *(f"z{i} = z[(BASE + {i}) * LANES]" for i in range(count))]
    lines += ["load = w.load", *own.lines]
    if entry == "step":
        lines += [f"z[(TRIAL + {i}) * LANES] = {arrays['z', i]}" for i in range(count)]
    lines.append(f"return {result}")
    return ["@compile_inlined", f"def {name}(w, {signature}, p):", *(f"    {line}" for line in lines)]


# ---- a record ----------------------------------------------------------------------------------------------------


def cut(forgotten: Mask, warm: int) -> list[int]:
    """Rows at which a record is cut into at most `LANES` segments, the longest as short as can be; the first is 0.

    Parameters
    ----------
    forgotten : array of bool, shape (n,)
        Where nothing is left of what was `warm` rows before.
    warm : int
        Rows that a segment begins before its cut.
    """
    allowed, n = np.flatnonzero(forgotten), forgotten.size
    short, long = n // LANES, n
    while long - short > max(1, n // 1000):
        middle = (short + long) // 2
        short, long = (short, middle) if cuts_within(middle, allowed, warm, n) else (middle, long)
    return cuts_within(long, allowed, warm, n) or [0]


def cuts_within(rows: int, allowed: Any, warm: int, n: int) -> list[int]:
    """Cuts so that no segment has more rows, what is before its cut included; none where there are no such."""
    cuts = [0]
    while (end := max(0, cuts[-1] - warm) + rows) < n:
        place = int(np.searchsorted(allowed, end, side="right")) - 1
        if place < 0 or allowed[place] <= cuts[-1] or len(cuts) == LANES:
            return []
        cuts.append(int(allowed[place]))
    return cuts


class Segments:
    """A held drive with an observer, laid out in segments."""

    def __init__(self, law: Law, drive: Drive, cuts: Sequence[int], warm: int, rounding: float) -> None:
        self.law, self.drive, self.cuts, self.warm, self.rounding = law, drive, list(cuts), warm, rounding
        n = drive.time.size
        ends = [*self.cuts[1:], n]
        self.begins = [max(0, c - warm) for c in self.cuts]
        rows = max(end - begin for begin, end in zip(self.begins, ends, strict=True))
        first = np.array(self.begins + [0] * (LANES - len(self.begins)))
        self.rows: Any = np.minimum(np.arange(rows)[:, None] + first, n - 1)
        self.ends, self.longest = ends, rows / n
        self.speeds = np.zeros(LANES)
        assert drive.goal is not None
        self.speeds[1 : len(first)] = drive.goal[first[1:]]
        self.signals = self.laid_out()
        self.substeps = max(1, math.ceil(float(np.max(np.diff(drive.time))) / drive.max_step - 1e-9))
        self.scaled = not reads_load(law)

    def laid_out(self) -> Array:
        """The signals of all lanes, shape (rows, SIGNALS, LANES)."""
        drive, at = self.drive, self.rows
        last = at == drive.time.size - 1
        out = np.zeros((len(at), len(simd_batch.SIGNALS), LANES))
        row = simd_batch.SIGNALS.index
        columns = {
            "signal": drive.gain * drive.signal, "seen": drive.position, "damping": drive.damping, "goal": drive.goal,
            "firm": drive.firm, "disturbance": drive.disturbance,
        }  # fmt: skip
        for name, values in columns.items():
            if values is not None:
                out[:, row(name)] = values[at]
        assert drive.position is not None
        out[:, row("next")] = np.append(drive.position[1:], drive.position[-1])[at]
        out[:, row("goes_on")] = ~last
        out[:, row("period")] = np.diff(drive.time, append=2.0 * drive.time[-1] - drive.time[-2])[at]
        return out

    def perturbed(self, torque: Array) -> Segments:
        """The same with another torque from outside, N·m, shape (n,)."""
        other = object.__new__(Segments)
        other.__dict__ |= self.__dict__
        other.signals = self.signals.copy()
        other.signals[:, simd_batch.SIGNALS.index("disturbance")] = torque[self.rows]
        return other

    def numbers(self, mechanics: Mechanics) -> Numbers:
        """What the kernel reads of axis and observer."""
        drive, m = self.drive, mechanics
        given = (
            m.inertia, m.offset, m.drive_gain, m.back_emf, m.load_motor, m.load_external, self.scaled, drive.spring,
            drive.forgets, drive.returns, drive.slack, self.rounding,
        )  # fmt: skip
        return Numbers(*map(float, given))

    def corrections(self, mechanics: Mechanics, parameters: Any) -> Array | None:
        """The observer's corrections, shape (n,), as `recorded_input.Course.run` says; None where it cannot be."""
        harmonics = mechanics.harmonics
        more = harmonics.torque or harmonics.friction or mechanics.gravity or mechanics.backlash
        packed = tuple(float(x) for x in self.law.pack(parameters))
        if self.longest > LONGEST or more or (program := program_for(self.law, packed)).follow is None:
            return None
        states = flat(self.law.pack_state(self.law.state(parameters)))
        found = np.empty((len(self.rows), LANES))
        program.follow(
            self.numbers(mechanics), packed, states, self.speeds, self.signals, self.substeps, LANES, found
        )
        out = np.empty(self.drive.time.size)
        for lane, (begin, first, end) in enumerate(zip(self.begins, self.cuts, self.ends, strict=True)):
            out[first:end] = found[first - begin : end - begin, lane]
        return out
