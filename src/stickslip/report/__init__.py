"""The report of a study: figures as SVG and PNG, and one HTML file."""

from __future__ import annotations

import os
from pathlib import Path

from stickslip.errors import InputError
from stickslip.study.result import StudyResult

__all__ = ["write"]


def write(result: StudyResult) -> Path:
    """Draw a study's figures into ``figures/`` of its folder and write ``report.html``.

    Parameters
    ----------
    result : StudyResult
        Runs may have failed or be missing; the report says so.

    Returns
    -------
    Path
        The report.

    Raises
    ------
    InputError
        If the folder cannot be written.
    """
    from stickslip.report._open_loop import comparison_figures, drive_figures, response_figures
    from stickslip.report._view import StudyView
    from stickslip.report.figures import reference_figures, result_figures
    from stickslip.report.html import render

    view = StudyView(result)
    folder = result.folder / "figures"
    target = result.folder / "report.html"
    try:
        figures = [
            figure
            for make in (
                reference_figures,
                response_figures,
                drive_figures,
                comparison_figures,
                result_figures,
            )
            for figure in make(view, folder)
        ]
        draft = target.with_name("report.html.part")
        draft.write_text(render(view, figures), encoding="utf-8")
        os.replace(draft, target)
    except OSError as error:
        raise InputError(f"cannot write {error.filename or target} ({error.strerror or error}); "
                         "choose another place with --out") from None  # fmt: skip
    return target
