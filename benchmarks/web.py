"""How long the page of `stickslip web` lets a person wait, and what it adds to an installation.

    python benchmarks/web.py [--only paint,slider,samples,way,size,help] [--rows 10000000]

Needs Chromium and the extras [web] and [dev]. Elapsed times depend on what else the machine does, so the load and the
CPU seconds stand beside them: those of the server with all its processes, without the browser's. The first way is
walked twice: the first time compiles what the installation has not compiled yet.
"""

from __future__ import annotations

import argparse
import os
import resource
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
import zipfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib import metadata
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from playwright.sync_api import sync_playwright

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

import stickslip
from stickslip.core.record import Record
from support.serving import QUIET, Served, drop, ended, start_server, stop_server
from support.web_logs import LOGS

EXTRA = ("starlette", "uvicorn", "anyio", "idna", "h11", "click")
"""What [web] installs, with what these need."""
WITHOUT = "import sys; sys.modules['starlette'] = sys.modules['uvicorn'] = None; "
HELP = "import sys; sys.argv = ['stickslip', '--help']; from stickslip.cli import main; sys.exit(main())"


@contextmanager
def serving() -> Iterator[Served]:
    """A server with an empty folder of projects."""
    with tempfile.TemporaryDirectory(prefix="stickslip-web-") as folder:
        served = start_server(Path(folder) / "projects")
        try:
            yield served
        finally:
            stop_server(served)


def cpu_of_children() -> float:
    """CPU seconds of every process that has ended, with theirs."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def said(what: str, values: list[float], unit: str, bar: str) -> None:
    """A line: median, the slowest, the bar."""
    ordered = sorted(values)
    slow = ordered[min(len(ordered) - 1, round(0.95 * len(ordered)))]
    print(
        f"{what}: median {statistics.median(values):.3g} {unit}, 95 % below {slow:.3g} {unit}, "
        f"{len(values)} times (bar {bar}; load {os.getloadavg()[0]:.1f})",
        flush=True,
    )


def entered(browser: Any, served: Served) -> Any:
    """A page with its cookie."""
    page = browser.new_context(viewport={"width": 1280, "height": 900}, accept_downloads=True).new_page()
    page.set_default_timeout(300_000)
    page.goto(served.page)
    page.wait_for_selector("body[data-ready]")
    return page


# ---- what is timed ---------------------------------------------------------------------------------------------------


def paint(browser: Any) -> None:
    """From the address in the terminal to the first picture, in a browser that is open."""
    began, painted, ready = [], [], []
    for _ in range(7):
        start = time.perf_counter()
        with serving() as served:
            began.append(time.perf_counter() - start)
            start = time.perf_counter()
            page = entered(browser, served)
            ready.append(time.perf_counter() - start)
            entry = "performance.getEntriesByName('first-contentful-paint')[0].startTime"
            painted.append(page.evaluate(entry) / 1000.0)
            page.context.close()
    said("start of the server", began, "s", "none")
    said("first paint after it", painted, "s", "0.5 s")
    said("page ready for a log", ready, "s", "none")


SLIDE = """async () => {
  const status = document.querySelector('[data-ms]');
  const slider = document.querySelector('input[aria-label="bandwidth, slider"]');
  const ends = [Number(slider.min), Number(slider.max)];
  const out = [];
  for (let n = 0; n < 60; n += 1) {
    slider.value = ends[0] + (ends[1] - ends[0]) * (0.3 + 0.4 * Math.random());
    const began = performance.now();
    const drawn = new Promise((resolve) => {
      const painted = () => requestAnimationFrame(() => setTimeout(resolve));
      const watch = new MutationObserver(() => { watch.disconnect(); painted(); });
      watch.observe(status, { childList: true, characterData: true, subtree: true, attributes: true });
    });
    slider.dispatchEvent(new Event('input', { bubbles: true }));
    await drawn;
    out.push(performance.now() - began);
  }
  return out;
}"""


def slider(browser: Any) -> None:
    """From a slider's move to the picture of the simulation: LuGre, 2.5 s, as the workbench opens."""
    with serving() as served:
        page = entered(browser, served)
        project = served.client().post("/api/projects", json={"name": "bench"}).json()["id"]
        page.evaluate("(a) => { location.hash = a; }", f"#/p/{project}/workbench")
        page.wait_for_selector("[data-ms]")
        page.evaluate(SLIDE)
        said("slider to picture", page.evaluate(SLIDE), "ms", "100 ms")
        page.context.close()


