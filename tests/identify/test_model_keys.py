"""A model's file that a person writes: keys that it does not have are named, with the nearest that it has."""

import re
from pathlib import Path

import pytest

import stickslip as ss
from stickslip.cli import main
from stickslip.core.errors import InputError

LAW = 'law = "coulomb"\n'
NUMBERS = "[parameters]\nfc = 0.51\nsigma2 = 0.08\n"
ASYMMETRIC = LAW + '[choices]\nsymmetry = "asymmetric"\n' + NUMBERS + "fc_negative = 0.43\n"


@pytest.fixture
def joint(tmp_path: Path) -> Path:
    return tmp_path / "joint.toml"


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (
            LAW + 'symmetry = "asymmetric"\ninertai = 0.2\n' + NUMBERS,
            "symmetry: unknown key; did you mean 'symmetry' in [choices]?; "
            "inertai: unknown key; did you mean 'inertia' in [axis]?",
        ),
        (LAW + "fc = 0.51\n" + NUMBERS, "fc: unknown key; did you mean 'fc' in [parameters]?"),
        (LAW + "[parametres]\nfc = 0.5\n", "parametres: unknown key; did you mean 'parameters'?"),
        (LAW + NUMBERS + "[axis]\ninertai = 0.2\n", "axis.inertai: unknown key; did you mean 'inertia'?"),
        (LAW + NUMBERS + "[axis]\nsigma2 = 0.2\n", "axis.sigma2: unknown key; did you mean 'sigma2' in [parameters]?"),
        (LAW + NUMBERS + "fc_negative = 0.4\n", 'it needs the choice symmetry = "asymmetric"'),
        (LAW + NUMBERS + '[axis]\ninertia = "0.2"\n', "axis.inertia = '0.2' must be a number"),
        (LAW + 'motion = "linaer"\n' + NUMBERS, "motion = 'linaer' is not known; did you mean 'linear'?"),
    ],
)  # fmt: skip
def test_what_a_model_file_does_not_have_is_named(
    joint: Path, content: str, said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    joint.write_text(content)
    with pytest.raises(InputError, match=re.escape(said)):
        ss.Model.from_file(joint)
    for call in (["export", str(joint), "--to", "urdf"], ["recommend", str(joint)]):
        assert main(call) == 2
        message = capsys.readouterr().err
        assert said in message
        assert message.count("\n") == 1


def test_a_study_names_the_choice_that_a_parameter_needs() -> None:
    with pytest.raises(
        InputError, match="no parameter 'fc_negative'; it needs the choice symmetry = \"asymmetric\""
    ):
        ss.Model("coulomb", fc=0.5, fc_negative=0.4)


def test_the_printed_model_file_is_a_model(joint: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["law", "coulomb"]) == 0
    plain = capsys.readouterr().out
    assert "with symmetry = asymmetric:\n  fc_negative" in plain
    assert main(["law", "coulomb", "--set", "symmetry=asymmetric", "--set", "fc_negative=0.2"]) == 0
    printed = capsys.readouterr().out.partition("in the file of a model (model.toml):\n")[2]
    joint.write_text(printed)
    found = ss.Model.from_file(joint)
    assert found.sliding_torque([1.0, -1.0]).tolist() == pytest.approx([0.303, -0.218])


def test_friction_of_each_direction_is_read(joint: Path) -> None:
    joint.write_text(ASYMMETRIC)
    assert ss.Model.from_file(joint).sliding_torque([1.0, -1.0]).tolist() == pytest.approx([0.59, -0.51])
