"""Compensators of the catalogue beside the settings of a law: which is switched on, why the others are not."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from test_recommend_axes import estimate

from stickslip.control.belief import believed
from stickslip.control.catalogue import CATALOGUE, compensated
from stickslip.control.controller import Controller
from stickslip.control.files import read_controller
from stickslip.control.linear import Gains
from stickslip.core.errors import InputError, ParameterError, UnknownName
from stickslip.identification.identified_file import Identified
from stickslip.machines.contact import Contact
from stickslip.machines.encoder import Encoder
from stickslip.machines.machine import Machine
from stickslip.machines.rigid import RigidAxis
from stickslip.models import plugins
from stickslip.models.model import Model, Reference
from stickslip.recommendation import beside, long_rest
from stickslip.recommendation import recommend as recommending
from stickslip.recommendation.beside import belief_of, tried_beside
from stickslip.recommendation.file import write_setting
from stickslip.recommendation.recommend import Drive, recommend
from stickslip.recommendation.swings import between_counts
from stickslip.report.recommendation_text import beside_lines, instead_lines, recommendation_lines
from stickslip.simulation.closed_loop import simulate
from stickslip.studies.bench_decision import CHATTER
from stickslip.studies.bench_metrics import judged
from stickslip.verbs.candidates_given import compensators_of
from stickslip.verbs.recommend import recommend as recommend_verb

REFUSED = ("lee-kim", "twisting-implicit", "sliding-mode", "friedland-park", "rbf", "dither")
"""What the reference found not worth switching on."""


@pytest.fixture
def few(monkeypatch):
    monkeypatch.setattr(recommending, "GAINS", (0.8,))
    monkeypatch.setattr(recommending, "LEADS", (0.0,))
    monkeypatch.setattr(recommending, "BEYOND", ())


def known(inertia, sigma0, fs, fc, vs, sigma2, off=1.0):
    """What was identified: a LuGre law whose levels are known to some per cent, off by that factor."""
    law = Model("lugre", sigma0=sigma0, sigma1=0.0, fs=off * fs, fc=off * fc, vs=vs, sigma2=sigma2)
    own = [
        estimate("fs", "N·m", off * fs, 0.03), estimate("fc", "N·m", off * fc, 0.03),
        estimate("sigma2", "N·m·s/rad", sigma2, 0.1),
    ]  # fmt: skip
    return Identified(Path("m.toml"), law, tuple(own), np.eye(len(own)), {"inertia": inertia})


THESIS = {"inertia": 3.8623e-4, "sigma0": 3.5e4, "fs": 0.335, "fc": 0.285, "vs": 0.01, "sigma2": 0.018}


@pytest.mark.usefixtures("few")
def test_what_is_not_switched_on_is_told_why(tmp_path):
    drive = Drive(20.0, amplitude=0.2, torque_limit=1.0, encoder_counts=65536.0, linear="PID")
    found = known(**THESIS)
    names = ("dob", "ff-dob", "scale-dob", "makkar", "ff-gms", "lugre-observer", *REFUSED)
    advice = recommend(found, drive, axes=1, confirm=2, compensators=names)
    why = {b.name: b.why_not for b in advice.beside}
    assert why["lugre-observer"].startswith(
        "one count of the encoder, 9.59e-05 rad, bends its bristle by 3.36 N·m"
    )
    for name in REFUSED:
        assert why[name] == CATALOGUE[name].against != ""
    assert why["ff-gms"].startswith("no GMS law is known")
    by_label = {b.label: b for b in advice.beside}
    assert by_label["PD + makkar"].why_not == "it adapts, and nothing else in it moves a sticking axis"
    scale = by_label["PD + scale-dob"].learned["feedforward_scale"]
    assert abs(scale["value"] - 1.0) <= 5.0 * scale["uncertainty"] < 0.2
    assert by_label["PD + dob"].learned == {}
    # The bare observers hunt at rest on this stiff contact: what is switched on does not.
    taken = advice.instead
    lines = beside_lines(advice)
    if taken is None:
        assert all("<- yes" not in line for line in lines)
    else:
        printed = recommendation_lines(advice, found.unit)
        (said,) = [line for line in printed if line.startswith("switch on:")]
        assert said.startswith(f"switch on:         {taken.label}; it leaves at most")
        assert sum("<- " in line for line in printed) == 1
        file = write_setting(tmp_path / "recommended.toml", found, advice)
        assert read_controller(file).values() == pytest.approx(taken.controller.values())


@pytest.mark.parametrize(("plain", "taken"), [(1.05, "PD + ff-lugre"), (1.2, "PID + scale")])
def test_of_those_as_good_what_adapts_nothing_is_switched_on(monkeypatch, plain, taken):
    """Within a tenth; what is passed over says so."""
    errors = {"ff-lugre": 0.02 * plain, "scale": 0.02, "none": 0.5}
    later = " on an axis sampled later "

    def on_axes(one, _, where):
        return replace(one, errors=(errors[one.name] * (1.5 if where == later else 1.0),))

    monkeypatch.setattr(beside, "on_axes", on_axes)
    monkeypatch.setattr(beside, "limit_cycle", lambda *_: "")
    drive = Drive(10.0, linear="PID")
    belief = belief_of(known(**THESIS).model, drive, THESIS["inertia"])
    tried = tried_beside(tuple(errors), belief, SimpleNamespace(drive=drive), SimpleNamespace(drive=drive))
    assert tried[0].label == taken
    # All are compared on the same axes; what is promised holds the later ones.
    assert (tried[0].worst, tried[0].at_most) == pytest.approx(
        (errors[tried[0].name], 1.5 * errors[tried[0].name])
    )
    (scale,) = (b for b in tried if b.name == "scale")
    assert scale.why_not == ("" if scale.label == taken else "it adapts, and PD + ff-lugre is equally good")


@pytest.mark.usefixtures("few")
def test_inertia_and_offset_are_fed_forward_with_compensators_as_with_settings():
    found = known(**THESIS)
    found = replace(found, axis={**found.axis, "offset": 0.03})
    drive = Drive(20.0, amplitude=0.2, torque_limit=1.0, encoder_counts=65536.0)
    names = ("none", "ff-dob", "lee-kim")
    fed = recommend(found, drive, axes=1, confirm=0, compensators=names)
    made = {b.name: b.controller for b in fed.beside if b.loop != "PID"}
    for name, inertia in (("none", THESIS["inertia"]), ("ff-dob", THESIS["inertia"]), ("lee-kim", 0.0)):
        own = next(b for b in made[name].blocks.values() if b.law.name == "inertia_feedforward")
        assert own.own == {"inertia": inertia, "offset": 0.03}, (
            name
        )  # Lee and Kim's law has an inertia of its own
    bare = recommend(found, drive, axes=1, confirm=0, compensators=names, feed_inertia=False)
    assert all(b.controller.answers_to_acceleration == (b.name == "lee-kim") for b in bare.beside)
    errors = [next(b for b in x.beside if b.label == "PD + ff-dob").errors[0] for x in (bare, fed)]
    assert errors[1] < errors[0]


@pytest.mark.parametrize("law", ["stribeck", "gms", "coulomb", "maxwell_slip", "stribeck_plain", "dahl"])
def test_a_belief_of_any_law_has_its_level(law):
    found = plugins.law(law)
    model = Model(found, **dict(found.example))
    belief = believed(model, 4e-4)
    assert belief.inertia == 4e-4
    assert belief.elements is (model if law == "gms" else None)
    slow = 5.0 * (found.velocity_scale(model.parameters) if found.velocity_scale else 0.01)
    assert belief.number("fc") + belief.number("sigma2") * slow == pytest.approx(
        found.steady(slow, model.parameters)
    )
    assert belief.number("sigma0") > belief.number("fs") > 0.0


def test_what_is_wrong_is_said_in_a_line():
    assert compensators_of(("all",)) == tuple(CATALOGUE)
    with pytest.raises(UnknownName, match="unknown compensator 'dobs'; did you mean 'dob'"):
        compensators_of(("dobs",))
    with pytest.raises(
        InputError, match="compensators=\"dob,all\": 'all' stands alone; give it without the others"
    ):
        compensators_of(("dob", "all"))
    # None is what is not given: only the loop is found wanting.
    with pytest.raises(InputError, match="loop: '' names no gain"):
        recommend_verb("m.toml", bandwidth=None, damping=None, loop="")
    for made in (lambda: Drive(math.inf), lambda: RigidAxis(math.nan, known(**THESIS).model)):
        with pytest.raises(ParameterError, match="must be greater than 0 and finite"):
            made()
    loop = compensated("dob", "PD", belief_of(known(**THESIS).model, Drive(amplitude=0.1), 4e-4))
    with pytest.raises(ParameterError, match="have their own loop; leave controller out"):
        belief_of(known(**THESIS).model, Drive(amplitude=0.1, controller=loop), 4e-4)


@pytest.mark.parametrize(
    ("cycles", "counts", "swing", "said"),
    [
        (1.5, 0.0, 1e-3, "hunts at rest, 1000 µrad peak to peak"),  # cut in mid-cycle: its net way is all
        (20.25, 0.0, 1e-3, "hunts at rest, 1000 µrad peak to peak"),
        (20.25, 2.0**16, 2.8e-4, ""),  # within the neighbours of a count: no loop holds an axis closer
        (20.25, 2.0**16, 3.0e-4, "hunts at rest, 300 µrad peak to peak"),
        (0.5, 0.0, 1e-3, ""),  # a creep
    ],
)
def test_a_limit_cycle_is_as_large_as_what_rises_and_falls_again(monkeypatch, cycles, counts, swing, said):
    drive = Drive(amplitude=0.2, encoder_counts=counts)
    seen = round(0.5 * long_rest.RESTS / drive.sample_time)
    position = 0.5 * swing * np.cos(2.0 * math.pi * cycles * np.linspace(0.0, 1.0, seen))
    monkeypatch.setattr(long_rest, "simulated", lambda *_: position)
    before = beside.Trial({"position_rms_rad": 1e-6}, position, position, drive.sample_time)
    bench = SimpleNamespace(
        drive=drive,
        plants=[None],
        before=lambda _: before,
        ran=lambda: None,
        longest_rest=0.0,
        hunted_within=0.0,
    )
    assert beside.limit_cycle(Controller(Gains(1.0), sample_time=drive.sample_time), bench, 0) == said


def test_what_is_switched_on_tells_what_it_learned_with_its_uncertainty():
    learned = {
        "feedforward_scale": {"meaning": "scale", "unit": "-", "value": 1.02, "uncertainty": 0.03},
        "feedforward_angle": {"meaning": "map", "unit": "N·m", "value": [0.1, 0.2], "uncertainty": None},
    }
    taken = beside.Beside("scale-dob", "PD", (0.1,), "", None, learned)
    lines = instead_lines(SimpleNamespace(hunts="", chosen=None), taken)
    assert lines[-3].startswith("switch on:         PD + scale-dob; it leaves at most 10.0 %")
    assert "up to 14.0 % with what is not simulated" in lines[-3]
    assert lines[-2] == "learned there:     scale (feedforward_scale) = 1.02 ± 0.03"
    assert lines[-1].endswith("= 2 values from 0.1 to 0.2 N·m; no uncertainty given")


# ---- "my axis sticks at reversal and my PID hunts; what do I switch on?" -------------------------------------------

STRANGERS = {
    "direct drive": (
        {"inertia": 1.2e-3, "sigma0": 2e4, "fs": 0.9, "fc": 0.7, "vs": 0.02, "sigma2": 0.03}, 262_144.0, 10.0, 4.0
    ),
    "belt drive": (
        {"inertia": 5e-3, "sigma0": 8e3, "fs": 2.2, "fc": 1.9, "vs": 0.05, "sigma2": 0.1}, 131_072.0, 8.0, 12.0
    ),
    "worm gear": (
        {"inertia": 2e-3, "sigma0": 1.2e4, "fs": 1.3, "fc": 0.9, "vs": 0.03, "sigma2": 0.2}, 262_144.0, 8.0, 6.0
    ),
}  # fmt: skip
AMPLITUDE, FREQUENCY, MOVES, RESTS = 0.1, 0.5, 4.0, 20.0


def stranger(numbers, counts, limit):
    """The machine as it is: springs in series and slip one after the other, which no LuGre law has."""
    springs = numbers["sigma0"] * np.array([0.4, 0.3, 0.2, 0.1])
    law = Model(
        "gms", k=springs.tolist(), alpha=[0.25] * 4, c=30.0 * numbers["fc"], fs=numbers["fs"], fc=numbers["fc"],
        vs=numbers["vs"], sigma2=numbers["sigma2"],
    )  # fmt: skip
    return Machine(
        "stranger", numbers["inertia"], Contact(law), encoder=Encoder(counts=counts), limits={"torque": limit}
    )


def along(machine, control, phase=0.0):
    """Its metrics along a sine that then stops for long; it starts by that part of a count off one."""
    t = np.arange(0.0, MOVES + 1e-9, 1e-2)
    w = 2.0 * math.pi * FREQUENCY
    position, velocity = AMPLITUDE * (1.0 - np.cos(w * t)), AMPLITUDE * w * np.sin(w * t)
    table = Reference(
        "table", time=[*t, MOVES + RESTS], position=[*position, position[-1]], velocity=[*velocity[:-1], 0.0, 0.0]
    )  # fmt: skip
    start = (phase * 2.0 * math.pi / machine.encoder.counts, 0.0)
    return judged(simulate(machine, control, table, MOVES + RESTS, metered=False, initial=start))


def usually(machine, control, phases=8):
    """The medians over the phases of the encoder: where a loop comes to rest between two counts is chance."""
    every = [along(machine, control, (k + 0.5) / phases) for k in range(phases)]
    return {
        name: float(np.median([m[name] for m in every])) for name in every[0] if every[0][name] is not None
    }


def calm(metrics, counts):
    """Whether it neither hunts nor chatters."""
    swing = max(between_counts(counts), 0.03 * metrics["rms_rad"], 3e-5)
    return metrics["hunting_rad"] <= swing and metrics["chatter_Nm"] <= CHATTER * metrics["effort_Nm"]


@pytest.mark.slow
@pytest.mark.parametrize("name", STRANGERS)
def test_a_stranger_whose_pid_hunts_is_told_what_to_switch_on(name):
    numbers, counts, bandwidth, limit = STRANGERS[name]
    machine = stranger(numbers, counts, limit)
    drive = Drive(
        bandwidth, amplitude=AMPLITUDE, frequency=FREQUENCY, torque_limit=limit, encoder_counts=counts, linear="PID"
    )  # fmt: skip
    found = known(**numbers, off=1.04)
    advice = recommend(found, drive, axes=3, confirm=9, compensators=tuple(CATALOGUE))
    assert advice.instead is not None
    given = usually(machine, advice.instead.controller)
    assert calm(given, counts)
    belief = belief_of(found.model, drive, numbers["inertia"])
    bench = {}
    for compensator, entry in CATALOGUE.items():
        for loop in entry.loops or ("PD",):
            try:
                made = compensated(compensator, loop, belief)
            except ParameterError:  # no GMS law is known
                continue
            bench[loop, compensator] = along(machine, made)
    assert not calm(bench["PID", "none"], counts)  # what the stranger complains of
    best = min(m["rms_rad"] for m in bench.values() if calm(m, counts))
    assert given["rms_rad"] <= 1.2 * best
