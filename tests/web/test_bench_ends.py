"""A simulation of the workbench that has no result: the page states why."""

from __future__ import annotations

import asyncio

import pytest

from stickslip.web import bench
from stickslip.web.asking import Refused


def test_a_simulation_that_takes_too_long_times_out(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bench, "PATIENCE", 0.0)

    async def simulated() -> None:
        await bench.Bench().simulate({})

    with pytest.raises(Refused, match="timed out after 0 s"):
        asyncio.run(simulated())
