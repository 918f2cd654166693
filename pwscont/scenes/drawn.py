"""What a branch diagram shows: an unknown, a recorded quantity, or a function."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from numbers import Integral
from typing import TypeAlias, final

import numpy as np

from pwscont.basics.arrays import Array
from pwscont.basics.errors import InvalidInputError
from pwscont.basics.quantities import Function
from pwscont.graph import BranchGraph

#: An index into z, the name of an unknown or of a recorded quantity, or a function of (z, alpha).
What: TypeAlias = int | str | Function


@final
@dataclass(frozen=True, slots=True, eq=False)
class Drawn:
    """A quantity with its name.

    Attributes
    ----------
    label : str
    along : callable
        Points (z, alpha), shape (k, n + 1) -> values, shape (k,).
    """

    label: str
    along: Callable[[Array], Array]

    @classmethod
    def of(cls, graph: BranchGraph, what: What) -> Drawn:
        """Return what is asked for.

        Raises
        ------
        InvalidInputError
            If there is no such unknown; a name that is close is told (UnknownNameError).
        """
        if isinstance(what, Integral):
            return cls._component(graph, int(what))
        if isinstance(what, str):
            return cls._named(graph, what)
        if callable(what):
            return cls(getattr(what, "__name__", "value").replace("<lambda>", "value"), _each(what))
        raise InvalidInputError(
            f"what is drawn must be an index, a name or a function of (z, alpha), got {what!r}"
        )

    @classmethod
    def _component(cls, graph: BranchGraph, index: int) -> Drawn:
        names = graph.names
        if not -len(names) <= index < len(names):
            raise InvalidInputError(f"there is no unknown {index}: there are {len(names)}")
        return cls(names[index], lambda points: points[:, :-1][:, index])

    @classmethod
    def _named(cls, graph: BranchGraph, name: str) -> Drawn:
        if name in graph.names:
            return cls._component(graph, graph.names.index(name))
        value = partial(graph.quantities.value, name)
        if name not in graph.quantities.record:
            value(np.zeros(len(graph.names)), 0.0)  # says which are close
        return cls(name, _each(value))


def _each(function: Function) -> Callable[[Array], Array]:
    def along(points: Array) -> Array:
        values = [np.asarray(function(x[:-1].copy(), float(x[-1]))).item() for x in points]
        return np.array(values, dtype=float)

    return along
