"""Next steps after an identification: commands towards a drive or towards another record."""

from __future__ import annotations

import math
import shlex
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

from stickslip.control.linear import Cascade, Gains
from stickslip.control.own_loop import REFERENCE_VELOCITY, USUAL_TIME
from stickslip.core.errors import InputError
from stickslip.core.messages import name_option, render
from stickslip.core.record import SAME_COUNTS, Record, counts_of_step, encoder_step, row_period
from stickslip.identification.estimate import Identification
from stickslip.identification.needed_motions import MOTIONS, experiment_for
from stickslip.identification.sliding import SlidingPosterior
from stickslip.machines.servo import ServoAxis
from stickslip.report.after_a_map import after_a_map
from stickslip.report.sliding_torque import beaten, sliding_of

OWN_LOOP = (*Gains._fields, *Cascade._fields, "filter", "limit", REFERENCE_VELOCITY)
"""Numbers of an identification's --loop that apply to a recommendation too."""
OPTIONS = "  # with the options of this run"
HEAVY = 0.25
"""Share of the friction level above which a torque with one period per turn may be a weight."""
FINEST = 1e-8
"""m: smaller steps are those of printed digits."""
BY_A_RIG = "stickslip rig run "
"""Start of its command."""


@dataclass(frozen=True)
class Step:
    """A command or advice: its purpose, and the line to copy (empty for advice).

    For a shell, and for Python, where the result is called ``found``.
    """

    what: str
    command: str = ""
    python: str = ""

    def __post_init__(self) -> None:
        object.__setattr__(self, "what", render(self.what))


def next_steps(
    found: Identification, records: Sequence[Record], model_file: str | Path, files: Sequence[str]
) -> list[Step]:  # fmt: skip
    """Return the next commands: towards a setting if the relevant numbers are identified, else towards another
    record."""
    return [*weighed(found, files, str(model_file)), *further_steps(found, records, model_file, files)]


def weighed(found: Identification, files: Sequence[str], model_file: str) -> list[Step]:
    """Return the step to identify with gravity if the angle shows an unnamed weight, which friction would contain
    otherwise."""
    axis = found.details.get("axis")
    if not isinstance(axis, ServoAxis) or axis.gravity == "pendulum" or found.method == "cogging":
        return []
    told = any(f.code == "gravity" for f in found.findings)
    sliding = found.details.get("sliding")
    if not told and isinstance(sliding, SlidingPosterior) and axis.motion != "linear":
        told = any(abs(order - 1.0) < 1e-3 and x > HEAVY * sliding.friction for order, x in sliding.waves)
    if not told:
        return []
    said = (
        "The torque depends on the angle as gravity does: identify with "
        f"{name_option('pendulum', True)}, or turn the axis upright"
    )
    again = f"stickslip identify {quoted(files)} --pendulum --out {shlex.quote(model_file)}{OPTIONS}"
    call = "found = ss.identify(..., pendulum=True)  # gravity shows over the angle; with the arguments of this run"
    return [Step(f"{said}:", again, call) if files else Step(f"{said}.", "", call)]


def further_steps(
    found: Identification, records: Sequence[Record], model_file: str | Path, files: Sequence[str]
) -> list[Step]:  # fmt: skip
    """As `next_steps`, for an axis whose weight is named."""
    wanted = [Step(s) for s in found.measure_next]
    if found.method == "cogging":
        return [*wanted, Step(*after_a_map(found, model_file))]
    if found.model is None:
        # A procedure for one purpose: sliding determines the law.
        command = f"stickslip identify sliding.npz --method sliding --out {shlex.quote(str(model_file))}"
        return [*wanted, *rig_runs(["sliding"], "For the whole law"), Step("And identify it:", command)]
    sliding = sliding_of(found)
    if sliding is not None and beaten(sliding) and files:
        plain = shlex.quote(str(Path(model_file).with_name("plain.toml")))
        command = f"stickslip identify {quoted(files)} --inverse --out {plain}{OPTIONS}"
        wanted = [
            Step("Look at plain least squares, which explains the torque better here:", command),
            *wanted,
        ]
    missing = lacking(found)
    if not missing:
        ahead = forward(found, records, str(model_file))
        return [*wanted, *ahead] if wanted and wanted[0].command else [*ahead, *wanted]
    return [*wanted, *another_record(found, missing, files, str(model_file))]


def lacking(found: Identification) -> list[str]:
    """Return the names of missing essential numbers: inertia, a pendulum's gravity, and the friction level."""
    names = {e.name.rpartition(".")[2]: e for e in found.estimates}
    levels = [n for n in names if n in ("fc", "fc_negative")]
    if not levels:
        law = {f.name for f in found.model.law.fields} if found.model else set[str]()
        levels = [n for n in names if n.partition("[")[0] in law]
    needed = [*(n for n in ("inertia", "gravity") if n in names), *levels]
    return [names[n].name for n in needed if not names[n].identified] if needed else list(names)


