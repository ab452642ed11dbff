"""Arduino: the C of a controller as a library with an example, in single precision."""

from __future__ import annotations

from typing import Any

from stickslip.control.controller import Controller
from stickslip.core.spec import Surroundings
from stickslip.exports import c99_controller
from stickslip.exports._text import render
from stickslip.exports.arduino import tried
from stickslip.exports.controllers import STILL, ControllerTarget, head_of
from stickslip.exports.job import Export


def write(controller: Controller, name: str, single: bool = True, around: Surroundings = STILL) -> Export:
    """Sources, an example, the library's properties, and the check of the C export."""
    c = c99_controller.write(controller, name, single=True, around=around).files
    values: dict[str, Any] = {
        **head_of(controller, name),
        "title": "Sampled controller",
        "surroundings": ", ".join(f"{u!r}f" for u in around),
        "controller": True,
        "sentence": "Controller of a servo axis.",
    }
    return Export(
        {
            f"src/{name}.h": c[f"{name}.h"],
            f"src/{name}.cpp": str(c[f"{name}.c"]).replace(
                f"see {name}.h.", f"see {name}.h. C that C++ compilers read too."
            ),
            "examples/Step/Step.ino": render("arduino_controller.ino.j2", **values),
            "library.properties": render("arduino.properties.j2", **values),
            f"extras/{name}_check.c": c[f"{name}_check.c"],
            "extras/golden_samples.csv": c["golden_samples.csv"],
            "README.md": render(
                "arduino_controller_readme.md.j2", **values, **c99_controller.step_error_of(controller)
            ),
        }
    )


CONTROLLER = ControllerTarget(write, tried)
