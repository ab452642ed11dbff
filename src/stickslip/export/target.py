"""What a target is: a name, a function that writes files, and a check that runs where its tool is installed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from stickslip.export.job import Check, Export, Job

__all__ = ["Target"]


@dataclass(frozen=True)
class Target:
    """A language or tool to which a law can be exported.

    Attributes
    ----------
    name, title : str
    write : callable
        ``write(job) -> Export``; raises `CannotCarry` where it has no room for a part of the model.
    check : callable or None
        ``check(job, export) -> Check``: run the export in its tool against the golden vectors.
    precision : bool
        Whether it heeds ``Job.single``.
    controller : bool
        Whether it carries a whole controller.
    """

    name: str
    title: str
    write: Callable[[Job], Export]
    check: Callable[[Job, Export], Check] | None = None
    precision: bool = False
    controller: bool = False
