"""Records that the tests of identification share."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import pytest


@pytest.fixture(scope="session")
def logs() -> Any:
    """The generator of ordinary logs, which uses nothing of the package."""
    sys.path.insert(0, str(Path(__file__).parents[2] / "benchmarks"))
    try:
        import ordinary_logs
    finally:
        sys.path.pop(0)
    return ordinary_logs
