"""The numbers of a machine by name: each can be changed, alone, and changes what runs."""

from __future__ import annotations

import math

import numpy as np
import pytest

from stickslip.core.errors import InputError, ParameterError
from stickslip.machines.files import library, machine
from stickslip.machines.numbers import machine_numbers, with_numbers


@pytest.mark.parametrize("name", library())
def test_every_number_can_be_changed_alone(name: str) -> None:
    one = machine(name)
    known = machine_numbers(one)
    assert {"inertia", "delay", "start_angle", "encoder.counts", "amplifier.bandwidth"} <= known.keys()
    for number, value in known.items():
        wanted = 0.01 if value == 0.0 else 0.99 * value if math.isfinite(value) else 1e4
        wanted = math.floor(wanted) if number == "seed" or number.endswith("bits") else wanted
        wanted = 25.0 if number == "encoder.max_speed" else wanted
        other = machine_numbers(with_numbers(one, {number: wanted}))
        assert other[number] == pytest.approx(wanted)
        changed = {k for k, v in other.items() if v != known[k]}
        shared = {"inertia", "flexible.rotor", "flexible.shaft", "flexible.disk"}
        assert changed - {number} <= (shared if number in shared else set())


def test_a_flexible_machines_inertia_is_shared_as_it_was() -> None:
    one = machine("thesis-dry")
    assert one.flexible is not None
    heavy = with_numbers(one, {"inertia": 2.0 * one.inertia})
    assert heavy.flexible is not None
    assert heavy.flexible.disk == pytest.approx(2.0 * one.flexible.disk)
    assert np.sum([heavy.flexible.rotor, heavy.flexible.shaft, heavy.flexible.disk]) == pytest.approx(
        heavy.inertia
    )


def test_what_it_has_not_and_what_cannot_be_are_named() -> None:
    one = machine("thesis-dry")
    with pytest.raises(InputError, match="encoder"):
        with_numbers(one, {"encoder.count": 1.0})
    with pytest.raises(ParameterError, match="delay"):
        with_numbers(one, {"delay": 200.0})
