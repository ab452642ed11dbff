"""Which kinds of file a verb takes."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from stickslip.verbs.kinds import require

if TYPE_CHECKING:
    import argparse

__all__ = ["check"]

WANTED: Mapping[str, Mapping[str, tuple[str, ...]]] = {
    "identify": {"model": ("model",)},
    "compare": {"first": ("model",), "second": ("model",)},
    "recommend": {"model": ("model",)},
    "sweep": {"sweep": ("sweep", "tuning")},
    "tune": {"tune": ("tuning", "sweep")},
    "simulate": {"file": ("simulation", "model")},
    "learn": {"file": ("simulation", "model")},
    "study": {"study": ("study",)},
    "export": {"file": ("model", "simulation", "map")},
    "rig": {"rig": ("rig",)},
}
"""Per verb and argument, the kinds of file that it takes, or knows better what to say of; records are looked at where
they are read."""


def check(args: argparse.Namespace) -> None:
    """Refuse files of another kind than the verb of `args` takes.

    Raises
    ------
    InputError
    """
    for name, wanted in WANTED.get(args.verb, {}).items():
        if (path := getattr(args, name, None)) is not None:  # `rig list` has none
            require(path, *wanted)
