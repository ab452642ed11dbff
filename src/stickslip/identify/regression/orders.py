"""Which cycles of a torque over the position a record shows: cogging, unbalance, the pitch of a screw.

Orders are taken one by one, the one that explains most first (orthogonal matching pursuit, ``pati1993``), as long as
what it explains is more than chance would among so many, and helps on the half of the record that it was not fitted to.
Where others explain about as much, the rows as they were logged tell which it is (`rivals`), if any do.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from stickslip.identify.regression.drifting import drift_columns
from stickslip.identify.regression.rivals import APART, told_as_logged
from stickslip.identify.regression.sliding_rows import SlidingRows
from stickslip.identify.regression.strokes import PIECE, memory_of, pieces_of, rows_in, stacked, strokes_of

Array = np.ndarray[Any, np.dtype[np.float64]]


class Shown(NamedTuple):
    """An order that shows, cycles a radian (m), and those it may be as well."""

    order: float
    alike: tuple[float, ...]


MOST = 8
HIGHEST_ORDER, PARTS = 60, 40
WHOLE_TURN = 0.5
"""Of a turn, from which on orders are whole numbers a turn; below, halves of the way travelled: here both lie as
densely."""
HIDDEN = 0.5
"""Squares of cosine and sine together, on average (1 where nothing hides them), below which windows hide a wave."""
OWN = 0.05
"""Part of a harmonic that no other column explains, at least."""
SURE = 8.0
"""Beyond twice the logarithm of how many are tried: what a harmonic explains, in variances of the noise."""
KEPT = 4_000_000
"""Numbers of harmonics' rows that are kept from one look to the next, at 8 bytes each."""
HELPS = 0.25
"""Of what a harmonic explains where it was fitted, that it must explain where it was not."""


def without_waves(torque: Array, rows: Sequence[SlidingRows], orders: Sequence[float]) -> Array:
    """A torque in the rows of all records less its least-squares waves of these cycles a radian (m), shape (n,)."""
    if not orders:
        return torque
    waves = np.concatenate([np.concatenate([r.around(order) for r in rows]) for order in orders], axis=1)
    return np.asarray(torque - waves @ np.linalg.lstsq(waves, torque, rcond=None)[0], dtype=np.float64)


def candidate_orders(
    records: Sequence[SlidingRows], rotary: bool, period: float | None = None
) -> list[float]:
    """Cycles a radian (m) that are tried.

    Parameters
    ----------
    records : sequence of SlidingRows
    rotary : bool
    period : float, optional
        rad (m) after which the torque repeats, where it is known.
    """
    if goes_round(records, rotary, period):
        turn = 2.0 * math.pi if period is None else period
        return [k / turn for k in range(1, HIGHEST_ORDER + 1)]
    return [k / (2.0 * way_of(records)) for k in range(1, PARTS + 1)]


def goes_round(records: Sequence[SlidingRows], rotary: bool, period: float | None = None) -> bool:
    """Whether the way is long enough for orders to be told apart by whole numbers a turn."""
    turn = period if period is not None else 2.0 * math.pi if rotary else math.inf
    return way_of(records) > WHOLE_TURN * turn


def way_of(records: Sequence[SlidingRows]) -> float:
    """The longest way between two rows of one record, rad (m)."""
    return max(float(np.ptp(r.position)) for r in records)


def shown_orders(
    records: Sequence[SlidingRows], skew: float, candidates: Sequence[float], falls: Sequence[int],
    known: Sequence[float] = (), drifting: bool = False,
) -> list[Shown]:  # fmt: skip
    """Those of the candidates that the records show, the largest first.

    Parameters
    ----------
    records : sequence of SlidingRows
    skew : float
        s by which the column of the torque lies behind the torque that acted.
    candidates : sequence of float
        Cycles a radian (m).
    falls : sequence of int
        Columns of `falling` that make up friction's curve: of one form, since more of them explain what is left by
        chance, and an order then stands out of it that is not there.
    known : sequence of float
        Cycles a radian (m) that are there in any case: a pendulum's weight, which over half a turn two others make up.
    drifting : bool
        Whether level and slope of friction may change evenly with time.
    """
    torque = np.concatenate([r.torque(skew) for r in records])
    basis = basis_of(np.column_stack([
        stacked(records, "fixed"), stacked(records, "jerk"), stacked(records, "falling")[:, list(falls)],
        *(around(records, order) for order in known), *([drift_columns(records)] if drifting else []),
    ]))  # fmt: skip
    residual: Array = np.asarray(torque - basis @ (basis.T @ torque), dtype=np.float64)
    pool: dict[float, Harmonic] = {}
    rows_of = functools.partial(around, records)
    if 2 * torque.size * len(candidates) <= KEPT:
        rows_of = functools.cache(rows_of)
    for order in candidates:
        pool[order] = Harmonic.of(rows_of(order), basis, residual)
    stroke = strokes_of(records)
    piece = pieces_of(stroke, rows_in(PIECE, records))
    found: list[Shown] = []
    # Where neighbours are half a cycle apart over the way, several make up one order between them, and none is it.
    whole = way_of(records) * float(np.diff(candidates[:2])[0]) > WHOLE_TURN
    least = 2.0 * math.log(len(candidates)) + SURE
    while len(found) < MOST and pool:
        power = float(residual @ residual)
        explained, order = max((h.explained, o) for o, h in pool.items())
        independent = torque.size / memory_of(residual, stroke)
        if power <= 0.0 or independent * explained / power < least:
            break
        alike: Sequence[float] = ()
        if whole:
            alike = rivals_of(order, pool, rows_of, basis, residual, power / independent, least)
        rows = rows_of(order)
        if alike and pool[order].size < HIDDEN * torque.size:
            # Of what is hidden the windows tell so little that none is out.
            hidden = [o for o, h in pool.items() if o != order and h.size < HIDDEN * torque.size]
            order, alike = told_as_logged(records, torque - residual, [order, *hidden])
            explained, rows = pool[order].explained, rows_of(order)
        own = rows - basis @ (basis.T @ rows)
        if held_out_power(own, residual, piece % 2 == 0) > power - HELPS * explained:
            break
        found.append(Shown(order, tuple(alike)))
        del pool[order]
        added: Array = np.asarray(np.linalg.qr(own)[0], dtype=np.float64)
        basis = np.asarray(np.column_stack([basis, added]), dtype=np.float64)
        residual = residual - added @ (added.T @ residual)
        if len(found) < MOST:
            for other, harmonic in pool.items():
                pool[other] = harmonic.beside(rows_of(other), added, residual)
    return found