def forward(found: Identification, records: Sequence[Record], model_file: str) -> list[Step]:
    """Return the steps from a model with the essential numbers to a drive."""
    model = shlex.quote(model_file)
    if found.details.get("mechanics") is None and not any(e.name == "inertia" for e in found.estimates):
        return [
            Step("Identify the axis with this friction, or export the law:", f"stickslip export {model} --to c99",
                 'ss.export(found, to="c99", folder="c")')
        ]  # fmt: skip
    setting, drive = shlex.quote(str(Path(model_file).with_name("recommended.toml"))), drive_in(records)
    instead = "in place of these" if "sample_time" in drive else f"({name_option('sample_time')}) besides"
    options = " ".join(f"--{name.replace('_', '-')} {value}" for name, value in drive.items())
    arguments = ", ".join(f"{n}={x!r}" if n == "loop" else f"{n}={x}" for n, x in drive.items())
    return [
        Step(
            "Find the compensator that is safe to switch on, with your drive's loop and sample time "
            f"{instead}"
            f"{', counts being those of 2π m' if is_linear(records) and 'counts_per_rev' in drive else ''}:",
            f"stickslip recommend {model} {options} --out {setting}",
            f"advice = ss.recommend(found, {arguments})",
        ),
        Step(
            "Write it for the drive:", f"stickslip export {setting} --to c99 --compensator recommended",
            'ss.export(advice, to="c99", folder="c")',
        ),
    ]  # fmt: skip


def drive_in(records: Sequence[Record]) -> dict[str, str]:
    """Return the options of a recommendation that follow from the records."""
    loops = {str(r.meta.get("loop", "")) for r in records}
    loop = loops.pop() if len(loops) == 1 else ""
    kept = [p for p in loop.split(",") if p.partition("=")[0] in OWN_LOOP]
    out = {"loop": ",".join(kept)} if kept else {"bandwidth": "10"}
    periods = [period for r in records if (period := row_period(r)) > 0.0]
    if (
        periods and min(periods) <= USUAL_TIME
    ):  # A slower record may have fewer rows than the loop has samples.
        out["sample_time"] = f"{min(periods):.3g}"
    counts = [counts_of(r) for r in records]
    if counts and min(counts) > 0:
        out["counts_per_rev"] = str(min(counts))
    return out


def is_linear(records: Sequence[Record]) -> bool:
    """Whether positions are lengths."""
    return any(r.units.get("position") == "m" for r in records)


def counts_of(record: Record) -> int:
    """Return the encoder counts per revolution (for a linear axis per 2π m) if the step is visible, else 0.

    They must be plausible for an encoder: a power of 2 or some thousands per revolution, or a length of two digits that
    is not a power of ten, which printed digits have as well.
    """
    if record.units.get("position") not in ("rad", "m") or "position" not in record.channels:
        return 0
    try:
        step = encoder_step(record["position"])
    except InputError:
        return 0
    if not step > 0.0:
        return 0
    linear = is_linear([record])
    counts = counts_of_step(step, linear)
    if linear:
        near = float(f"{step:.2g}")
        printed = near == float(f"1e{math.floor(math.log10(near) + 0.5)}")
        scale = step > FINEST and not printed and abs(step - near) < SAME_COUNTS * near
        return counts if scale else 0
    known = counts % 1000 == 0 or counts & (counts - 1) == 0
    return counts if known and 0 < counts < 1e6 else 0


def another_record(
    found: Identification, missing: Sequence[str], files: Sequence[str], model_file: str
) -> list[Step]:  # fmt: skip
    """Return the steps to record and identify the missing numbers."""
    runs = list(dict.fromkeys(map(experiment_for, missing)))[:2]
    steps = rig_runs(runs, f"To settle {', '.join(missing)}")
    if not files or found.method not in ("axis", "inverse dynamics"):
        return steps
    logs = quoted([*files, *(f"{name}.npz" for name in runs)])
    again = f"stickslip identify {logs} --out {shlex.quote(model_file)}{OPTIONS}"
    return [*steps, Step("Identify all of it together:", again)]


def quoted(files: Iterable[str]) -> str:
    """Return the files quoted for a shell."""
    return " ".join(shlex.quote(f) for f in files)


def rig_runs(names: Sequence[str], why: str) -> list[Step]:
    """Return the records to make."""
    return [
        Step(
            f"{why}, record {MOTIONS[name]} with your drive, or let a rig do it:"
            if number == 0
            else f"And {MOTIONS[name]}:",
            f"{BY_A_RIG}{name} --rig machine.toml --out {name}.npz",
        )
        for number, name in enumerate(names)
    ]
