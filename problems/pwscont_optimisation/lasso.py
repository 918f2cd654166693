"""The LASSO: least squares with a penalty on the sum of the magnitudes of the coefficients."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Self, final

import numpy as np

from pwscont import InvalidInputError
from pwscont.extending import EPS, Array, finite_array
from pwscont_optimisation.active_sets import ActiveSets, is_symmetric
from pwscont_optimisation.numbered import numbered


@final
class Lasso(ActiveSets):
    r"""The minimiser b of |X b - y|^2 / 2 + lambda |b|_1, with the penalty lambda as parameter.

    With c = X^T (y - X b), the correlations with the residual, b is a minimiser exactly if
    c_j = lambda where b_j > 0, c_j = -lambda where b_j < 0, and |c_j| <= lambda elsewhere
    (Tibshirani 1996; the path is piecewise linear: Osborne, Presnell and Turlach 2000, Efron,
    Hastie, Johnstone and Tibshirani 2004). Feature j is decided by the two tests
    b_j + (c_j +- lambda) / |X_j|^2.

    The minimiser is unique for each lambda if X has full column rank. With more features than
    observations the minimiser is unique for lambda > 0 if the features are in general position,
    such as drawn from a continuous distribution (R. J. Tibshirani 2013): promise uniqueness by
    ``unique=True``; without the promise all starts of the search are followed.

    Parameters
    ----------
    X : array_like, shape (m, p)
        A column for each feature. Nothing is centred or scaled.
    y : array_like, shape (m,)
    names : sequence of str, length p, optional
        The features; default b1, b2, ...
    unique : bool, optional
        The promise that the minimiser is unique for each lambda of the interval; default whether X
        has full column rank.

    Attributes
    ----------
    greatest : float
        The penalty from which on all coefficients are zero, max |X^T y|.

    Raises
    ------
    InvalidInputError
        If shapes do not fit, or a feature is zero in all observations.

    Examples
    --------
    >>> from pwscont import explore
    >>> from pwscont_optimisation import Lasso
    >>> path = explore(Lasso([[1.0, 0.0], [0.0, 1.0], [1.0, 1.0]], [1.0, 2.0, 3.5]), (0.01, 10.0))
    >>> [p.message for p in path.special_points("transition")]
    ['b1+ leaves', 'b2+ leaves']
    """

    active = ("-", None, "+")
    enters, leaves = "enters", "leaves"
    domain = (0.0, np.inf)

    def __init__(
        self, X: Any, y: Any, names: Sequence[str] | None = None, unique: bool | None = None
    ) -> None:
        X = finite_array("X", X)
        if X.ndim != 2:
            raise InvalidInputError(f"X must be a matrix, got shape {X.shape}")
        y = finite_array("y", y, (len(X),))
        self._set_up(X.T @ X, X.T @ y, names, unique)

    @classmethod
    def from_products(cls, gram: Any, products: Any, names: Sequence[str] | None = None) -> Self:
        """Return the same problem from X^T X, shape (p, p), and X^T y, shape (p,)."""
        system = cls.__new__(cls)
        products = finite_array("products", products)
        gram = finite_array("gram", gram, (products.size,) * 2)
        if not is_symmetric(gram):
            raise InvalidInputError("gram must be symmetric: it is X^T X")
        system._set_up(gram, products, names, None)
        return system

    def _set_up(
        self, gram: Array, products: Array, names: Sequence[str] | None, unique: bool | None
    ) -> None:
        self._names = numbered("names", names, "b", len(products))
        squares = np.diag(gram)
        if not (squares > 0.0).all():
            j = int(np.argmin(squares > 0.0))
            raise InvalidInputError(f"feature {self._names[j]} is zero in all observations")
        self.greatest = float(np.abs(products).max())
        has_full_rank = _is_positive_definite(gram)
        self.unique = has_full_rank if unique is None else unique
        self.degree = 1 if has_full_rank else None
        self._sizes = np.abs(products) / squares
        super().__init__(self._names, *_conditions(gram, products, squares))

    def names(self) -> tuple[str, ...]:
        """Return the names of the features."""
        return self._names

    def scale(self, lo: float, hi: float) -> Array:
        """Return the coefficients of each feature alone, the largest for all."""
        return np.full(self.size, float(self._sizes.max()) or 1.0)


def _conditions(gram: Array, products: Array, squares: Array) -> tuple[Array, Array, Array]:
    """Return rows, tests and necessary inequalities in x = (b, lambda, 1).

    All rows are divided by |X_j|^2, which gives rows in units of b and selections that agree.
    """
    p = len(products)
    zero = np.zeros((p, 1))
    b = np.hstack([np.eye(p), zero, zero])
    c = np.hstack([-gram, zero, products[:, np.newaxis]]) / squares[:, np.newaxis]
    penalty = np.hstack([np.zeros((p, p)), 1.0 / squares[:, np.newaxis], zero])
    rows = np.stack([-(c + penalty), b, penalty - c])
    tests = np.stack([b + c + penalty, b + c - penalty], axis=1)
    return rows, tests, np.vstack([penalty - c, penalty + c])


def _is_positive_definite(matrix: Array) -> bool:
    """Tell whether a matrix is positive definite beyond rounding, in scaled variables."""
    root = np.sqrt(np.diag(matrix))
    values = np.linalg.eigvalsh(matrix / np.outer(root, root))
    return bool(values[0] > len(matrix) * EPS * values[-1])
