"""A record in a notebook: a table of its channels, and a figure."""

from __future__ import annotations

import numpy as np
import pytest

import stickslip as ss

SLOW = ss.Reference("sine", amplitude=0.1, frequency=0.4)
CONTACT = ss.Contact(ss.Model("lugre", sigma0=3.5e3, sigma1=0.1, sigma2=0.018, fs=0.335, fc=0.285, vs=0.01))


def belt(encoder: str) -> ss.Record:
    axis = ss.TwoMassAxis(motor=2e-4, load=2e-4, stiffness=50.0, damping=0.02, encoder=encoder)
    machine = ss.Machine("belt", axis.inertia, CONTACT, flexible=axis, sample_time=1e-3)
    return ss.simulate(machine, ss.Controller(ss.place("PD", axis.inertia, 20.0)), SLOW, 2.5)


@pytest.mark.parametrize("encoder", ["motor", "load"])
def test_a_record_of_two_masses_has_the_positions_of_motor_and_load(encoder: str) -> None:
    """Friction on the load winds the spring up by as much as it holds."""
    record = belt(encoder)
    assert np.array_equal(record["position"], record[f"{encoder}_position"])
    twist = record["motor_position"] - record["load_position"]
    assert np.ptp(twist) > 0.01
    # But for the load's acceleration where it slips.
    assert np.median(np.abs(twist - record["friction_torque"] / 50.0)) < 1e-4


def test_a_rigid_axis_has_one_position() -> None:
    rigid = ss.Machine("axis", 4e-4, CONTACT, sample_time=1e-3)
    record = ss.simulate(rigid, ss.Controller(ss.place("PD", 4e-4, 20.0)), SLOW, 0.1)
    assert "motor_position" not in record.channels


def test_a_figure_shows_the_motion_the_error_and_the_torque() -> None:
    record = belt("motor")
    figure = record.plot()
    labels = [axes.get_ylabel() for axes in figure.axes]
    assert labels == ["position (rad)", "error (mrad)", "velocity (rad/s)", "torque (N·m)"]
    (error,) = figure.axes[1].get_lines()
    assert np.max(error.get_ydata()) == pytest.approx(
        1e3 * np.max(record["position_reference"] - record["position"])
    )
    assert figure._repr_png_().startswith(b"\x89PNG")
    (torque,) = record.plot("motor_torque").axes
    assert [line.get_label() for line in torque.get_lines()] == ["motor torque"]
    with pytest.raises(ss.InputError, match="no channel 'motor_torqe'"):
        record.plot("motor_torqe")


def test_a_notebook_shows_channels_units_and_metrics() -> None:
    html = belt("load")._repr_html_()
    assert "<td>load_position</td><td>rad</td>" in html
    assert "position_rms_rad" in html
    empty = ss.Record(np.zeros(0), {"x": np.zeros(0)}, {"x": "<m>"})
    assert "<td>&lt;m&gt;</td><td>nan</td>" in empty._repr_html_()
