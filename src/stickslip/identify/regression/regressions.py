"""Regressions on certain sliding, each made once: the doctor's and the identification's of a record are the same."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Sequence
from typing import Any

from stickslip.identify.experiment import Experiment
from stickslip.identify.regression.regression import Regression, regress_axis
from stickslip.machines.servo import ServoAxis

Regress = Callable[..., Regression]
"""`stickslip.identify.regression.regression.regress_axis`, or what stands in for it."""


class Regressions:
    """`stickslip.identify.regression.regression.regress_axis`, with what was found kept for who asks the same again.

    Known by its content: every number that the regression reads, so that a record changed meanwhile is another. What
    was found is kept as long as this object is.
    """

    def __init__(self) -> None:
        self._found: dict[bytes, Regression] = {}

    def __call__(self, experiments: Sequence[Experiment], axis: ServoAxis, **options: Any) -> Regression:
        """As `regress_axis`, with its parameters and errors."""
        key = content_of(experiments, axis, options)
        if key not in self._found:
            self._found[key] = regress_axis(experiments, axis, **options)
        return self._found[key]


def content_of(experiments: Sequence[Experiment], axis: ServoAxis, options: dict[str, Any]) -> bytes:
    """A digest of all that a regression depends on; options at their defaults count as not given."""
    given = sorted((name, repr(x)) for name, x in options.items() if x is not None)
    digest = hashlib.sha256(repr((axis.motion, axis.gravity, given)).encode())
    for t in experiments:
        arrays = (t.time, t.position, t.signal(), t.rows, t.supply)
        digest.update(repr((axis.drive_gains(t.quantity), t.time.size, [a is None for a in arrays])).encode())
        for a in arrays:
            if a is not None:
                digest.update(a.tobytes())
    return digest.digest()
