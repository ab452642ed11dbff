"""Everything the README and CONTRIBUTING show is run."""

from __future__ import annotations

import doctest
import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

import stickslip
from stickslip.cli import main, parser_of

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text()
CONTRIBUTING = (ROOT / "CONTRIBUTING.md").read_text()


def blocks(text: str, kind: str) -> list[str]:
    return re.findall(rf"```{kind}\n(.*?)```", text, re.DOTALL)


def pasted(script: str, folder: Path) -> str:
    """What a block prints that is pasted into an empty file, in a folder of its own."""
    out = subprocess.run(
        [sys.executable, "-c", script], cwd=folder, capture_output=True, text=True, check=False
    )
    assert out.returncode == 0, out.stderr
    return out.stdout


@pytest.mark.slow
def test_the_log_in_python_gives_the_numbers_of_its_commands(tmp_path):
    """From the log that ships to C; the friction that the log was made with lies in the interval."""
    printed = pasted(blocks(README, "python")[0], tmp_path)
    low, high = (float(x) for x in re.findall(r"0\.\d+", printed)[:2])
    assert low < 0.285 < high
    for file in ("report.html", "recommended.html", "answer.png", "c/model.c"):
        assert (tmp_path / file).exists(), file


@pytest.mark.slow
def test_the_simulator_gets_its_files(tmp_path):
    pasted(blocks(README, "python")[1], tmp_path)
    assert (tmp_path / "fmu" / "friction.fmu").exists()
    assert "elbow" in (tmp_path / "urdf" / "friction.urdf").read_text()


@pytest.mark.slow
def test_the_law_hunts_and_is_simulated(tmp_path):
    printed = pasted(blocks(README, "python")[2], tmp_path)
    assert "the integral part hunts against the friction at rest" in printed
    assert 0.0 < float(printed.split()[-1]) < 0.01
    assert (tmp_path / "run.png").exists()


def test_every_python_block_is_run_by_one_of_these():
    assert len(blocks(README, "python")) == 3


@pytest.mark.slow
def test_the_first_command_prints_what_the_readme_shows(tmp_path, monkeypatch, capsys):
    """In the place of "..." anything."""
    monkeypatch.chdir(tmp_path)
    assert main(["demo"]) == 0
    printed = capsys.readouterr().out
    (shown,) = blocks(README, "text")
    same = doctest.OutputChecker().check_output
    assert same(shown, printed, doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE), printed
    for file in re.findall(r"`(stickslip-demo/[^`]*)`", README):
        assert (tmp_path / file).exists(), file


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
    """From the log that ships, and from the last block, but for its sweep."""
    _, _, log, _, last = blocks(README, "sh")
    run_as_printed([line for line in of_the_verbs(log + last) if "sweep" not in line], tmp_path)
    assert (tmp_path / "axis" / "report.html").exists()
    assert (tmp_path / "recommended.html").exists()
    assert (tmp_path / "recommended-c99").is_dir()
    assert (tmp_path / "step-study" / "report.html").exists()


@pytest.mark.slow
@pytest.mark.long
def test_commands_on_a_machine_run_as_they_are_printed(tmp_path):
    *_, machine, last = blocks(README, "sh")
    run_as_printed([*of_the_verbs(machine), *(x for x in of_the_verbs(last) if "sweep" in x)], tmp_path)
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


def test_the_install_block_is_the_same_on_every_system():
    """But for the shell's own words."""
    (linux,) = blocks(README, "bash")
    (windows,) = blocks(README, "powershell")
    plain = re.sub(r" +#.*", "", linux).replace("python3", "py").replace("/bin/", "\\Scripts\\")
    assert plain.replace("'", '"') == windows


@pytest.mark.slow
def test_first_command_in_a_fresh_environment(tmp_path):
    """The README's first line, as it stands, on a copy of the sources."""
    demo, tests = blocks(README, "sh")[:2]
    assert demo.strip().endswith("stickslip demo")
    assert tests.strip().endswith("-m pytest")
    copy = tmp_path / "copy"
    copy.mkdir()
    for name in ("src", "pyproject.toml", "README.md", "LICENSE"):
        os.symlink(ROOT / name, copy / name)
    # What is not imported need not be translated: all of SciPy's and Matplotlib's files take 12 s of the processor.
    # Compiled code goes by the content of its text: what the sources' tests compiled is found from here too (50 s).
    environment = {**os.environ, "PIP_COMPILE": "0"}
    out = subprocess.run(
        demo.strip(), shell=True, cwd=copy, env=environment, capture_output=True, text=True, check=False
    )
    assert out.returncode == 0, out.stderr
    assert (copy / "stickslip-demo" / "recommended.html").exists()


def test_the_citation_names_this_version_and_the_thesis():
    cited = (ROOT / "CITATION.cff").read_text()
    assert f"version: {stickslip.__version__}\n" in cited
    assert "Control of Systems under the Effect of Friction" in cited


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
