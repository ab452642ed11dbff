"""ROS 2: feedforward of friction in ros2_controllers' joint_trajectory_controller.

The controller of an ``effort`` interface adds ``gains.<joint>.ff_velocity_scale`` times the desired velocity, read in
the parameter file of ros2_controllers 6 (the key is the same since 2), and the ``effort`` of a trajectory's points
(since March 2025, pull request 1200). It has no key for Coulomb friction; a function of one file puts that
into the points.
"""

from __future__ import annotations

from typing import Any

from stickslip.exports._text import Code, quoted, render
from stickslip.exports.job import Export, Job
from stickslip.exports.nearest import COULOMB, carried
from stickslip.exports.target import Setting, Target, settings_of

NOTE = "the keys are those of ros2_controllers 6, read in its source; not tried on a robot"


def write(job: Job) -> Export:
    """Parameters of the controller, a function for trajectories, and how to use both."""
    found = carried(job, TARGET.name, TARGET.forms)
    p = found.model.parameters
    settings = settings_of(TARGET, job.settings)
    notes = (NOTE, *found.notes)
    values: dict[str, Any] = {
        "x": job.name, "law": job.model.law, "joint": quoted(settings["joint"]),
        "controller": quoted(settings["controller"]), "coulomb": repr(p.fc), "viscous": repr(p.sigma2),
        "notes": notes,
    }  # fmt: skip
    return Export(
        {
            f"{job.name}.yaml": render("ros.yaml.j2", **values),
            f"{job.name}_effort.py": render(
                "ros_effort.py.j2", **{**values, "joint": Code(repr(settings["joint"]))}
            ),
            "README.md": render("ros_readme.md.j2", **values),
        },
        notes,
    )


TARGET = Target(
    "ros",
    "ROS 2, feedforward in the joint_trajectory_controller (YAML)",
    write,
    forms=(COULOMB,),
    settings=(
        Setting("joint", "joint", "name of the joint"),
        Setting("controller", "joint_trajectory_controller", "name of the controller"),
    ),
    tried="a YAML parser; not on a robot",
)
