"""Independent work in parallel threads: simulations run in compiled code, without the interpreter."""

from __future__ import annotations

import functools
import itertools
import os
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextvars import copy_context
from typing import TypeVar

T = TypeVar("T")
R = TypeVar("R")


def _cores() -> int:
    """Return the number of cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


@functools.cache
def _helpers() -> ThreadPoolExecutor | None:
    """Return a pool with a thread for every available core except the caller's; None for a single core."""
    cores = _cores()
    return ThreadPoolExecutor(cores - 1, "stickslip") if cores > 1 else None


# A forked process has none of its parent's threads.
if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_helpers.cache_clear)


def mapped(function: Callable[[T], R], items: Iterable[T]) -> list[R]:
    """Return the function of every item, in their order; calls may be nested.

    The caller participates: it computes items that no helper has started. No thread therefore waits for idle work, and
    nested calls keep all cores busy.
    """
    given, helpers = list(items), _helpers()
    if len(given) < 2 or helpers is None:
        return [function(x) for x in given]
    asked: list[Future[R]] = [helpers.submit(copy_context().run, function, x) for x in given]
    own: dict[int, R] = {}
    try:
        # From the end, which helpers reach last.
        for i in reversed(range(len(given))):
            if not asked[i].cancel():
                break
            own[i] = function(given[i])
        return [own[i] if i in own else f.result() for i, f in enumerate(asked)]
    finally:
        for f in asked:
            f.cancel()


def in_turn(function: Callable[[T], R], items: Iterable[T]) -> Iterator[R]:
    """Yield the function of every item, in their order: the first alone, then as many at a time as there are cores.

    For work that may stop early, whose remaining results are then discarded.
    """
    coming = iter(items)
    for first in itertools.islice(coming, 1):
        yield function(first)
    while some := list(itertools.islice(coming, _cores())):
        yield from mapped(function, some)
