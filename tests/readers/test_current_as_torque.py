"""A current that is called the torque: the torque constant makes it one."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from stickslip.cli import main
from stickslip.core.errors import InputError
from stickslip.readers import Drive, read


@pytest.fixture
def log(tmp_path: Path) -> Path:
    path = tmp_path / "log.csv"
    path.write_text("t_ms,q_deg,iq_A,note\n" + "".join(f"{k},{k}.5,{100 * k},{k}\n" for k in range(40)))
    return path


@pytest.mark.parametrize(
    ("said", "factor"), [("iq_A:mA", 1e-3), ("iq_A:A", 1.0), ("iq_A", 1.0), ("iq_A:-mA", -1e-3)]
)
def test_a_torque_with_a_unit_of_current_is_a_current(log, said, factor):
    """The example in the help of `doctor` itself was refused."""
    record = read(log, [f"torque={said}"], drive=Drive(torque_constant=0.05))
    np.testing.assert_allclose(record["motor_torque"][:3], 0.05 * factor * np.array([0.0, 100.0, 200.0]))
    assert "torque constant 0.05" in record.meta["derived"]["motor_torque"]


def test_a_profile_keeps_it_so(log, tmp_path, capsys, monkeypatch):
    monkeypatch.setenv("STICKSLIP_CONFIG", str(tmp_path / "config"))
    main(["doctor", str(log), "--map", "torque=iq_A:mA", "--torque-constant", "0.05"])
    capsys.readouterr()
    main(["doctor", str(log)])
    out = capsys.readouterr().out
    assert "current       'iq_A'" in out
    assert "current x torque constant 0.05" in out


def test_two_currents_and_a_voltage_are_refused(log):
    with pytest.raises(InputError, match=r"is a current, and map=\{\"current\": \"note:A\"\} names another"):
        read(log, ["torque=iq_A:mA", "current=note:A"])
    with pytest.raises(InputError, match="'V' is a unit of voltage; map it as voltage"):
        read(log, ["torque=iq_A:V"])
