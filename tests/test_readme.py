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
    _, *rest = blocks(README, "python")
    script = "\n".join(["import stickslip as ss", *rest])
    out = subprocess.run(
        [sys.executable, "-c", script], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert out.returncode == 0, out.stderr
    assert float(out.stdout.split()[0]) == pytest.approx(0.00995, rel=1e-3)
    assert (tmp_path / "move.npz").exists()


@pytest.mark.slow
def test_the_first_example_in_python_gives_the_numbers_of_its_commands(tmp_path):
    """From the log that ships to C, as printed; the friction that the log was made with lies in the interval."""
    script = blocks(README, "python")[0]
    run_as_printed(["stickslip demo --log log.csv"], tmp_path)
    out = subprocess.run(
        [sys.executable, "-c", script], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert out.returncode == 0, out.stderr
    low, high = (float(x) for x in re.findall(r"0\.\d+", out.stdout)[:2])
    assert low < 0.285 < high
    assert (tmp_path / "report.html").exists()
    assert (tmp_path / "c" / "model.c").exists()


def run_as_printed(commands: list[str], folder: Path) -> None:
    """Line by line, by a shell, in a folder of their own and without what the user had told earlier."""
    environment = {
        **os.environ, "PATH": f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}",
        "XDG_CONFIG_HOME": str(folder / "settings"),
    }  # fmt: skip
    for command in commands:
        out = subprocess.run(
            command, shell=True, cwd=folder, env=environment, capture_output=True, text=True, check=False
        )
        assert out.returncode == 0, f"{command}: {out.stderr}"


def of_the_verbs(block: str) -> list[str]:
    return [line for line in block.splitlines() if line.startswith("stickslip ")]


@pytest.mark.slow
def test_commands_run_as_they_are_printed(tmp_path):
    """From the first example, whose log ships, to the last, which takes up what the first found."""
    _, _, first, _, last = blocks(README, "sh")
    run_as_printed([*of_the_verbs(first), *of_the_verbs(last)], tmp_path)
    assert (tmp_path / "axis" / "report.html").exists()
    assert (tmp_path / "recommended-c99").is_dir()
    assert (tmp_path / "step-study" / "report.html").exists()
    assert (tmp_path / "c" / "model.c").exists()


@pytest.mark.slow
@pytest.mark.long
def test_commands_on_a_machine_run_as_they_are_printed(tmp_path):
    run_as_printed(of_the_verbs(blocks(README, "sh")[3]), tmp_path)
    assert (tmp_path / "commissioned" / "recommended.toml").exists()
    assert (tmp_path / "sweep-thesis-robustness" / "summary.csv").exists()


def test_every_command_is_one_that_is_run():
    """By one of the tests here; and every flag and name is one that the command knows."""
    shown = blocks(README, "sh")
    assert len(shown) == 5
    for line in [line for block in shown[2:] for line in block.splitlines()]:
        name, *arguments = shlex.split(line, comments=True)
        assert name == "stickslip", f"{line!r} is run by no test"
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
    # What is not imported need not be translated: all of SciPy's and Matplotlib's files take 12 s of the processor.
    # Compiled code goes by the content of its text: what the sources' tests compiled is found from here too (50 s).
    environment = {**os.environ, "PIP_COMPILE": "0"}
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
        # In one process: others would each collect the suite first.
        [*python, "pytest", "-n0", "-p", "no:cacheprovider", "tests/contract", "-k", "dahl and example"],
        cwd=ROOT, env=environment, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert suite.returncode == 0, suite.stdout[-3000:]
    passed = re.search(r"(\d+) passed", suite.stdout)
    assert passed is not None
    assert int(passed.group(1)) >= 10