MOVE = """async (keys) => {
  const canvas = document.querySelector('.signals .canvas');
  const figures = [...document.querySelectorAll('.signals .plot')];
  const out = [];
  for (const key of keys) {
    const began = performance.now();
    const drawn = Promise.all(figures.map((figure) => new Promise((resolve) => {
      const watch = new MutationObserver(() => { watch.disconnect(); resolve(); });
      watch.observe(figure.querySelector('.summary'), { childList: true, characterData: true, subtree: true });
    })));
    canvas.dispatchEvent(new KeyboardEvent('keydown', { key, bubbles: true, cancelable: true }));
    await drawn;
    await new Promise((resolve) => requestAnimationFrame(() => setTimeout(resolve)));
    out.push(performance.now() - began);
  }
  return out;
}"""
FRAMES = """async (keys) => {
  const canvas = document.querySelector('.signals .canvas');
  const out = [];
  let before = 0;
  for (const key of keys) {
    await new Promise((resolve) => requestAnimationFrame(() => setTimeout(resolve)));
    const now = performance.now();
    if (before) out.push(now - before);
    before = now;
    canvas.dispatchEvent(new KeyboardEvent('keydown', { key, bubbles: true, cancelable: true }));
  }
  return out;
}"""
KEYS = ["+"] * 8 + ["ArrowRight"] * 8 + ["-"] * 7 + ["+"] * 20 + ["ArrowLeft"] * 10 + ["-"] * 12
"""Each changes what is seen: no key at an end of the record"""


def long_record(path: Path, rows: int) -> None:
    """Time, position and torque of a servo that swings, with noise, as a compressed record."""
    rng = np.random.default_rng(1)
    t = np.arange(rows) * 1e-3
    position = 0.5 * np.sin(0.2 * t) + 1e-4 * rng.standard_normal(rows)
    torque = 0.3 * np.sign(np.cos(0.2 * t)) + 0.01 * rng.standard_normal(rows)
    units = {"position": "rad", "motor_torque": "N*m"}
    Record(t, {"position": position, "motor_torque": torque}, units, {}).save(path)


def samples(browser: Any, rows: int) -> None:
    """From a key to the picture of all signals, in a long record."""
    with serving() as served, tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "long.npz"
        long_record(path, rows)
        client = served.client()
        project = client.post("/api/projects", json={"name": "long"}).json()["id"]
        start = time.perf_counter()
        made = client.post(f"/api/projects/{project}/logs?name=long.npz", content=path.read_bytes()).json()
        while client.get(f"/api/projects/{project}/logs/{made['id']}").json()["state"] == "reading":
            time.sleep(0.05)
        print(f"{rows:g} rows sent and read in {time.perf_counter() - start:.1f} s", flush=True)
        page = entered(browser, served)
        start = time.perf_counter()
        page.evaluate("(a) => { location.hash = a; }", f"#/p/{project}/log/{made['id']}")
        page.wait_for_selector(f".signals .canvas[data-drawn='{rows}'] canvas")
        print(f"its view opened in {time.perf_counter() - start:.2f} s")
        page.evaluate(MOVE, KEYS)
        frames = page.evaluate(FRAMES, KEYS * 3)
        said(f"zoom and pan in {rows:g} samples, from frame to frame", frames, "ms", "33 ms")
        said("from a key to every sample of its stretch", page.evaluate(MOVE, KEYS), "ms", "none")
        ended(client, project, made["job"], 1200.0)
        print(
            f"the doctor has looked at it {time.perf_counter() - start:.1f} s after the view opened",
            flush=True,
        )
        page.context.close()


