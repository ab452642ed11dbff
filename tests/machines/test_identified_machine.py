"""A model.toml of `identify` is a machine wherever one is asked for."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

import stickslip as ss
from stickslip.cli import main
from stickslip.core.errors import InputError, StickslipError
from stickslip.machines.files import machine

HEAD = 'format = "stickslip-model-1"\nlaw = "coulomb"\n'
LAW = "[parameters]\nfc = 0.3\nsigma2 = 0.01\n"
PENDULUM = "[axis]\ninertia = 4e-4\ngravity = 0.6\ngravity_angle = 0.4\n"
BELT = (
    "[drivetrain]\nantiresonance = 11.0\nantiresonance_interval = [10.0, 12.0]\nmotor_share = 0.25\n"
    "motor_share_interval = [0.2, 0.3]\n"
)


@pytest.fixture
def model(tmp_path: Path) -> Path:
    path = tmp_path / "arm.toml"
    path.write_text(HEAD + LAW + PENDULUM + BELT)
    return path


def test_it_has_friction_inertia_weight_and_springs(model: Path) -> None:
    found = ss.load_machine(model)
    assert (found.name, found.inertia) == ("arm", 4e-4)
    assert found.friction == ss.Model("coulomb", fc=0.3, sigma2=0.01)
    assert found.flexible is not None
    assert found.flexible.modes[1] == pytest.approx(22.0, rel=1e-3)
    weight = found.cogging
    q = np.linspace(-3.0, 3.0, 7)
    torque = weight.amplitude[0] * np.cos(q + weight.phase[0])
    assert torque == pytest.approx(-0.6 * np.sin(q - 0.4))
    assert any("damped by 0.03 of critical" in note for note in found.notes)


def test_a_rigid_one_moves_as_its_axis(model: Path) -> None:
    model.write_text(HEAD + LAW + "[axis]\ninertia = 4e-4\n")
    controller = ss.Controller(ss.place("PD", 4e-4, 10.0), sample_time=1e-3)
    slow = ss.Reference("sine", amplitude=0.5, frequency=0.5)
    own = ss.simulate(ss.load_machine(model), controller, slow, 1.0)
    axis = ss.simulate(ss.RigidAxis(4e-4, ss.Model.from_file(model)), controller, slow, 1.0)
    assert np.interp(1.0, own.time, own["position"]) == pytest.approx(axis["position"][-1], abs=1e-6)


def test_it_is_shown_printed_and_run(
    model: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(model.parent)
    assert main(["machine", "arm.toml"]) == 0
    assert "free modes: 0, 22 Hz" in capsys.readouterr().out
    assert main(["machine", "arm.toml", "--print"]) == 0
    Path("printed.toml").write_text(capsys.readouterr().out)
    one, other = machine("arm.toml"), machine("printed.toml")
    assert (one.flexible, one.cogging, one.friction) == (other.flexible, other.cogging, other.friction)
    assert main(["rig", "run", "breakaway", "--rig", "arm.toml", "--dry-run"]) == 0


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (HEAD + LAW, "holds no inertia"),
        (HEAD.partition("\n")[2] + LAW, "holds no inertia"),
        (HEAD + LAW + "[axis]\ninertia = -1.0\n", "holds no inertia"),
        (HEAD + LAW + '[axis]\ninertia = "much"\n', "axis.inertia = 'much' must be a number"),
        (HEAD + LAW + PENDULUM + BELT.replace("0.25", "0.5"), r"motor_share = 0.5 \[0.2, 0.3\]"),
        (HEAD + LAW + PENDULUM + "[drivetrain]\nantiresonance = 11.0\n", "its drivetrain lacks"),
        (HEAD.replace("1", "9") + LAW + PENDULUM, "is of another version"),
    ],
)
def test_a_damaged_one_is_refused_in_a_line(model: Path, content: str, said: str) -> None:
    model.write_text(content)
    with pytest.raises(InputError, match=said) as caught:
        ss.load_machine(model)
    assert "arm.toml" in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("share", [0.0, 1.0, math.nan])
def test_a_share_that_no_motor_has_is_refused(share: float) -> None:
    from stickslip.machines.two_inertias import TwoInertias

    with pytest.raises(StickslipError, match="motor_share"):
        TwoInertias(11.0, (10.0, 12.0), share, (share, share))
