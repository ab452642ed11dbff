"""A memo of the sliding estimate, which the doctor and the identification share for one record."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Sequence

from stickslip.identification.experiment import Experiment
from stickslip.identification.search import Asked
from stickslip.identification.sliding import SlidingPosterior, estimate_sliding
from stickslip.machines.servo import ServoAxis

EstimateSliding = Callable[..., SlidingPosterior]
"""`stickslip.identification.sliding.estimate_sliding`, or a memo of it."""


class SlidingMemo:
    """`estimate_sliding` with results kept by the content of its inputs, for the lifetime of this object."""

    def __init__(self) -> None:
        self._found: dict[bytes, SlidingPosterior] = {}

    def __call__(
        self, experiments: Sequence[Experiment], axis: ServoAxis, asked: Asked | None = None
    ) -> SlidingPosterior:
        """Return the result of `estimate_sliding`, with its parameters and errors."""
        asked = asked or Asked(pendulum=axis.gravity == "pendulum")
        key = _content(experiments, axis, asked)
        if key not in self._found:
            self._found[key] = estimate_sliding(experiments, axis, asked)
        return self._found[key]


def _content(experiments: Sequence[Experiment], axis: ServoAxis, asked: Asked) -> bytes:
    digest = hashlib.sha256(repr((axis.motion, asked)).encode())
    for t in experiments:
        arrays = (t.time, t.position, t.signal(), t.rows, t.supply)
        digest.update(repr((axis.drive_gains(t.quantity), t.time.size, [a is None for a in arrays])).encode())
        for a in arrays:
            if a is not None:
                digest.update(a.tobytes())
    return digest.digest()
