"""What tests share: the reference results, and where compiled code and approvals go."""

from __future__ import annotations

import gc
import json
import os
import shutil
import signal
import tempfile
from collections import Counter
from pathlib import Path
from typing import Any

import pytest
from hypothesis import settings

from support import kept_compilers
from support.places import REFERENCE

# What tests approve stays with them; set before anything is imported, so that other processes inherit it.
os.environ["STICKSLIP_CONFIG"] = tempfile.mkdtemp(prefix="stickslip-tests-")
# The tests share the cores already: linear algebra in threads of its own waits in a loop for them, at four times the
# processor's time, and the commands do without as well. Before NumPy is imported, which reads it.
for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_name, "1")

# A job in the background is born deaf to Ctrl-C and nohup's to the end of its terminal: tests that send these to
# themselves or to what they start would wait for a minute each.
for _signal, _usual in ((signal.SIGINT, signal.default_int_handler), (signal.SIGQUIT, signal.SIG_DFL),
                        (signal.SIGHUP, signal.SIG_DFL)):  # fmt: skip
    if signal.getsignal(_signal) is signal.SIG_IGN:
        signal.signal(_signal, _usual)

_MADE = [os.environ["STICKSLIP_CONFIG"]]

# What C compilers made is kept where compiled kernels are; set before anything is tried, so that workers inherit it.
_MADE += kept_compilers.put_first()

# The first example of a test may compile for seconds: no example is held to a time.
settings.register_profile("stickslip", deadline=None)
settings.load_profile("stickslip")

TESTS = Path(__file__).parent


# Dearest first, by time and the processor's time (the page's files keep a browser and servers busy, or wait for them):
# a file goes to one process as a whole, and the others wait for a long one that comes last. The rest, of less than ten
# seconds each, may stand in any order.
LONGEST = (
    "test_readme", "commission/test_commission", "web/test_accessible", "web/test_way", "web/test_log_view",
    "web/test_rig_view", "control/test_special_results", "contract/test_declarations", "web/test_hostile",
    "identify/test_axis", "identify/test_presliding", "export/test_targets", "web/test_rig_files",
    "identify/test_sliding", "identify/test_doctor_spoiled", "export/test_c99", "web/test_workbench",
    "recommend/test_recommend_beside", "contract/test_control_laws", "contract/test_laws", "cli/test_results",
    "rigs/test_ds402", "identify/test_doctor_change", "sweep/test_sweep", "export/test_composed",
    "report/test_thesis_report", "export/test_modelica", "cli/test_identify", "control/test_control_loops",
    "study/test_stability_map", "web/test_sent", "identification/test_sliding",
    "test_compiled_code", "rigs/test_faults",
)  # fmt: skip


UNAVAILABLE = ("needs iec2c",)
"""Reasons to skip that no installation removes: matiec (iec2c), which neither Debian nor PyPI has."""


def pytest_addoption(parser: pytest.Parser) -> None:
    text = "fail if a test is skipped for want of something that Debian, PyPI or the project's data provide"
    parser.addoption("--every-tool", action="store_true", help=text)


def skipped(config: pytest.Config) -> Counter[str]:
    """Count the skipped tests by reason."""
    reporter = config.pluginmanager.get_plugin("terminalreporter")
    reports = reporter.stats.get("skipped", []) if reporter else []
    return Counter(r.longrepr[2].removeprefix("Skipped: ") for r in reports)


def pytest_sessionfinish(session: pytest.Session) -> None:
    """Fail a run with --every-tool in which a test was skipped that could have run."""
    if session.config.getoption("every_tool") and any(
        not r.startswith(UNAVAILABLE) for r in skipped(session.config)
    ):
        session.exitstatus = pytest.ExitCode.TESTS_FAILED


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter, config: pytest.Config) -> None:
    """Print the table of what was skipped and why."""
    if not config.getoption("every_tool"):
        return
    terminalreporter.section("skipped, and why")
    for reason, count in skipped(config).most_common():
        verdict = "cannot be installed" if reason.startswith(UNAVAILABLE) else "NOT ALLOWED: install it"
        terminalreporter.write_line(f"{count:5d}  {verdict:23}  {reason}")


def pytest_unconfigure() -> None:
    """What this process made beside pytest's own folders goes with it."""
    for folder in _MADE:
        shutil.rmtree(folder, ignore_errors=True)


def pytest_collection() -> None:
    """What collecting makes stays until the end: to look through it for garbage, time and again, finds none."""
    gc.disable()


def pytest_collection_finish() -> None:
    """Nor is it looked through while tests run, nor copied page by page by the processes that they fork."""
    gc.freeze()
    gc.enable()


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """The files that take longest begin first."""
    places = {str(TESTS / f"{name}.py"): place for place, name in enumerate(LONGEST)}
    items.sort(key=lambda item: places.get(str(item.path), len(LONGEST)))


@pytest.fixture(scope="session")
def study_reference() -> dict[tuple[str, str], dict[str, Any]]:
    """The reference's 180 runs by slip rule and case; the test is skipped where they are not there."""
    path = REFERENCE / "study.json"
    if not path.exists():
        pytest.skip("needs the independent results study.json; STICKSLIP_REFERENCE names their folder")
    rule = {"abs": "literal", "signed": "signed"}
    return {(rule[r["rule"]], r["case"]): r for r in json.loads(path.read_text())["runs"]}
