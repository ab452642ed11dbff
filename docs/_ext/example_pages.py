"""Draw the phenomena of the gallery and write the page that shows them: words, picture, code."""

from __future__ import annotations

import ast
import hashlib
from pathlib import Path

from pages import GENERATED, ROOT, prose, write

from stickslip.gallery import FIGURES, picture_of
from stickslip.report.plots import draw

FOLDER = GENERATED / "phenomena"
SCRIPTS = ROOT / "src" / "stickslip" / "gallery"

INTRODUCTION = """# Phenomena of friction

What section 2.1 of the thesis describes by measurements of others, as this package's laws show it. `stickslip figure
NUMBER` draws each picture; the code below it simulates what it shows.

A law that shows none of this is no worse a law: it is a simpler one. The [laws' pages](../laws/index.md) say what each
declares.
"""


def make() -> None:
    """Draw what has changed and write the page."""
    parts = [INTRODUCTION]
    sources = b"".join(p.read_bytes() for p in sorted((ROOT / "src").rglob("*.py")))
    shown = {figure.module: number for number, figure in reversed(FIGURES.items()) if number.startswith("2.")}
    for module, number in sorted(shown.items()):
        script = SCRIPTS / f"{module}.py"
        draw_new(number, FOLDER / module, hashlib.sha256(sources).hexdigest())
        parts.append(section(script, number))
    write(FOLDER / "index.md", "\n".join(parts))


def draw_new(number: str, target: Path, now: str) -> None:
    """Draw a figure, unless the package is as it was."""
    stamp = target.with_name(f".{target.name}")
    if not stamp.exists() or stamp.read_text() != now:
        draw(target, *picture_of(number))
        stamp.write_text(now)


def section(script: Path, number: str) -> str:
    """Title and words are the script's docstring."""
    said = ast.get_docstring(ast.parse(script.read_text(encoding="utf-8"))) or script.stem
    title, _, words = said.partition("\n")
    words = prose(words.strip())
    path = Path("../../../src/stickslip/gallery") / script.name
    return f"""## {title.rstrip(".")}

{words}

```{{image}} {script.stem}.svg
:alt: {title.rstrip(".")}
```

```{{literalinclude}} {path.as_posix()}
:language: python
:lines: {code_begins(script)}-
:caption: stickslip figure {number}
```
"""


def code_begins(script: Path) -> int:
    """The line after the docstring."""
    first = ast.parse(script.read_text(encoding="utf-8")).body[0]
    return (first.end_lineno or 0) + 2
