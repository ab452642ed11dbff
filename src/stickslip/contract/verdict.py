"""What a check of the contract says."""

from __future__ import annotations

from typing import NamedTuple


class Verdict(NamedTuple):
    """What a check says of a law.

    Attributes
    ----------
    name : str
    passed : bool or None
        None where there is nothing to check, or nothing to check it with.
    text : str
        One line: what was found, or why it was not tried.
    """

    name: str
    passed: bool | None
    text: str


def held(name: str, text: str) -> Verdict:
    """A check that the law passes."""
    return Verdict(name, True, text)


def failed(name: str, text: str) -> Verdict:
    """A check that the law does not pass."""
    return Verdict(name, False, text)


def not_tried(name: str, text: str) -> Verdict:
    """A check that has nothing to look at."""
    return Verdict(name, None, text)
