"""A law with a band of rest on general steps: no end velocity is looked for inside the band."""

from __future__ import annotations

import numpy as np

import stickslip as ss
from stickslip.simulation.closed_loop import prepare
from stickslip.simulation.sampled import engine as sampled

J = 3.8623e-4
LUGRE = ss.Model("lugre", sigma0=3.5e4, sigma1=0.1, fs=0.335, fc=0.285, vs=0.01, sigma2=0.018)


def test_a_band_of_rest_is_left_and_entered_where_it_is_at_a_finer_tolerance() -> None:
    axis = ss.RigidAxis(J, ss.Model("karnopp", **ss.law("karnopp").example))
    controller = ss.Controller(ss.place("PD", J, 20.0, 1.0), ss.Feedforward(LUGRE), 1.0, 1e-3)
    slow = ss.Reference("sine", amplitude=0.01, frequency=0.4)
    paths = []
    for tolerance in (1e-6, 1e-8):
        rows = sampled.run(prepare(axis, controller, slow, 5.0, tolerance=tolerance, metered=False)).rows
        paths.append(rows[rows[:, 8] == 0.0, 3])
    assert np.abs(paths[0] - paths[1]).max() < 1e-5
