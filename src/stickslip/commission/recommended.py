"""What to switch on: bandwidth, law, structure and gain for a commissioned machine, and what they do on it.

The bandwidth comes from the measured response: `MARGIN` below that from which a PD rings, sliding or sticking. The rest
is simulated, not on the machine but on what is known of it (`stickslip.commission.candidates`). Then the machine itself
follows the slow sinusoid with the PD alone and with the compensator, at this bandwidth and at lower ones.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from stickslip.analyse.tracking import tracking_metrics
from stickslip.commission.candidates import (
    DAMPING,
    LEVELS,
    MARGIN,
    Candidate,
    Following,
    Known,
    candidates_of,
    chosen_of,
    controller_of,
    laws_to_try,
    simulated,
)
from stickslip.control.controller import Controller
from stickslip.identify.estimate import Identification, Picture, Trace
from stickslip.identify.model_file import write_model
from stickslip.machines.angle import AngleMap
from stickslip.model import Model
from stickslip.rigs.procedures.base import Performed
from stickslip.rigs.rig import Rig
from stickslip.simulation.driven import Mechanics

__all__ = ["SLOWER", "Recommended", "Tracked", "picture_of_candidates", "recommend_on", "write_recommended"]

SLOWER = (0.75, 0.5)
"""Of the bandwidth: where the gain over the linear controller alone is measured too."""


@dataclass(frozen=True)
class Tracked:
    """RMS errors on the machine itself at one bandwidth, rad."""

    bandwidth: float
    alone: float
    helped: float

    @property
    def ratio(self) -> float:
        """How many times smaller the error is with the compensator."""
        return self.alone / self.helped


@dataclass(frozen=True, eq=False)
class Recommended:
    """What is recommended, why, and what it did.

    Attributes
    ----------
    known : Known
    candidates : tuple of Candidate
    chosen : Candidate or None
        None: none is calm and better than the PD alone.
    model : Model or None
        The law to run, without the ripple (that is `Known.angle`).
    alone : float
        RMS error of the PD alone on the identified machine, rad.
    tracked : tuple of Tracked
        On the machine itself, from the recommended bandwidth down.
    """

    known: Known
    candidates: tuple[Candidate, ...]
    chosen: Candidate | None
    model: Model | None
    alone: float
    tracked: tuple[Tracked, ...] = ()

    def controllers(self, rig: Rig, bandwidth: float) -> tuple[Controller, Controller]:
        """The PD alone, and with the compensator."""
        assert self.chosen is not None
        assert self.model is not None
        return (
            controller_of(self.known, rig, bandwidth, None),
            controller_of(self.known, rig, bandwidth, (self.model, self.chosen.kind, self.chosen.gain)),
        )

    def lines(self) -> Iterator[str]:
        """What people read."""
        k = self.known
        yield (
            f"A PD rings from {k.rings_at:.3g} Hz on, at {k.rings_with:.3g} Hz while {k.rings_while} (measured "
            f"response); recommended: {k.bandwidth:.3g} Hz, a factor of {MARGIN:g} below."
        )
        if self.chosen is None:
            yield "No compensator is recommended: none is calm on the identified machine and better than the PD alone."
            return
        c = self.chosen
        yield (
            f"Recommended compensator: {c.kind} of law {c.law!r}, gain {c.gain:g}, with the ripple and the torque "
            f"beside friction by angle; simulated with friction {', '.join(f'{100 * x:g}' for x in LEVELS)} % of that "
            f"identified: error {', '.join(f'{self.alone / e:.3g}' for e in c.errors)} times smaller than with the "
            f"PD alone ({1e3 * self.alone:.3g} mrad RMS)."
        )
        for t in self.tracked:
            yield (
                f"Measured on the slow sinusoid, PD of {t.bandwidth:.3g} Hz: {1e3 * t.alone:.3g} mrad RMS alone, "
                f"{1e3 * t.helped:.3g} with the compensator: {t.ratio:.3g} times smaller."
            )

    def table(self) -> dict[str, Any]:
        """``[recommended]`` of a recommended.toml."""
        assert self.chosen is not None
        return {
            "compensator": self.chosen.kind, "gain": self.chosen.gain, "bandwidth": self.known.bandwidth,
            "damping": DAMPING, "inertia": self.known.inertia,
        }  # fmt: skip


def write_recommended(path: Path, found: Recommended) -> Path:
    """A model.toml of the law to run, with ``[angle]`` and ``[recommended]``: what `stickslip rig run track` takes."""
    assert found.model is not None
    result = Identification("commission", found.model, (), np.eye(0), {}, tuple(found.lines()), details={
        "mechanics": Mechanics(found.known.inertia), "angle": found.known.angle,
    })  # fmt: skip
    return write_model(path, result, more={"recommended": found.table()})


# ---- on the machine ---------------------------------------------------------------------------------------------


def recommend_on(
    known: Known, rig: Rig, lugre: Model | None, follow: Callable[[Following, str], Performed]
) -> Recommended:
    """Choose on the identified machine, then track on the rig with the PD alone and with what was chosen.

    Parameters
    ----------
    known : Known
    rig : Rig
    lugre : Model or None
        LuGre's dynamics, where they were identified.
    follow : callable
        Performs a `Following` on the rig; also given a name for its record.
    """
    laws = laws_to_try(known.model, lugre)
    tried = candidates_of(known, rig, laws)
    alone, _ = simulated(known.machine(rig), controller_of(known, rig, known.bandwidth, None), known.angle)
    chosen = chosen_of(tried, alone)
    found = Recommended(known, tuple(tried), chosen, laws[chosen.law] if chosen else None, alone)
    if chosen is None:
        return found
    tracked: list[Tracked] = []
    for share in (1.0, *SLOWER):
        errors: list[float] = []
        for name, controller, angle in zip(
            ("alone", "helped"), found.controllers(rig, share * known.bandwidth), (AngleMap(), known.angle), strict=True
        ):  # fmt: skip
            done = follow(Following(using=controller, over=angle), f"track-{100 * share:.0f}-{name}")
            errors.append(tracking_metrics(done.record)["position_rms_rad"])
        tracked.append(Tracked(share * known.bandwidth, *errors))
    return dataclasses.replace(found, tracked=tuple(tracked))


def picture_of_candidates(found: Recommended) -> Picture:
    """How many times smaller than with the PD alone each candidate's error is, over the friction there is."""
    traces: list[Trace] = []
    order = np.argsort(LEVELS)
    for c in found.candidates:
        if len(c.errors) == len(LEVELS) and c.gain == 1.0:
            traces.append(Trace(
                f"{c.law}, {c.kind}" + (" (restless)" if c.restless else ""), 100.0 * np.array(LEVELS)[order],
                found.alone / np.array(c.errors)[order],
            ))  # fmt: skip
    return Picture(
        "recommended", "Candidates at gain 1 on the identified machine",
        f"PD of {found.known.bandwidth:.3g} Hz; the error with it alone is {1e3 * found.alone:.3g} mrad RMS",
        "friction there is over that identified (%)", "times smaller error", tuple(traces),
    )  # fmt: skip
