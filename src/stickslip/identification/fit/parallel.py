"""Independent pieces of work side by side in threads: simulations run in compiled code, without the interpreter."""

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
    """How many this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


@functools.cache
def _helpers() -> ThreadPoolExecutor | None:
    """A thread for every core but the caller's that this process may use."""
    cores = _cores()
    return ThreadPoolExecutor(cores - 1, "stickslip") if cores > 1 else None


# A forked process has none of its parent's threads.
if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_helpers.cache_clear)


def mapped(function: Callable[[T], R], items: Iterable[T]) -> list[R]:
    """The function of every item, in their order, which may call this in turn.

    The caller takes part: it works on what no helper has begun. So nobody waits for work that nobody does, and calls
    within calls keep all cores busy.
    """
    given, helpers = list(items), _helpers()
    if len(given) < 2 or helpers is None:
        return [function(x) for x in given]
    asked: list[Future[R]] = [helpers.submit(copy_context().run, function, x) for x in given]
    own: dict[int, R] = {}
    try:
        # From the end, where helpers come last.
        for i in reversed(range(len(given))):
            if not asked[i].cancel():
                break
            own[i] = function(given[i])
        return [own[i] if i in own else f.result() for i, f in enumerate(asked)]
    finally:
        for f in asked:
            f.cancel()


def in_turn(function: Callable[[T], R], items: Iterable[T]) -> Iterator[R]:
    """The function of every item, in their order: the first alone, of the others as many ahead as there are cores.

    For work that may end early, whose rest is then lost.
    """
    coming = iter(items)
    for first in itertools.islice(coming, 1):
        yield function(first)
    while some := list(itertools.islice(coming, _cores())):
        yield from mapped(function, some)
