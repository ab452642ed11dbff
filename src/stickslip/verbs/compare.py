"""Has the friction changed between two identifications: the verb `compare`."""

from __future__ import annotations

import os

from stickslip.core.arguments import arguments_checked
from stickslip.identification.compare.change import Comparison, compare_models
from stickslip.identification.identified_file import Identified, read_identified
from stickslip.verbs.identification import IdentificationResult
from stickslip.verbs.kinds import require

IdentifiedModel = IdentificationResult | Identified | str | os.PathLike[str]
"""What `identify` handed back, or the path of the model that it saved."""


def identified_of(given: IdentifiedModel) -> Identified:
    """The identified law, from memory or from its file.

    Raises
    ------
    InputError
        If there is no such file, it is no model, or the identification yields no whole law.
    """
    if isinstance(given, IdentificationResult):
        return given.identified()
    if isinstance(given, Identified):
        return given
    require(given, "model")
    return read_identified(given)


@arguments_checked
def compare(first: IdentifiedModel, second: IdentifiedModel, *, top: float | None = None) -> Comparison:
    """Test the difference of two identified models, parameters and sliding curve, at a level of 5 % together.

    Parameters
    ----------
    first, second : IdentificationResult or path
    top : float, optional
        Highest velocity of the curves, rad/s (m/s); that of the records unless given.

    Returns
    -------
    Comparison
        ``summary`` in a sentence, ``changes`` of the parameters, ``levels`` of the torque, ``p``, ``as_dict()``.

    Raises
    ------
    InputError
        As `identified_of`; if the laws cannot be compared.
    """
    return compare_models(identified_of(first), identified_of(second), top=top)
