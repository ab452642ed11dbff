"""The rig view on a virtual rig: a plan first, arming as a step of its own, and a stop whatever happens to the page."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

import pytest

from stickslip.core.record import Record
from support.serving import Served

pytestmark = pytest.mark.slow
LONG = {"machine": "thesis-dry", "procedure": "stickslip", "options": {"cycles": "60"}}
"""A minute of the machine's time"""


def project_of(client: Any) -> str:
    """A new project."""
    identifier: str = client.post("/api/projects", json={"name": "rig"}).json()["id"]
    return identifier


def moving(stream: Path, patience: float = 200.0) -> None:
    """Wait until a torque is commanded."""
    until = time.monotonic() + patience
    while time.monotonic() < until:
        if stream.is_file():
            command = Record.load(stream)["torque_command"]
            if command.size and abs(command).max() > 0.0:
                return
        time.sleep(0.05)
    raise AssertionError("the rig never moved")


def at_rest(served: Served, project: str, log: str, patience: float = 60.0) -> None:
    """The run has ended, and its last command is a torque of zero."""
    folder = served.folder / project / "logs" / log
    client, until = served.client(), time.monotonic() + patience
    while time.monotonic() < until:
        if client.get(f"/api/projects/{project}/logs/{log}").json()["state"] == "read":
            break
        time.sleep(0.1)
    command = Record.load(folder / "live.stream")["torque_command"]
    assert command[-1] == 0.0
    assert command.size < 60_000  # it was stopped long before its end


def test_an_unarmed_rig_does_not_move(served: Served) -> None:
    """Nor one with a procedure, a machine or an option that is a file."""
    client = served.client()
    project = project_of(client)
    for wrong in ({}, {"armed": False}, {"armed": "yes"}, {"armed": 1}):
        assert client.post(f"/api/projects/{project}/rig/run", json={**LONG, **wrong}).status_code == 409
    for wrong in (
        {"machine": "../x.toml"},
        {"procedure": "x"},
        {"options": {"model": "x.toml"}},
        {"options": []},
    ):
        answer = client.post(f"/api/projects/{project}/rig/run", json={**LONG, "armed": True, **wrong})
        assert answer.status_code == 400
    assert client.get(f"/api/projects/{project}").json()["logs"] == []


def test_a_page_that_is_silent_stops_the_rig(served: Served) -> None:
    """Without its sign of life the torque is zero within seconds, though nobody says stop."""
    client = served.client()
    project = project_of(client)
    made = client.post(f"/api/projects/{project}/rig/run", json={**LONG, "armed": True}).json()
    stream = served.folder / project / "logs" / made["log"] / "live.stream"
    until = time.monotonic() + 200.0
    while time.monotonic() < until and not stream.is_file():
        assert client.post(f"/api/projects/{project}/rig/{made['job']}/alive", json={}).status_code == 200
        time.sleep(0.1)
    moving_while_alive(client, project, made, stream)
    at_rest(served, project, made["log"])


def moving_while_alive(client: Any, project: str, made: dict[str, str], stream: Path) -> None:
    """Keep saying that the page is there until the rig moves."""
    until = time.monotonic() + 100.0
    while time.monotonic() < until:
        client.post(f"/api/projects/{project}/rig/{made['job']}/alive", json={})
        command = Record.load(stream)["torque_command"]
        if command.size and abs(command).max() > 0.0:
            return
        time.sleep(0.05)
    raise AssertionError("the rig never moved")


def begin(page: Any) -> None:
    """As a person begins a run: plan, arm, start."""
    page.get_by_label("New project name").fill("rig")
    page.get_by_role("button", name="Create").click()
    page.get_by_role("link", name="Rig", exact=True).click()
    page.get_by_label("Rig", exact=True).select_option("thesis-dry")
    page.locator("summary", has_text="Options of the procedure").click()
    page.get_by_label("cycles").fill("60")
    page.get_by_role("button", name="Show the plan").click()
    start = page.get_by_role("button", name="Start")
    start.wait_for()
    assert start.is_disabled()
    page.get_by_label("Arm the rig").check()
    start.click()
    page.wait_for_selector("[data-frames]")


def run_of(served: Served, page: Any) -> tuple[str, str]:
    """Project and log of the run that the page shows."""
    project = page.url.split("/p/")[1].split("/")[0]
    return project, served.client().get(f"/api/projects/{project}").json()["logs"][-1]["id"]


def test_a_key_stops_the_rig(page: Any, served: Served) -> None:
    """Wherever the focus is."""
    begin(page)
    project, log = run_of(served, page)
    moving(served.folder / project / "logs" / log / "live.stream")
    page.get_by_role("link", name="Workbench").focus()
    page.keyboard.press("Escape")
    page.wait_for_selector(".live:has-text('Stopped: the torque is zero.')")
    at_rest(served, project, log)
    assert page.get_by_role("button", name="Stop").is_disabled()


def test_signals_come_twenty_times_a_second(page: Any) -> None:
    """In the best second of some: what else the machine does is no matter of the page."""
    begin(page)
    times = page.evaluate("""async () => {
      const figures = document.querySelector('[data-frames]');
      const out = [];
      const watch = new MutationObserver((all) => all.forEach(() => out.push(performance.now())));
      watch.observe(figures, { attributes: true, attributeFilter: ['data-frames'] });
      await new Promise((resolve) => setTimeout(resolve, 8000));
      watch.disconnect();
      return out;
    }""")
    page.keyboard.press("Escape")
    best = max(sum(t <= other < t + 1000.0 for other in times) for t in times)
    assert best >= 20
    page.wait_for_selector(".live:has-text('Stopped: the torque is zero.')")


def test_a_connection_that_is_cut_stops_the_rig(browser: Any, served: Served) -> None:
    """The page is there, but cannot be heard: it says so, and the torque is zero."""
    context = browser.new_context()
    page = context.new_page()
    page.set_default_timeout(200_000)
    page.goto(served.page)
    page.wait_for_selector("body[data-ready]")
    begin(page)
    project, log = run_of(served, page)
    moving(served.folder / project / "logs" / log / "live.stream")
    context.set_offline(True)
    page.wait_for_selector(".live:has-text('The connection is lost')")
    at_rest(served, project, log)
    assert page.get_by_role("button", name="Stop").is_disabled()
    context.close()


def test_a_page_that_is_closed_stops_the_rig(browser: Any, served: Served) -> None:
    """The connection is cut: the torque is zero."""
    context = browser.new_context()
    page = context.new_page()
    page.set_default_timeout(200_000)
    page.goto(served.page)
    page.wait_for_selector("body[data-ready]")
    begin(page)
    project, log = run_of(served, page)
    moving(served.folder / project / "logs" / log / "live.stream")
    job = served.client().get(f"/api/projects/{project}").json()["jobs"][-1]
    assert job["state"] == "running", job
    context.close()
    at_rest(served, project, log)
