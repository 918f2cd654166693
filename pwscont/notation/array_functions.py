"""Functions of numpy for Duals, other than arithmetic: join, cut, move, sum."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from functools import partial
from typing import Any

import numpy as np
import scipy.sparse as sp

from pwscont.extending import Indices
from pwscont.notation.arithmetic import UntraceableError, refuse_kink
from pwscont.notation.dual import FUNCTIONS, Dual, as_dual, as_operand, is_traced, joined, spread

#: Functions that move entries around, or put zeros between entries.
NAMES_OF_MOVING = (
    "append atleast_1d atleast_2d broadcast_to column_stack concatenate diag diagonal dstack "
    "expand_dims flip fliplr flipud hstack moveaxis ravel repeat reshape roll rollaxis rot90 "
    "split array_split squeeze stack swapaxes take tile transpose tril triu vstack"
)
MOVING = tuple(getattr(np, name) for name in NAMES_OF_MOVING.split())
#: Modes of np.pad that put entries, or zeros, at the ends.
PADS = frozenset({"constant", "edge", "reflect", "symmetric", "wrap"})


def gathered(function: Any, *args: Any, **kwargs: Any) -> Any:
    """Return the operands' entries as a function of ``MOVING`` moves entry numbers.

    Number 0 stands for the entry 0.0, for functions that put zeros between entries.
    """
    seen, total = [np.zeros(1)], 1

    def numbered(thing: Any) -> Any:
        nonlocal total
        if isinstance(thing, list | tuple) and not _is_plain(thing):
            return [numbered(each) for each in thing]
        operand = as_operand(thing)
        first, total = total, total + operand.size
        seen.append(operand)
        return first + np.arange(operand.size).reshape(operand.shape)

    count = 2 if function is np.append else 1
    places = function(*map(numbered, args[:count]), *args[count:], **kwargs)
    entries = joined(seen)
    if isinstance(places, list):
        return [entries.moved(each) for each in places]
    return entries.moved(places)


def _is_plain(things: Sequence[Any]) -> bool:
    return all(np.isscalar(thing) for thing in things)


def product(one: Any, other: Any) -> Any:
    """Return the product of a Dual and a matrix or vector, in either order."""
    if sp.issparse(other):
        return product(other.T, one)
    if not sp.issparse(one):
        one, other = as_operand(one), as_operand(other)
    if not isinstance(one, Dual) and one.ndim == 2 and other.ndim == 1:
        return Dual(one @ other.value, one @ other.rows)
    if sp.issparse(one):
        raise UntraceableError("products of sparse matrices with matrices")
    if not one.ndim or not other.ndim:
        return one * other
    if other.ndim == 1:
        return (one * other).sum(axis=-1)
    if one.ndim == 1:
        return product(other.swapaxes(-1, -2) if isinstance(other, np.ndarray) else other.T, one)
    return (one[..., :, :, np.newaxis] * other[..., np.newaxis, :, :]).sum(axis=-2)


def _zeros_like(thing: Dual, dtype: Any = None, **options: Any) -> Dual:
    return as_dual(np.zeros(thing.shape), thing.rows.shape[1])


def _pad(thing: Dual, width: Any, mode: str = "constant", constant_values: Any = 0.0) -> Dual:
    if mode not in PADS or np.any(constant_values):
        raise UntraceableError(f"pad with {mode} values")
    padded: Dual = gathered(np.pad, thing, width, mode)
    return padded


def _where(condition: Any, *branches: Any) -> Any:
    if isinstance(condition, Dual):
        raise refuse_kink("where")
    if len(branches) != 2:
        raise UntraceableError("where")
    condition, parts = np.asarray(condition), [as_operand(each) for each in branches]
    if _are_alike(parts[0], parts[1], condition.shape):
        rows = np.where(condition.reshape(-1, 1), parts[0].rows, parts[1].rows)
        return Dual.made(np.where(condition, parts[0].value, parts[1].value), rows)
    shape = np.broadcast_shapes(condition.shape, *(part.shape for part in parts))
    variables = _variables(parts)
    one, other = (as_dual(spread(part, shape), variables) for part in parts)
    chosen = np.broadcast_to(condition, shape)
    value = np.where(chosen, one.value, other.value)
    if sp.issparse(one.rows) or sp.issparse(other.rows):
        size = value.size
        both = sp.vstack([sp.csr_array(one.rows), sp.csr_array(other.rows)], "csr")
        return Dual(value, both[np.arange(size) + np.where(chosen.ravel(), 0, size)])
    return Dual(value, np.where(chosen.reshape(-1, 1), one.rows, other.rows))


def _are_alike(one: Any, other: Any, shape: tuple[int, ...]) -> bool:
    """Tell whether two operands are Duals of a given shape with dense derivatives."""
    if not (type(one) is Dual is type(other) and one.shape == other.shape == shape and shape):
        return False
    return type(one.rows) is np.ndarray is type(other.rows)


def _variables(parts: Sequence[Any]) -> int:
    return next(int(part.rows.shape[1]) for part in parts if isinstance(part, Dual))


def _diff(thing: Dual, n: int = 1, axis: int = -1) -> Dual:
    for _ in range(n):
        thing = thing.moved(_cut(thing, axis, 1, None)) - thing.moved(_cut(thing, axis, None, -1))
    return thing


def _cut(thing: Dual, axis: int, start: int | None, stop: int | None) -> Indices:
    return np.moveaxis(np.moveaxis(thing._places(), axis, 0)[start:stop], 0, axis)


FUNCTIONS.update(
    {
        "sum": lambda thing, axis=None, **options: as_operand(thing).sum(axis, **options),
        "mean": lambda thing, axis=None, **options: as_operand(thing).mean(axis, **options),
        "dot": product,
        "inner": lambda one, other: product(one, np.transpose(other)),
        "vdot": lambda one, other: product(np.ravel(one), np.ravel(other)),
        "outer": lambda one, other: np.reshape(one, (-1, 1)) * np.reshape(other, (1, -1)),
        "diff": _diff,
        "pad": _pad,
        "where": _where,
        "zeros_like": _zeros_like,
        "empty_like": _zeros_like,
        "ones_like": lambda thing, **options: np.ones(thing.shape),
        "full_like": lambda thing, value, **options: np.full(thing.shape, float(value)),
        "copy": lambda thing, **options: thing.copy(),
        "shape": lambda thing: thing.shape,
        "size": lambda thing, axis=None: np.size(thing.value, axis),
        "ndim": lambda thing: thing.ndim,
    }
)
FUNCTIONS.update({function.__name__: partial(gathered, function) for function in MOVING})


def chosen(entries: Any, places: Indices) -> Any:
    """Return the entries of an operand at places, in the places' shape; a number for shape ()."""
    found = entries.moved(places) if isinstance(entries, Dual) else entries[places]
    return found[()] if not places.ndim and isinstance(found, np.ndarray) else found


def where(condition: Any, a: Any, b: Any) -> Any:
    """Return the entries of ``a`` where a condition holds, those of ``b`` elsewhere."""
    if type(a) is np.ndarray is type(b) and a.ndim:
        return np.where(condition, a, b)  # nearly always
    if is_traced(a) or is_traced(b):
        return sys.modules["jax"].numpy.where(condition, a, b)
    found = np.where(condition, a, b)
    return found if isinstance(found, Dual) else found[()]
