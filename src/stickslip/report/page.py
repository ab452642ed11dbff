"""A report as one HTML file that needs nothing but itself: its filled template."""

from __future__ import annotations

from typing import Any

from stickslip.report.plots import tied


def filled(template: str, **values: Any) -> str:
    """The HTML of a template beside this file; a value that it lacks is an error."""
    from jinja2 import Environment, PackageLoader, StrictUndefined

    environment = Environment(
        loader=PackageLoader("stickslip.report", "."), autoescape=True, undefined=StrictUndefined, trim_blocks=True
    )  # fmt: skip
    environment.filters["tied"] = tied
    return environment.get_template(template).render(**values)
