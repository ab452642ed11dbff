"""Names of parameters that a method has no use for are refused, not passed over."""

from __future__ import annotations

import pytest

from stickslip.core.errors import InputError, UnknownName
from stickslip.identification.methods import METHODS, method_named
from stickslip.identification.methods._records import known_curve
from stickslip.identification.methods.method import Options
from stickslip.identification.methods.sliding import refuse_unknown
from stickslip.models.model import Model

OWN = ("axis", "cogging", "sliding", "presliding", "lugre")
"""Those that look at parameters of a law, or at names of their own, themselves."""


@pytest.mark.parametrize("name", [n for n in METHODS if n not in OWN])
def test_a_method_refuses_what_it_would_not_hear(name: str) -> None:
    method = method_named(name)
    for given, option in (
        (Options(values={"rubbish": 3.0}), "values"), (Options(free=("fc",)), "free"),
        (Options(frozen=("fc",)), "frozen"),
    ):  # fmt: skip
        with pytest.raises(InputError, match=f"method=.{name}. has no '(rubbish|fc)' for {option}"):
            method.refuse_unknown(given)
    method.refuse_unknown(Options(values=dict.fromkeys(method.values or (), 1.0)))


def test_a_curve_has_the_parameters_of_its_law() -> None:
    asymmetric = Model("stribeck_plain", {"symmetry": "asymmetric"}, fs=1.2, fc=1.0, vs=0.1, fs_negative=1.3,
                       fc_negative=1.1, vs_negative=0.2)  # fmt: skip
    curve = known_curve(
        Options(model=asymmetric, values={"fc_negative": 1.05, "inertia": 1.0}), "lugre", ("inertia",)
    )
    assert (curve.parameters.fc, curve.parameters.fc_negative) == (1.0, 1.05)
    for model in (None, asymmetric):
        with pytest.raises(UnknownName, match="'rubbish'"):
            known_curve(Options(model=model, values={"rubbish": 3.0}), "presliding", ("inertia",))
    with pytest.raises(InputError, match="lacks vs"):
        known_curve(Options(values={"fs": 1.2, "fc": 1.0}), "presliding", ())


def test_sliding_knows_the_parameters_of_its_curves() -> None:
    curves = [
        Model("coulomb", fc=1.0, sigma2=0.1),
        Model("stribeck_plain", fs=1.2, fc=1.0, vs=0.1, sigma2=0.1),
    ]
    refuse_unknown(Options(values={"vs": 0.1, "fc": 1.0}, frozen=("fc",)), curves)
    with pytest.raises(UnknownName, match="'rubbish'"):
        refuse_unknown(Options(values={"rubbish": 3.0}), curves)
    with pytest.raises(InputError, match=r"leave free=\[.fc.\] out"):
        refuse_unknown(Options(free=("fc",)), curves)