def way(browser: Any) -> None:
    """From a dropped log to C that compiles: identify, recommend, export, as a person clicks."""
    for name, make in [("CSV, for the first time", LOGS["CSV"]), *LOGS.items()]:
        before = cpu_of_children()
        with tempfile.TemporaryDirectory() as folder, serving() as served:
            log = make(Path(folder))
            page = entered(browser, served)
            marks = [("", time.perf_counter())]
            for step, what in walked(page, log, Path(folder)):
                what()
                marks.append((step, time.perf_counter()))
            page.context.close()
        parts = ", ".join(f"{b[0]} {b[1] - a[1]:.1f}" for a, b in pairwise(marks))
        print(
            f"{name}: {marks[-1][1] - marks[0][1]:.1f} s ({parts}); {cpu_of_children() - before:.1f} CPU s (bar 60 s; "
            f"load {os.getloadavg()[0]:.1f})",
            flush=True,
        )


def walked(page: Any, log: Path, folder: Path) -> Iterator[tuple[str, Callable[[], object]]]:
    """The steps of the way."""

    def read() -> None:
        drop(page, log)
        page.wait_for_selector(".view.log .findings")

    def identified() -> None:
        page.get_by_role("button", name="Identify", exact=True).click()
        page.wait_for_selector(".verdicts")

    def recommended() -> None:
        for label, value in (
            ("Bandwidth of the position", "20"),
            ("Encoder, counts", "65536"),
            ("Torque limit", "3"),
        ):
            page.get_by_label(label).fill(value)
        page.get_by_role("button", name="Recommend a setting").click()
        page.wait_for_selector(".view.setting .verdict")

    def compiled() -> None:
        page.get_by_role("button", name="Make the archive").click()
        with page.expect_download() as download:
            page.get_by_role("link", name="Download recommended-c99.zip").click()
        download.value.save_as(folder / "c.zip")
        zipfile.ZipFile(folder / "c.zip").extractall(folder / "c")
        command = ["gcc", "-std=c99", "-Wall", "-Wextra", "-Werror", "-c", "recommended.c"]
        subprocess.run(command, cwd=folder / "c" / "recommended-c99", check=True)

    yield from (("read", read), ("identify", identified), ("recommend", recommended), ("C", compiled))


def size() -> None:
    """MB that the extra adds: its packages, and the page's own files."""
    folder = Path(stickslip.__file__).with_name("web")
    own = sum(p.stat().st_size for p in folder.rglob("*") if p.is_file() and p.suffix != ".pyc")
    packages: dict[str, int] = {}
    for name in EXTRA:
        files = metadata.distribution(name).files or ()
        places = [Path(str(f.locate())) for f in files]
        packages[name] = sum(p.stat().st_size for p in places if p.is_file() and p.suffix != ".pyc")
    each = ", ".join(f"{k} {v / 1e6:.2f}" for k, v in packages.items())
    print(
        f"installed: {(own + sum(packages.values())) / 1e6:.2f} MB (page {own / 1e6:.2f}, {each}; bar 5 MB)"
    )


def help_time() -> None:
    """CPU seconds of `stickslip --help`, with the extra and as if it were not installed, in turns."""
    times: dict[str, list[float]] = {"with [web]": [], "without": []}
    for _ in range(15):
        for kind, code in (("with [web]", HELP), ("without", WITHOUT + HELP)):
            before = cpu_of_children()
            subprocess.run([sys.executable, "-c", code], check=True, stdout=subprocess.DEVNULL)
            times[kind].append(1000.0 * (cpu_of_children() - before))
    for kind, values in times.items():
        said(f"stickslip --help, {kind}", values, "CPU ms", "as fast")


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--only", default="size,help,paint,slider,samples,way")
    parser.add_argument("--rows", type=int, default=10_000_000)
    args = parser.parse_args()
    wanted = args.only.split(",")
    for name, measure in (("size", size), ("help", help_time)):
        if name in wanted:
            measure()
    if not {"paint", "slider", "samples", "way"} & set(wanted):
        return
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=shutil.which("chromium"), args=list(QUIET))
        for name, shown in (("paint", paint), ("slider", slider), ("way", way)):
            if name in wanted:
                shown(browser)
        if "samples" in wanted:
            samples(browser, args.rows)
        browser.close()


if __name__ == "__main__":
    main()
