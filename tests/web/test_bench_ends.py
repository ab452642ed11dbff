"""A simulation of the workbench that has no result: the page states why."""

from __future__ import annotations

import asyncio
from concurrent.futures import ThreadPoolExecutor

import pytest

from stickslip.web import bench
from stickslip.web.asking import Refused


def test_a_simulation_that_takes_too_long_times_out(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bench, "PATIENCE", 0.0)

    async def simulated() -> None:
        await bench.Bench().simulate({})

    # In a thread of its own: a browser of other tests may keep a running loop in this one.
    with ThreadPoolExecutor() as other, pytest.raises(Refused, match="timed out after 0 s"):
        other.submit(asyncio.run, simulated()).result()
