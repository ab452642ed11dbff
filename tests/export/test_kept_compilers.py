"""What the tests' compilers keep is what compiling gives: of these files, with these options, and nothing said."""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path

import pytest

from support.kept_compilers import MARK

pytestmark = pytest.mark.skipif(
    MARK not in os.environ or shutil.which("gcc") is None, reason="needs gcc on a POSIX system"
)
MAIN = """#include "x.h"
int main(void) { return NUMBER; }
"""


def built(folder: Path, *more: str) -> subprocess.CompletedProcess[str]:
    command = ["gcc", "-Wall", *more, "main.c", "-o", "main"]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)


def test_the_same_files_give_the_same_program_and_others_another(tmp_path: Path) -> None:
    """A header counts, and so does an option."""
    (tmp_path / "main.c").write_text(MAIN)
    found = []
    for text, more in (("3", ()), ("3", ()), ("4", ()), ("4", ("-DNUMBER=5",)), ("3", ())):
        (tmp_path / "x.h").write_text(f"#ifndef NUMBER\n#define NUMBER {text}\n#endif\n")
        done = built(tmp_path, *more)
        assert (done.returncode, done.stderr) == (0, "")
        found.append(subprocess.run([tmp_path / "main"], check=False).returncode)
        (tmp_path / "main").unlink()
    assert found == [3, 3, 4, 5, 3]


def test_what_was_compiled_before_is_not_compiled_again(tmp_path: Path) -> None:
    """The compiler that is called is no real one: nothing but what is kept can answer."""
    (tmp_path / "main.c").write_text("int main(void) { return 6; }\n")
    assert built(tmp_path).returncode == 0
    script = Path(os.environ[MARK], "gcc").read_text()
    real = script.split("real=")[1].split()[0]
    blind = tmp_path / "blind"
    blind.mkdir()
    (blind / "gcc").write_text(script.replace(real, "/bin/false"))
    (blind / "gcc").chmod(0o755)
    (tmp_path / "main").unlink()
    folder = tmp_path / "copy"
    folder.mkdir()
    shutil.copy(tmp_path / "main.c", folder)
    command = [str(blind / "gcc"), "-Wall", "main.c", "-o", "main"]
    assert subprocess.run(command, cwd=folder, check=False).returncode == 0
    assert subprocess.run([folder / "main"], check=False).returncode == 6
    (folder / "main.c").write_text("int main(void) { return 7; }\n")
    assert subprocess.run(command, cwd=folder, check=False).returncode != 0


@pytest.mark.parametrize("text", ["int main(void) { int unused; return 0; }", "int main(void) { return }"])
def test_what_the_compiler_says_is_said_every_time(tmp_path: Path, text: str) -> None:
    """A warning or an error, and nothing of it is kept."""
    (tmp_path / "main.c").write_text(text)
    first, second = built(tmp_path), built(tmp_path)
    assert "main.c:1" in first.stderr
    assert (first.returncode, first.stderr) == (second.returncode, second.stderr)
