"""The regression on gross sliding tries another window if one has too little of it, and passes real errors on."""

from __future__ import annotations

import numpy as np
import pytest

import stickslip as ss
from stickslip.errors import InputError
from stickslip.identify.experiment import experiment_of
from stickslip.identify.regression import bands, drifted
from stickslip.identify.regression.regression import regress_axis
from stickslip.identify.regression.sliding_rows import TooLittleSliding
from stickslip.machines.servo import ServoAxis


def regression() -> object:
    """Two sines with friction and noise."""
    t = np.arange(5000) * 2e-3
    w = 2.0 * np.pi * np.array([0.5, 0.8])
    v = 6.0 * np.sin(w[0] * t) + 3.0 * np.sin(w[1] * t)
    a = 6.0 * w[0] * np.cos(w[0] * t) + 3.0 * w[1] * np.cos(w[1] * t)
    torque = 4e-3 * a + 0.3 * np.sign(v) + 0.02 * v + np.random.default_rng(2).normal(0.0, 0.01, t.size)
    channels = {"position": np.round(np.cumsum(v) * 2e-3, 5), "motor_torque": torque}
    record = ss.Record(t, channels, {"position": "rad", "motor_torque": "N·m"})
    return regress_axis([experiment_of(record, ServoAxis())], ServoAxis())


@pytest.mark.parametrize(("where", "name"), [(bands, "rows_of"), (drifted, "in_bands")])
def test_an_error_that_is_not_too_little_sliding_is_passed_on(
    where: object, name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It was taken for a window that shows nothing, and the result had no word of it."""
    whole, calls = getattr(where, name), [0]

    def broken(*given: object, **options: object) -> object:
        calls[0] += 1
        if calls[0] > 1:
            raise InputError("the record has a fault")
        return whole(*given, **options)

    monkeypatch.setattr(where, name, broken)
    with pytest.raises(InputError, match="the record has a fault"):
        regression()


def test_a_window_with_too_little_sliding_is_left_out(monkeypatch: pytest.MonkeyPatch) -> None:
    whole, calls = bands.in_bands, [0]

    def short(*given: object, **options: object) -> object:
        calls[0] += 1
        if calls[0] > 1:
            raise TooLittleSliding("too little")
        return whole(*given, **options)

    monkeypatch.setattr(drifted, "in_bands", short)
    assert regression() is not None
