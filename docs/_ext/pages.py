"""What the generators share: where pages go, tables, symbols."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from pathlib import Path

DOCS = Path(__file__).parents[1]
ROOT = DOCS.parent
GENERATED = DOCS / "generated"

GREEK = [
    "alpha",
    "beta",
    "gamma",
    "delta",
    "epsilon",
    "zeta",
    "eta",
    "theta",
    "kappa",
    "lambda",
    "mu",
    "nu",
    "xi",
    "pi",
    "rho",
    "sigma",
    "tau",
    "phi",
    "psi",
    "omega",
    "Delta",
    "Theta",
    "Phi",
    "Omega",
]


def write(path: Path, text: str) -> None:
    """Write a page, unless it says so already: Sphinx reads again only what has changed."""
    if path.exists() and path.read_text(encoding="utf-8") == text:
        return
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text, encoding="utf-8")


def latex(symbol: str) -> str:
    """A symbol as a law writes it (``sigma_0``, ``F_C``, ``alpha_i``) in LaTeX."""
    symbol = re.sub(rf"(?<![A-Za-z\\])({'|'.join(GREEK)})(?![a-z])", r"\\\1", symbol)
    symbol = re.sub(r"_([A-Za-z0-9]{2,})", r"_{\\mathrm{\1}}", symbol)
    return symbol if re.search(r"[\\_^{]", symbol) or len(symbol) == 1 else rf"\mathrm{{{symbol}}}"


def table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A table in Markdown; cells may not hold a line break."""
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join("| " + " | ".join(cell.replace("|", r"\|") for cell in row) + " |" for row in lines)


def prose(text: str) -> str:
    """A docstring as Markdown: letters that mean something there are escaped, but for code between backticks."""
    parts = text.split("`")
    parts[::2] = [re.sub(r"([*_|<])", r"\\\1", part) for part in parts[::2]]
    return "`".join(parts)


def number(value: float) -> str:
    """A number as people write it."""
    return f"{value:.10g}"
