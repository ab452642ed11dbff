"""YAML for Isaac Lab and ROS 2: read by a YAML parser, with the keys of those tools."""

from types import SimpleNamespace

import pytest
import yaml

from stickslip.exports import isaac, ros
from stickslip.exports.job import Job
from stickslip.models.model import Model

STATIC = Model("static", fs=0.335, fc=0.285, sigma2=0.018)
COULOMB = Model("coulomb", fc=0.285, sigma2=0.018)


def test_isaac_has_the_fields_of_the_actuators_configuration():
    files = isaac.write(Job(STATIC, "x", settings={"group": "arm: left", "joints": r'.*_"hip"\d'})).files
    content = yaml.safe_load(files["x.yaml"])["actuators"]
    assert content == {
        "arm: left": {
            "joint_names_expr": [r'.*_"hip"\d'], "friction": 0.335, "dynamic_friction": 0.285, "viscous_friction": 0.018
        }
    }  # fmt: skip


def test_coulomb_friction_holds_as_much_as_it_slides():
    content = yaml.safe_load(isaac.write(Job(COULOMB, "x")).files["x.yaml"])["actuators"]["axis"]
    assert content["friction"] == content["dynamic_friction"] == 0.285


def test_ros_has_the_velocity_feedforward_of_the_controller():
    files = ros.write(Job(COULOMB, "x", settings={"joint": "elbow"})).files
    gains = yaml.safe_load(files["x.yaml"])["joint_trajectory_controller"]["ros__parameters"]["gains"]
    assert gains == {"elbow": {"ff_velocity_scale": 0.018}}


@pytest.mark.parametrize(
    ("velocities", "expected"),
    [
        ([0.0, 0.5, 0.0, -0.5, 0.0], [0.285, 0.285, -0.285, -0.285, -0.285]),
        ([0.0, 0.0], [0.0, 0.0]),
        ([0.2], [0.285]),
    ],
)
def test_the_points_of_a_trajectory_get_the_coulomb_torque_of_their_direction(velocities, expected):
    scope = {}
    exec(ros.write(Job(COULOMB, "x", settings={"joint": "b"})).files["x_effort.py"], scope)
    points = [SimpleNamespace(velocities=[1.0, v], effort=[]) for v in velocities]
    points[0].effort = [0.5, 0.25]
    out = scope["add_friction"](SimpleNamespace(joint_names=["a", "b"], points=points))
    got = [p.effort[1] for p in out.points]
    assert got == pytest.approx([expected[0] + 0.25, *expected[1:]])
    assert out.points[0].effort[0] == 0.5
