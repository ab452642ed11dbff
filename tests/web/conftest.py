"""A server for a file of tests, and a browser that looks at it."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from typing import Any

import pytest

pytest.importorskip("starlette", reason="the page needs the extra: pip install 'stickslip[web]'")
pytest.importorskip("httpx", reason="the tests of the page need httpx: pip install 'stickslip[dev]'")

from support.serving import QUIET, Served, start_server, stop_server


@pytest.fixture(scope="module")
def served(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Served]:
    """One server for a file of tests; whatever they do to it, it ends without a traceback."""
    one = start_server(tmp_path_factory.mktemp("web") / "projects")
    yield one
    assert one.process.poll() is None, "the server ended by itself"
    said = stop_server(one)
    assert "Traceback" not in said
    assert "Error" not in said, said


@pytest.fixture(scope="session")
def browser() -> Iterator[Any]:
    """Debian's Chromium, driven by Playwright."""
    chromium = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
    if chromium is None:
        pytest.skip("no Chromium on this machine; `apt-get install chromium` brings it")
    reason = "the page is driven by Playwright: pip install 'stickslip[dev]'"
    api = pytest.importorskip("playwright.sync_api", reason=reason)
    with api.sync_playwright() as playwright:
        found = playwright.chromium.launch(executable_path=chromium, args=list(QUIET))
        yield found
        found.close()


@pytest.fixture
def page(browser: Any, served: Served) -> Iterator[Any]:
    """A page that has entered; nothing may go wrong in it that a person would not see."""
    context = browser.new_context(viewport={"width": 1280, "height": 900}, accept_downloads=True)
    found = context.new_page()
    wrong: list[str] = []
    found.on("pageerror", lambda error: wrong.append(str(error)))
    found.on("console", lambda line: wrong.append(line.text) if line.type == "error" else None)
    found.set_default_timeout(120_000)
    found.goto(served.page)
    found.wait_for_selector("body[data-ready]")
    yield found
    context.close()
    assert not wrong, wrong
