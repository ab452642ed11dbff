"""Pages that are run from top to bottom, so that what they show is what happens.

    python docs/_ext/sessions.py PAGE.md FOLDER

In a page, a ``python`` block is executed (one namespace a page), a ``sh`` block is run line by line, a block with a
caption is written to the file of that name, and a ``text`` block right after one of them is what it prints
("..." stands for anything). Exit code 1 where that is not so.
"""

from __future__ import annotations

import contextlib
import doctest
import io
import os
import re
import shlex
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

FENCE = re.compile(
    r"^```(?:\{code-block\} )?(?P<kind>python|sh|toml|text|csv)\n"
    r"(?P<options>(?::\w[\w-]*:[^\n]*\n)*)\n?(?P<body>.*?)^```$",
    re.MULTILINE | re.DOTALL,
)


@dataclass(frozen=True)
class Block:
    """A block of a page, and what it prints as the page shows it (None: the page does not say)."""

    kind: str
    body: str
    file: str
    printed: str | None


def blocks(text: str) -> Iterator[Block]:
    """The blocks that are run or written."""
    found = list(FENCE.finditer(text))
    for match, following in zip(found, [*found[1:], None]):
        caption = re.search(r":caption: (.*)", match["options"])
        if match["kind"] == "text" or ":class: shown" in match["options"]:
            continue
        shown = (
            following["body"]
            if following and following["kind"] == "text" and not text[match.end() : following.start()].strip()
            else None
        )
        yield Block(match["kind"], match["body"], caption[1].strip() if caption else "", shown)


def run(page: Path, folder: Path) -> list[str]:
    """Run a page in a folder; what went otherwise than it says."""
    folder.mkdir(parents=True, exist_ok=True)
    os.chdir(folder)
    namespace: dict[str, object] = {"__name__": "__main__"}
    wrong = []
    for block in blocks(page.read_text(encoding="utf-8")):
        if block.file:
            Path(block.file).write_text(block.body, encoding="utf-8")
            continue
        try:
            printed = executed(block, namespace)
        except Exception as error:
            wrong.append(f"{page.name}: {type(error).__name__}: {error}, in\n{block.body}")
            break
        same = doctest.OutputChecker().check_output
        if block.printed is not None and not same(
            block.printed, printed, doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE
        ):
            wrong.append(f"{page.name}: shows\n{block.printed}but this prints\n{printed}in\n{block.body}")
    return wrong


def executed(block: Block, namespace: dict[str, object]) -> str:
    """What a block prints."""
    if block.kind == "python":
        said = io.StringIO()
        with contextlib.redirect_stdout(said):
            exec(compile(block.body, "<page>", "exec"), namespace)
        return said.getvalue()
    if block.kind != "sh":
        return ""
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    said = ""
    for line in filter(None, map(str.strip, block.body.splitlines())):
        words = shlex.split(line, comments=True)
        if words:
            said += subprocess.run(
                words, env={**os.environ, "PATH": path}, check=True, capture_output=True, text=True
            ).stdout
    return said


if __name__ == "__main__":
    complaints = run(Path(sys.argv[1]).resolve(), Path(sys.argv[2]))
    print("\n".join(complaints), file=sys.stderr)
    sys.exit(1 if complaints else 0)
