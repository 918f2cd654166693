"""Magnitudes of unknowns and rows that balance the terms of linear equations.

Logarithms are balanced, which another unit only shifts. Of several answers (a row without terms, a
group of unknowns without constants) the logarithms with the least sum of squares are taken.
"""

from __future__ import annotations

from math import prod
from typing import Any

import numpy as np
import scipy.sparse as sp

from pwscont.basics.arrays import Array

#: Relative accuracy of the logarithms in lsqr: magnitudes need no more than a digit.
ACCURACY = 1e-6

#: Most entries of equations that are solved as a dense matrix.
MOST_DENSE = 10_000


def balanced(terms: Any, size: int) -> tuple[Array, Array]:
    """Return magnitudes u of unknowns and v of rows that balance equations (Curtis and Reid 1972).

    The terms ``terms[i, j] u[j] / v[i]`` are as close to 1 as possible: the sum of the squares of
    the logarithms of the terms is least.

    Parameters
    ----------
    terms : ndarray or sparse matrix, shape (m, size + k)
        Coefficients of ``size`` unknowns, and k columns of constants, whose magnitudes are 1.
    size : int

    Returns
    -------
    ndarray, ndarray, shapes (size,) and (m,)

    Examples
    --------
    >>> import numpy as np
    >>> from pwscont.extending import balanced
    >>> u, v = balanced(np.array([[2.0, 0.0, 6.0], [0.0, 5.0, 5.0]]), 2)
    >>> [float(x) for x in np.round(u, 3)], [float(x) for x in np.round(v, 3)]
    ([3.0, 1.0], [6.0, 5.0])
    """
    from scipy.sparse.linalg import lsqr  # noqa: PLC0415  only where magnitudes are not given

    rows, columns, values = sp.find(terms)
    each, of_unknown = np.arange(len(rows)), columns < size
    entries = np.concatenate([np.ones(of_unknown.sum()), -np.ones(len(rows))])
    at = (
        np.concatenate([each[of_unknown], each]),
        np.concatenate([columns[of_unknown], size + rows]),
    )
    logarithms, shape = -np.log(np.abs(values)), (len(rows), size + terms.shape[0])
    if prod(shape) <= MOST_DENSE:
        equations = np.zeros(shape)
        equations[at] = entries
        found = np.linalg.lstsq(equations, logarithms, rcond=None)[0]
    else:
        equations = sp.csr_array((entries, at), shape=shape)
        found = lsqr(equations, logarithms, atol=ACCURACY, btol=ACCURACY)[0]
    return np.exp(found[:size]), np.exp(found[size:])
