"""Constructors of frequent problems over :func:`Switched`."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any, final

import numpy as np
import scipy.sparse as sp

from pwscont import InvalidInputError
from pwscont.extending import (
    EPS,
    GUARD,
    Array,
    Matrix,
    balanced,
    counted,
    dense,
    finite_array,
    generic,
)
from pwscont.notation.dual import Dual, as_dual, as_operand, is_traced, joined, value_of
from pwscont.notation.function import one_for_each
from pwscont.notation.notated import Notated
from pwscont.notation.switched import Switched
from pwscont.notation.switches import Switches

#: Largest number of unknowns that is tried if the user does not say how many F takes.
MOST_UNKNOWNS = 1000
#: F is multiplied if F and z differ by more than this power of two. Up to there the comparison
#: loses three of sixteen digits at most.
FAR_UNITS = 10


def Complementarity(  # noqa: N802  used like a class
    F: Callable[[Any, Any], Any],
    lower: Any = 0.0,
    upper: Any = np.inf,
    *,
    n: int | None = None,
    jacobian: Callable[[Array, float], Any] | None = None,
    **given: Any,
) -> Notated:
    """Return the mixed complementarity problem of F between bounds.

    z lies between bounds; F(z, alpha) is zero where z is strictly between the bounds, not negative
    at the lower bound, and not positive at the upper bound.

    Parameters
    ----------
    F : callable
        (z, alpha) -> (n,), smooth. F in far other units than z is multiplied by powers of two.
    lower, upper : array_like or callable
        Broadcastable to (n,), infinite where there is no bound; or functions of alpha.
    n : int, optional
        The number of unknowns; default as many as F takes, or as there are bounds.
    jacobian : callable, optional
        (z, alpha) -> the derivatives of F by (z, alpha), shape (n, n + 1), dense or sparse.
    **given
        As for :func:`Switched`: ``linear``, ``names``, ``degree``, ``unique``, ``scale``, ...

    Returns
    -------
    PiecewiseSystem

    Raises
    ------
    InvalidInputError
        If the number of unknowns is not clear.
    InvalidSystemError
        As for :func:`Switched`.

    Examples
    --------
    >>> from pwscont import Complementarity, explore
    >>> limited = Complementarity(lambda z, t: z**3 - t, lower=0.0, upper=2.0, n=1)
    >>> [round(float(s.z[0]), 6) for s in explore(limited, (-1.0, 10.0)).solutions(1.0)]
    [1.0]
    """
    if not callable(F):
        raise InvalidInputError(f"F must be a function of (z, alpha), got {F!r}")
    size = n if n is not None else _size(F, lower, upper)
    below, above = _bound("lower", lower, size), _bound("upper", upper, size)
    function = F if jacobian is None else WithJacobian(F, jacobian)
    factors = _factors_of(function, below, above, size)
    move = not given.get("linear") and (callable(lower) or callable(upper))
    median = partial(_median_if_any if move else _median, function, factors, below, above)
    return Switched(size, median, **given)


def _median(
    function: Any, factors: Any, below: Any, above: Any, z: Any, alpha: Any, sw: Any
) -> Any:
    """Return the median of z - upper, F and z - lower, in a form without small differences."""
    value = function(z, alpha)
    value = one_for_each(value, len(z)) if isinstance(sw, Switches) else np.asarray(value)
    if factors is not None:
        value = factors * value
    return -sw.clip(-value, below(alpha) - z, above(alpha) - z)


def _median_if_any(
    function: Any, factors: Any, below: Any, above: Any, z: Any, alpha: Any, sw: Any
) -> Any:
    """Return the median of z - upper, F and z - lower, nan where bounds that move have crossed."""
    median = _median(function, factors, below, above, z, alpha, sw)
    lower, upper = below(alpha), above(alpha)
    if not isinstance(sw, Switches) or is_traced(lower) or is_traced(upper):
        return median
    lower, upper = np.asarray(value_of(lower)), np.asarray(value_of(upper))
    with np.errstate(invalid="ignore"):  # both bounds may be infinite
        have_crossed = lower - upper > GUARD * EPS * (np.abs(lower) + np.abs(upper))
    return np.nan * median if have_crossed.any() else median


def _factors_of(function: Any, below: Any, above: Any, size: int) -> Array | None:
    """Return powers of two by which F has the magnitudes of z, None where F has them already.

    The median compares F with z: next to a bound, F in far larger or far smaller units would be
    rounding of z, or the other way round. Derivatives at the bounds tell the units.
    """
    alpha = float(generic(1)[0])
    try:
        with np.errstate(all="ignore"):
            at = np.clip(np.zeros(size), below(alpha), above(alpha))
            u = Dual.variables(np.append(at, alpha), 0, size + 1)
            rows = as_dual(function(u[:-1], u[-1]), size + 1).rows
            column, rest = dense(rows[:, [-1]])[:, 0], function(np.zeros(size), 0.0)
            rows = sp.csr_array(rows[:, :-1])
    except Exception:  # F may be undefined there, or take plain numbers only
        return None
    if rows.shape != (size, size) or np.shape(rest) != (size,):
        return None
    rows.data[~np.isfinite(rows.data)] = 0.0
    scaled = _factors(rows, *(np.where(np.isfinite(x), x, 0.0) for x in (column, rest)))
    factors = np.where(abs(rows).sum(axis=1) > 0.0, scaled, 1.0)
    return factors if np.abs(np.log2(factors)).max() > FAR_UNITS else None


def LCP(M: Any, q: Any, d: Any, **given: Any) -> Notated:  # noqa: N802  the usual name
    """Return the linear complementarity problem z >= 0, w = M z + q + alpha d >= 0, z w = 0.

    Parameters
    ----------
    M : array_like or sparse matrix, shape (n, n)
    q, d : array_like, shape (n,)
    **given
        As for :func:`Switched`: ``names``, ``degree``, ``unique``, ``scale``, ... With a P-matrix
        there is one solution at each alpha: ``degree=1, unique=True``.

    Returns
    -------
    PiecewiseLinearSystem

    Raises
    ------
    InvalidInputError
        If the shapes do not fit.

    Examples
    --------
    >>> from pwscont import LCP, enumerate_solutions
    >>> problem = LCP([[2, 1], [1, 2]], q=[-1, -1], d=[1, 0])  # w = M z + q + alpha d
    >>> enumerate_solutions(problem, 2.0)[0].z
    array([0. , 0.5])
    """
    matrix = M if sp.issparse(M) else finite_array("M", M)
    if matrix.ndim != 2 or matrix.shape[0] != matrix.shape[1]:
        raise InvalidInputError(f"M must be square, got shape {matrix.shape}")
    n = matrix.shape[0]
    q, d = finite_array("q", q, (n,)), finite_array("d", d, (n,))
    median = partial(_median, lambda z, t: matrix @ z + q + t * d, _factors(matrix, q, d))
    return Switched(
        n, partial(median, _Constant(0.0), _Constant(np.inf)), **{"linear": True} | given
    )


def _factors(matrix: Any, *columns: Array) -> Array:
    """Return powers of two by which w has the magnitudes of z.

    Multiplied by powers of two, entries keep all their digits; a row whose entries would not is
    left alone. Else the powers follow from M alone: a family of problems with one M is affine in q
    and d.
    """
    sizes, rows = balanced(matrix, matrix.shape[0])
    factors = np.ldexp(1.0, np.frexp(sizes / rows)[1])
    parts = (sp.csr_array(part) for part in (matrix, *(x[:, np.newaxis] for x in columns)))
    given = abs(sp.hstack([*parts], "csr"))
    with np.errstate(over="ignore"):
        sizes = sp.diags_array(factors) @ given
    kept = (sizes >= np.finfo(float).tiny).sum(axis=1) - (sizes >= np.inf).sum(axis=1)
    return np.where(kept < (given > 0.0).sum(axis=1), 1.0, factors)


def AbsNormal(  # noqa: N802  the usual name
    Z: Any, L: Any, J: Any, Y: Any, c: Any, b: Any, **given: Any
) -> Notated:
    """Return the system in abs-normal form s = c + Z x + L |s|, 0 = b + J x + Y |s|.

    Any piecewise-linear function has an abs-normal form (Griewank, *On stable piecewise
    linearization and generalized algorithmic differentiation*, 2013). The unknowns are x; alpha is
    in c or b.

    Parameters
    ----------
    Z, L, J, Y : array_like, shapes (s, n), (s, s), (n, n), (n, s)
        L is strictly lower triangular: each switch depends on earlier switches only.
    c, b : array_like or callable
        Shapes (s,) and (n,); or pairs (constant, slope), shapes (2, s) and (2, n); or functions of
        alpha, affine unless ``linear=False`` is given.
    **given
        As for :func:`Switched`.

    Returns
    -------
    PiecewiseLinearSystem

    Raises
    ------
    InvalidInputError
        If the shapes do not fit, or L is not strictly lower triangular.

    Examples
    --------
    >>> from pwscont import AbsNormal, enumerate_solutions
    >>> problem = AbsNormal(Z=[[1]], L=[[0]], J=[[1]], Y=[[2]], c=[0], b=([0], [-1]))
    >>> [s.z.tolist() for s in enumerate_solutions(problem, 3.0)]
    [[-3.0], [1.0]]
    """
    Z, L, J, Y = (finite_array(name, A) for name, A in zip("ZLJY", (Z, L, J, Y), strict=True))
    n, count = len(np.atleast_1d(J)), len(np.atleast_1d(Z))
    shapes = {"Z": (count, n), "L": (count, count), "J": (n, n), "Y": (n, count)}
    for A, (name, shape) in zip((Z, L, J, Y), shapes.items(), strict=True):
        if A.shape != shape:
            raise InvalidInputError(f"{name} has shape {A.shape}, expected {shape}")
    if np.triu(L).any():
        raise InvalidInputError("L must be strictly lower triangular: each switch after its own")
    inner, outer = _affine("c", c, count), _affine("b", b, n)

    def f(x: Any, alpha: Any, sw: Any) -> Any:
        s, sizes = inner(alpha) + Z @ x, np.zeros(0)
        for first, last in _levels(L):
            level = s[first:last] + L[first:last, :first] @ sizes
            sizes = joined([sizes, sw.abs(level)])
        return outer(alpha) + J @ x + Y @ sizes

    return Switched(n, f, **{"linear": True} | given)


def _levels(L: Array) -> list[tuple[int, int]]:
    """Return successive switches that do not depend on each other, as (first, last + 1)."""
    levels, first = [], 0
    for last in range(1, len(L) + 1):
        if last == len(L) or L[last, first:last].any():
            levels.append((first, last))
            first = last
    return levels


def _affine(name: str, values: Any, size: int) -> Callable[[Any], Any]:
    """Return a function of alpha from numbers, or from a constant and a slope."""
    if callable(values):
        return values
    array = finite_array(name, values)
    if array.shape == (2, size):
        return lambda alpha: array[0] + alpha * array[1]
    if array.shape != (size,):
        raise InvalidInputError(
            f"{name} has shape {array.shape}, expected ({size},) or (2, {size})"
        )
    return lambda alpha: array


def _bound(name: str, given: Any, size: Any) -> Callable[[Any], Any]:
    """Return a bound as a function of alpha."""
    if callable(given):
        return given
    try:
        values = np.asarray(given, dtype=float)
    except (TypeError, ValueError):
        values = np.asarray(np.nan)
    if np.isnan(values).any() or values.shape not in ((), (1,), (size,)):
        each = counted(size, "unknown")
        raise InvalidInputError(
            f"{name} must be numbers, one for all or one for each of {each}, got {given!r}"
        )
    return _Constant(values)


@final
class _Constant:
    """A bound that does not depend on alpha."""

    def __init__(self, values: Any) -> None:
        self._values = values

    def __call__(self, alpha: Any) -> Any:
        return self._values


def _size(F: Callable[[Any, Any], Any], lower: Any, upper: Any) -> int:
    """Return the number of unknowns that F takes, from the bounds or from calls."""
    lengths = [np.size(bound) for bound in (lower, upper) if not callable(bound) and np.ndim(bound)]
    if lengths:
        return max(lengths)
    fits = (n for n in range(1, MOST_UNKNOWNS + 1) if _takes(F, n))
    found = next(fits, None)
    if found is None or _takes(F, found + 1):
        raise InvalidInputError(
            "how many unknowns F has is not clear, say it: Complementarity(F, ..., n=...)"
        )
    return found


@np.errstate(all="ignore")
def _takes(F: Callable[[Any, Any], Any], n: int) -> bool:
    """Tell whether F takes n unknowns and returns n values."""
    try:
        return bool(np.shape(F(np.full(n, 0.5), 0.5)) == (n,))
    except Exception:  # F takes another number of unknowns
        return False


@final
class WithJacobian:
    """A function F(z, alpha) whose derivatives a user gives."""

    def __init__(self, F: Callable[[Any, Any], Any], jacobian: Callable[[Any, Any], Any]) -> None:
        self._F, self._jacobian = F, jacobian

    def __call__(self, z: Any, alpha: Any) -> Any:
        """Return F(z, alpha), with derivatives if z is a Dual."""
        if not isinstance(z, Dual):
            return self._F(z, alpha)
        variables = z.rows.shape[1]
        number = float(alpha.value) if isinstance(alpha, Dual) else float(alpha)
        matrix: Matrix = self._jacobian(z.value.copy(), number)
        along = joined([z, as_dual(alpha, variables)])
        return Dual(as_operand(self._F(z.value.copy(), number)), matrix @ along.rows)
