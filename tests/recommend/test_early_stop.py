"""Candidates that cannot be the best are not finished, and the answer is the one without that."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np
import pytest
from test_inertia_alone import FAST, identified

from stickslip.recommendation import recommend as recommending
from stickslip.recommendation.candidate_run import Drive
from stickslip.recommendation.candidates import Bench, Candidate, Moved, Setting
from stickslip.recommendation.recommend import ALIKE, LEADS, best_of, find_best, recommend, with_lead
from stickslip.verbs.recommendation import RecommendationResult

DRIVE = Drive(sample_time=1e-3)


class Table(Bench):
    """A bench whose results are drawn, and which notes what is simulated."""

    def __init__(self, seed: int, settings: Sequence[Setting], axes: int) -> None:
        super().__init__([None] * axes, None, DRIVE, {})  # type: ignore[list-item, arg-type]
        rng = np.random.default_rng(seed)
        errors = rng.uniform(0.05, 1.0) * np.exp(rng.normal(0.0, 0.3, (len(settings), axes)))
        errors *= np.exp(rng.normal(0.0, rng.choice([0.02, 1.0]), (len(settings), 1)))
        unsafe = rng.uniform(size=errors.shape) < rng.choice([0.0, 0.1, 0.5])
        self.results = {
            s: [Moved(float(e), ("unsafe",) * bool(u)) for e, u in zip(errors[k], unsafe[k], strict=True)]
            for k, s in enumerate(settings)
        }
        self.run: set[tuple[Setting, int]] = set()

    def _along_motion(self, setting: Setting, axes: Sequence[int] | None = None) -> Iterator[Moved]:
        for i in range(len(self.plants)) if axes is None else axes:
            self.run.add((setting, i))
            yield self.results[setting][i]

    def _after_a_push(self, setting: Setting, i: int) -> tuple[str, ...]:
        return ()

    def before(self, i: int) -> str:
        return ""


def test_the_best_is_that_of_all_candidates_finished_and_many_are_not() -> None:
    kinds = ("feedforward", "feedback")
    settings = [Setting("coulomb", kind, gain) for kind in kinds for gain in (0.5, 0.7, 0.8, 0.9, 1.0)]
    simulated = finished = 0
    for seed in range(300):
        bench, whole = (Table(seed, settings, 7) for _ in range(2))
        candidates = {s: bench.judged(s, 0.0) for s in settings}
        assert find_best(candidates, bench) == best_of([whole.judged(s) for s in settings])
        simulated, finished = simulated + len(bench.run), finished + len(whole.run)
        for s, c in candidates.items():
            assert c == whole.judged(s) if c.finished else c.errors == whole.judged(s).errors[: len(c.errors)]
    assert simulated < 0.6 * finished


def test_the_lead_is_that_of_all_leads_finished() -> None:
    """The shortest whose worst error is within `ALIKE` of the least."""
    leads = [Setting("coulomb", "feedforward", 0.9, lead=n * DRIVE.sample_time) for n in LEADS]
    taken = set()
    for seed in range(300):
        bench, whole = (Table(seed, leads, 7) for _ in range(2))
        first = bench.judged(leads[0])
        if first.unsafe:
            continue
        safe = [c for c in (whole.judged(s) for s in leads) if not c.unsafe]
        least = min(c.worst for c in safe)
        wanted = next(c for c in safe if c.worst <= ALIKE * least)
        assert with_lead(first, bench) == wanted
        taken.add((wanted.setting.lead, len(bench.run) < len(leads) * 7))
    assert {lead for lead, _ in taken} == {s.lead for s in leads}
    assert any(early for _, early in taken)


@pytest.mark.parametrize(("friction", "drive"), [(0.1, FAST), (0.02, Drive(20.0, amplitude=0.1))])
def test_the_answer_is_that_with_all_candidates_finished(
    monkeypatch: pytest.MonkeyPatch, friction: float, drive: Drive
) -> None:
    found = identified(friction, 0.005)

    def answer() -> tuple[RecommendationResult, list[str]]:
        advice = RecommendationResult(recommend(found, drive, axes=2, confirm=3), found)
        return advice, advice.details.splitlines()

    early, said = answer()
    judged = Bench.judged

    def finished(bench: Bench, setting: Setting, most: float = math.inf) -> Candidate:
        return judged(bench, setting)

    monkeypatch.setattr(recommending.Bench, "judged", finished)
    monkeypatch.setattr(recommending.Bench, "error_on", lambda *_: 0.0)
    whole, wanted = answer()
    stopped = {i for i, c in enumerate(early.candidates, 1) if not c.finished}
    assert stopped
    assert [line for i, line in enumerate(said) if i not in stopped] == [
        line for i, line in enumerate(wanted) if i not in stopped
    ]
    assert early.chosen == whole.chosen
    assert all("not tried further" in said[i] for i in stopped)
