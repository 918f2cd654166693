"""Estimates of errors from samples, against sums of squares in rational arithmetic."""

from fractions import Fraction
from math import isqrt

import numpy as np
import pytest
import scipy.sparse as sp

from pwscont.basics.rounding import CONFIDENCE, EPS
from pwscont.curve.error_samples import magnitude, zero_up_to

DIGITS = 10**40


def root_of_squares(numbers):
    """The root of the sum of squares, to forty digits of the largest number."""
    exact = [Fraction(float(number)) for number in numbers]
    unit = max(map(abs, exact))
    if not unit:
        return 0.0
    total = sum((number / unit) ** 2 for number in exact)
    return float(unit * Fraction(isqrt(int(total * DIGITS**2)), DIGITS))


@pytest.mark.parametrize("unit", [1e-300, 1e-200, 1e-150, 1e-16, 1.0, 1e100])
@pytest.mark.parametrize("samples", [1, 4, 5])
def test_errors_of_points(unit, samples):
    rng = np.random.default_rng(samples)
    error = unit * rng.normal(size=(samples, 6))
    error[:, 2] = 0.0
    error[1:, 3] = 0.0
    found = magnitude(np.zeros(6), error)
    np.testing.assert_allclose(found, [root_of_squares(e) for e in error.T], rtol=1e-14, atol=0)


def test_an_error_is_no_less_than_the_rounding_of_the_point():
    x = np.array([1.0, -1e30, 0.0])
    np.testing.assert_array_equal(magnitude(x, np.zeros((1, 3))), EPS * np.abs(x))


def test_numbers_that_are_not_finite_stay_so():
    found = magnitude(np.zeros(2), np.array([[np.inf, 1e-300], [1.0, 0.0]]))
    np.testing.assert_array_equal(found, [np.inf, 1e-300])
    assert np.isnan(magnitude(np.zeros(2), np.array([[np.nan, 1.0]]))[0])


@pytest.mark.parametrize("stored", [np.asarray, sp.csr_matrix, sp.csc_array])
@pytest.mark.parametrize("unit", [1e-200, 1.0, 1e100])
def test_errors_of_functions_of_points(stored, unit):
    rng = np.random.default_rng(3)
    rows, error = rng.integers(-3, 4, size=(4, 5)).astype(float), rng.normal(size=(3, 5))
    rows[2] = 0.0  # a function that depends on nothing has no error
    error[:, 0] = 0.0
    found = zero_up_to(stored(unit * rows), np.zeros(5), error)
    changes = CONFIDENCE * unit * (rows @ error.T)
    exact = [root_of_squares(change) for change in changes]
    np.testing.assert_allclose(found, exact, rtol=1e-12, atol=0)


def test_no_functions_have_no_errors():
    assert zero_up_to(np.zeros((0, 3)), np.ones(3), np.ones((2, 3))).shape == (0,)
