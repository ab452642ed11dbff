"""Folders outside the repository that tests read: measured records and independent results."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
_SHARED = ROOT.parent / "shared"

REFERENCE = Path(os.environ.get("STICKSLIP_REFERENCE", _SHARED / "reference"))
DATA = Path(os.environ.get("STICKSLIP_DATA", _SHARED / "data"))


def needs_reference(name: str) -> pytest.MarkDecorator:
    """Skip a test unless this file of independent results is present."""
    return _needs(REFERENCE / name, "independent results", "STICKSLIP_REFERENCE")


def needs_data(name: str) -> pytest.MarkDecorator:
    """Skip a test unless this file or folder of measured records is present."""
    return _needs(DATA / name, "measured records", "STICKSLIP_DATA")


def _needs(path: Path, what: str, variable: str) -> pytest.MarkDecorator:
    reason = f"needs the {what} {path.name}; {variable} names their folder"
    return pytest.mark.skipif(not path.exists(), reason=reason)
