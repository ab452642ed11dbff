"""Libraries that only some formats need."""

from __future__ import annotations

import importlib
from typing import Any

from stickslip.errors import InputError


def needed(module: str, extra: str, what: str) -> Any:
    """The module, imported now.

    Raises
    ------
    InputError
        If it is not installed; names the extra that brings it.
    """
    try:
        return importlib.import_module(module)
    except ModuleNotFoundError:
        raise InputError(
            f"{what} need {module.split('.')[0]}; run `pip install 'stickslip[{extra}]'`"
        ) from None