def basis_of(columns: Array) -> Array:
    """Orthonormal columns that span the same, shape (n, up to as many)."""
    size = np.linalg.norm(columns, axis=0)
    left, singular, _ = np.linalg.svd(columns[:, size > 0.0] / size[size > 0.0], full_matrices=False)
    return np.asarray(left[:, singular > 1e-6 * singular[0]], dtype=np.float64)


def rivals_of(
    order: float, pool: Mapping[float, Harmonic], rows_of: Callable[[float], Array], basis: Array, residual: Array,
    noise: float, least: float,
) -> list[float]:  # fmt: skip
    """The others that explain about as much of the residual, and beside which this order shows no longer.

    Parameters
    ----------
    order : float
        Cycles a radian (m).
    pool : mapping of float to Harmonic
        All that are tried.
    rows_of : callable
        Cosine and sine of an order at every row, shape (n, 2).
    basis, residual : array, shape (n, k), (n,)
    noise : float
        Power of the residual that an order explains by chance, one degree of freedom's.
    least : float
        What one must explain to show, in such powers.
    """
    found: list[float] = []
    for other, harmonic in pool.items():
        if other == order or harmonic.explained < pool[order].explained - APART * noise:
            continue
        rows = rows_of(other)
        added: Array = np.asarray(np.linalg.qr(rows - basis @ (basis.T @ rows))[0], dtype=np.float64)
        left = residual - added @ (added.T @ residual)
        if pool[order].beside(rows_of(order), added, left).explained < least * noise:
            found.append(other)
    return found


def around(records: Sequence[SlidingRows], order: float) -> Array:
    """Cosine and sine of an order at every row, shape (n, 2)."""
    return np.concatenate([r.around(order) for r in records])


@dataclass(frozen=True)
class Harmonic:
    """What a harmonic shares with a residual and with the columns before it: of a long record its rows are not kept.

    Attributes
    ----------
    products : array, shape (2, 2)
        Of its cosine and sine with each other.
    own : array, shape (2, 2)
        The same, of the part that no column before it explains.
    seen : array, shape (2,)
        Its products with the residual, which those columns do not explain.
    """

    products: Array
    own: Array
    seen: Array

    @staticmethod
    def of(rows: Array, basis: Array, residual: Array) -> Harmonic:
        """Of rows of shape (n, 2), beside an orthonormal basis of shape (n, k)."""
        products: Array = np.asarray(rows.T @ rows)
        return Harmonic(products, products, np.zeros(2)).beside(rows, basis, residual)

    def beside(self, rows: Array, added: Array, residual: Array) -> Harmonic:
        """The same with orthonormal columns added to the basis, and another residual."""
        mixing: Array = np.asarray(added.T @ rows)
        return replace(self, own=self.own - mixing.T @ mixing, seen=rows.T @ residual)

    @property
    def size(self) -> float:
        """Sum of its squares: as many as there are rows where windows hide none of it."""
        return float(np.trace(self.products))

    @cached_property
    def explained(self) -> float:
        """Power of the residual that its own part explains; none where that part is hardly there."""
        # A harmonic that no row resolves is 0 throughout.
        if np.min(np.diag(self.own)) <= OWN**2 * np.max(np.diag(self.products)):
            return 0.0
        told: Array = np.asarray(
            np.linalg.solve(self.own + 1e-9 * np.trace(self.own) * np.eye(2), self.seen), dtype=np.float64
        )
        return float(self.seen @ told)


def held_out_power(own: Array, residual: Array, half: np.ndarray[Any, np.dtype[np.bool_]]) -> float:
    """Power that is left where each half is explained by what the other half shows."""
    total = 0.0
    for fitted in (half, ~half):
        values = np.linalg.lstsq(own[fitted], residual[fitted], rcond=1e-9)[0]
        total += float(np.sum((residual[~fitted] - own[~fitted] @ values) ** 2))
    return total
