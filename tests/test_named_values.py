"""NAME=VALUE of the command line: the same rules for every option of every verb."""

from pathlib import Path

import numpy as np
import pytest

from stickslip.analyse.spectrum import spectrum
from stickslip.cli import main
from stickslip.core.errors import InputError
from stickslip.core.record import Record

MODEL = 'law = "coulomb"\n[parameters]\nfc = 0.5\n[axis]\ninertia = 0.02\n'
SPECTRUM = "analyse spectrum log.csv --channel position"
SPRINGS = "analyse flexibility --stiffness 100 --inertia 1"


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    t = np.arange(0.0, 2.0, 0.002)
    table = np.column_stack([t, np.sin(6.0 * t), 0.1 * np.sign(np.cos(6.0 * t))])
    np.savetxt("log.csv", table, delimiter=",", header="time_s,position_rad,torque_Nm", comments="")
    Path("model.toml").write_text(MODEL)


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (f"{SPECTRUM} --mode x=nan", "--mode x=nan: nan must be a finite number in Hz"),
        (f"{SPECTRUM} --mode x=-inf", "--mode x=-inf: -inf must be a finite number in Hz"),
        (f"{SPECTRUM} --mode x=-3", "modes['x'] = -3 Hz must be a finite number greater than 0"),
        (f"{SPECTRUM} --mode x=3,4", "'3,4' must be a number in Hz"),
        (f"{SPECTRUM} --mode 30", "--mode '30' must be NAME=HZ"),
        (f"{SPECTRUM} --mode x=30 --mode x=31", "--mode gives both 30 and 31; give x once"),
        (f"{SPECTRUM} --resolution nan", "argument --resolution: nan is not a number"),
        (f"{SPECTRUM} --from nan", "argument --from: nan is not a number"),
        (f"{SPRINGS} --torque dry=nan", "--torque dry=nan: nan must be a finite number in N·m"),
        (f"{SPRINGS} --torque 1 --torque 2", "give each a name, --torque NAME=NM"),
        (f"{SPRINGS} --claimed inf", "inf must be a finite number in Hz"),
        ("analyse flexibility --stiffness 100,nan --inertia 1", "nan must be a finite number in N·m/rad"),
        ("analyse stability --rig thesis-dry --filter nan", "argument --filter: nan is not a number"),
        ("identify log.csv --set fc=nan", "--set fc=nan: nan must be a finite number"),
        ("identify log.csv --freeze fc=inf", "--freeze fc=inf: inf must be a finite number"),
        ("identify log.csv --set fc=1 --freeze fc=2", "--freeze fc=2 contradicts fc=1; give one of them"),
        ("identify log.csv --set =3", "--set '=3' must be NAME=VALUE"),
        ("rig run breakaway --rig thesis-dry --limit torque=nan", "--limit torque=nan: nan must be a finite number"),
        ("rig run breakaway --rig thesis-dry --set rate", "--set 'rate' must be NAME=VALUE"),
        ("recommend model.toml --loop kp=nan", "--loop kp=nan: nan must be a finite number"),
        ("export model.toml --to mujoco --set joint=a --set joint=b", "--set gives both a and b; give joint once"),
        ("law coulomb --set fc=1 --set fc=2", "--set gives both 1 and 2; give fc once"),
    ],
)  # fmt: skip
def test_a_value_that_cannot_be_used_is_refused(
    call: str, said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(call.split()) == 2
    message = capsys.readouterr().err
    assert said in message
    assert "Traceback" not in message


def test_good_values_are_taken(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(f"{SPRINGS} --torque dry=0.3 --torque -1 --claimed 1".split()) == 0
    assert "twist under 0.3 N·m (dry)" in capsys.readouterr().out
    assert main(f"{SPECTRUM} --mode own=0.95".split()) == 0


@pytest.mark.parametrize("hertz", [float("nan"), float("inf"), 0.0, -1.0])
def test_python_refuses_a_mode_that_is_no_frequency(hertz: float) -> None:
    t = np.arange(0.0, 2.0, 0.002)
    record = Record(t, {"position": np.sin(6.0 * t)}, {"position": "rad"})
    with pytest.raises(InputError, match=r"modes\['x'\] = .* must be a finite number greater than 0"):
        spectrum(record, "position", modes={"x": hertz})
