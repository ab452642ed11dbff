"""Libraries that only some functions and formats need, which extras of the package bring."""

from __future__ import annotations

import importlib
from typing import Any

from stickslip.core.errors import InputError


def needed(module: str, extra: str, what: str) -> Any:
    """The module, imported now; `what` is who needs it, with the verb: "MDF files need".

    Raises
    ------
    InputError
        If it is not installed; names the extra that brings it.
    """
    try:
        return importlib.import_module(module)
    except ModuleNotFoundError:
        raise InputError(f"{what} {module.split('.')[0]}; run `pip install 'stickslip[{extra}]'`") from None
