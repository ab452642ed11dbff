"""Whether a law's description is whole: what people, files and the engines read of it."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from stickslip.contract.motions import name_of, variants
from stickslip.contract.verdict import Verdict, failed, held
from stickslip.core.control_spec import ControlLaw
from stickslip.core.errors import LawError, ParameterError
from stickslip.core.spec import COMPILED, Configurable, Law, Mode
from stickslip.subset import law_layouts, lower


def description(law: Law) -> Verdict:
    """Texts, units and symbols are there, and functions that belong together come together."""
    name = "description"
    missing = [part for part in required(law) if not getattr(law, part)]
    fields = (*law.fields, *law.state_fields)
    missing += [
        f"{part} of {f.name}"
        for f in fields
        for part in ("unit", "symbol", "meaning")
        if not getattr(f.par, part)
    ]
    if missing:
        return failed(name, f"{', '.join(missing)} is missing")
    if (law.guards is None) != (law.switch is None):
        return failed(name, "guards and switch belong together; give both or neither")
    switches = any(isinstance(f.par, Mode) for f in law.state_fields)
    if law.rate is not None and switches != (law.guards is not None):
        return failed(name, "a law with `rate` has `guards` and `switch` where it has modes, and only there")
    return held(name, f"{len(law.fields)} parameters, {len(law.state_fields)} states; {source_of(law)}")


def required(law: Law | ControlLaw) -> tuple[str, ...]:
    """The texts that a law must have: one of the package also says where it comes from."""
    function = law.written["step" if isinstance(law, Law) else "sample"]
    ours = str(getattr(function, "__module__", "")).startswith("stickslip.")
    return ("title", "equation", *(("source",) if ours else ()))


def source_of(law: Law | ControlLaw) -> str:
    """Where it comes from, for people."""
    if law.source:
        return f"source: {'; '.join(law.source)}"
    return "no source is stated, which a law of your own may do; one that enters the package names its source"


def subset(law: Law) -> Verdict:
    """Every function is in the scalar subset and returns on every path, under every option."""
    count = 0
    for variant in variants(law):
        try:
            lower({n: f for n in COMPILED if (f := getattr(variant, n))}, law_layouts(variant))
        except LawError as error:
            return failed("subset", f"{name_of(variant)}: {error}")
        count += 1
    return held("subset", f"all functions, under {count} options")


def bounds(law: Configurable) -> Verdict:
    """Parameters out of bounds are refused by name, and the example holds with every option."""
    good = dict(law.example)
    for f in law.fields:
        wrong = [math.nan, math.inf]
        if f.par.positive:
            wrong += [0.0, -1.0]
        elif f.par.lower > -math.inf:
            wrong.append(f.par.lower - 1.0)
        if f.par.upper < math.inf:
            wrong.append(f.par.upper + 1.0)
        if f.par.whole:
            wrong.append(max(f.par.lower, 0.0) + 0.5)
        for x in wrong:
            value = [x] * len(good[f.name]) if f.per_element and f.name in good else x
            if not _refused(lambda v=value, n=f.name: law.parameters({**good, n: v}), f.name):
                return failed("bounds", f"{f.name} = {x:g} is not refused by its name")
    return held("bounds", "every parameter out of bounds is refused by its name")


def _refused(make: Callable[[], Any], name: str) -> bool:
    try:
        make()
    except ParameterError as error:
        return name in str(error)
    return False
