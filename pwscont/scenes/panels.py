"""The things that a scene shows: quantities, bodies, panels."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from math import isfinite
from numbers import Integral
from typing import Any, Protocol, TypeAlias, final

import numpy as np

from pwscont import BranchGraph, Character, InvalidInputError, PiecewiseSystem
from pwscont.extending import Array, Function, Indices, Quantities, as_written, spelled

#: The states of a contact node.
CONTACT_STATES = ("no contact", "stick", "slip+", "slip-")


@final
@dataclass(frozen=True, slots=True, eq=False)
class Shapes:
    """The shapes in which pictures show a body in several states.

    Between two states all numbers are interpolated; the picture in between is right only if the
    numbers depend linearly on (z, alpha).

    Attributes
    ----------
    corners : ndarray of int, shape (elements, c)
        The nodes around each element.
    positions : ndarray, shape (states, 2, v)
        Places at which the v nodes are drawn: displacements may be magnified.
    shade : ndarray, shape (states, m, elements)
        Stress of each element; the Euclidean norm over the m components chooses the colour.
    contact : ndarray of int, shape (p,)
        The nodes in or near contact.
    tangents : ndarray, shape (2, p)
        Unit vectors in the direction of ``slip+``.
    pressure, shear, bound : ndarray, shape (states, p)
        Force per area on each contact node, and the friction bound of the shear.
    arc : ndarray, shape (p,)
        Length along the boundary at each contact node.
    part : ndarray of int, shape (p,)
        Number of the connected part of the boundary that each contact node belongs to.
    obstacles : tuple of ndarray, each of shape (2, j)
        Outlines of the obstacles that the body leans on.
    held : ndarray of int
        Nodes that are held in place.
    note : str
        The quantity that is magnified, and the factor.
    shade_label, arc_label, force_label : str
        Names of colours and axes, with units.
    """

    corners: Indices
    positions: Array
    shade: Array
    contact: Indices
    tangents: Array
    pressure: Array
    shear: Array
    bound: Array
    arc: Array
    part: Indices
    obstacles: tuple[Array, ...] = ()
    held: Indices = field(default_factory=lambda: np.zeros(0, dtype=int))
    note: str = ""
    shade_label: str = "largest shear stress"
    arc_label: str = "length along the boundary"
    force_label: str = "force per area"


class BodyPicture(ABC):
    """The seam for pictures of a body; the field ``body`` of a scene holds a picture.

    :class:`pwscont.View` shows the body beside the branch diagram.
    """

    @abstractmethod
    def shapes(self, points: Array) -> Shapes:
        """Return the shapes of the body at several solutions.

        Parameters
        ----------
        points : ndarray, shape (states, n + 1)
            Solutions (z, alpha).
        """

    @abstractmethod
    def contact_states(self, character: Character) -> Sequence[str]:
        """Return the state of each contact node in the cell of a character.

        Returns
        -------
        sequence of str, length p
            ``no contact``, ``stick``, ``slip+`` or ``slip-``.
        """


#: An index into z, the name of an unknown or of a recorded quantity, or a function of (z, alpha).
What: TypeAlias = int | str | Function
#: Changes smaller than this part of a quantity are rounding.
DUST = 1e-9


@final
@dataclass(frozen=True, slots=True, eq=False)
class Drawn:
    """A quantity to draw, with name and typical magnitude.

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
        """Return the quantity for an index, a name or a function."""
        if isinstance(what, Integral):
            return cls._component(graph, int(what))
        if isinstance(what, str):
            return cls._named(graph, what)
        if callable(what):
            name = getattr(what, "__name__", "value").replace("<lambda>", "value")
            return cls(name, _each(name, what))
        raise _undrawable(what)

    def is_constant(self, values: Sequence[Array]) -> bool:
        """Tell whether all values of a quantity, at least one, are equal to rounding."""
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
            value(np.zeros(len(graph.names)), 0.0)  # raises an error that lists similar names
        return cls(name, _each(name, value))


