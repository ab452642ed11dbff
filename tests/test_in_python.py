"""What the package says of options of the command line, it says of arguments to whoever called a function."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import stickslip as ss
from stickslip.cli import main
from stickslip.in_python import in_python, with_options

T = np.arange(0.0, 2.0, 1e-3)


@pytest.mark.parametrize(
    ("said", "function", "arrays", "python"),
    [
        ("say --map torque=COLUMN:Nm", "read", False, 'say map={"torque": "COLUMN:Nm"}'),
        ("say --map torque=COLUMN:Nm", "read", True, 'say torque=..., units={"torque": "Nm"}'),
        ("--map 'motor_torque=tau:-N·m', if", "read", True, 'units={"torque": "-N·m"}, if'),
        ("leave it out with --map load=none", "read", True, "leave it out with normal_force=None"),
        ("--map position=q:counts --counts-per-rev N", "read", False,
         'map={"position": "q:counts"}, counts_per_rev=N'),
        ("say --map supply=u --map voltage=none", "read", False, 'say map={"supply": "u", "voltage": "none"}'),
        ("each alone: --to 1.5, and --from 1.5", "identify", False, "each alone: end=1.5, and start=1.5"),
        ("or use --to c99", "export", False, 'or use to="c99"'),
        ("leave --compensator out", "export", False, "leave compensator out"),
        ("--torque-limit 5 and the limit of --loop", "recommend", False, "torque_limit=5 and the limit of loop"),
        ("give --set fs=.. (values)", "identify", False, 'give values={"fs": ..} (values)'),
        ("give --set bits=VALUE", "export", False, 'give settings={"bits": VALUE}'),
        ("with --leave-out spikes", "identify", False, 'with leave_out=["spikes"]'),
        ("with --leave-out 1:4 --leave-out 7:9, or", "identify", False, 'with leave_out=["1:4", "7:9"], or'),
        ("its controller (--loop kp=..,kd=..)", "identify", False, 'its controller (loop={"kp": .., "kd": ..})'),
        ("--loop kp=nan: nan must be", "recommend", False, 'loop={"kp": nan}: nan must be'),
        ("give --side load, and", "identify", False, 'give side="load", and'),
        ("identify with --pendulum, or", "identify", False, "identify with pendulum=True, or"),
        ("say so: --torque-is commanded and --delay 0. Or", "identify", False,
         'say so: torque_is="commanded" and delay=0. Or'),
        ("give it (--torque-is, --delay), or", "identify", False, "give it (torque_is, delay), or"),
        ("or simulate it (`stickslip simulate`)", "stability", False, "or simulate it (`ss.simulate(...)`)"),
        ("run `stickslip tune x.toml --out y`", "sweep", False, "run `stickslip tune x.toml --out y`"),
    ],
)  # fmt: skip
def test_options_become_arguments(said: str, function: str, arrays: bool, python: str) -> None:
    assert in_python(said, function, arrays) == python
    with with_options():
        assert in_python(said, function, arrays) == said


def test_an_error_names_what_was_called(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The same mistake, from arrays, from a mapping and from the command line."""
    log = {"t": T, "position": np.sin(T)}
    with pytest.raises(ss.InputError, match=r'\(torque=\.\.\., units=\{"torque": "UNIT"\}\)') as error:
        ss.identify(**log)
    assert "--" not in str(error.value)
    with pytest.raises(ss.InputError, match=r'\(map=\{"torque": "COLUMN:UNIT"\}\)'):
        ss.identify({"time [s]": T, "position [rad]": np.sin(T)})
    file = tmp_path / "log.csv"
    np.savetxt(
        file, np.column_stack([*log.values()]), "%.6f", ",", header="time [s],position [rad]", comments=""
    )
    assert main(["identify", str(file), "--out", str(tmp_path)]) == 2
    assert "(--map torque=COLUMN:UNIT)" in capsys.readouterr().err


def test_what_is_printed_names_them_too() -> None:
    found = ss.doctor(t=T, position=np.sin(7.0 * T), torque=-np.cos(7.0 * T), velocity=-np.cos(7.0 * T))
    assert 'say units={"torque": "-N·m"}' in str(found)
    assert "--" not in str(found)
    assert "--map" not in found.errors[0].line()
