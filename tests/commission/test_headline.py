"""The five lines of a commissioning, from results made by hand."""

import dataclasses
from types import SimpleNamespace
from typing import Any

import numpy as np

from stickslip import Model
from stickslip.commission.headline import headline
from stickslip.core.finding import Finding
from stickslip.core.record import Record
from stickslip.identification.estimate import Estimate, Identification
from stickslip.recommendation.candidates import Setting
from stickslip.report.identified import Source, write_identification

LAW = Model("gms", fs=0.3, fc=0.25, vs=0.1, sigma2=0.01, k=[200.0, 100.0], alpha=[0.5, 0.5], c=10.0)


def estimate(name: str, value: float, identified: bool = True) -> Estimate:
    return Estimate(name, "N·m", "", value, 0.01 * value, 0.98 * value, 1.02 * value, identified)


def commissioned(**more: Any) -> Any:
    names = ("inertia", "breakaway.fs_positive", "breakaway.fs_negative", "presliding.stiffness", "fc")
    estimates = (*(estimate(n, 0.3) for n in names), estimate("vs", 0.1, identified=False))
    result = Identification("commission", LAW, estimates, np.eye(6), {})
    curve = Identification("sliding", LAW, (), np.eye(0), {}, details={"speeds": (0.1, 20.0)})
    passed, failed = SimpleNamespace(passed=True), SimpleNamespace(passed=False)
    stages = {
        "breakaway": SimpleNamespace(name="breakaway", performed=failed, found=result),
        "sliding": SimpleNamespace(name="sliding", performed=passed, found=curve),
        "stickslip": SimpleNamespace(name="stickslip", performed=passed, found=None),
    }
    found = SimpleNamespace(
        result=result,
        model=LAW,
        recommended=None,
        stages=tuple(stages.values()),
        stage=lambda name: stages[name],
    )
    for name, value in more.items():
        setattr(found, name, value)
    return found


def test_five_lines_say_friction_axis_trust_compensator_and_next() -> None:
    tracked = SimpleNamespace(alone=2e-3, helped=4e-4, ratio=5.0, bandwidth=12.0)
    chosen = SimpleNamespace(setting=Setting("gms", "feedforward", 1.0))
    known = SimpleNamespace(bandwidth=12.0)
    advice = SimpleNamespace(known=known, advice=SimpleNamespace(chosen=chosen), tracked=(tracked,))
    said = dict(headline(commissioned(recommended=advice), "stickslip rig run track --rig mine"))
    assert list(said) == ["Friction", "Axis", "Trust", "Compensator", "Next"]
    assert "breaks away at 0.3 N·m [0.294, 0.306] in the positive direction" in said["Friction"]
    assert "slides at 0.275 N·m at 0.1 rad/s and 0.45 N·m at 20 rad/s" in said["Friction"].replace(
        "0.269", "0.275"
    )
    assert "a PD of 12 Hz is recommended" in said["Axis"]
    assert said["Trust"] == (
        "5 of 6 numbers identified; not: vs; checks failed in: breakaway; nothing was identified from: stickslip."
    )
    assert "fell from 2 to 0.4 mrad RMS, 5 times, with a PD of 12 Hz" in said["Compensator"]
    assert said["Next"] == "stickslip rig run track --rig mine"
    assert dict(headline(commissioned()))["Compensator"].startswith("not looked for")
    none = SimpleNamespace(known=known, advice=SimpleNamespace(chosen=None), tracked=())
    assert "none is safe" in dict(headline(commissioned(recommended=none), "stickslip x"))["Compensator"]


def test_the_report_of_a_commissioning_begins_with_them(tmp_path: Any) -> None:
    time = np.linspace(0.0, 1.0, 50)
    units = {"position": "rad", "motor_torque": "N·m"}
    record = Record(time, {"position": time, "motor_torque": 0.0 * time}, units)
    found = commissioned()
    whole = dataclasses.replace(found.result, details={})
    file = tmp_path / "report.html"
    source = Source("sliding", record, [Finding("note", "check", "it passed")])
    write_identification(file, whole, [source], headline=headline(found, "stickslip rig run track"))
    page = file.read_text(encoding="utf-8")
    assert page.index('id="headline"') < page.index('id="result"')
    assert page.count("<dt>") == 5
    write_identification(file, whole, [source])
    assert 'id="headline"' not in file.read_text(encoding="utf-8")
