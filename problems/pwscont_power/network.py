"""Networks of buses: branches, loads and generators with reactive limits, all per unit."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from numbers import Real
from typing import Any, final

import numpy as np
import scipy.sparse as sp

from pwscont import InvalidInputError
from pwscont.extending import Array, Indices, finite_array


@final
@dataclass(frozen=True)
class Branch:
    """A line or transformer between two buses, as a pi circuit (MATPOWER manual, section 3.2).

    Attributes
    ----------
    start, end : int
        Numbers of the buses.
    r, x : float
        Series resistance and reactance.
    b : float
        Total charging susceptance.
    tap : float
        Ratio of the transformer at ``start``.
    shift : float
        Phase shift of the transformer in radians.
    g : float
        Total shunt conductance, such as iron losses.

    Raises
    ------
    InvalidInputError
        If a number is no finite number.

    Examples
    --------
    >>> from pwscont_power import Branch
    >>> Branch(1, 2, r=0.02, x=0.2).tap
    1.0
    """

    start: int
    end: int
    r: float
    x: float
    b: float = 0.0
    tap: float = 1.0
    shift: float = 0.0
    g: float = 0.0

    def __post_init__(self) -> None:
        """Check the numbers."""
        for name in ("r", "x", "b", "tap", "shift", "g"):
            what = f"{name} of the branch from bus {self.start} to bus {self.end}"
            finite_array(what, getattr(self, name), ())

    @cached_property
    def admittance(self) -> Array:
        """The currents into the branch by the voltages at the ends, shape (2, 2)."""
        if self.r == self.x == 0.0 or self.tap == 0.0:
            raise InvalidInputError(
                f"the branch from bus {self.start} to bus {self.end} needs an impedance and a tap "
                "that are not zero; make one bus of buses that a closed switch joins"
            )
        ratio = self.tap * np.exp(1j * self.shift)
        series = 1.0 / complex(self.r, self.x)
        own = series + 0.5 * complex(self.g, self.b)
        return np.array([[own / self.tap**2, -series / ratio.conjugate()], [-series / ratio, own]])


@final
@dataclass(frozen=True)
class Generator:
    """A generator that holds a voltage as long as the reactive power is within limits.

    Attributes
    ----------
    bus : int
        Number of the bus.
    V : float
        The voltage to hold.
    Q_min, Q_max : float
        Limits of the reactive power, Q_min < Q_max; a limit may be infinite.

    Raises
    ------
    InvalidInputError
        If V is not positive, or Q_min is not below Q_max.

    Examples
    --------
    >>> from pwscont_power import Generator
    >>> Generator(2, V=1.02, Q_max=0.8).Q_min
    -inf
    """

    bus: int
    V: float
    Q_min: float = -np.inf
    Q_max: float = np.inf

    def __post_init__(self) -> None:
        """Check the numbers."""
        finite_array(f"V of the generator at bus {self.bus}", self.V, ())
        for name in ("Q_min", "Q_max"):
            if not isinstance(value := getattr(self, name), Real):
                words = f"generator at bus {self.bus}: {name} must be a number, got {value!r}"
                raise InvalidInputError(words)
        if not 0.0 < self.V < np.inf:
            raise InvalidInputError(f"generator at bus {self.bus}: V must be > 0, got {self.V}")
        if not self.Q_min < self.Q_max:
            raise InvalidInputError(
                f"generator at bus {self.bus}: Q_min < Q_max is needed, got {self.Q_min} and "
                f"{self.Q_max}; a generator of fixed reactive power is a negative load"
            )


@final
@dataclass(frozen=True)
class Network:
    """Buses with loads and generators, joined by branches.

    Attributes
    ----------
    buses : tuple of int
        Numbers of the buses, the slack first or anywhere.
    branches : tuple of Branch
    generators : tuple of Generator
        No two at the same bus. The generator of the slack bus gives the voltage of the slack, and
        has no limits.
    slack : int
        The bus whose voltage is given, at angle zero.
    load, generation : array_like of complex, shape (buses,)
        Power taken, and power given except the reactive power of generators.
    shunt : array_like of complex, shape (buses,)
        Admittances to ground.

    Raises
    ------
    InvalidInputError
        If numbers of buses are not known, or not distinct, or shapes do not fit.

    Examples
    --------
    >>> from pwscont_power import Branch, Generator, Network
    >>> line = Branch(1, 2, 0.02, 0.2)
    >>> Network((1, 2), (line,), (Generator(1, 1.0),), slack=1, load=[0, 0.5 + 0.2j]).buses
    (1, 2)
    """

    buses: tuple[int, ...]
    branches: tuple[Branch, ...]
    generators: tuple[Generator, ...]
    slack: int
    load: Any
    generation: Any = 0.0
    shunt: Any = 0.0

    def __post_init__(self) -> None:
        """Check kinds, numbers and shapes."""
        for name, kind in (("branches", Branch), ("generators", Generator)):
            given = getattr(self, name)
            for part in given if isinstance(given, Sequence) else [given]:
                if not isinstance(given, Sequence) or not isinstance(part, kind):
                    words = f"{name} must be several {kind.__name__}(...), got {part!r}"
                    raise InvalidInputError(words)
        if len(set(self.buses)) != len(self.buses):
            raise InvalidInputError("two buses have the same number")
        at = [generator.bus for generator in self.generators]
        if len(set(at)) != len(at):
            raise InvalidInputError("two generators are at one bus: add them up")
        ends = [bus for branch in self.branches for bus in (branch.start, branch.end)]
        self.places([self.slack, *at, *ends])
        if self.slack not in at:
            raise InvalidInputError(
                f"the slack, bus {self.slack}, has no generator for its voltage"
            )
        for name in ("load", "generation", "shunt"):
            given = one_each(name, getattr(self, name), len(self.buses))
            object.__setattr__(self, name, given)

    def places(self, buses: Sequence[int]) -> Indices:
        """Return the places of some buses in ``buses``.

        Raises
        ------
        InvalidInputError
            If there is no such bus.
        """
        place = {bus: i for i, bus in enumerate(self.buses)}
        unknown = [bus for bus in buses if bus not in place]
        if unknown:
            raise InvalidInputError(f"there is no bus {unknown[0]}; buses are {self.buses}")
        return np.array([place[bus] for bus in buses], dtype=np.intp)

    def with_limits(self, bus: int, Q_min: float, Q_max: float) -> Network:
        """Return the network with other reactive limits at a bus.

        Raises
        ------
        InvalidInputError
            If there is no generator.
        """
        if bus not in [generator.bus for generator in self.generators]:
            raise InvalidInputError(f"there is no generator at bus {bus}")
        changed = (
            replace(each, Q_min=Q_min, Q_max=Q_max) if each.bus == bus else each
            for each in self.generators
        )
        return replace(self, generators=tuple(changed))

    @cached_property
    def admittance(self) -> sp.csr_array:
        """The admittance matrix: currents into the network by voltages."""
        size = len(self.buses)
        Y = sp.lil_array((size, size), dtype=complex)
        Y.setdiag(self.shunt)
        for branch in self.branches:
            ends = self.places([branch.start, branch.end])
            for i, row in zip(ends, branch.admittance, strict=True):
                for j, entry in zip(ends, row, strict=True):
                    Y[i, j] += entry
        return Y.tocsr()


def one_each(name: str, values: Any, buses: int) -> Array:
    """Return given values as a complex number for each bus.

    Raises
    ------
    InvalidInputError
        If the shape does not fit, or a number is not finite.
    """
    try:
        array = np.asarray(values, dtype=complex)
        if array.shape == (1,) != (buses,):
            raise ValueError  # numpy would give the number to every bus
        array = np.array(np.broadcast_to(array, buses))
    except (TypeError, ValueError) as error:
        raise InvalidInputError(
            f"{name} must be one complex number for each of {buses} buses"
        ) from error
    finite_array(name, array.view(float))
    return array
