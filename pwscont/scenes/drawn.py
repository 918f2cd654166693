"""The quantity that a branch diagram shows: an unknown, a recorded one, or a function."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from numbers import Integral
from typing import Any, TypeAlias, final

import numpy as np

from pwscont.basics.arrays import Array
from pwscont.basics.errors import InvalidInputError
from pwscont.basics.quantities import Function, Quantities, as_written, spelled
from pwscont.graph import BranchGraph

#: An index into z, the name of an unknown or of a recorded quantity, or a function of (z, alpha).
What: TypeAlias = int | str | Function
#: Changes smaller than this part of a quantity are rounding.
DUST = 1e-9


@final
@dataclass(frozen=True, slots=True, eq=False)
class Drawn:
    """A quantity with its name.

    Attributes
    ----------
    label : str
    along : callable
        Points (z, alpha), shape (k, n + 1) -> values, shape (k,).
    size : float
        A typical magnitude; zero if no magnitude is known.
    """

    label: str
    along: Callable[[Array], Array]
    size: float = 0.0

    @classmethod
    def of(cls, graph: BranchGraph, what: What) -> Drawn:
        """Return the quantity that is asked for.

        Raises
        ------
        InvalidInputError
            If there is no such quantity; UnknownNameError names close ones.
        """
        if isinstance(what, Integral):
            return cls._component(graph, int(what))
        if isinstance(what, str):
            return cls._named(graph, what)
        if callable(what):
            return cls(getattr(what, "__name__", "value").replace("<lambda>", "value"), _each(what))
        raise _undrawable(what)

    def is_constant(self, values: Sequence[Array]) -> bool:
        """Tell whether there are values and all of them are equal to rounding."""
        if not values:
            return False
        low, high = (extreme([extreme(some) for some in values]) for extreme in (np.min, np.max))
        return bool(high - low <= DUST * max(self.size, abs(low), abs(high)))

    @classmethod
    def _component(cls, graph: BranchGraph, index: int) -> Drawn:
        names = graph.names
        _check_index(index, len(names))
        return cls(names[index], lambda points: points[:, :-1][:, index], _size(graph, index))

    @classmethod
    def _named(cls, graph: BranchGraph, name: str) -> Drawn:
        name = as_written(name, (*graph.names, *graph.quantities.record))
        if name in graph.names:
            return cls._component(graph, graph.names.index(name))
        value = partial(graph.quantities.value, name)
        if name not in graph.quantities.record:
            value(np.zeros(len(graph.names)), 0.0)  # raises an error that names close ones
        return cls(name, _each(value))


def is_parameter(graph: BranchGraph, name: str) -> bool:
    """Tell whether a name is that of the parameter, and of no unknown and no recorded quantity."""
    known = (*graph.names, *graph.quantities.record)
    return name not in known and spelled(name) == spelled(graph.parameter)


def quantity_named(name: str, unknowns: Sequence[str], record: Mapping[str, Function]) -> str:
    """Return the name of an unknown or a recorded quantity, asked for by name or index.

    Greek letters may be given in words, ``lambda_t`` for ``λ_t``.

    Raises
    ------
    UnknownNameError
        If there is none; the message names close ones.
    """
    if name.isdecimal() and name not in record and int(name) < len(unknowns):
        return unknowns[int(name)]
    name = as_written(name, (*unknowns, *record))
    if name not in record:
        Quantities(unknowns, record).value(name, np.zeros(len(unknowns)), 0.0)
    return name


def check_drawn(what: Any, unknowns: Sequence[str], record: Mapping[str, Function]) -> None:
    """Refuse a quantity that no diagram can show, before any work; errors as of ``Drawn.of``."""
    if isinstance(what, Integral):
        _check_index(int(what), len(unknowns))
    elif isinstance(what, str) and what not in record:
        Quantities(unknowns, record).value(what, np.zeros(len(unknowns)), 0.0)
    elif not (isinstance(what, str) or callable(what)):
        raise _undrawable(what)


def _undrawable(what: object) -> InvalidInputError:
    return InvalidInputError(
        f"what is drawn must be an index, a name or a function of (z, alpha), got {what!r}"
    )


def _check_index(index: int, size: int) -> None:
    if not -size <= index < size:
        raise InvalidInputError(f"there is no unknown {index}: there are {size}")


def _size(graph: BranchGraph, index: int) -> float:
    """Return a typical magnitude of an unknown: the system's, else the largest of all unknowns."""
    if graph.system is not None and graph.system.gives_scale:
        return float(graph.system.scale(*graph.interval)[index])
    return max((float(np.abs(piece.z).max()) for piece in graph.pieces), default=0.0)


def _each(function: Function) -> Callable[[Array], Array]:
    def along(points: Array) -> Array:
        values = [np.asarray(function(x[:-1].copy(), float(x[-1]))).item() for x in points]
        return np.array(values, dtype=float)

    return along
