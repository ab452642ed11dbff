"""The contract of a law: what the engines, identification and the exports rely on, held against one law.

What a law promises is in the docstring of `stickslip.core.spec`. `examine` tries it on laws of anyone, with their own
sources and units; the package's tests hold its own laws to the same functions over more cases. The short form that runs
when a law from outside is first used is `stickslip.core.smoke_test`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial

from stickslip.contract.agreement import modes_against_rate, steady_is_reached, step_against_rate
from stickslip.contract.derivatives import derivatives
from stickslip.contract.description import bounds, description, subset
from stickslip.contract.energy import dissipation
from stickslip.contract.exports import EXPORTS, exported, single_precision
from stickslip.contract.torques import bounded, compiled, no_length
from stickslip.contract.units import units
from stickslip.contract.verdict import Verdict, failed
from stickslip.core.spec import Law

CHECKS: tuple[Callable[[Law], Verdict], ...] = (
    description, subset, bounds, units, no_length, compiled, bounded, dissipation, step_against_rate,
    steady_is_reached, modes_against_rate, derivatives, single_precision,
)  # fmt: skip
"""In the order in which `examine` runs them; the exports follow."""


def examine(law: Law) -> Iterator[Verdict]:
    """Hold a law to its contract, check after check; each takes up to some seconds, most of it compilation.

    Parameters
    ----------
    law : Law
        As `stickslip.law` returns it. Its own choices are tried with every option, those that every law has together.

    Yields
    ------
    Verdict
        As soon as it is known: of every check in `CHECKS`, then of every export target.
    """
    for check in (*CHECKS, *(partial(exported, name=name) for name in EXPORTS)):
        name = getattr(check, "__name__", "export").replace("_", " ")
        try:
            yield check(law)
        except Exception as error:  # whatever the law's own code may raise
            yield failed(name, f"ends in {type(error).__name__}: {error}")
