"""Whether a law leaves Python: every export target writes it and passes its own check where its tool is installed."""

from __future__ import annotations

from stickslip.contract.verdict import Verdict, held, not_tried
from stickslip.core.spec import Law
from stickslip.exports import TARGETS, target_named
from stickslip.exports.job import CannotCarry, Job
from stickslip.models.model import Model


def exported(law: Law, name: str) -> Verdict:
    """The law by one target."""
    target, label = target_named(name), f"export {name}"
    needed: dict[str, str | float] = {s.name: 4e-4 for s in target.settings if s.default is None}
    order = Job(Model(law, **dict(law.example)), "friction", settings=needed)
    try:
        export = target.write(order)
    except CannotCarry as error:
        return not_tried(label, str(error).partition(". The nearest")[0])
    if target.check is None:
        return held(label, f"{len(export.files)} files; the target has no tool to run them")
    result = target.check(order, export)
    return Verdict(label, result.passed, result.text)


def single_precision(law: Law) -> Verdict:
    """The exported C in single precision."""
    target = target_named("c99")
    order = Job(Model(law, **dict(law.example)), "friction", single=True)
    assert target.check is not None
    result = target.check(order, target.write(order))
    return Verdict("single precision", result.passed, result.text)


EXPORTS = TARGETS
