"""What tests of studies share."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from stickslip.studies import study as studies
from stickslip.studies.plan import load

DATA = Path(__file__).parents[1] / "data"


@pytest.fixture
def small(tmp_path: Path) -> studies.Study:
    for name in ("small_study.toml", "motion.csv"):
        shutil.copy(DATA / name, tmp_path)
    return load(tmp_path / "small_study.toml")
