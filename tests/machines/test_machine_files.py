"""A machine's file: printed, written, read again, and begun from a template with every key."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path

import pytest

import stickslip as ss
from stickslip.cli import main
from stickslip.core.errors import ConfigError, InputError
from stickslip.machines.files import library
from stickslip.machines.keys import PARTS
from stickslip.machines.written import machine_text, template
from support import identified_files


def again(machine: ss.Machine, folder: Path) -> ss.Machine:
    """The machine as its own file has it."""
    return ss.load_machine(machine.write(folder / f"{machine.name}.toml"))


@pytest.mark.parametrize("name", library())
def test_a_machine_of_the_package_comes_again_of_what_is_printed_and_of_what_is_written(
    name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    machine = ss.load_machine(name)
    assert main(["machine", name, "--print"]) == 0
    printed = tmp_path / "printed" / f"{name}.toml"
    printed.parent.mkdir()
    printed.write_text(capsys.readouterr().out)
    assert ss.load_machine(printed) == machine
    assert again(machine, tmp_path) == machine
    assert machine_text(again(machine, tmp_path)) == machine_text(machine)


def test_a_changed_copy_runs(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["machine", "thesis-dry", "--print"]) == 0
    mine = tmp_path / "mine.toml"
    mine.write_text(capsys.readouterr().out.replace("counts = 1000000", "counts = 4096"))
    run = tmp_path / "run.toml"
    run.write_text(
        '[machine]\nmachine = "mine.toml"\n[reference]\nkind = "sine"\namplitude = 0.05\nfrequency = 2.0\n'
        'duration = 0.1\n[controller]\nlinear = "PD"\nplacement = {bandwidth_hz = 10.0, damping = 0.85}\n'
    )
    assert main(["simulate", str(run), "--out", str(tmp_path / "run.npz")]) == 0
    assert ss.Record.load(tmp_path / "run.npz").meta["machine"]["name"] == "mine"


def test_switched_off_imperfections_stay_off(tmp_path: Path) -> None:
    bare = ss.load_machine("thesis-dry").without("flexibility", "cogging", "direction", "drift", "converters")
    other = again(bare, tmp_path)
    assert replace(other, flexible_stiffness=bare.flexible_stiffness, switched_off=bare.switched_off) == bare


def test_a_machine_on_an_identified_model_names_its_file(tmp_path: Path) -> None:
    model = ss.Model.from_file(identified_files.written(tmp_path / "model.toml"))
    file = tmp_path / "axis.toml"
    file.write_text('inertia = 4e-4\n[friction]\nlaw = {model = "model.toml"}\n')
    machine = ss.load_machine(file)
    assert machine.friction == model
    assert again(replace(machine, name="other"), tmp_path).friction == model


@pytest.mark.parametrize("left", ["flexible", "two_mass"])
def test_the_template_holds_every_key_with_its_default(
    left: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["machine", "--template"]) == 0
    text = capsys.readouterr().out
    assert text == template()
    file = tmp_path / "mine.toml"
    file.write_text(text)
    assert again(ss.load_machine(file), tmp_path) == ss.load_machine(file)
    # Of the two trains a file has one.
    one = re.sub(rf"^# \[{left}\]\n(# .*\n)+", "", text, flags=re.MULTILINE)
    assert one != text
    file.write_text(re.sub(r"^# (?=\[|\w+ = )", "", one, flags=re.MULTILINE))
    whole = ss.load_machine(file)  # every key can be read
    assert again(whole, tmp_path) == whole
    for part in PARTS:
        assert all(
            re.search(rf"^(# )?{key.name} = .*# .*{re.escape(key.par.meaning)}", text, re.M)
            for key in part.keys
        )
    assert whole.flexible
    assert whole.encoder.max_speed == 37.7


def test_what_a_machine_is_is_said_with_units(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["machine"]) == 0
    assert [line.split()[0] for line in capsys.readouterr().out.splitlines()] == list(library())
    assert main(["machine", "thesis-dry"]) == 0
    said = capsys.readouterr().out
    for words in (
        "0.00042757 kg·m²",
        "sample_time",
        "17800 N·m/rad",
        "free modes: 0, 307.8, 2749 Hz",
        "lugre, gms",
    ):
        assert words in said
    assert main(["machine", "thesis-dry", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["encoder"]["counts"] == 1e6


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("inertia = 4e-4\n[friction]\nlaw = 3", "law = 3 must be a string"),
        ("inertia = 4e-4", "friction is missing"),
        ('inertia = 4e-4\nseed = 1.5\n[friction]\nlaw = "coulomb"\nfc = 0.1', "seed = 1.5 must be a whole number"),
        (
            'inertia = 4e-4\n[friction]\nlaw = "coulomb"\nfc = 0.1\n[encoder]\ncount = 4096',
            "encoder.count: unknown key; did you mean 'counts'",
        ),
        ("[machine]\nmachine = 'ideal'\n[reference]\n[controller]", "is a simulation, not a machine"),
    ],
)  # fmt: skip
def test_a_file_that_is_none_is_refused_in_a_line(
    text: str, said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "mine.toml"
    file.write_text(text)
    assert main(["machine", str(file)]) == 2
    told = capsys.readouterr().err
    assert said in told
    assert told.count("\n") == 1


def test_what_a_file_cannot_hold_is_refused(tmp_path: Path) -> None:
    machine = ss.load_machine("ideal")
    with pytest.raises(InputError, match=r"name it mine\.toml"):
        machine.write(tmp_path / "mine.txt")
    odd = replace(machine, amplifier=ss.Amplifier(1.0, command=ss.Converter(12, 5.0)))
    with pytest.raises(InputError, match="a file has one for both"):
        odd.write(tmp_path / "odd.toml")
    with pytest.raises(ConfigError, match="no file"):
        ss.load_machine(tmp_path / "odd.toml")


def test_amplitudes_without_a_peak_are_parts_of_friction(tmp_path: Path) -> None:
    file = tmp_path / "rippled.toml"
    file.write_text(
        'inertia = 4e-4\n[friction]\nlaw = "viscous"\nsigma2 = 0.1\n'
        "[ripple]\norder = [3]\namplitude = [0.1]\nphase = [0.0]\n"
    )
    assert ss.load_machine(file).contact.ripple.amplitude == (0.1,)


def test_a_machine_built_of_its_parts_runs_and_comes_again_of_its_file(tmp_path: Path) -> None:
    axis = ss.FlexibleAxis(1.5e-4, 0.5e-4, 2e-4, coupling=8e3, elasticity=300.0, damping=0.02)
    converter = ss.Converter(14, 10.0)
    contact = ss.Contact(
        ss.Model("coulomb", fc=0.285, sigma2=0.018), ss.Harmonics((3.0,), (0.1,), (0.2,)), (1.0, 0.95),
        ss.Bearings(0.02, 0.002), ss.Drift(-0.1, 60.0, 1.0), ss.Heat(-0.001, resistance=1.0),
    )  # fmt: skip
    machine = ss.Machine(
        "own", axis.inertia, contact, "Built of parts", axis,
        amplifier=ss.Amplifier(0.2, 15.0, 1500.0, converter, converter),
        cogging=ss.Harmonics((12.0,), (0.005,), (0.0,)), encoder=ss.Encoder(65536.0),
        sensor=ss.Sensor(0.01, ss.Converter(12, 5.0)), delay=0.5,
        sample_time=5e-4, seed=3, limits={"torque": 2.0}, models={"c": ss.Model("coulomb", fc=0.3)}, notes=("A note.",),
        start_angle=0.1,
    )  # fmt: skip
    assert again(machine, tmp_path) == machine
    loop = ss.Controller(ss.place("PD", machine.inertia, 20.0))
    run = ss.simulate(machine, loop, ss.Reference("sine", amplitude=0.05, frequency=2.0), 0.05)
    assert run.meta["sample_time"] == 5e-4


@pytest.mark.parametrize(
    "name", ["Amplifier", "Converter", "Encoder", "FlexibleAxis", "Harmonics", "Machine", "Sensor"]
)
def test_the_help_of_a_part_says_units_and_defaults(name: str) -> None:
    said = getattr(ss, name).__doc__
    assert said.count("Attributes\n----------") == 1
    assert ("Frequency of its mounting's mode; 0 for none (Hz, default 0)." in said) is (name == "Encoder")


def test_a_contact_without_springs_has_no_stiffness_to_give() -> None:
    axis = ss.FlexibleAxis(1.5e-4, 0.5e-4, 2e-4, 8e3, 300.0)
    contact = ss.Contact(ss.Model("coulomb", fc=0.285))
    with pytest.raises(
        ss.InputError, match=r"flexible_stiffness = 5000 .* law 'coulomb' has none; leave it out"
    ):
        ss.Machine("own", axis.inertia, contact, flexible=axis, flexible_stiffness=5e3)
    with pytest.raises(ss.InputError, match="flexible_stiffness = -1 "):
        ss.Machine("own", axis.inertia, contact, flexible=axis, flexible_stiffness=-1.0)
