"""The path of the LASSO, as a user of the framework writes it, and by scikit-learn.

Coefficients b minimise |y - X b|^2 / (2 m) + alpha |b|_1. With z = b + g, where g is the gradient
of the first part with its sign changed, b is z without what lies between -alpha and alpha, and
z = b + g is a piecewise linear equation for z (the normal map). The path goes from zero
coefficients at the largest alpha to small ones.
"""

from __future__ import annotations

from importlib.util import find_spec

import numpy as np

from pwscont import Character, PiecewiseLinearSystem

#: The path ends at this part of the largest alpha.
SMALLEST = 1e-3


class Lasso(PiecewiseLinearSystem):
    """The LASSO over its penalty alpha.

    Parameters
    ----------
    size : int
        Number of coefficients.
    """

    domain = (0.0, np.inf)

    def __init__(self, size: int) -> None:
        rng, samples = np.random.default_rng(0), 3 * size // 2
        self.size, self.X = size, rng.normal(size=(samples, size))
        true = np.where(np.arange(size) < size // 10, rng.normal(size=size), 0.0)
        self.y = self.X @ true + 0.1 * rng.normal(size=samples)
        self.gram, self.start = self.X.T @ self.X / samples, self.X.T @ self.y / samples
        one, column = np.eye(size), np.ones((size, 1))
        self.gradients = np.block([[one, -column], [-one, -column]])
        self.coupling = self.gram - one

    @property
    def interval(self) -> tuple[float, float]:
        """Where to follow it: from alpha with all coefficients zero, downwards."""
        largest = float(np.abs(self.start).max())
        return SMALLEST * largest, 1.05 * largest

    def test_functions(self, z: np.ndarray, alpha: float) -> np.ndarray:
        """Return what is positive where coefficients are positive, then where negative."""
        return np.concatenate([z - alpha, -z - alpha])

    def residual(self, z: np.ndarray, alpha: float, character: Character) -> np.ndarray:
        """Return b + g - z with its sign changed."""
        positive, negative = self.active(character)
        return self.coupling @ (positive * (z - alpha) + negative * (z + alpha)) + z - self.start

    def jacobian(self, z: np.ndarray, alpha: float, character: Character) -> np.ndarray:
        """Return the matrix of one cell."""
        positive, negative = self.active(character)
        jacobian = np.empty((self.size, self.size + 1))
        np.multiply(self.coupling, (positive | negative).astype(float), out=jacobian[:, :-1])
        np.einsum("ii->i", jacobian[:, :-1])[:] += 1.0
        jacobian[:, -1] = self.coupling @ (negative.astype(float) - positive)
        return jacobian

    def test_jacobian(self, z: np.ndarray, alpha: float) -> np.ndarray:
        """Return the gradients of the tests, which are constant."""
        return self.gradients

    def bounding_tests(self, character: Character) -> np.ndarray:
        """Return both tests of coefficients that are zero, one of each other."""
        positive, negative = self.active(character)
        return np.flatnonzero(np.concatenate([~negative, ~positive]))

    def kink(self, before: Character, after: Character, test: int) -> np.ndarray:
        """Return by how much a coefficient that comes or goes changes the residual."""
        comes = before.array[test] < after.array[test]
        column = self.coupling[:, test % self.size]
        return column if comes == (test < self.size) else -column

    def active(self, character: Character) -> tuple[np.ndarray, np.ndarray]:
        """Tell which coefficients are positive, and which are negative."""
        return character.array[: self.size], character.array[self.size :]


def is_installed() -> bool:
    """Tell whether scikit-learn is there; nothing requires it."""
    return find_spec("sklearn") is not None


def breaks(lasso: Lasso) -> np.ndarray:
    """Return where coefficients come and go by scikit-learn, downwards."""
    from sklearn.linear_model import lars_path  # noqa: PLC0415  not required

    m = len(lasso.y)
    given = {"Gram": m * lasso.gram, "Xy": m * lasso.start, "method": "lasso"}
    alphas, *_ = lars_path(lasso.X, lasso.y, alpha_min=lasso.interval[0], **given)
    return alphas[:-1]  # the last is the end
