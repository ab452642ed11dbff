"""What several bands of frequencies say together of one number: their mean, and their spread beside each one's own."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from stickslip.identify.regression.band_fit import BandFit
from stickslip.identify.regression.drifting import DRIFTS
from stickslip.identify.regression.flexible import Train
from stickslip.identify.regression.number import QUANTILE, Number

TELLING, NARROW = 4.0, 0.1
"""A band tells of a number where its standard deviation is at most so many times the smallest, or that part of the
value."""
FINEST = 0.01
"""Rows: standard deviation of a skew that is found, at least: a hold, a lag and a mean are a delay to that only."""
SWUNG = 0.1
"""The same where a load swings, which a delay explains in part."""
SURELY, BLURRED = 0.02, 0.3
"""Part of the inertia that its half-width may be at most beside a train that gives or swings, and the skew's standard
deviation in rows beyond it: of 23 skews told to a quarter of a row there on tuning steps 8 held, of 49 of moves and
staircases 47."""
FORM = 0.012
"""Part of Fc, one standard deviation, that its level is unsure by where the slope beside it is not told: of 103 levels
on tuning steps 89 % held without it."""
BENT, AGAIN = 0.05, 0.03
"""Part of Fc by which friction's curve must be another one over the recorded speeds, in some band; in a second."""
ROTATED = {"gravity_sin", "gravity_cos"}


def that_tell(name: str, bands: Sequence[BandFit]) -> list[BandFit]:
    """The fits that tell of a number."""
    least = min(b.numbers[name].std for b in bands)
    signed = name in ROTATED or name in ("skew", "offset", "uneven", *DRIFTS)

    def tells(n: Number) -> bool:
        return n.std <= max(TELLING * least, 0.0 if signed else NARROW * abs(n.value))

    return [b for b in bands if tells(b.numbers[name])]


def telling(name: str, bands: Sequence[BandFit]) -> list[Number]:
    """What the fits that tell of a number say."""
    return [b.numbers[name] for b in that_tell(name, bands)]


def together(name: str, bands: Sequence[BandFit]) -> Number:
    """One number of all bands that tell of it: their mean, and their spread beside each one's own."""
    told = telling(name, bands)
    found = mixed(told)
    against = [
        n for n in (b.numbers[name] for b in bands)
        if n not in told and abs(n.value - found.value) > QUANTILE * math.hypot(n.std, found.std)
    ]  # fmt: skip
    return mixed([*told, *against]) if against else found


def mixed(numbers: Sequence[Number]) -> Number:
    """Their mean, with the spread of what each says."""
    value = math.fsum(n.value for n in numbers) / len(numbers)
    variance = math.fsum(n.std**2 + (n.value - value) ** 2 for n in numbers) / len(numbers)
    return Number(value, math.sqrt(variance))


def holding(found: Number, perhaps: Number) -> Number:
    """A number whose interval holds what it may be as well."""
    return Number(found.value, max(found.std, abs(perhaps.value - found.value) / QUANTILE))


def as_told(numbers: Mapping[str, Number], size: float, period: float, train: Train) -> Number:
    """The skew, s: no surer than its usual size where the inertia, by which acceleration shows it, is not told, and
    than a part of a row beside a load that swings, or a larger one where the inertia beside it is not told well."""
    found, inertia = numbers["skew"], numbers["inertia"]
    least = SWUNG if train is Train.SWINGS else FINEST
    if train is not Train.RIGID and QUANTILE * inertia.std > SURELY * abs(inertia.value):
        least = BLURRED
    return Number(found.value, math.hypot(found.std, least * period, 0.0 if inertia.told_to_two else size))


def with_form(level: Number, slope: Number) -> Number:
    """The level of friction, where the slope beside it is not told no surer than a law's form is true."""
    if slope.told_to_two:
        return level
    return Number(level.value, math.hypot(level.std, FORM * level.value))


def bend_of(bands: Sequence[BandFit]) -> float:
    """Part of Fc by which friction bends with velocity in another way than any level, slope and fall: what one band
    shows and one of another width confirms; above 0 where friction rises ever faster, below 0 ever more slowly, else 0.
    """
    bends = {b.corner: b.bend for b in bands}
    most = max(bends.values(), key=abs, default=0.0)
    return most if abs(most) > BENT and len(bending(bends, most)) > 1 else 0.0


def bends_by_itself(bands: Sequence[BandFit]) -> bool:
    """Whether it is friction that bends so, in as many bands: no load that swings would explain it as well, nor what
    the axis accelerates with, which is told beside it."""
    bends = {b.corner: 0.0 if b.swing_bends else b.bend for b in bands}
    accelerates = bool(bands) and together("inertia", bands).interval[0] > 0.0
    return accelerates and len(bending(bends, bend_of(bands))) > 1


def bending(bends: Mapping[float, float], most: float) -> list[float]:
    """Those of some bends, by the bands' corners, that go the same way as the largest."""
    return [b for b in bends.values() if b * most > 0.0 and abs(b) > AGAIN]
