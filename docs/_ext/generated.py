"""Write the pages that are made from the package before Sphinx looks for pages, and run those that are executed."""

from __future__ import annotations

import hashlib
import os
import shutil
import subprocess
import sys
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import api_pages
import command_pages
import example_pages
import failure_pictures
import law_pages
import machine_page
import nomenclature_page
import reference_pages
import sessions
import study_page
import target_pages
from pages import DOCS, GENERATED, ROOT, write
from sphinx.application import Sphinx
from sphinx.util import logging

log = logging.getLogger(__name__)

RUN = ("tutorial.md", "from_a_log.md", "thesis.md", "howto/*.md", "explanation/*.md")
"""Pages that are executed (`sessions`)."""


def generate(app: Sphinx, config: Any) -> None:
    """Write and run; what is made in this process comes first, and leaves compiled code to those that run beside."""
    for make in MAKERS:
        timed(make)
    pages = sorted(page for pattern in RUN for page in DOCS.glob(pattern))
    with ThreadPoolExecutor(os.cpu_count()) as pool:  # each in a process of its own
        diagram = pool.submit(timed, work_precision)
        for wrong in pool.map(run, pages):
            if wrong:
                log.warning("%s", wrong)
        diagram.result()


def timed(make: Callable[[], None]) -> None:
    """Make, and say how long it took."""
    start = time.perf_counter()
    make()
    log.info("%s.%s: %.1f s", make.__module__, make.__name__, time.perf_counter() - start)


def work_precision() -> None:
    """Measure and draw the work-precision diagram, unless the package is as it was."""
    script, stamp = ROOT / "benchmarks" / "work_precision.py", GENERATED / ".work_precision"
    now = hashlib.sha256(script.read_bytes() + package_hash().encode()).hexdigest()
    if stamp.exists() and stamp.read_text() == now:
        return
    command = [sys.executable, str(script), str(GENERATED / "work_precision")]
    done = subprocess.run(command, check=True, capture_output=True, text=True)
    write(GENERATED / "work_precision.txt", done.stdout)
    stamp.write_text(now)


def run(page: Path) -> str:
    """Run a page, unless page and package are as they were; says what went wrong, which fails the build."""
    if not any(sessions.blocks(page.read_text(encoding="utf-8"))):
        return ""
    folder = GENERATED / "sessions" / page.stem
    stamp = folder / ".stamp"
    now = hashlib.sha256(page.read_bytes() + package_hash().encode()).hexdigest()
    if stamp.exists() and stamp.read_text() == now:
        return ""
    shutil.rmtree(folder, ignore_errors=True)  # what an earlier build left there is not on the page
    start = time.perf_counter()
    done = subprocess.run(
        [sys.executable, str(DOCS / "_ext" / "sessions.py"), str(page), str(folder)],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    log.info("%s: %.1f s", page.name, time.perf_counter() - start)
    if done.returncode:
        return done.stderr.strip() or f"{page.name}: exit code {done.returncode}"
    stamp.write_text(now)
    return ""


def package_hash() -> str:
    """A hash of the package's sources."""
    parts = [p.read_bytes() for p in sorted((ROOT / "src").rglob("*.py"))]
    return hashlib.sha256(b"\0".join(parts)).hexdigest()


MAKERS = (
    law_pages.make, reference_pages.make, machine_page.make, command_pages.make, nomenclature_page.make, api_pages.make,
    example_pages.make, failure_pictures.make, study_page.make, target_pages.make,
)  # fmt: skip


def setup(app: Sphinx) -> dict[str, Any]:
    """Before the environment looks for pages."""
    app.connect("config-inited", generate)
    return {"version": "1", "parallel_read_safe": True, "parallel_write_safe": True}
