"""The equations of a circuit, summed up from the elements.

Modified nodal analysis (Ho, Ruehli and Brennan, *The modified nodal approach to network analysis*,
IEEE Transactions on Circuits and Systems 22, 1975): the unknowns are the voltages of all nodes
except ground, and the currents that are no linear function of voltages. The row of a voltage says
that the currents that leave the node sum to zero; the row of a current is the law of the element.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import TypeAlias, final

import numpy as np

from pwscont_circuits.polyline import Polyline

GROUND = "0"
Pair: TypeAlias = tuple[str, str]
#: Nodes with factors: of voltages in a sum, or of a current that leaves there.
Terms: TypeAlias = Sequence[tuple[str, float]]
#: Unknowns with factors.
Sum: TypeAlias = list[tuple[str, float]]


@final
@dataclass(frozen=True, slots=True)
class Ramp:
    """A change of slope in a row where a control voltage exceeds a knot."""

    row: str
    control: Sum
    knot: float
    change: float


@final
@dataclass
class Stamps:
    """The equations while elements are added.

    Attributes
    ----------
    nodes, currents : dict of str to None
        The nodes except ground, and the names of the currents, in the order of addition.
    entries : list of (row, unknown, factor)
        The linear part, summed where entries repeat.
    sources : list of (row, source, factor)
        Factors with which the values of sources are added to rows.
    constants : list of (row, value)
    ramps : list of Ramp
    curves : list of (row, number of knots)
        The rows with ramps, in the order of the ramps.
    supports : list of (sum, value)
        Sums of unknowns that are nowhere negative once the value is added.
    paths : list of pair of str
        Nodes between which current finds a way.
    stiff : list of pair of str
        The paths whose voltage follows from the current.
    fixed : list of tuple of str
        The element that gives a voltage, and the two nodes between which the voltage is given.
    is_monotone : bool
        Whether all elements have two ends and currents that never fall while voltages grow.

    Examples
    --------
    >>> from pwscont_circuits import Resistor, Stamps
    >>> stamps = Stamps()
    >>> Resistor("R", "in", "0", 2.0).stamp(stamps)
    >>> stamps.has_ground
    True
    """

    nodes: dict[str, None] = field(default_factory=dict)
    currents: dict[str, None] = field(default_factory=dict)
    entries: list[tuple[str, str, float]] = field(default_factory=list)
    sources: list[tuple[str, str, float]] = field(default_factory=list)
    constants: list[tuple[str, float]] = field(default_factory=list)
    ramps: list[Ramp] = field(default_factory=list)
    curves: list[tuple[str, int]] = field(default_factory=list)
    supports: list[tuple[Sum, float]] = field(default_factory=list)
    paths: list[Pair] = field(default_factory=list)
    stiff: list[Pair] = field(default_factory=list)
    fixed: list[tuple[str, str, str]] = field(default_factory=list)
    is_monotone: bool = True
    has_ground: bool = False

    @property
    def names(self) -> tuple[str, ...]:
        """The unknowns, voltages first."""
        return (*map(voltage, self.nodes), *self.currents)

    def resistor(self, plus: str, minus: str, resistance: float) -> None:
        """Add a current that is proportional to a voltage."""
        across = self._voltages(((plus, 1.0 / resistance), (minus, -1.0 / resistance)))
        for row, sign in self._voltages(((plus, 1.0), (minus, -1.0))):
            self.entries += [(row, unknown, sign * factor) for unknown, factor in across]
        self.paths.append((plus, minus))
        self.stiff.append((plus, minus))

    def current_source(self, name: str, plus: str, minus: str) -> None:
        """Add a given current from plus to minus."""
        ends = self._voltages(((plus, 1.0), (minus, -1.0)))
        self.sources += [(row, name, sign) for row, sign in ends]

    def voltage_source(self, name: str, plus: str, minus: str) -> None:
        """Add a given voltage from plus to minus, and the current through the source."""
        ends = ((plus, 1.0), (minus, -1.0))
        row = self._current(name, ends)
        self.entries += [(row, unknown, -sign) for unknown, sign in self._voltages(ends)]
        self.sources.append((row, name, 1.0))
        self.fixed.append((name, plus, minus))
        self.stiff.append((plus, minus))

    def nonlinear_resistor(self, name: str, plus: str, minus: str, curve: Polyline) -> None:
        """Add a current that is a function of the voltage from plus to minus."""
        ends = ((plus, 1.0), (minus, -1.0))
        self._controlled(name, ends, ends, curve)
        self.is_monotone &= bool((curve.slopes >= 0.0).all())
        if (curve.slopes > 0.0).all():
            self.stiff.append((plus, minus))

    def junction(self, name: str, leaves: Terms, control: Terms, curve: Polyline) -> None:
        """Add a current that is a function of a sum of voltages and leaves nodes with factors."""
        self._controlled(name, leaves, control, curve)
        self.is_monotone = False

    def voltage_of(self, name: str, node: str, control: Terms, curve: Polyline) -> None:
        """Make a function of a sum of voltages the voltage of a node, and add a current there."""
        row = self._current(name, ((node, 1.0), (GROUND, -1.0)))
        self._curve(row, self._voltages([(node, 1.0)]), self._voltages(control), curve, -1.0)
        self.fixed.append((name, node, GROUND))
        self.is_monotone = False

    def _controlled(self, name: str, leaves: Terms, control: Terms, curve: Polyline) -> None:
        row = self._current(name, leaves)
        self._curve(row, [(row, 1.0)], self._voltages(control), curve)

    def _curve(
        self, row: str, output: Sum, control: Sum, curve: Polyline, sign: float = 1.0
    ) -> None:
        """Let a row say sign * (output - curve(control)) = 0.

        The curve is written as the first segment plus a ramp from each knot on.
        """
        first, knots = curve.slopes[0], curve.knots
        self.entries += [(row, *term) for term in combined(output, -first, control, sign)]
        self.constants.append((row, sign * (first * knots[0] - curve.value)))
        changes = zip(knots, sign * np.diff(curve.slopes), strict=True)
        self.ramps += [Ramp(row, control, knot, change) for knot, change in changes]
        self.curves.append((row, len(knots)))
        self.supports += [
            (combined(output, -slope, control, side), -side * value)
            for side, value, slope in curve.supports()
        ]

    def _current(self, name: str, leaves: Terms) -> str:
        """Return a new unknown current that leaves nodes into an element with factors."""
        current = f"I({name})"
        self.currents[current] = None
        self.entries += [(row, current, factor) for row, factor in self._voltages(leaves)]
        self.paths += pairwise(node for node, _ in leaves)
        return current

    def _voltages(self, terms: Terms) -> Sum:
        """Return a sum of voltages without the voltage of ground, which is zero."""
        self.has_ground |= any(node == GROUND for node, _ in terms)
        inner = [(node, factor) for node, factor in terms if node != GROUND]
        self.nodes |= dict.fromkeys(node for node, _ in inner)
        return [(voltage(node), factor) for node, factor in inner]


def combined(first: Sum, factor: float, second: Sum, side: float = 1.0) -> Sum:
    """Return side * (first + factor * second)."""
    scaled = [(unknown, side * each) for unknown, each in first]
    return scaled + [(unknown, side * factor * each) for unknown, each in second]


def voltage(node: str) -> str:
    """Return the name of the voltage of a node."""
    return f"V({node})"
