"""All operating points of a circuit, with the value of a source as parameter."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import groupby, islice, pairwise, product
from typing import final

import numpy as np

from pwscont import Block, Character, PiecewiseLinearSystem
from pwscont.extending import Array, Matrix
from pwscont_circuits.elements import Element
from pwscont_circuits.equations import Equations
from pwscont_circuits.stamps import Stamps


@final
class SourceSweep(PiecewiseLinearSystem):
    """The operating points of a circuit; the parameter is the value of a source.

    z holds the voltages V(node) of all nodes except ground, then the currents I(name) of voltage
    sources, nonlinear elements and outputs of op-amps. From the linear rows of modified nodal
    analysis a ramp is subtracted for each knot of a characteristic, in the row of the element::

        H = A (z, alpha) + b - R max(0, C (z, alpha) - knots)

    The test functions C (z, alpha) - knots tell on which side of each knot an element is.

    Parameters
    ----------
    elements : sequence of Element
        The owner of each characteristic; an element with two characteristics is listed twice.
    stamps : Stamps
    values : mapping of str to float
        The values of all other sources.
    unique : bool
        Whether no value of the parameter has two operating points.

    Examples
    --------
    >>> from pwscont import enumerate_solutions
    >>> from pwscont_circuits import Circuit, Resistor, VoltageSource
    >>> resistors = [Resistor("R1", "a", "b", 1.0), Resistor("R2", "b", "0", 1.0)]
    >>> divider = Circuit([VoltageSource("E", "a", "0", 0.0), *resistors])
    >>> round(enumerate_solutions(divider.sweep("E"), 4.0)[0]["V(b)"], 9)
    2.0
    """

    def __init__(
        self,
        elements: Sequence[Element],
        stamps: Stamps,
        values: Mapping[str, float],
        unique: bool,
    ) -> None:
        self.size, self._names, self.unique = len(stamps.names), stamps.names, unique
        self._equations = Equations(stamps, values)
        self._elements = [(element, len(list(same))) for element, same in groupby(elements)]
        knots = [count for _, count in stamps.curves]
        #: The number of the first test of each curve, and the number of all tests.
        self._firsts = np.cumsum([0, *knots])
        self._rows = [self._equations.place[row] for row, _ in stamps.curves]
        #: The row of each ramp, and the change of slope at the knot.
        self._ramps = [(self._equations.place[ramp.row], ramp.change) for ramp in stamps.ramps]

    def test_functions(self, z: Array, alpha: float) -> Array:
        """Return control voltages less knots, shape (m,)."""
        values: Array = self._equations.C @ np.append(z, alpha) - self._equations.knots
        return values

    def test_jacobian(self, z: Array, alpha: float) -> Matrix:
        """Return the constant gradients of the tests."""
        return self._equations.C

    def residual(self, z: Array, alpha: float, character: Character) -> Array:
        """Return the sums of currents, then the laws of the elements."""
        x, equations = np.append(z, alpha), self._equations
        ramps = np.where(character.array, self.test_functions(z, alpha), 0.0)
        value: Array = equations.A @ x + equations.b - equations.R @ ramps
        return value

    def jacobian(self, z: Array, alpha: float, character: Character) -> Matrix:
        """Return the constant matrix of a cell."""
        on, equations = character.array, self._equations
        return equations.A - equations.R[:, on] @ equations.C[on]

    def kink(self, before: Character, after: Character, test: int) -> Array:
        """Return c, shape (n,): a ramp begins to be subtracted, or ends."""
        row, change = self._ramps[test]
        c = np.zeros(self.size)
        c[row] = -change if after.array[test] else change
        return c

    def blocks(self) -> tuple[Block, ...]:
        """Return a block for each characteristic, with a choice for each segment."""
        spans = zip(pairwise(self._firsts.tolist()), self._rows, strict=True)
        return tuple(Block(tuple(range(*span)), (row,), _segments(*span)) for span, row in spans)

    def cells(self) -> Iterator[Character]:
        """Yield all combinations of segments."""
        for signs in product(*(block.modes for block in self.blocks())):
            yield Character(tuple(sign for part in signs for sign in part))

    def necessary(self, alpha: float) -> tuple[Matrix, Array]:
        """Return the lines that whole characteristics do not cross, as inequalities in z."""
        D, d = self._equations.supports
        return D[:, :-1], d + alpha * D[:, -1]

    def scale(self, lo: float, hi: float) -> Array:
        """Return a typical voltage and a typical current, repeated for all unknowns."""
        return self._equations.scale(max(abs(lo), abs(hi)))

    def names(self) -> tuple[str, ...]:
        """Return V(node) and I(name)."""
        return self._names

    def describe(self, character: Character) -> str:
        """Return the states of all elements with kinks, such as ``D1 to D3 on, Q1 saturated``."""
        return _told([(element.name, state) for element, (state, _) in self._states(character)])

    def describe_transition(self, before: Character, after: Character) -> str:
        """Return what changes, such as ``D1 turns on``."""
        states = zip(self._states(before), self._states(after), strict=True)
        return _told([(e.name, new[1]) for (_, old), (e, new) in states if old != new])

    def test_name(self, test: int) -> str:
        """Return the element and the knot of a test."""
        curve = int(np.searchsorted(self._firsts, test, side="right")) - 1
        owners = [element.name for element, count in self._elements for _ in range(count)]
        return f"{owners[curve]} at {self._equations.knots[test]:g}"

    def _states(self, character: Character) -> list[tuple[Element, tuple[str, str]]]:
        """Return the state of each element, and the event of entering the state."""
        if not len(self._rows):
            return []
        segments = iter(np.add.reduceat(character.array, self._firsts[:-1], dtype=int).tolist())
        return [(e, e.state(tuple(islice(segments, count)))) for e, count in self._elements]


def _segments(first: int, last: int) -> tuple[tuple[bool, ...], ...]:
    """Return the signs of the tests of a characteristic on each segment."""
    knots = last - first
    return tuple(tuple(i < on for i in range(knots)) for on in range(knots + 1))


def _told(words: list[tuple[str, str]]) -> str:
    """Return names with words; neighbours with the same word are put together."""
    runs = [(word, [name for name, _ in run]) for word, run in groupby(words, lambda w: w[1])]
    return ", ".join(f"{_span(names)} {word}" for word, names in runs)


def _span(names: list[str]) -> str:
    return f"{names[0]} to {names[-1]}" if len(names) > 2 else ", ".join(names)
