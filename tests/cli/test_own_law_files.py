"""Law files of one's own at the command line: one to begin from, checks of both kinds, names without their ending."""

from __future__ import annotations

import pytest

import stickslip as ss
from stickslip.cli import main
from stickslip.contract.control_laws import description as control_description
from stickslip.contract.description import description, required
from stickslip.core.errors import UnknownName


@pytest.fixture
def began(tmp_path, capsys, monkeypatch):
    """A file with the printed law of that kind."""
    monkeypatch.chdir(tmp_path)

    def made(kind: str) -> str:
        assert main(["law", "--template", kind]) == 0
        (tmp_path / f"my_{kind}.py").write_text(capsys.readouterr().out)
        return f"my_{kind}.py"

    return made


def test_the_printed_laws_run_as_they_are(began):
    friction = ss.Model(began("friction"), fc=0.3, vt=1e-3)
    loop = ss.ControlBlock(began("control"), kp=6.0, kd=0.1, corner=600.0, fc=0.28)
    control = ss.Controller(loop=loop, sample_time=1e-3, torque_limit=1.0)
    motion = ss.Reference("sine", amplitude=0.05, frequency=1.0)
    record = ss.simulate(ss.RigidAxis(4e-4, friction), control, motion, 0.3)
    assert record.meta["metrics"]["position_rms_rad"] < 0.01


def test_a_control_law_is_explained_and_checked_as_a_friction_law_is(began, capsys, monkeypatch):
    """There was no check of control laws at the command line."""
    file = began("control")
    assert main(["law", file]) == 0
    said = capsys.readouterr().out
    assert "place: loop" in said
    assert "filtered rate of the error" in said
    assert f'loop = {{law = "{file}", kp = 6.1' in said
    monkeypatch.setattr("stickslip.contract.control_laws.CHECKS", (control_description,))
    assert main(["law", file, "--check"]) == 0
    assert "no source is stated" in capsys.readouterr().out
    assert main(["law", "pid"]) == 0
    assert main(["law", file, "--plot"]) == 2
    assert "belong to friction laws" in capsys.readouterr().err


def test_a_law_of_ones_own_needs_no_source(began, capsys, monkeypatch):
    """It was "source is missing", and "1 checks failed"."""
    monkeypatch.setattr("stickslip.contract.CHECKS", (description,))
    monkeypatch.setattr("stickslip.contract.EXPORTS", ())
    file = began("friction")
    assert main(["law", file, "--check"]) == 0
    assert "no source is stated, which a law of your own may do" in capsys.readouterr().out
    assert main(["law", file]) == 0
    assert "source: none stated" in capsys.readouterr().out
    assert "source" in required(ss.law("lugre"))


def test_the_help_leads_to_the_printed_laws(capsys):
    assert main(["law", "--help"]) == 0
    assert "docs/howto/own_control_law.md" in capsys.readouterr().out
    for kind, words in ((ss.ControlBlock, "control"), (ss.Law, "friction"), (ss.ControlLaw, "control")):
        assert f"stickslip law --template {words}" in (kind.__doc__ or "")
    assert main(["law"]) == 2
    assert "--template" in capsys.readouterr().err


def test_a_file_named_without_its_ending_is_meant(began):
    """36 names were listed."""
    began("control")
    began("friction")
    with pytest.raises(UnknownName, match=r"did you mean 'my_control\.py'"):
        ss.ControlBlock("my_control")
    with pytest.raises(UnknownName, match=r"did you mean 'my_friction\.py'"):
        ss.Model("my_friction")
    with pytest.raises(UnknownName, match=r"has its ending, 'elsewhere\.py'"):
        ss.ControlBlock("elsewhere")


def test_an_unknown_choice_says_which_there_are():
    with pytest.raises(UnknownName, match=r"'curv'; did you mean 'curve'\? Its choices are curve, viscous,"):
        ss.law("lugre").having(curv="table")
