"""Run the scripts in examples/phenomena and write the page that shows them: words, picture, script."""

from __future__ import annotations

import ast
import hashlib
import subprocess
import sys
from pathlib import Path

from pages import GENERATED, ROOT, prose, write

FOLDER = GENERATED / "phenomena"
SCRIPTS = ROOT / "examples" / "phenomena"

INTRODUCTION = """# Phenomena of friction

What section 2.1 of the thesis describes by measurements of others, as this package's laws show it. Every picture
is drawn by the script below it, which runs as it stands: `python examples/phenomena/NAME.py FILE` draws FILE.svg and
FILE.png. The same numbers are asserted by the tests in `tests/phenomena`.

A law that shows none of this is no worse a law: it is a simpler one. The [laws' pages](../laws/index.md) say what each
declares.
"""


def make() -> None:
    """Draw what has changed and write the page."""
    parts = [INTRODUCTION]
    sources = b"".join(p.read_bytes() for p in sorted((ROOT / "src").rglob("*.py")))
    for script in sorted(SCRIPTS.glob("[a-z]*.py")):
        draw(script, hashlib.sha256(sources + script.read_bytes()).hexdigest())
        parts.append(section(script))
    write(FOLDER / "index.md", "\n".join(parts))


def draw(script: Path, now: str) -> None:
    """Run a script, unless it and the package are as they were."""
    target, stamp = FOLDER / script.stem, FOLDER / f".{script.stem}"
    if not stamp.exists() or stamp.read_text() != now:
        FOLDER.mkdir(parents=True, exist_ok=True)
        subprocess.run([sys.executable, str(script), str(target)], check=True, stdout=subprocess.DEVNULL)
        stamp.write_text(now)


def section(script: Path) -> str:
    """Title and words are the script's docstring."""
    said = ast.get_docstring(ast.parse(script.read_text(encoding="utf-8"))) or script.stem
    title, _, words = said.partition("\n")
    words = prose(words.strip())
    path = Path("../../../examples/phenomena") / script.name
    return f"""## {title.rstrip(".")}

{words}

```{{image}} {script.stem}.svg
:alt: {title.rstrip(".")}
```

```{{literalinclude}} {path.as_posix()}
:language: python
:lines: {code_begins(script)}-
:caption: examples/phenomena/{script.name}
```
"""


def code_begins(script: Path) -> int:
    """The line after the docstring."""
    first = ast.parse(script.read_text(encoding="utf-8")).body[0]
    return (first.end_lineno or 0) + 2
