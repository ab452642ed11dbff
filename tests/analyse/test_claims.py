"""The thesis's statements against the reference results' verdicts."""

from __future__ import annotations

import json
from typing import Any

from stickslip.core.record import Record
from stickslip.thesis.claims import CLAIMS, judge
from support.places import REFERENCE, needs_reference

STATUS = {
    (True, True): "reproduced",
    (False, True): "only literal rule",
    (True, False): "only signed rule",
    (False, False): "not reproduced",
}
# The reference's metrics that claims are judged on, by the package's names.
NAMES = {
    "position_rms_rad": "rms_e",
    "position_peak_rad": "max_e",
    "steady_state_error_rad": "ss_e",
    "velocity_above_50Hz_rms_rad_s": "rms_hp",
    "reversals_per_s": "rev_per_s",
    "second_half_reversals_per_s": "w2_rev_per_s",
    "second_half_position_span_rad": "w2_pp_e",
}


class ReferenceView:
    """The reference's metrics; it has no records."""

    def __init__(self) -> None:
        runs: list[dict[str, Any]] = json.loads((REFERENCE / "study.json").read_text())["runs"]
        rules = {"abs": "literal", "signed": "signed"}
        self.metrics = {(rules[run["rule"]], run["case"]): run["metrics"] for run in runs}

    def metric(self, rule: str, case: str, name: str) -> float:
        return float(self.metrics[rule, case][NAMES[name]][0])

    def record(self, rule: str, case: str) -> Record:
        raise KeyError(f"{rule}/{case}")


def expected() -> dict[str, dict[str, str]]:
    return {claim["id"]: claim for claim in json.loads((REFERENCE / "claims.json").read_text())}


@needs_reference("claims.json")
def test_every_statement_is_there_word_for_word() -> None:
    wanted = expected()
    assert {claim.id for claim in CLAIMS} == set(wanted)
    assert [claim.id for claim in CLAIMS if claim.text != wanted[claim.id]["claim"]] == []


@needs_reference("claims.json")
def test_verdicts_on_the_reference_metrics_agree_with_the_reference() -> None:
    view, wanted = ReferenceView(), expected()
    signed, literal = judge(view, "signed"), judge(view, "literal")
    judged = [claim.id for claim in CLAIMS if signed[claim.id].holds is not None]
    assert len(judged) >= 70  # the others need records
    found = {id: STATUS[bool(signed[id].holds), bool(literal[id].holds)] for id in judged}
    assert found == {id: wanted[id]["status"] for id in judged}


@needs_reference("claims.json")
def test_a_reason_is_given_exactly_where_a_statement_fails_somewhere() -> None:
    wanted = expected()
    without = {claim.id for claim in CLAIMS if not claim.why}
    assert without == {id for id, claim in wanted.items() if claim["status"] == "reproduced"}


def test_ids_are_unique() -> None:
    assert len({claim.id for claim in CLAIMS}) == len(CLAIMS) == 89


def test_missing_runs_leave_a_claim_open() -> None:
    class Empty:
        def metric(self, rule: str, case: str, name: str) -> float:
            raise KeyError(f"{rule}/{case}")

        def record(self, rule: str, case: str) -> Record:
            raise KeyError(f"{rule}/{case}")

    verdicts = judge(Empty(), "signed")
    assert all(verdict.holds is None for verdict in verdicts.values())
    assert verdicts["M-high-FF"].numbers == "no run signed/high/minus10/FF-coulomb"
