"""Covariance of a least-squares estimate whose residuals are correlated and uneven: leave a stretch of time out.

The estimate moves by a Newton step when a block of rows is left out; the sum of the squares of these moves is its
covariance (the delete-a-group jackknife, CR3 of Bell and McCaffrey 2002). A block that decides a parameter alone
makes the move large and the degrees of freedom few, so that an interval by Student's quantile stays honest where
one event tells nearly everything.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

Array = np.ndarray[Any, np.dtype[np.float64]]


@dataclass(frozen=True, eq=False)
class BlockCovariance:
    """What leaving blocks out says.

    Attributes
    ----------
    covariance : array, shape (p, p)
        Of the coordinates.
    moves : array, shape (blocks, p)
        How far each block moves the estimate.
    shares : array, shape (blocks, p, p)
        Each block's part of the covariance that independent, even residuals would give, but for their variance.
    """

    covariance: Array
    moves: Array
    shares: Array

    def freedom(self, direction: Array) -> float:
        """Degrees of freedom of the variance along a direction, shape (p,): Satterthwaite's."""
        parts = np.einsum("i,bij,j->b", direction, self.shares, direction)
        squares = float(np.sum(parts**2))
        return float(np.sum(parts)) ** 2 / squares if squares > 0.0 else 0.0


def leave_blocks_out(jacobian: Array, residuals: Array, blocks: Array, ridge: Array) -> BlockCovariance:
    """Covariance of the minimum of the sum of squares.

    Parameters
    ----------
    jacobian : array, shape (n, p)
    residuals : array, shape (n,)
        Both at the minimum, weighted.
    blocks : array of int, shape (n,)
        To which block each row belongs, counted from 0.
    ridge : array, shape (p, p)
        What is known beside the data: it keeps directions that the rest of the blocks leave open finite.

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
    # What the ridge holds has no move to show: there it is the ridge that says how far the truth may lie.
    variance = float(residuals @ residuals) / max(residuals.size - jacobian.shape[1], 1)
    return BlockCovariance(found.T @ found + variance * inverse @ ridge @ inverse, found, np.array(shares))
