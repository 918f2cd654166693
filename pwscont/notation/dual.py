"""Arrays with derivatives, by which a user's function of arrays is differentiated exactly.

A function written with numpy takes a :class:`Dual` like an array: arithmetic, smooth functions,
matrix products, indexing, sums and functions that move entries around are known here.

Failure modes and answers
-------------------------
- The function has a kink that no switch announces (``np.abs``, ``np.maximum``, a comparison): the
  kink is refused by name; differences would not notice the kink.
- The function does something that is not known here: :class:`UntraceableError`; derivatives are
  then taken in another way.
- The function has many variables: derivatives are sparse.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Sequence
from typing import Any, final

import numpy as np
import scipy.sparse as sp

from pwscont.extending import Array, Indices, Matrix, dense
from pwscont.notation.arithmetic import (
    KINKED,
    OF_TWO,
    PLAIN,
    QUESTIONS,
    SMOOTH,
    Arithmetic,
    UntraceableError,
    added,
    refuse_kink,
    scaled,
)

#: Functions of numpy, other than ufuncs, for Duals, by name; array_functions fills the table.
FUNCTIONS: dict[str, Callable[..., Any]] = {}
#: More variables than this: derivatives are stored sparse.
MANY_VARIABLES = 200


@final
class Dual(Arithmetic):
    """An array with the derivatives of the entries by D variables.

    Parameters
    ----------
    value : ndarray, any shape
    rows : ndarray or scipy.sparse array, shape (value.size, D)
        The derivatives of each entry, entries in C order.
    """

    __slots__ = ()

    def __init__(self, value: Any, rows: Matrix) -> None:
        self.value, self.rows = np.asarray(value, dtype=float), rows

    @classmethod
    def variables(cls, value: Array, first: int, total: int) -> Dual:
        """Return values as the variables ``first``, ``first + 1``, ... of ``total`` variables."""
        if total > MANY_VARIABLES:
            rows = sp.eye_array(value.size, total, k=first, format="csr")
        else:
            rows = np.eye(value.size, total, k=first)
        return cls(value, rows)

    # -- what an array has ---------------------------------------------------------------

    @property
    def shape(self) -> tuple[int, ...]:
        """The shape of the values."""
        return self.value.shape

    @property
    def ndim(self) -> int:
        """The number of axes."""
        return self.value.ndim

    @property
    def size(self) -> int:
        """The number of entries."""
        return self.value.size

    @property
    def dtype(self) -> Any:
        """The type of the values."""
        return self.value.dtype

    @property
    def T(self) -> Dual:  # noqa: N802  numpy's name
        """The transpose."""
        return self.moved(self._places().T)

    def __len__(self) -> int:
        return len(self.value)

    def __iter__(self) -> Iterator[Dual]:
        return (self[i] for i in range(len(self)))

    def __getitem__(self, key: Any) -> Dual:
        if type(key) is int and self.value.ndim == 1 and type(self.rows) is np.ndarray:
            value = self.value[key]  # refuses a key that is too large
            key %= len(self.value)
            return Dual.made(value, self.rows[key : key + 1])
        return self.moved(self._places()[key])

    def __setitem__(self, key: Any, new: Any) -> None:
        places = np.asarray(self._places()[key])
        source = spread(as_dual(new, self.rows.shape[1]), places.shape)
        self.value = self.value.copy()  # other Duals may share the array
        self.value[key] = source.value
        if sp.issparse(self.rows):
            rows = self.rows.tolil()
            rows[places.ravel()] = source.rows
            self.rows = rows.tocsr()
        else:
            self.rows = self.rows.copy()
            self.rows[places.ravel()] = dense(source.rows)

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> Any:
        """Return a 0-d object array that holds this Dual: numpy passes the Dual on undivided."""
        if dtype is not None and np.dtype(dtype) != np.dtype(object):
            raise UntraceableError("a Dual is no array of plain numbers")
        box = np.empty((), dtype=object)
        box[()] = self
        return box

    def __float__(self) -> float:
        raise UntraceableError("a Dual is no plain number")

    def __bool__(self) -> bool:
        raise refuse_kink("not_equal")

    __hash__ = None  # type: ignore[assignment]

    def _places(self) -> Indices:
        return np.arange(self.size).reshape(self.shape)

    def moved(self, places: Any) -> Dual:
        """Return the entries at places, in the shape of the places."""
        places = np.asarray(places, dtype=np.intp)
        return Dual(self.value.ravel()[places], self.rows[places.ravel()])

    def copy(self) -> Dual:
        """Return a copy."""
        return Dual(self.value.copy(), self.rows.copy())

    def astype(self, dtype: Any, copy: bool = True) -> Dual:
        """Return this Dual if the type is a float type; a Dual holds floats."""
        if np.dtype(dtype).kind != "f":
            raise UntraceableError("a Dual holds floats")
        return self

    def reshape(self, *shape: Any, order: Any = "C") -> Dual:
        """Return the entries in another shape."""
        if order == "C":
            return Dual(self.value.reshape(*shape), self.rows)
        return self.moved(self._places().reshape(*shape, order=order))

    def ravel(self, order: Any = "C") -> Dual:
        """Return the entries as a vector."""
        return self.moved(self._places().ravel(order=order))

    flatten = ravel

    def sum(self, axis: Any = None, **options: Any) -> Dual:
        """Return the sum along axes."""
        if set(options) - {"keepdims"}:
            raise UntraceableError(f"sum with {', '.join(options)}")
        value = self.value.sum(axis=axis, **options)
        shape = self.value.sum(axis=axis, keepdims=True).shape
        into = np.broadcast_to(np.arange(np.size(value)).reshape(shape), self.shape).ravel()
        one = (np.ones(self.size), (into, np.arange(self.size)))
        return Dual(value, sp.csr_array(one, shape=(np.size(value), self.size)) @ self.rows)

    def mean(self, axis: Any = None, **options: Any) -> Dual:
        """Return the mean along axes."""
        total = self.sum(axis, **options)
        found: Dual = total * (total.size / self.size)
        return found

    def dot(self, other: Any) -> Any:
        """Return the product of matrices."""
        return FUNCTIONS["dot"](self, other)

    # -- what numpy does with an array ---------------------------------------------------

    def __array_ufunc__(self, ufunc: Any, method: str, *inputs: Any, **options: Any) -> Any:
        if method == "reduce" and ufunc is np.add:
            return inputs[0].sum(options.pop("axis", 0), **options)
        (out,) = options.pop("out", (None,))
        if method != "__call__" or options or not isinstance(out, Dual | None):
            raise UntraceableError(f"{ufunc.__name__}.{method}")
        found = applied(ufunc, *inputs)
        if out is None or not out.ndim:  # numbers are replaced, not changed: s = z[0]; s += z[1]
            return found
        out[...] = found
        return out

    def __array_function__(self, function: Any, types: Any, args: Any, kwargs: Any) -> Any:
        name = function.__name__
        if name in KINKED:
            raise refuse_kink(name)
        if name not in FUNCTIONS:
            raise UntraceableError(name)
        return FUNCTIONS[name](*args, **kwargs)

    def __getattr__(self, name: str) -> Any:
        """Return the method of a smooth function, which numpy asks of objects; refuse a kink."""
        if name in KINKED:
            raise refuse_kink(name)
        if name in SMOOTH:
            return lambda: applied(getattr(np, name), self)
        raise AttributeError(f"a Dual has no {name}")


def value_of(thing: Any) -> Array:
    """Return the values of a Dual or array-like as an array, without derivatives."""
    thing = as_operand(thing)
    return thing.value if isinstance(thing, Dual) else thing


def is_traced(thing: Any) -> bool:
    """Tell whether a thing is an array that JAX traces."""
    return "jax" in sys.modules and isinstance(thing, sys.modules["jax"].core.Tracer)


def as_operand(thing: Any) -> Any:
    """Return an array of floats, or a Dual: also for a list or box with Duals."""
    if isinstance(thing, Dual) or (type(thing) is np.ndarray and thing.dtype == float):
        return thing  # nearly always
    if is_traced(thing):
        return thing
    array = np.asarray(thing)
    if array.dtype == object:
        entries = array.ravel()
        some = next((entry for entry in entries if isinstance(entry, Dual)), None)
        if some is None:
            raise UntraceableError("objects that are no numbers")
        if _are_all_numbers(entries):
            return _of_numbers(entries, some.rows.shape[1]).reshape(array.shape)
        parts = [as_dual(entry, some.rows.shape[1]) for entry in entries]
        return joined(parts).reshape(array.shape + parts[0].shape)
    if array.dtype.kind not in "fiub":
        is_text = array.dtype.kind in "SU"
        raise UntraceableError("texts" if is_text else f"numbers of type {array.dtype}")
    return array.astype(float)


def _are_all_numbers(entries: Any) -> bool:
    return all(
        not entry.value.ndim and type(entry.rows) is np.ndarray
        if type(entry) is Dual
        else type(entry) in PLAIN
        for entry in entries
    )


def _of_numbers(entries: Any, variables: int) -> Dual:
    """Return numbers and 0-d Duals as one Dual with dense derivatives."""
    value, rows = np.empty(len(entries)), np.zeros((len(entries), variables))
    for i, entry in enumerate(entries):
        if type(entry) is Dual:
            value[i], rows[i] = entry.value, entry.rows[0]
        else:
            value[i] = entry
    return Dual.made(value, rows)


def as_dual(thing: Any, variables: int) -> Dual:
    """Return an operand as a Dual; plain numbers get zero derivatives."""
    thing = as_operand(thing)
    if isinstance(thing, Dual):
        return thing
    if variables > MANY_VARIABLES:
        return Dual(thing, sp.csr_array((thing.size, variables)))
    return Dual(thing, np.zeros((thing.size, variables)))


def spread(thing: Any, shape: tuple[int, ...]) -> Any:
    """Return an operand, broadcast to a shape."""
    if thing.shape == shape:
        return thing
    if isinstance(thing, Dual):
        return thing.moved(np.broadcast_to(thing._places(), shape))
    if is_traced(thing):
        return sys.modules["jax"].numpy.broadcast_to(thing, shape)
    return np.broadcast_to(thing, shape)


def joined(parts: Sequence[Any]) -> Any:
    """Return the entries of operands as one vector, operand by operand."""
    if len(parts) == 1:
        return parts[0].reshape(-1)
    kinds = set(map(type, parts))
    if kinds <= {np.ndarray, np.float64}:  # nearly always
        return np.concatenate([part.reshape(-1) for part in parts] or [np.zeros(0)])
    if any(map(is_traced, parts)):
        return sys.modules["jax"].numpy.concatenate([part.reshape(-1) for part in parts])
    return _joined_duals(parts) if Dual in kinds else np.concatenate([*map(np.ravel, parts)])


def _joined_duals(parts: Sequence[Any]) -> Dual:
    variables = next(part.rows.shape[1] for part in parts if type(part) is Dual)
    duals = [part if type(part) is Dual else as_dual(part, variables) for part in parts]
    value = np.concatenate([dual.value.reshape(-1) for dual in duals])
    if not any(type(dual.rows) is np.ndarray for dual in duals):
        return Dual.made(value, sp.vstack([dual.rows for dual in duals], format="csr"))
    return Dual.made(value, np.concatenate([dense(dual.rows) for dual in duals]))


def applied(ufunc: Any, *inputs: Any) -> Any:
    """Return numpy's ``ufunc`` of Duals and numbers: a Dual, or plain values for isfinite etc."""
    name = ufunc.__name__
    if name in KINKED:
        raise refuse_kink(name)
    if name in QUESTIONS:
        return ufunc(value_of(inputs[0]))
    if name == "matmul":
        return FUNCTIONS["dot"](*inputs)
    if name not in SMOOTH and name not in OF_TWO:
        raise UntraceableError(name)
    operands = [as_operand(each) for each in inputs]
    values: list[Any] = [value_of(each) for each in operands]
    value = ufunc(*values)
    if name in SMOOTH:
        slopes = np.asarray(SMOOTH[name](values[0], value))
        return Dual(value, scaled(operands[0].rows, slopes))
    parts = [
        scaled(spread(each, value.shape).rows, _factors(slope, values, value))
        for each, slope in zip(operands, OF_TWO[name], strict=True)
        if isinstance(each, Dual)
    ]
    return Dual(value, parts[0] if len(parts) == 1 else added(*parts))


def _factors(slope: Callable[..., Any], values: Sequence[Any], value: Any) -> Array:
    factors: Array = spread(np.asarray(slope(*values, value)), value.shape)
    return factors
