"""What `help` says of a function that is a package, too; and what the package shows of itself."""

from __future__ import annotations

import inspect
import pydoc
import re
from types import ModuleType

import pytest

import stickslip as ss

ROOMS = [name for name in ss.__all__ if isinstance(getattr(ss, name), ModuleType)]


@pytest.mark.parametrize("name", ROOMS)
def test_help_shows_the_call_and_the_whole_text(name: str) -> None:
    """It was that of a package: no signature, no defaults."""
    function = getattr(ss, name)
    page = pydoc.plain(pydoc.render_doc(function)).partition("PACKAGE CONTENTS")[0]
    assert f"{name}(" in page
    shown = " ".join(page.split())
    for p in inspect.signature(function).parameters.values():
        assert re.search(rf"\b{p.name}: {re.escape(str(p.annotation))}", shown), p.name
        if p.default is not p.empty and not callable(p.default):
            assert f"= {p.default!r}," in shown
    for line in (inspect.unwrap(function).__doc__ or "").split("\n"):
        assert " ".join(line.split()) in shown


def test_every_option_of_identify_is_described_where_it_is_listed() -> None:
    said = inspect.unwrap(ss.identify).__doc__ or ""
    assert "As in" not in said
    listed = re.findall(r"^    ([\w, ]+) : .*\n        \S", said, flags=re.MULTILINE)
    described = {name for names in listed for name in names.split(", ")}
    named = {p.name for p in inspect.signature(ss.identify).parameters.values() if p.kind is p.KEYWORD_ONLY}
    assert named <= described


def test_the_package_shows_what_is_public() -> None:
    """Its own helpers and imports stood among the names."""
    shown = {name for name in dir(ss) if not name.startswith("__")}
    packages = {name for name in shown if getattr(getattr(ss, name), "__name__", "") == f"stickslip.{name}"}
    assert shown == {*ss.__all__, *packages}
    assert not {"TYPE_CHECKING", "importlib", "sys", "_Room"} & shown
