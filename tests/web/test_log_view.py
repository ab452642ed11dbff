"""The view of a log in a browser: parts chosen by dragging, zoom and pan by keyboard, a spike that stays in sight."""

from __future__ import annotations

import csv
import gzip
import re
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from stickslip.core.record import Record
from support.serving import DEMO, Served, drop

pytestmark = pytest.mark.slow
WHOLE = ".signals .canvas[data-drawn='6000']"


@pytest.fixture
def log(page: Any) -> Any:
    """A page that shows the example log, drawn whole."""
    drop(page, DEMO)
    page.wait_for_selector(".view.log .findings")
    page.wait_for_selector(f"{WHOLE} canvas")
    return page


def seen(page: Any) -> tuple[float, float]:
    """The stretch of time that the first plot says it shows."""
    text = page.locator(".signals .summary").first.inner_text().replace("−", "-")
    found = re.search(r"time \(s\): (\S+) to (\S+),", text)
    assert found, text
    return float(found[1]), float(found[2])


def moved(page: Any, before: tuple[float, float]) -> tuple[float, float]:
    """The stretch, once it is another one."""
    first = page.locator(".signals .summary").first
    shown = f"time (s): {before[0]:g} to {before[1]:g},".replace("-", "−")
    first.filter(has_not_text=shown).wait_for()
    return seen(page)


def test_a_part_is_chosen_by_dragging(log: Any) -> None:
    """The form holds what was dragged over; nothing is left out before a button says so."""
    box = log.locator(".signals .u-over").first.bounding_box()
    y = box["y"] + box["height"] / 2
    log.mouse.move(box["x"] + 0.25 * box["width"], y)
    log.mouse.down()
    log.mouse.move(box["x"] + 0.5 * box["width"], y, steps=5)
    log.mouse.move(box["x"] + 0.75 * box["width"], y, steps=5)
    log.mouse.up()
    start, end = (float(log.get_by_label(name, exact=True).input_value()) for name in ("From", "to"))
    assert start == pytest.approx(1.5, abs=0.05)
    assert end == pytest.approx(4.5, abs=0.05)
    assert log.locator(".facts").inner_text().count("6000 rows") == 1
    log.get_by_role("button", name="Use only this part").click()
    log.locator(".facts").filter(has_not_text="6000 rows").wait_for()
    rows = int(re.search(r"(\d+) rows", log.locator(".facts").inner_text())[1])
    assert rows == pytest.approx(3000, abs=60)
    assert "is used" in log.locator(".cut").inner_text()
    log.get_by_role("button", name="Use the whole log again").click()
    log.locator(".facts").filter(has_text="6000 rows").wait_for()


def test_the_keyboard_zooms_and_pans(log: Any) -> None:
    """Plus and minus, the arrows, and Home; every plot of the log goes along, and no view leaves the record."""
    log.locator(".signals .canvas").first.focus()
    whole = seen(log)
    assert whole == (0.0, 5.999)
    log.keyboard.press("+")
    near = moved(log, whole)
    assert near[1] - near[0] == pytest.approx(0.6 * 5.999, rel=1e-3)
    log.keyboard.press("ArrowRight")
    right = moved(log, near)
    assert right[0] - near[0] == pytest.approx(0.15 * (near[1] - near[0]), rel=1e-2)
    log.keyboard.press("ArrowLeft")
    assert moved(log, right) == near
    for _ in range(6):
        log.keyboard.press("ArrowLeft")
    log.locator(".signals .summary").first.filter(has_text="time (s): 0 to 3.599").wait_for()
    log.locator(".signals .summary").last.filter(has_text="time (s): 0 to 3.599").wait_for()
    log.keyboard.press("Home")
    log.wait_for_selector(WHOLE)
    assert seen(log) == whole
    log.keyboard.press("-")
    log.keyboard.press("ArrowLeft")
    log.wait_for_selector(WHOLE)
    assert seen(log) == whole


def test_a_spike_stays_in_sight(page: Any, tmp_path: Path) -> None:
    """In the words and in the pixels of the plot, from the whole record to a hundredth of it."""
    rows = list(csv.reader(DEMO.open(encoding="utf-8")))
    column = next(i for i, name in enumerate(rows[0]) if "torque" in name)
    rows[3001][column] = "9.5"
    with (tmp_path / "spike.csv").open("w", newline="") as file:
        csv.writer(file).writerows(rows)
    drop(page, tmp_path / "spike.csv")
    page.wait_for_selector(f"{WHOLE} canvas")
    torque = page.locator(".signals .plot", has_text="motor torque").last
    torque.locator(".canvas").focus()
    before = seen(page)
    for _ in range(9):
        torque.locator(".summary").filter(has_text="to 9.5 N·m").wait_for()
        assert top_of_ink(torque) < 0.2
        page.keyboard.press("+")
        before = moved(page, before)
    assert before[1] - before[0] < 0.07
    torque.locator(".summary").filter(has_text="to 9.5 N·m").wait_for()


def top_of_ink(plot: Any) -> float:
    """How far below the plot's upper end its line reaches, as a part of its height."""
    return plot.evaluate("""(figure) => {
      const canvas = figure.querySelector('canvas');
      const over = figure.querySelector('.u-over');
      const scale = canvas.width / canvas.clientWidth;
      const [left, top] = [over.offsetLeft, over.offsetTop].map((v) => Math.round(v * scale));
      const [width, height] = [over.clientWidth, over.clientHeight].map((v) => Math.round(v * scale));
      const probe = document.createElement('span');
      probe.className = 'line-1';
      document.body.append(probe);
      const ink = getComputedStyle(probe).color.match(/\\d+/g).map(Number);
      probe.remove();
      const { data } = canvas.getContext('2d').getImageData(left, top, width, height);
      for (let i = 0; i < data.length; i += 4) {
        const far = Math.abs(data[i] - ink[0]) + Math.abs(data[i + 1] - ink[1]) + Math.abs(data[i + 2] - ink[2]);
        if (data[i + 3] > 60 && far < 60) return Math.floor(i / 4 / width) / height;
      }
      return 1;
    }""")


