"""What `help` shows of the verbs, and what the package shows of itself."""

from __future__ import annotations

import inspect
import pydoc
import re
import subprocess
import sys

import pytest

import stickslip as ss

VERBS = ("export", "identify", "recommend", "study", "sweep")


@pytest.mark.parametrize("name", VERBS)
def test_a_verb_is_a_function_whatever_was_imported_before(name: str) -> None:
    """Rooms have other names than the functions, so no import replaces a function by a package."""
    others = ("recommendation", "identification", "exports", "studies", "sweeps", "cli")
    code = "".join(f"import stickslip.{room}\n" for room in others)
    code += f"import stickslip, inspect\nassert inspect.isfunction(stickslip.{name})"
    subprocess.run([sys.executable, "-c", code], check=True)


@pytest.mark.parametrize("name", VERBS)
def test_help_shows_the_call_and_the_whole_text(name: str) -> None:
    page = pydoc.plain(pydoc.render_doc(getattr(ss, name)))
    assert f"{name}(" in page
    for line in inspect.getdoc(getattr(ss, name)).split("\n"):
        assert line.strip() in page


def test_every_option_of_identify_is_described_where_it_is_listed() -> None:
    said = inspect.unwrap(ss.identify).__doc__ or ""
    assert "As in" not in said
    listed = re.findall(r"^    ([\w, ]+) : .*\n        \S", said, flags=re.MULTILINE)
    described = {name for names in listed for name in names.split(", ")}
    named = {p.name for p in inspect.signature(ss.identify).parameters.values() if p.kind is p.KEYWORD_ONLY}
    assert named <= described


def test_the_package_shows_what_is_public() -> None:
    assert {name for name in dir(ss) if not name.startswith("__")} == set(ss.__all__)
