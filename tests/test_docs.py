"""The documentation's sources: public parameters are documented, links are well formed, pages are there."""

from __future__ import annotations

import importlib
import inspect
import re
import shlex
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

import stickslip
from stickslip import gallery
from stickslip.cli import parser_of

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
sys.path.insert(0, str(DOCS / "_ext"))

from api_pages import FURTHER  # noqa: E402
from sessions import blocks  # noqa: E402

SHOWN = [("stickslip", name) for name in stickslip.__all__] + [
    (module, name) for module, names in FURTHER.items() for name in names
]
PAGES = sorted(p for p in DOCS.rglob("*.md") if "_build" not in p.parts and "generated" not in p.parts)


def public(module: str, name: str) -> Any:
    return getattr(importlib.import_module(module), name)


def callables(module: str, name: str) -> list[tuple[str, Any, str]]:
    """A function, or a class and its public methods, each with the docstring that has to name its parameters."""
    found = inspect.unwrap(public(module, name))
    if not inspect.isclass(found):
        return [(name, found, inspect.getdoc(found) or "")]
    # "Its arguments are those of `Par`."
    named = [b for b in found.__mro__[1:] if f"`{b.__name__}`" in (found.__doc__ or "")]
    said = "\n".join(inspect.getdoc(c) or "" for c in (found, *named))
    out = [] if issubclass(found, Exception) else [(name, found, said)]
    for key, member in vars(found).items():
        member = getattr(member, "__func__", member)
        if (
            not key.startswith("_")
            and inspect.isfunction(member)
            and member.__module__.startswith("stickslip")
        ):
            out.append((f"{name}.{key}", member, (inspect.getdoc(member) or "") + said))
    return out


@pytest.mark.parametrize(("module", "name"), SHOWN, ids=lambda x: x)
def test_every_public_parameter_is_named_in_its_docstring(module: str, name: str) -> None:
    for label, found, said in callables(module, name):
        assert said, f"{label} has no docstring"
        annotated = " ".join(
            f"{n} {h!r}" for n, h in getattr(found, "__annotations__", {}).items() if "Par(" in repr(h)
        )
        for parameter in inspect.signature(found).parameters.values():
            if parameter.name in ("self", "cls") or parameter.name in annotated:
                continue
            assert re.search(rf"\b{re.escape(parameter.name)}\b", said), f"{label}: {parameter.name}"


def test_the_test_above_can_fail() -> None:
    def undocumented(velocity: float) -> None:
        """Do something."""

    assert not re.search(r"\bvelocity\b", inspect.getdoc(undocumented) or "")


@pytest.mark.parametrize("page", PAGES, ids=lambda p: p.relative_to(DOCS).as_posix())
def test_links_are_well_formed_and_those_inside_exist(page: Path) -> None:
    """What leads to a generated page is checked when the documentation is built (-n -W)."""
    text = re.sub(r"```.*?```", "", page.read_text(encoding="utf-8"), flags=re.DOTALL)
    for target in re.findall(r"\]\(([^)\s]+)\)", text):
        if "://" in target:
            assert re.fullmatch(r"https://[\w.-]+\.[a-z]{2,}(/[\w./#~%+=&?-]*)?", target), target
        elif "generated/" not in target and not target.startswith("#"):
            assert (page.parent / target.partition("#")[0]).exists(), f"{page.name}: {target}"


@pytest.mark.parametrize("page", PAGES, ids=lambda p: p.relative_to(DOCS).as_posix())
def test_pages_have_an_example_or_a_picture(page: Path) -> None:
    """Except lists of pages, tables of benchmarks, decisions and the bibliography."""
    text = page.read_text(encoding="utf-8")
    listing = (
        "toctree" in text
        or "{include}" in text
        or not {"decisions", "benchmarks"}.isdisjoint(page.relative_to(DOCS).parts)
        or "bibliography" in page.stem
    )
    assert listing or page.stem == "metrics" or "![" in text or any(blocks(text))


