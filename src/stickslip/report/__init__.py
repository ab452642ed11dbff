"""The report of a study: figures as SVG and PNG, and one HTML file."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from stickslip.studies.result import StudyResult

if TYPE_CHECKING:
    from stickslip.report.figures import Figure


def draw(result: StudyResult) -> list[Figure]:
    """Draw a study's figures into ``figures/`` of its folder, as SVG and PNG.

    Figures of an earlier run that are not drawn again are deleted.

    Parameters
    ----------
    result : StudyResult
        Runs that are missing are left out.

    Returns
    -------
    list of Figure
        With titles, captions and the stems of the files.
    """
    from stickslip.report._open_loop import comparison_figures, drive_figures, response_figures
    from stickslip.report._view import StudyView
    from stickslip.report.figures import reference_figures, result_figures

    view = StudyView(result)
    makers = (reference_figures, response_figures, drive_figures, comparison_figures, result_figures)
    figures = [figure for make in makers for figure in make(view, result.folder / "figures")]
    made = {f"{figure.stem}{suffix}" for figure in figures for suffix in (".svg", ".png")}
    for file in (result.folder / "figures").glob("*/figure-*"):
        if file.suffix in (".svg", ".png") and str(file) not in made:  # of an earlier run
            file.unlink()
    return figures


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
    if "experiments" in result.config:
        from stickslip.report.rig_report import write_rig_report

        return write_rig_report(result)
    from stickslip.core.errors import unwritable
    from stickslip.core.whole_files import write_whole
    from stickslip.report._view import StudyView
    from stickslip.report.html import render

    view = StudyView(result)
    target = result.folder / "report.html"
    try:
        html = render(view, draw(result))
    except OSError as error:
        raise unwritable(target, error) from None
    return write_whole(target, html)
