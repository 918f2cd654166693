"""H at several points by a single call: each number is a column, with an entry for each point.

A method that only computes with numbers computes with columns as well. A method that compares,
converts or calls functions of scipy fails with columns, and H is evaluated point by point.
"""

from __future__ import annotations

import gc
from collections.abc import Callable
from types import FunctionType, ModuleType
from typing import Any, final

import numpy as np

from pwscont.basics.arrays import Array, are_finite, generic
from pwscont.system.abilities import formula_of
from pwscont.system.system import PiecewiseSystem

#: Most unknowns, and fewest points, for which columns are faster than H of a point at a time.
MOST_OF_COLUMNS, FEWEST_POINTS = 8, 4
#: How far from a curve H is evaluated both ways, as a part of the largest unknown, and the largest
#: difference, as a part of the largest entry of H.
COLUMN_MOVED, SAME_VALUE = 0.01, 1e-9
#: Most objects within reach of H for which columns are used: finding all must cost less than H.
MOST_KEPT = 400
#: Functions of numpy that compute an entry from the same entry of the argument.
FUNCTIONS = (
    *("exp", "expm1", "exp2", "log", "log1p", "log2", "log10", "sqrt", "cbrt"),
    *("sin", "cos", "tan", "arcsin", "arccos", "arctan", "sinh", "cosh", "tanh"),
    *("arcsinh", "arccosh", "arctanh", "square", "reciprocal"),
)
NUMBERS = frozenset({float, int, np.float64})


@final
class Column:
    """A number at each of k points: ``values``, shape (k,)."""

    __slots__ = ("values",)
    shape, ndim, size = (), 0, 1  # as of a number of numpy
    __hash__ = None  # type: ignore[assignment]  # a number may be a key, a column may not

    def __init__(self, values: Array) -> None:
        self.values = values  # not finite where numbers would raise an error or become complex

    def __bool__(self) -> bool:
        raise TypeError("a column is neither true nor false")

    def __eq__(self, other: object) -> bool:
        raise TypeError("columns are not compared")

    def reshape(self, *shape: Any) -> Array:
        """Return the column in an array of objects of this shape."""
        return np.array(self, dtype=object).reshape(*shape)

    def __neg__(self) -> Column:
        return Column(-self.values)

    def __abs__(self) -> Column:
        return Column(np.abs(self.values))


def _operator(name: str) -> Callable[[Column, Any], Any]:
    operate = getattr(np.ndarray, name)

    def computed(self: Column, other: Any) -> Any:
        if type(other) is Column:
            return Column(operate(self.values, other.values))
        return Column(operate(self.values, other)) if type(other) in NUMBERS else NotImplemented

    return computed


def _function(compute: Any) -> Callable[[Column], Column]:
    return lambda self: Column(compute(self.values))


for _name in ("add", "sub", "mul", "truediv", "pow"):
    setattr(Column, f"__{_name}__", _operator(f"__{_name}__"))
    setattr(Column, f"__r{_name}__", _operator(f"__r{_name}__"))
for _name in FUNCTIONS:
    setattr(Column, _name, _function(getattr(np, _name)))


def numbers_in(array: Array) -> Array | None:
    """Return all numbers in an array of floats or columns, None if there is anything else.

    Examples
    --------
    >>> import numpy as np
    >>> from pwscont.extending import numbers_in
    >>> numbers_in(np.array([1.0, 2.0]))
    array([1., 2.])
    """
    if array.dtype != object:
        return array
    entries: list[Any] = array.ravel().tolist()
    if not all(type(entry) is Column or type(entry) in NUMBERS for entry in entries):
        return None
    return np.concatenate([*(np.atleast_1d(getattr(e, "values", e)) for e in entries), []])


def by_columns(residual: Callable[[Array, Any], Any], points: Array) -> Array | None:
    """Return H at points by a single call, None if H is not finite or fails with columns.

    ``residual``: (z, alpha) -> ndarray, shape (n,); ``points``: shape (k, n + 1).
    """
    *unknowns, alpha = map(Column, points.T.copy())
    z = np.empty(len(unknowns), dtype=object)
    z[:] = unknowns
    values = np.empty((len(unknowns), len(points)))
    try:
        found = residual(z, alpha)
        if found.dtype != object or found.shape != z.shape:
            return None
        for row, each in zip(values, found.tolist(), strict=True):
            if type(each) is not Column and type(each) not in NUMBERS:
                return None
            row[:] = each.values if type(each) is Column else each
    except Exception:
        return None
    return values.T if are_finite(values.ravel()) else None


def takes_columns(
    system: PiecewiseSystem, residual: Callable[[Array, Any], Any], points: Array
) -> bool:
    """Tell whether H computed with columns is H, from a few of the points, moved off the curve.

    H that changes anything between two calls gets no columns: what H keeps would become columns.
    """
    count, size = points.shape
    if size - 1 > MOST_OF_COLUMNS:
        return False
    moved = points[[0, count // 2, -1]]
    moved[:, :-1] += COLUMN_MOVED * np.abs(moved[:, :-1]).max() * generic(size - 1)
    roots = [formula_of(system) or (system, type(system).residual)]
    before = _within_reach(roots)
    try:
        one_by_one = np.array([residual(x[:-1], float(x[-1])) for x in moved])
    except Exception:  # beside the curve H may be undefined
        return False
    is_pure = list(map(id, before)) == list(map(id, _within_reach(roots)))
    found = by_columns(residual, moved) if is_pure and len(before) <= MOST_KEPT else None
    if found is None:
        return False
    return bool(np.abs(found - one_by_one).max() <= SAME_VALUE * np.abs(one_by_one).max())


def _within_reach(roots: list[Any]) -> list[Any]:
    """Return what functions and objects can change: attributes, closures, globals, contents."""
    found, seen = list(roots), set[int]()
    for each in found:  # found grows
        if len(found) > MOST_KEPT:
            break
        if id(each) in seen or isinstance(each, (type, ModuleType)):
            continue
        seen.add(id(each))
        if isinstance(each, FunctionType):
            known = each.__globals__
            found += [known[name] for name in each.__code__.co_names if name in known]
            found += [each.__closure__, each.__defaults__, each.__kwdefaults__, each.__dict__]
        else:
            found += gc.get_referents(each)
    return found
