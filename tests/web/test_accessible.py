"""Every view for everybody: nothing that axe-core finds, wide and narrow, dark and light; all of it by keyboard."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from support.serving import Served, ended

pytestmark = pytest.mark.slow
AXE = Path(__file__).with_name("axe") / "axe.min.js"
"""axe-core 4.14.1 of the npm registry, MPL-2.0, unchanged; for tests alone"""
DRIVE = """
[rig]
kind = "ds402"
node = 5
bus = {interface = "socketcan", channel = "can0"}
[rig.limits]
torque = 0.8
speed = 30.0
lowest_position = -3.2
highest_position = 3.2
"""
SIZES = ((400, "light"), (1280, "dark"), (2560, "light"))


@pytest.fixture(scope="module")
def filled(served: Served) -> dict[str, str]:
    """A project with a log, a model and a setting; the addresses of its views."""
    client = served.client()
    project = client.post("/api/projects", json={"name": "seen"}).json()["id"]
    base = f"/api/projects/{project}"
    log = client.post(f"{base}/example", json={}).json()
    ended(client, project, log["job"])
    model = client.post(f"{base}/models", json={"logs": [log["id"]], "laws": ["coulomb"]}).json()
    assert ended(client, project, model["job"], 300.0)["state"] == "done"
    asked = {"model": model["id"], "bandwidth": 20, "confirm": 3, "axes": 1}
    setting = client.post(f"{base}/settings", json=asked).json()
    assert ended(client, project, setting["job"], 300.0)["state"] == "done"
    law = [
        {"name": "a.toml", "text": 'law = "sent.py"\n[parameters]\n'},
        {"name": "sent.py", "text": "LAW = 1\n" * 60},
    ]
    sent = client.post(f"{base}/sent", json={"files": law}).json()
    assert ended(client, project, sent["job"])["state"] == "done"
    rig = client.post(f"{base}/sent", json={"files": [{"name": "drive.toml", "text": DRIVE}]}).json()
    assert ended(client, project, rig["job"])["state"] == "done"
    here = f"#/p/{project}"
    return {
        "start": "#/", "project": here, "log": f"{here}/log/{log['id']}", "model": f"{here}/model/{model['id']}",
        "setting": f"{here}/setting/{setting['id']}", "compare": f"{here}/compare",
        "workbench": f"{here}/workbench", "rig": f"{here}/rig", "ask": f"{here}/model/{sent['id']}",
        "real": f"{here}/rig/{rig['id']}",
    }  # fmt: skip


def opened(browser: Any, served: Served, address: str, width: int, scheme: str) -> Any:
    """A page that shows a view."""
    context = browser.new_context(
        viewport={"width": width, "height": 900},
        color_scheme=scheme,
        bypass_csp=True,
        reduced_motion="reduce",
    )
    page = context.new_page()
    page.set_default_timeout(120_000)
    page.goto(served.page)
    page.wait_for_selector("body[data-ready='#/']")
    page.evaluate("(address) => { location.hash = address; }", address)
    page.wait_for_selector(f"body[data-ready='{address}']")
    return page


@pytest.mark.parametrize(
    "view", ["start", "project", "log", "model", "setting", "compare", "workbench", "rig", "ask", "real"]
)
def test_axe_finds_nothing(browser: Any, served: Served, filled: dict[str, str], view: str) -> None:
    """And no view is wider than its window."""
    for width, scheme in SIZES:
        page = opened(browser, served, filled[view], width, scheme)
        for summary in page.locator("details > summary").all():
            summary.click()
        if view == "real":
            page.get_by_label("Procedure", exact=True).select_option("presliding")
            page.get_by_role("button", name="Show the plan").click()
            page.get_by_label("This moves a real machine").check()
        page.wait_for_timeout(500)
        page.add_script_tag(path=AXE)
        found = page.evaluate("async () => (await axe.run()).violations")
        said = [
            (v["id"], [n["html"][:200] for n in v["nodes"][:3]], v["nodes"][0]["failureSummary"])
            for v in found
        ]
        assert not found, f"{width} {scheme}: {json.dumps(said, indent=1)}"
        assert page.evaluate("document.documentElement.scrollWidth") <= width, f"{view} is wider than {width}"
        page.context.close()


@pytest.mark.parametrize("view", ["log", "model"])
def test_every_plot_says_in_words_what_it_shows(
    browser: Any, served: Served, filled: dict[str, str], view: str
) -> None:
    """With numbers, and the plot points to it."""
    page = opened(browser, served, filled[view], 1280, "light")
    page.wait_for_selector(".plot canvas")
    page.wait_for_function(
        "() => [...document.querySelectorAll('.plot .summary')].every((s) => s.textContent)"
    )
    plots = page.locator(".plot").all()
    assert plots
    for plot in plots:
        canvas = plot.locator(".canvas")
        assert canvas.get_attribute("aria-label")
        said = page.locator(f"#{canvas.get_attribute('aria-describedby').split()[0]}").inner_text()
        assert any(c.isdigit() for c in said), said
    page.context.close()


def test_a_plot_is_zoomed_by_keyboard(browser: Any, served: Served, filled: dict[str, str]) -> None:
    """And a part chosen in numbers, without a mouse."""
    page = opened(browser, served, filled["log"], 1280, "light")
    page.wait_for_selector(".canvas[data-drawn='6000']")
    page.locator(".signals .canvas").first.focus()
    page.keyboard.press("+")
    page.wait_for_selector(".signals .canvas:not([data-drawn='6000'])")
    assert int(page.locator(".signals .canvas").first.get_attribute("data-drawn")) < 6000
    page.keyboard.press("Home")
    page.wait_for_selector(".signals .canvas[data-drawn='6000']")
    page.context.close()
