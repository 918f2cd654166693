"""What users see of an evolution: states, nodes, smooth pieces."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import final

import numpy as np

from pwscont.basics.arrays import Array
from pwscont.basics.looks import card, short
from pwscont.basics.looks import state as in_words
from pwscont.basics.quantities import NAMELESS, Quantities
from pwscont.basics.rounding import EPS, GUARD

#: The kinds of nodes of an evolution.
KINDS = ("start", "event", "branching", "loss", "jump", "undecided", "end")
#: Times closer than this part of the interval are one time.
SAME_TIME = 2.0**10 * GUARD * EPS


def same_time(interval: tuple[float, float]) -> float:
    """Return the largest difference of two times that are one time."""
    lo, hi = interval
    return SAME_TIME * (hi - lo) + GUARD * EPS * max(abs(lo), abs(hi))


@final
@dataclass(frozen=True, slots=True, eq=False)
class EvolutionState:
    """One state of an evolution.

    ``state["u_t"]`` is an unknown by name, or a recorded quantity.

    Attributes
    ----------
    t : float
    z : ndarray, shape (n,)
    memory : ndarray, shape (k,)
        What the state leaves behind.
    label : str
        The modes of the parts, on the piece that leads to the state.
    kind : str or None
        The kind of the node; None between nodes.
    name : str
        The names of the user's events that are zero here.
    remark : str
        What is uncertain of the ways on, in words; empty where nothing is.
    node : int or None
        The number of the node; None between nodes.
    history : tuple of int
        The nodes of one evolution that leads to the state, from its start.
    """

    t: float
    z: Array
    memory: Array
    label: str
    kind: str | None = None
    name: str = ""
    remark: str = ""
    node: int | None = None
    history: tuple[int, ...] = ()
    quantities: Quantities = NAMELESS

    def __getitem__(self, name: str) -> float:
        return self.quantities.value(name, self.z, self.t)

    def _in_words(self) -> str:
        return in_words(self.quantities.names(len(self.z)), self.z)

    def __repr__(self) -> str:
        kind = f"{self.kind}, " if self.kind else ""
        label = f"{short(self.label)}, " if self.label else ""
        return f"EvolutionState({kind}{label}t={self.t:.10g}, {self._in_words()})"

    def _repr_html_(self) -> str:
        rows = [("mode", short(self.label)), ("state", self._in_words())]
        return card(f"{self.kind or 'state'} at t = {self.t:.10g}", rows)


@final
@dataclass(slots=True, eq=False)
class EvolutionNode:
    """A state at an event, as the graph keeps the state.

    Attributes
    ----------
    t : float
    z : ndarray, shape (m,)
        In the unknowns of the evolver.
    memory : ndarray, shape (k,)
    kind, name, remark : str
        As for :class:`EvolutionState`.
    """

    t: float
    z: Array
    memory: Array
    kind: str = "undecided"
    name: str = ""
    remark: str = ""


@final
@dataclass(slots=True, eq=False)
class EvolutionPiece:
    """A smooth piece between two nodes, straight in (z, t); or a jump, at one t.

    Attributes
    ----------
    start, end : int
        The nodes.
    label : str
    first, last : ndarray, shape (m,)
        The states at both ends, in the unknowns of the evolver.
    """

    start: int
    end: int
    label: str
    first: Array
    last: Array
    is_jump: bool = field(default=False)

    def between(self, part: float) -> Array:
        """Return the state after a part of the time of the piece."""
        state: Array = (1.0 - part) * self.first + part * self.last
        return np.asarray(state)
