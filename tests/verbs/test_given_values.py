"""What the user holds has a value, and a row of its own beside what was fitted."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import stickslip as ss
from stickslip.cli import main
from support.written_log import written

FC = 0.3


@pytest.fixture(scope="module")
def log() -> dict[str, np.ndarray]:
    """Two sines with friction and noise."""
    t = np.arange(5000) * 1e-3
    w = 2.0 * np.pi * np.array([0.5, 0.8])
    v = 6.0 * np.sin(w[0] * t) + 3.0 * np.sin(w[1] * t)
    a = 6.0 * w[0] * np.cos(w[0] * t) + 3.0 * w[1] * np.cos(w[1] * t)
    torque = 4e-3 * a + FC * np.sign(v) + 0.02 * v
    noise = np.random.default_rng(2).normal(0.0, 0.02, t.size)
    return {"t": t, "position": np.round(np.cumsum(v) * 1e-3, 6), "torque": torque + noise}


@pytest.mark.parametrize("method", ["axis", "sliding"])
def test_nothing_is_held_without_a_value(log: dict[str, np.ndarray], method: str) -> None:
    """An internal value where a search starts was frozen in silence."""
    if method == "sliding":
        v = np.repeat([1.0, 2.0, 3.0, -1.0, -2.0, -3.0], 1000)
        log = {
            "t": np.arange(v.size) * 1e-3,
            "position": np.cumsum(v) * 1e-3,
            "torque": FC * np.sign(v) + 0.02 * v,
        }
    with pytest.raises(ss.InputError, match=r'fc cannot be held without a value; give values=\{"fc": \.\.\}'):
        ss.identify(**log, law="coulomb", method=method, frozen=["fc"])


def test_what_is_given_stands_beside_what_was_fitted(log: dict[str, np.ndarray], tmp_path: Path) -> None:
    found = ss.identify(**log, law="coulomb", frozen=["fc"], values={"fc": FC})
    assert dict(found.given) == {"fc": FC}
    assert "fc" not in found.parameters
    row = next(line for line in str(found).splitlines() if line.startswith("fc "))
    assert row.split()[1:4] == ["0.3", "N·m", "given"]
    assert "<td>fc</td><td>0.3</td><td></td><td>N·m</td><td>given</td>" in found._repr_html_()
    assert ">given</td>" in found.report(tmp_path / "r.html").read_text()


def test_the_command_says_what_was_given(
    log: dict[str, np.ndarray], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = written(log, tmp_path)
    command = ["identify", str(file), "--law", "coulomb", "--no-report", "--out", str(tmp_path / "m.toml")]
    assert main([*command, "--freeze", "fc"]) == 2
    assert "give --set fc=.." in capsys.readouterr().err
    assert main([*command, "--freeze", f"fc={FC}"]) == 0
    row = next(line for line in capsys.readouterr().out.splitlines() if line.startswith("fc "))
    assert "given" in row
