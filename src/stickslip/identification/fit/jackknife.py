"""Covariance of a least-squares estimate with correlated, uneven residuals, by leaving segments of time out.

The estimate moves by a Newton step when a block of rows is left out; the sum of the squares of these moves is its
covariance (the delete-a-group jackknife, CR3 of Bell and McCaffrey 2002). If a single block determines a parameter, the
move is large and the degrees of freedom are few, so an interval by Student's quantile keeps its coverage.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

Array = np.ndarray[Any, np.dtype[np.float64]]


@dataclass(frozen=True, eq=False)
class BlockCovariance:
    """Covariance by leaving blocks out.

    Attributes
    ----------
    covariance : array, shape (p, p)
        Covariance of the coordinates.
    moves : array, shape (blocks, p)
        Change of the estimate when each block is left out.
    shares : array, shape (blocks, p, p)
        Each block's part of the covariance for independent, even residuals of unit variance.
    """

    covariance: Array
    moves: Array
    shares: Array

    def freedom(self, direction: Array) -> float:
        """Return Satterthwaite's degrees of freedom of the variance along a direction, shape (p,)."""
        parts = np.einsum("i,bij,j->b", direction, self.shares, direction)
        squares = float(np.sum(parts**2))
        return float(np.sum(parts)) ** 2 / squares if squares > 0.0 else 0.0


def leave_blocks_out(jacobian: Array, residuals: Array, blocks: Array, ridge: Array) -> BlockCovariance:
    """Estimate the covariance of the minimum of the sum of squares.

    Parameters
    ----------
    jacobian : array, shape (n, p)
    residuals : array, shape (n,)
        Both at the minimum, weighted.
    blocks : array of int, shape (n,)
        Block of each row, counted from 0.
    ridge : array, shape (p, p)
        Prior information: it bounds directions that the remaining blocks do not determine.

    Returns
    -------
    BlockCovariance
    """
    total = jacobian.T @ jacobian + ridge
    inverse = np.linalg.inv(total)
    moves: list[Any] = []
    shares: list[Any] = []
    for b in range(int(blocks.max(initial=-1)) + 1):
        rows = blocks == b
        part = jacobian[rows]
        inner = part.T @ part
        moves.append(np.linalg.solve(total - inner, part.T @ residuals[rows]))
        shares.append(inverse @ inner @ inverse)
    found = np.array(moves)
    # A direction bounded by the ridge does not move: there the ridge itself gives the uncertainty.
    variance = float(residuals @ residuals) / max(residuals.size - jacobian.shape[1], 1)
    return BlockCovariance(found.T @ found + variance * inverse @ ridge @ inverse, found, np.array(shares))
