"""What tests share: the reference results, and where compiled code and approvals go."""

from __future__ import annotations

import json
import os
import tempfile
from pathlib import Path
from typing import Any

import pytest

# What tests approve stays with them; set before anything is imported, so that other processes inherit it.
os.environ["STICKSLIP_CONFIG"] = tempfile.mkdtemp(prefix="stickslip-tests-")

ROOT = Path(__file__).parents[1]
REFERENCE = Path(os.environ.get("STICKSLIP_REFERENCE", ROOT.parent / "shared" / "reference"))


@pytest.fixture(scope="session")
def study_reference() -> dict[tuple[str, str], dict[str, Any]]:
    """The reference's 180 runs by slip rule and case; the test is skipped where they are not there."""
    path = REFERENCE / "study.json"
    if not path.exists():
        pytest.skip(f"no {path}; set STICKSLIP_REFERENCE")
    rule = {"abs": "literal", "signed": "signed"}
    return {(rule[r["rule"]], r["case"]): r for r in json.loads(path.read_text())["runs"]}
