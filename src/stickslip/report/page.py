"""Fill the template of a report: one self-contained HTML file."""

from __future__ import annotations

from typing import Any

from stickslip.report.plots import tied


def filled(template: str, **values: Any) -> str:
    """Return the HTML of a template in this folder; a missing value is an error."""
    from jinja2 import Environment, PackageLoader, StrictUndefined

    environment = Environment(
        loader=PackageLoader("stickslip.report", "."), autoescape=True, undefined=StrictUndefined, trim_blocks=True
    )  # fmt: skip
    environment.filters["tied"] = tied
    return environment.get_template(template).render(**values)
