"""Constant rows: products and single rows against dense matrices."""

import numpy as np
import pytest
import scipy.sparse as sp

from pwscont.linear.factorise import Rows


def few_entries(lengths, columns, seed=0):
    """Return rows with so many entries each, dense."""
    rng = np.random.default_rng(seed)
    matrix = np.zeros((len(lengths), columns))
    for row, length in zip(matrix, lengths, strict=True):
        row[rng.choice(columns, length, replace=False)] = rng.normal(size=length)
    return matrix


@pytest.mark.parametrize("given", [np.asarray, sp.csr_matrix, sp.coo_array, sp.csc_array])
@pytest.mark.parametrize(
    "lengths",
    [
        [2] * 300,
        [*range(5)] * 60,  # some are empty
        [0] * 200,
        [1, 2, 3] * 2000,
        [1] * 200 + [5],
    ],
    ids=["alike", "short", "empty", "many", "uneven"],
)
@pytest.mark.sweep(3)
def test_products_and_rows_are_those_of_the_matrix(given, lengths):
    matrix = few_entries(lengths, 200)
    rows, x = Rows(given(matrix)), np.random.default_rng(1).normal(size=200)
    np.testing.assert_allclose(rows.dot(x), matrix @ x, rtol=1e-14, atol=1e-14)
    np.testing.assert_allclose(rows.magnitudes @ np.ones(200), abs(matrix).sum(axis=1), rtol=1e-14)
    for index in (0, 7, len(matrix) - 1):
        np.testing.assert_array_equal(rows.one(index), matrix[index])
    some = np.array([3, 3, len(matrix) - 1])
    np.testing.assert_array_equal(rows.some(some), matrix[some])


def test_entries_given_twice_are_added():
    twice = sp.coo_array(([1.0, 2.0, 4.0], ([0, 0, 1], [1, 1, 0])), shape=(2, 3))
    np.testing.assert_array_equal(Rows(twice).dot(np.array([1.0, 10.0, 100.0])), [30.0, 4.0])


def test_what_a_row_does_not_see_does_not_matter():
    """An unknown that is not finite spoils the rows that depend on it, and no others."""
    rows = Rows(sp.csr_array([[0.0, 1.0, 0.0], [0.0, 1.0, 2.0]]))
    np.testing.assert_array_equal(rows.dot(np.array([np.inf, 3.0, 5.0])), [3.0, 13.0])
