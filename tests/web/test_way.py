"""The whole way in a browser: a dropped log, what is wrong with it, its friction, a setting, C that compiles."""

from __future__ import annotations

import csv
import re
import shutil
import signal
import subprocess
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from support.serving import DEMO, Served, drop, ended, start_server
from support.web_logs import as_it_is, german, matlab


@pytest.mark.slow
@pytest.mark.parametrize(
    "made",
    [as_it_is, pytest.param(german, marks=pytest.mark.long), pytest.param(matlab, marks=pytest.mark.long)],
)
def test_from_a_dropped_log_to_c_that_compiles(
    page: Any, tmp_path: Path, made: Callable[[Path], Path]
) -> None:
    """Nothing but what the page offers is used, in the order in which it offers it."""
    log = made(tmp_path)
    drop(page, log)
    page.wait_for_selector(".view.log .findings")
    assert page.locator("h1").inner_text() == log.name
    assert "6000 rows" in page.locator(".facts").inner_text()
    assert page.locator(".findings .good, .findings .fair").count() == 1
    page.wait_for_selector(".canvas[data-drawn='6000'] canvas")
    page.get_by_role("button", name="Identify", exact=True).click()
    page.wait_for_selector(".verdicts")
    numbers = page.locator("table", has_text="95 % interval").inner_text()
    inertia = float(re.search(r"inertia\s+(\S+)", numbers)[1].replace("−", "-"))
    assert 3.3e-4 < inertia < 4.8e-4  # true: 4e-4
    page.get_by_label("Bandwidth of the position loop").fill("20")
    page.get_by_label("Encoder counts per revolution").fill("65536")
    page.get_by_label("Torque limit").fill("3")
    page.get_by_role("button", name="Recommend a setting").click()
    page.wait_for_selector(".view.setting .verdict")
    assert "Switch on: feedforward" in page.locator(".verdict h2").inner_text()
    page.get_by_role("button", name="Download (.zip)").click()
    with page.expect_download() as download:
        page.get_by_role("link", name="Download recommended-c99.zip").click()
    download.value.save_as(tmp_path / "c.zip")
    compiled(tmp_path)


def compiled(folder: Path) -> None:
    """Unzip the archive and compile its C."""
    zipfile.ZipFile(folder / "c.zip").extractall(folder / "c")
    sources = folder / "c" / "recommended-c99"
    assert "gain" in (sources / "README.md").read_text(encoding="utf-8")
    gcc = shutil.which("gcc")
    if gcc is None:
        pytest.skip("needs gcc")
    subprocess.run(
        [gcc, "-std=c99", "-Wall", "-Wextra", "-Werror", "-c", "recommended.c"], cwd=sources, check=True
    )


@pytest.mark.slow
def test_an_inertia_that_is_known_is_shown_as_given(page: Any) -> None:
    """It stands among the numbers, and the axis can be tried: what is given is known."""
    drop(page, DEMO)
    page.wait_for_selector(".view.log .findings")
    page.locator("summary", has_text="Options").click()
    page.get_by_label("Inertia, if you know it").fill("4e-4")
    page.get_by_role("button", name="Identify", exact=True).click()
    page.wait_for_selector(".verdicts")
    row = page.locator("tr", has=page.locator("th", has_text=re.compile("^inertia$"))).inner_text()
    assert row.replace("−", "-").split() == ["inertia", "4e-4", "kg·m²", "given"]
    assert page.get_by_role("link", name="Try it in the workbench").count() == 1


@pytest.mark.slow
def test_a_reload_in_the_middle_of_an_identification_loses_nothing(page: Any) -> None:
    """The job is still there, its progress too, and its result is shown."""
    drop(page, DEMO)
    page.wait_for_selector(".view.log .findings")
    page.get_by_role("button", name="Identify", exact=True).click()
    page.wait_for_selector(".job")
    page.reload()
    page.wait_for_selector(".job .said:not(:has-text('waiting'))")
    page.wait_for_selector(".job", state="detached")
    page.get_by_role("link", name="Logs and results").click()
    page.get_by_role("link", name="Friction of demo.csv").click()
    page.wait_for_selector(".verdicts")
    assert "inertia =" in page.locator(".verdicts").inner_text()


