"""What tests of rigs share."""

from __future__ import annotations

import gc
from collections.abc import Iterator
from types import SimpleNamespace

import pytest

from stickslip.rigs import realtime


@pytest.fixture(scope="session", autouse=True)
def what_tests_hold_is_no_garbage() -> Iterator[None]:
    """A loop collects garbage before it begins: through all that tests have loaded that takes 0.1 s, for every loop."""
    quick = SimpleNamespace(
        collect=lambda: gc.collect(0), freeze=gc.freeze, unfreeze=gc.unfreeze, enable=gc.enable, disable=gc.disable
    )  # fmt: skip
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(realtime, "gc", quick)
        yield
