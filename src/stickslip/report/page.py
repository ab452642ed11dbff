"""A report as one HTML file that needs nothing but itself: the templates filled, and the file put in place whole."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

from stickslip.errors import unwritable
from stickslip.report.plots import tied


def filled(template: str, **values: Any) -> str:
    """The HTML of a template beside this file; a value that it lacks is an error."""
    from jinja2 import Environment, PackageLoader, StrictUndefined

    environment = Environment(
        loader=PackageLoader("stickslip.report", "."), autoescape=True, undefined=StrictUndefined, trim_blocks=True
    )  # fmt: skip
    environment.filters["tied"] = tied
    return environment.get_template(template).render(**values)


def replaced(target: Path, html: str) -> Path:
    """Write the file in one move, so that an older one stays whole until then; returns it.

    Raises
    ------
    InputError
        If it cannot be written.
    """
    draft = target.with_name(target.name + ".part")
    try:
        draft.write_text(html, encoding="utf-8")
        os.replace(draft, target)
    except OSError as error:
        raise unwritable(target, error) from None
    return target
