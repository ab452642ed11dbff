"""The thesis's study whole: every statement against the reference, every figure, the report's size."""

from __future__ import annotations

import json

import pytest

from stickslip import report
from stickslip.report._view import StudyView
from stickslip.studies.result import StudyResult
from stickslip.studies.study import load, run
from stickslip.thesis.claims import CLAIMS, judge
from support.places import REFERENCE, needs_reference

pytestmark = pytest.mark.slow

STATUS = {
    (True, True): "reproduced",
    (False, True): "only literal rule",
    (True, False): "only signed rule",
    (False, False): "not reproduced",
}
COMMON = ["3.5", "3.10", "3.11", "3.12", "3.13", "3.14", "3.15", "3.16", "3.17", "3.18", "3.19", "3.20"]


@pytest.fixture(scope="module")
def result(tmp_path_factory: pytest.TempPathFactory) -> StudyResult:
    return run(load("thesis"), tmp_path_factory.mktemp("thesis"))


@needs_reference("claims.json")
def test_every_statement_fares_as_in_the_reference(result: StudyResult) -> None:
    view = StudyView(result)
    signed, literal = judge(view, "signed"), judge(view, "literal")
    found = {c.id: STATUS[bool(signed[c.id].holds), bool(literal[c.id].holds)] for c in CLAIMS}
    wanted = {c["id"]: c["status"] for c in json.loads((REFERENCE / "claims.json").read_text())}
    assert found == wanted


def test_the_report_has_every_figure_and_stays_small(result: StudyResult) -> None:
    path = report.write(result)
    results = [f"3.{n}" for n in range(21, 39)]
    for rule, numbers in (("both", COMMON), ("signed", results), ("literal", results)):
        for number in numbers:
            stem = result.folder / "figures" / rule / f"figure-{number}"
            assert 0 < stem.with_name(stem.name + ".svg").stat().st_size < 300_000
            assert stem.with_name(stem.name + ".png").stat().st_size > 0
    page = path.read_text(encoding="utf-8")
    assert len(page) < 15e6
    assert page.count("<figure ") == 48
    assert page.count('id="claim-') == 89
    assert "not run" not in page