def is_parameter(graph: BranchGraph, name: str) -> bool:
    """Tell whether a name means the parameter, and no unknown or recorded quantity."""
    known = (*graph.names, *graph.quantities.record)
    return name not in known and spelled(name) == spelled(graph.parameter)


def quantity_named(name: str, unknowns: Sequence[str], record: Mapping[str, Function]) -> str:
    """Return the name of an unknown or a recorded quantity, asked for by name or index.

    Greek letters may be given in words, ``lambda_t`` for ``λ_t``.
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
    wanted = "an index, a name or a function of (z, alpha)"
    return InvalidInputError(f"what is drawn must be {wanted}, got {what!r}")


def _check_index(index: int, size: int) -> None:
    if not -size <= index < size:
        raise InvalidInputError(f"there is no unknown {index}: the last one is {size - 1}")


def _size(graph: BranchGraph, index: int) -> float:
    """Return a typical magnitude of an unknown: the system's, else the largest of all unknowns."""
    if graph.system is not None and graph.system.gives_scale:
        return float(graph.system.scale(*graph.interval)[index])
    return max((float(np.abs(piece.z).max()) for piece in graph.pieces), default=0.0)


def _each(name: str, function: Function) -> Callable[[Array], Array]:
    def value(x: Array) -> float:
        try:
            found = np.asarray(function(x[:-1].copy(), float(x[-1]))).item()
            if isfinite(found):
                return float(found)
        except Exception as error:
            found = f"{type(error).__name__}: {error}"
        words = f"{name}, which is drawn, must be a finite number, at alpha = {x[-1]:.8g} it is"
        raise InvalidInputError(f"{words} not: {found}")

    return lambda points: np.array([value(x) for x in points])


@final
@dataclass(frozen=True, slots=True)
class Panel:
    """A diagram: a quantity against the parameter.

    Attributes
    ----------
    component : int, str or callable
        Index into z, name of an unknown or of a recorded quantity, or function of (z, alpha).
    mode : callable, optional
        Character -> the word that chooses the line style; default the system's description.
        Transitions that do not change this word, in other parts of the system, are not marked.
    title : str

    Examples
    --------
    >>> from pwscont import Panel
    >>> Panel("λ_t", title="node 1").component
    'λ_t'
    """

    component: What
    mode: Callable[[Character], str] | None = None
    title: str = ""


@final
@dataclass(frozen=True, slots=True)
class ParameterPath:
    """A companion picture: two quantities along the parameter, such as a load path.

    Attributes
    ----------
    curve : callable
        alpha -> (horizontal, vertical).
    labels : tuple of str
        Names of the horizontal and the vertical axis.
    title : str

    Examples
    --------
    >>> from pwscont import ParameterPath
    >>> ParameterPath(lambda alpha: (0.25, alpha), ("f_ν", "f_t")).curve(1.0)
    (0.25, 1.0)
    """

    curve: Callable[[float], tuple[float, float]]
    labels: tuple[str, str]
    title: str = ""


class Shown(Protocol):
    """The part of a :class:`pwscont.Scene` that tables and pictures know."""

    @property
    def name(self) -> str:
        """The name by which the scene is run."""

    @property
    def title(self) -> str:
        """The title that a reader sees."""

    @property
    def system(self) -> PiecewiseSystem:
        """The system that is explored."""

    @property
    def parameter(self) -> str:
        """Name of alpha."""

    @property
    def orientations(self) -> tuple[int, ...]:
        """Directions, +1 or -1; the table reads every branch in the first direction."""

    @property
    def panels(self) -> tuple[Panel, ...]:
        """The branch diagrams."""

    @property
    def paths(self) -> tuple[ParameterPath, ...]:
        """The companion pictures."""

    @property
    def styles(self) -> Mapping[str, Any]:
        """The line style for each mode."""

    @property
    def body(self) -> BodyPicture | None:
        """The picture of the body; None without a body."""