@pytest.mark.slow
def test_cancel_ends_the_work_and_keeps_the_log(page: Any, served: Served) -> None:
    """The worker's process is gone; what was read stays, what was begun says that it was cancelled."""
    psutil = pytest.importorskip("psutil")
    drop(page, DEMO)
    page.wait_for_selector(".view.log .findings")
    page.get_by_role("button", name="Identify", exact=True).click()
    page.wait_for_selector(".job .said:not(:has-text('waiting'))")
    server, at_work = psutil.Process(served.process.pid), []
    for _ in range(100):
        at_work = at_work or [p for p in server.children(recursive=True) if not waits(p)]
        page.wait_for_timeout(0 if at_work else 20)  # its process is only just forked
    assert at_work
    page.get_by_role("button", name="Cancel").click()
    page.wait_for_selector(".problem:has-text('cancelled')")
    assert not psutil.wait_procs(at_work, timeout=120)[1]
    page.get_by_role("link", name="Back to the log").click()
    page.wait_for_selector(".view.log .findings")
    assert "6000 rows" in page.locator(".facts").inner_text()


def waits(process: Any) -> bool:
    """Whether it is the process that jobs are forked from, or one whose first line of stdin has not come."""
    return process.num_threads() == 1


def test_a_log_whose_columns_say_nothing_is_read_by_the_form(page: Any, tmp_path: Path) -> None:
    """What could not be read is asked for, and the answer is used."""
    values = np.array(list(csv.reader(DEMO.open(encoding="utf-8")))[1:], dtype=float)
    lines = ["a,b,c", *(f"{t},{np.rad2deg(q)},{1e3 * m}" for t, q, m in values[:, :3])]
    (tmp_path / "nameless.csv").write_text("\n".join(lines))
    drop(page, tmp_path / "nameless.csv")
    page.wait_for_selector("h1:has-text('nameless.csv')")
    page.wait_for_selector("select[name='column-position']", state="attached")
    if not page.locator("select[name='column-position']").is_visible():
        page.locator("summary", has_text="Correct columns").click()
    for channel, column, unit in (("time", "a", "s"), ("position", "b", "deg"), ("motor_torque", "c", "mNm")):
        page.locator(f"select[name='column-{channel}']").select_option(column)
        page.locator(f"input[name='unit-{channel}']").fill(unit)
    page.get_by_role("button", name="Apply").click()
    page.wait_for_selector("figcaption:has-text('motor torque against position')")
    page.wait_for_selector(".summary:has-text('−4.733 to 2.161 rad')")
    assert page.locator(".findings .good, .findings .fair").count() == 1


def test_without_the_token_the_page_says_what_to_do(browser: Any, served: Served) -> None:
    """A tab opened by the address alone shows no project."""
    page = browser.new_page()
    page.goto(served.url)
    page.wait_for_selector("h1:has-text('Open the address with its token')")
    assert "Copy all of it from the terminal" in page.locator("main").inner_text()
    assert page.locator(".drop").count() == 0
    page.close()


def test_the_token_leaves_the_address_bar(page: Any) -> None:
    """It is not left where a photo of the screen, or the history, has it."""
    assert "token" not in page.url


@pytest.mark.parametrize("asked", [signal.SIGINT, signal.SIGTERM], ids=["Ctrl-C", "SIGTERM"])
def test_the_server_ends_with_its_workers(tmp_path: Path, asked: signal.Signals) -> None:
    """A server that is asked to end leaves no process behind, in the middle of a job too, and prints no traceback."""
    psutil = pytest.importorskip("psutil")
    served = start_server(tmp_path / "projects")
    client = served.client()
    project = client.post("/api/projects", json={}).json()["id"]
    log = client.post(f"/api/projects/{project}/example", json={}).json()
    assert ended(client, project, log["job"])["state"] == "done"
    job = client.post(f"/api/projects/{project}/models", json={"logs": [log["id"]]}).json()["job"]
    while client.get(f"/api/projects/{project}/jobs/{job}/about").json()["state"] == "waiting":
        pass
    children = psutil.Process(served.process.pid).children(recursive=True)
    assert children
    client.close()
    served.process.send_signal(asked)
    said = served.process.communicate(timeout=120)[1]
    assert "Traceback" not in said
    assert "Error" not in said
    assert served.process.returncode in (0, 130, -signal.SIGTERM)
    assert not psutil.wait_procs(children, timeout=120)[1]
