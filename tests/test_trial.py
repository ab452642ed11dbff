"""A law from outside is refused when it is read or first used: a path without a return, a step that is not its rate."""

from __future__ import annotations

import subprocess
import sys

import pytest

from stickslip.cli import main
from stickslip.core import smoke_test
from stickslip.core.errors import LawError
from stickslip.models import plugins
from support.faulty import END, RATE, dahl

NO_RETURN = dahl((END, END.replace("    return z.force", "        return z.force")))
FAULTS = {
    "a path of step": (NO_RETURN, r"law\.py, line 35: step\(\) goes on here without returning a number"),
    "all of step": (
        dahl((END, END.replace("    return z.force", "    z.force = z.force"))), r"step\(\) goes on here"
    ),
    "a path of a callee": (
        dahl(("    return goal +", "    if distance > 0.0:\n        return goal +")),
        r"slide\(\) goes on here",
    ),
    "return of nothing": (
        dahl(("    if v == 0.0:\n        return 0.0", "    if v == 0.0:\n        return None")),
        r"steady\(\) goes on here",
    ),
    "the value of nothing": (
        dahl(
            ("def step(", "def note(z):\n    z.force = 0.0\n\n\ndef step("),
            (END, END.replace("return", "return note(z) +")),
        ),
        r"the value of note\(\), which returns none",
    ),
    "a rate of half": (dahl((RATE, RATE.replace("p.sigma0", "0.5 * p.sigma0"))), "not the same law.*'force' moves"),
    "a rate of the wrong sign": (dahl((RATE, RATE.replace("(v -", "(v +"))), "step and rate are not the same law"),
    "another torque": (dahl(("    dz.force", "    z.force = 1.1 * z.force\n    dz.force")), "where step gives"),
    "a division by dt": (
        dahl((END, END.replace("return z.force", "return z.force + 0.0 * (v1 - v0) / dt"))), "ZeroDivisionError"
    ),
    "a torque of no number": (
        dahl((END, END.replace("return z.force", "return z.force * math.inf"))), "not finite"
    ),
    "a name without a value": (
        dahl((END, "        late = 1.0\n" + END.replace("return", "return late *"))), "UnboundLocalError"
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", FAULTS)
def test_a_fault_is_said_when_the_law_is_read(name, tmp_path, capsys):
    text, said = FAULTS[name]
    file = tmp_path / "law.py"
    file.write_text(text)
    with pytest.raises(LawError, match=said) as caught:
        plugins.law(str(file))
    assert "\n" not in str(caught.value)
    assert main(["law", str(file)]) == 2
    assert capsys.readouterr().err.count("\n") == 1


def test_a_run_with_such_a_law_ends_before_it_begins(tmp_path):
    """It gave metrics with exit code 0, and 94 MB on stderr for a second of motion."""
    (tmp_path / "law.py").write_text(NO_RETURN)
    (tmp_path / "run.toml").write_text(
        '[axis]\ninertia = 4e-4\n[friction]\nlaw = "law.py"\nsigma0 = 3.5e4\nfc = 0.285\n'
        '[reference]\nkind = "sine"\namplitude = 0.01\nfrequency = 4.0\nduration = 1.0\n'
        '[controller]\nlinear = "PD"\nplacement = {bandwidth_hz = 36.0, damping = 1.0}\n'
    )
    done = subprocess.run(
        [sys.executable, "-m", "stickslip", "simulate", "run.toml", "--allow-code"],
        cwd=tmp_path, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 2
    assert len(done.stderr.splitlines()) <= 2
    assert "without returning a number" in done.stderr


def test_the_law_without_a_fault_passes(tmp_path):
    (tmp_path / "law.py").write_text(dahl())
    assert plugins.law(str(tmp_path / "law.py")).name == "dahl-example"


@pytest.mark.parametrize("name", plugins.law_names())
def test_no_registered_law_with_any_option_is_complained_of(name):
    law = plugins.law(name)
    for variant in [law, *(law.having(**{c.name: o}) for c in law.choices for o in c.options)]:
        assert smoke_test.complaint(variant) == "", variant.chosen
