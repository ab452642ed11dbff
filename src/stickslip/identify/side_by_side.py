"""Independent pieces of work side by side in threads: simulations run in compiled code, without the interpreter."""

from __future__ import annotations

import functools
import os
import threading
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

__all__ = ["mapped"]

T = TypeVar("T")
R = TypeVar("R")
_inside = threading.local()


@functools.cache
def _pool() -> ThreadPoolExecutor:
    """As many threads as this process may use cores."""
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    return ThreadPoolExecutor(cores, "stickslip")


# A forked process has none of its parent's threads.
if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_pool.cache_clear)


def mapped(function: Callable[[T], R], items: Iterable[T]) -> list[R]:
    """The function of every item, in their order; one after another inside of another call of this."""
    given = list(items)
    if len(given) < 2 or getattr(_inside, "works", False):
        return [function(x) for x in given]

    def marked(item: T) -> R:
        _inside.works = True
        return function(item)

    return list(_pool().map(marked, given))