@pytest.mark.slow
@pytest.mark.long  # CI runs the page where it builds the documentation
def test_the_tutorial_does_what_it_says(tmp_path: Path) -> None:
    """As it is run when the documentation is built, in a folder of its own."""
    command = [sys.executable, str(DOCS / "_ext" / "sessions.py"), str(DOCS / "tutorial.md"), str(tmp_path)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert {p.name for p in tmp_path.iterdir()} >= {"alone.svg", "helped.svg", "lugre.png", "helped.npz"}


@pytest.mark.slow
@pytest.mark.long  # CI runs the page where it builds the documentation
def test_the_page_on_the_library_does_what_it_says(tmp_path: Path) -> None:
    page = DOCS / "howto" / "library.md"
    command = [sys.executable, str(DOCS / "_ext" / "sessions.py"), str(page), str(tmp_path)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "c" / "model.c").exists()


@pytest.mark.slow
@pytest.mark.parametrize(
    "page",
    ["index", "symptoms", "glossary", "howto/record_a_log", "howto/nothing_recommended"],
)
def test_the_pages_for_a_start_do_what_they_say(page: str, tmp_path: Path) -> None:
    command = [sys.executable, str(DOCS / "_ext" / "sessions.py"), str(DOCS / f"{page}.md"), str(tmp_path)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def test_the_list_for_language_models_names_pages_that_there_are() -> None:
    text = (DOCS / "llms.txt").read_text(encoding="utf-8")
    named = re.findall(r"\]\(([^)]*)\.html\)", text)
    assert named
    for page in named:
        assert (DOCS / f"{page}.md").exists(), page


THESIS = DOCS / "thesis.md"
FIGURES = {1: 1, 2: 12, 3: 38, 4: 59, 7: 5}
"""Figures in each chapter of the thesis; 7 is its appendix."""


def numbers_in(text: str) -> set[str]:
    """Numbers of figures and sections in a text, ranges such as 3.10 to 3.14 with all that they span."""
    found = set(re.findall(r"(?<![\d.])\d\.\d+(?:\.\d+)*", text))
    for chapter, first, last in re.findall(r"(\d)\.(\d+) to \1\.(\d+)", text):
        found |= {f"{chapter}.{n}" for n in range(int(first), int(last) + 1)}
    return found


def test_the_page_of_the_thesis_has_every_figure_table_and_section() -> None:
    text = THESIS.read_text(encoding="utf-8")
    prose = re.sub(r"```.*?```", "", text, flags=re.DOTALL)
    found = numbers_in(prose)
    assert {f"{c}.{n}" for c, count in FIGURES.items() for n in range(1, count + 1)} - found == set()
    assert {"1.2", "2.1.8", "2.2.4", "2.3.4", "3.2.4", "4.3.2.2.3", "4.4", "4.5", "5.1", "5.2"} <= found
    spans = re.findall(r"Tables? (\d+)(?:(?:,| and| to) (\d+))?", " ".join(prose.split()))
    tables = {n for first, last in spans for n in range(int(first), int(last or first) + 1)}
    assert tables == set(range(1, 11))


def test_every_command_on_the_page_of_the_thesis_is_one() -> None:
    """Those in its tables are not run when it is built."""
    text = THESIS.read_text(encoding="utf-8")
    commands = [c for c in re.findall(r"`(stickslip [a-z][^`]*)`", text) if not re.search(r"[A-Z]{4}", c)]
    commands += [
        c for body in re.findall(r"```(?:ba)?sh\n(.*?)```", text, re.DOTALL) for c in body.splitlines()
    ]
    assert len(commands) > 50
    for command in commands:
        words = shlex.split(command)[1:]
        parser_of([words[0]]).parse_args(words)
        if words[0] == "figure":
            assert words[1] in gallery.FIGURES


@pytest.mark.slow
@pytest.mark.long  # minutes: what the page shows without running it
def test_the_long_commands_on_the_page_of_the_thesis_run(tmp_path: Path) -> None:
    text = THESIS.read_text(encoding="utf-8")
    commands = [c for body in re.findall(r"```bash\n(.*?)```", text, re.DOTALL) for c in body.splitlines()]
    assert len(commands) == 3
    for command in commands:
        words = [sys.executable, "-m", *shlex.split(command)]
        done = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
    assert {"chapter3", "commissioned", "chapter4"} <= {p.name for p in tmp_path.iterdir()}
    assert "52 hold under both rules" in (tmp_path / "chapter3" / "report.html").read_text(encoding="utf-8")


def test_a_page_that_shows_what_is_not_printed_is_refused(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text("```python\nprint(1 + 1)\n```\n\n```text\n3\n```\n")
    command = [sys.executable, str(DOCS / "_ext" / "sessions.py"), str(page), str(tmp_path / "run")]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert "prints\n2" in done.stderr


def test_a_fraction_of_two_digits_without_braces_is_that_fraction() -> None:
    r"""TeX reads `\tfrac12 x` as a half of x, docutils' translator as 12 over x: three pages showed that."""
    pytest.importorskip("sphinx")
    drawn = importlib.import_module("mathml").drawn
    assert drawn(r"\tfrac12 x", block=False) == drawn(r"\tfrac{1}{2} x", block=False)


def test_an_index_stands_beside_an_accented_letter_and_no_accent_in_it() -> None:
    """Beside one with two accents as well; docutils sets it below."""
    pytest.importorskip("sphinx")
    drawn = importlib.import_module("mathml").drawn
    rate = drawn(r"\dot{\hat\sigma}_1 = \dot e", block=False)
    assert "munderover" not in rate
    assert "accent" not in rate
    assert rate.count("<msub>") == 1
