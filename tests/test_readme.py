"""Everything the README and CONTRIBUTING show is run."""

from __future__ import annotations

import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

from stickslip.cli import parser_of

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text()
CONTRIBUTING = (ROOT / "CONTRIBUTING.md").read_text()


def blocks(text: str, kind: str) -> list[str]:
    return re.findall(rf"```{kind}\n(.*?)```", text, re.DOTALL)


def test_python_examples_run_in_order(tmp_path, capsys):
    """As one session, from top to bottom, in a folder of their own."""
    script = "\n".join(blocks(README, "python"))
    out = subprocess.run(
        [sys.executable, "-c", script], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert out.returncode == 0, out.stderr
    assert float(out.stdout.split()[0]) == pytest.approx(0.00995, rel=1e-3)
    assert (tmp_path / "move.npz").exists()


def test_commands_run(tmp_path):
    commands = [line for line in blocks(README, "sh")[-1].splitlines() if line.strip()]
    environment = {**os.environ, "PATH": f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"}
    for command in commands:
        out = subprocess.run(
            shlex.split(command), cwd=tmp_path, env=environment, capture_output=True, text=True, check=False
        )
        assert out.returncode == 0, f"{command}: {out.stderr}"
    assert (tmp_path / "step-study" / "report.html").exists()
    assert (tmp_path / "c" / "model.c").exists()


def test_the_other_commands_are_spelt_right(tmp_path):
    """What takes a rig's time or a log of the user's own: every flag and name is one that the command knows."""
    shown = [line for block in blocks(README, "sh")[2:-1] for line in block.splitlines()]
    assert len(shown) >= 8
    for line in shown:
        name, *arguments = shlex.split(line, comments=True)
        assert name == "stickslip"
        parser_of(arguments[:1]).parse_args(arguments)  # complains of what it does not know


@pytest.mark.slow
def test_first_command_in_a_fresh_environment(tmp_path):
    """The README's first line, as it stands, on a copy of the sources; one reference of the study for brevity."""
    study, tests = blocks(README, "sh")[:2]
    assert study.strip().endswith("stickslip study thesis")
    assert tests.strip().endswith("-m pytest")
    copy = tmp_path / "copy"
    copy.mkdir()
    for name in ("src", "pyproject.toml", "README.md", "LICENSE"):
        os.symlink(ROOT / name, copy / name)
    environment = {**os.environ, "STICKSLIP_CACHE": str(tmp_path / "cache")}
    out = subprocess.run(
        study.strip() + " --only step",
        shell=True,
        cwd=copy,
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )
    assert out.returncode == 0, out.stderr
    assert (copy / "study-thesis" / "report.html").exists()
    assert (copy / "study-thesis" / "metrics.csv").read_text().count("\n") == 1 + 60


def test_law_of_contributing_passes_the_contract(tmp_path):
    """One file of at most 60 lines: listed, simulated, compensating, and through the contract suite."""
    (text,) = blocks(CONTRIBUTING, "python")
    assert len(text.splitlines()) <= 60
    path = tmp_path / "dahl_example.py"
    path.write_text(text)
    environment = {**os.environ, "STICKSLIP_LAWS": str(path)}
    python = [sys.executable, "-m"]
    listing = subprocess.run(
        [*python, "stickslip", "laws"], env=environment, capture_output=True, text=True, check=False
    )
    assert "dahl-example" in listing.stdout, listing.stderr
    shown = subprocess.run(
        [*python, "stickslip", "law", "dahl-example"],
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )
    assert "stiffness at rest" in shown.stdout, shown.stderr
    suite = subprocess.run(
        [*python, "pytest", "-p", "no:cacheprovider", "tests/contract", "-k", "dahl and example"],
        cwd=ROOT, env=environment, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert suite.returncode == 0, suite.stdout[-3000:]
    passed = re.search(r"(\d+) passed", suite.stdout)
    assert passed is not None
    assert int(passed.group(1)) >= 10