def test_a_log_without_torque_says_so_first(page: Any, tmp_path: Path) -> None:
    """Instead of an identification that must fail; the button leads to the form."""
    rows = list(csv.reader(DEMO.open(encoding="utf-8")))
    keep = [i for i, name in enumerate(rows[0]) if "torque" not in name]
    lines = [",".join(row[i] for i in keep) for row in rows]
    (tmp_path / "motion.csv").write_text("\n".join(lines))
    drop(page, tmp_path / "motion.csv")
    page.get_by_text("This log has no torque, force or current").wait_for()
    assert page.get_by_role("button", name="Identify", exact=True).count() == 0
    assert "--map" not in page.locator(".findings").inner_text()
    page.get_by_role("button", name="Choose the column").click()
    assert page.locator("select[name='column-time']").is_visible()


def test_a_compressed_log_is_unpacked(page: Any, tmp_path: Path) -> None:
    """And one that only says so is refused in a line."""
    (tmp_path / "demo.csv.gz").write_bytes(gzip.compress(DEMO.read_bytes()))
    (tmp_path / "broken.csv.gz").write_bytes(b"no gzip")
    drop(page, tmp_path / "broken.csv.gz")
    page.get_by_text("broken.csv.gz ends in .gz but cannot be unpacked").wait_for()
    drop(page, tmp_path / "demo.csv.gz")
    page.wait_for_selector(f"{WHOLE} canvas")
    assert page.locator("h1").inner_text() == "demo.csv"


@pytest.mark.parametrize(
    ("name", "said"),
    [("run.xlsx", "a spreadsheet: save its sheet as CSV"), ("runs.zip", "an archive: unpack it"),
     ("plot.png", "not a log"), ("law.py", "drop both together")],
)  # fmt: skip
def test_what_is_no_log_is_told_so(page: Any, tmp_path: Path, name: str, said: str) -> None:
    """With what to do instead, before it is sent."""
    (tmp_path / name).write_bytes(b"content")
    drop(page, tmp_path / name)
    page.locator(".sent .problem").filter(has_text=said).wait_for()
    assert page.url.endswith("#/")


def test_two_models_are_compared(page: Any, served: Served) -> None:
    """Verdict, table and curves; models of the same log have names of their own."""
    drop(page, DEMO)
    page.wait_for_selector(".view.log .findings")
    project, log = re.search(r"#/p/([^/]+)/log/(\S+)", page.url).groups()
    client = served.client()
    for _ in range(2):
        made = client.post(f"/api/projects/{project}/models", json={"logs": [log], "laws": ["coulomb"]})
        assert made.is_success
    # Whoever comes before the second is identified finds it here when it is.
    page.evaluate("(a) => { location.hash = a; }", f"#/p/{project}/compare")
    page.get_by_role("button", name="Compare").click()
    page.get_by_role("heading", name="No significant change").wait_for()
    page.wait_for_selector(".plot canvas")
    legend = page.locator(".plot .legend li").all_inner_texts()
    assert len(set(legend)) == len(legend) >= 2
    assert {"Friction of demo.csv", "Friction of demo.csv (2)"} <= {t.partition(",")[0] for t in legend}
    head = page.locator("thead").first.locator("th").all_inner_texts()
    assert head == ["quantity", "before", "after", "unit", "change", "verdict"]
    inertia = page.locator("tr", has_text="inertia").first.locator("td").all_inner_texts()
    assert inertia[0] == inertia[1]
    assert inertia[2:] == ["kg·m²", "0.0 %", "no significant change"]


def test_a_long_log_is_seen_before_the_doctor_has_done(page: Any, served: Served, tmp_path: Path) -> None:
    """What was zoomed to stays in sight when his findings come; nothing is identified from it before."""
    rng = np.random.default_rng(1)
    t = np.arange(500_000) * 1e-3
    position = 0.5 * np.sin(0.2 * t) + 1e-4 * rng.standard_normal(t.size)
    torque = 0.3 * np.sign(np.cos(0.2 * t)) + 0.01 * rng.standard_normal(t.size)
    units = {"position": "rad", "motor_torque": "N*m"}
    Record(t, {"position": position, "motor_torque": torque}, units, {}).save(tmp_path / "long.npz")
    client = served.client()
    base = "/api/projects/" + client.post("/api/projects", json={"name": "long"}).json()["id"]
    log = client.post(f"{base}/logs?name=long.npz", content=(tmp_path / "long.npz").read_bytes()).json()
    while client.get(f"{base}/logs/{log['id']}").json()["state"] == "reading":
        time.sleep(0.02)
    assert client.post(f"{base}/models", json={"logs": [log["id"]]}).status_code == 409
    page.evaluate("(a) => { location.hash = a; }", f"#/p/{base.rpartition('/')[2]}/log/{log['id']}")
    page.wait_for_selector(".signals .canvas[data-drawn='500000'] canvas")
    page.get_by_text("The doctor is checking this log").wait_for()
    page.locator(".signals .canvas").first.focus()
    whole = seen(page)
    page.keyboard.press("+")
    before = moved(page, whole)
    page.wait_for_selector(".findings", timeout=400_000)
    page.locator(".signals .summary").first.filter(has_text="samples").wait_for()
    assert seen(page) == before
    assert page.get_by_role("button", name="Identify", exact=True).is_visible()
