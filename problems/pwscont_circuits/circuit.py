"""Circuits of named elements, and the mistakes that a circuit may have."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from typing import final

from pwscont import InvalidInputError, UnknownNameError
from pwscont.extending import counted
from pwscont_circuits.elements import Element, Source
from pwscont_circuits.joined import Joined
from pwscont_circuits.stamps import GROUND, Stamps
from pwscont_circuits.sweep import SourceSweep


@final
class Circuit:
    """A circuit of elements, which meet at nodes of the same name; ``0`` is ground.

    Parameters
    ----------
    elements : iterable of Element

    Raises
    ------
    InvalidInputError
        If a name is used twice, nothing is at ground, a node floats or belongs to a single element,
        or voltage sources and outputs of op-amps form a loop.

    Examples
    --------
    >>> from pwscont import explore
    >>> from pwscont_circuits import Circuit, Diode, Resistor, VoltageSource
    >>> source, diode = VoltageSource("E", "in", "0", 0.0), Diode("D", "out", "0")
    >>> clipper = Circuit([source, Resistor("R", "in", "out", 9.0), diode])
    >>> graph = explore(clipper.sweep("E"), (0.0, 2.0), parameter="E")
    >>> [(p.message, round(p.alpha, 6)) for p in graph.special_points("transition")]
    [('D turns on', 0.6)]
    """

    def __init__(self, elements: Iterable[Element]) -> None:
        if not isinstance(elements, Iterable):
            raise InvalidInputError(f"elements must be a sequence of elements, got {elements!r}")
        self.elements = tuple(elements)
        for element in self.elements:
            if not isinstance(element, Element):
                raise InvalidInputError(f"elements must be elements of circuits, got {element!r}")
        self._stamps, self._kinked = Stamps(), list[Element]()
        self._refuse_names_used_twice()
        self._stamp_all()
        self._refuse_missing_ground()
        self._refuse_loops()
        self._refuse_floating_nodes()
        self._refuse_lone_nodes()

    @property
    def unknowns(self) -> tuple[str, ...]:
        """The unknowns: V(node) of all nodes except ground, then the I(name) that are unknown."""
        return self._stamps.names

    def sweep(self, source: str) -> SourceSweep:
        """Return the system of all operating points, with the value of a source as parameter.

        Raises
        ------
        UnknownNameError
            If there is no such source.
        """
        sources = {e.name: e.value for e in self.elements if isinstance(e, Source)}
        if source not in sources:
            there = ", ".join(sources) or "none"
            raise UnknownNameError(f"no source is called {source!r}; the sources are: {there}")
        others = {name: value for name, value in sources.items() if name != source}
        return SourceSweep(self._kinked, self._stamps, others, self._is_unique)

    def __repr__(self) -> str:
        number, nodes = len(self.elements), len(self._stamps.nodes)
        return f"Circuit({counted(number, 'element')}, {counted(nodes, 'node')} beside ground)"

    def _stamp_all(self) -> None:
        for element in self.elements:
            known = len(self._stamps.curves)
            element.stamp(self._stamps)
            self._kinked += [element] * (len(self._stamps.curves) - known)

    @property
    def _is_unique(self) -> bool:
        """Whether two operating points would contradict Tellegen's theorem.

        In a circuit of sources and monotone elements with two ends, products of the differences of
        voltages and currents of two operating points are nowhere negative, and sum to zero (Duffin,
        *Nonlinear networks IIa*, Bulletin of the AMS 53, 1947): all products are zero, and with
        them the differences of voltages along every way of strictly monotone elements and voltage
        sources.
        """
        stiff = Joined(self._stamps.stiff)
        return self._stamps.is_monotone and stiff.are(GROUND, *self._stamps.nodes)

    def _refuse_names_used_twice(self) -> None:
        for name, times in Counter(element.name for element in self.elements).items():
            if times > 1:
                raise InvalidInputError(f"the name {name} is used {times} times")

    def _refuse_missing_ground(self) -> None:
        if not self.elements:
            raise InvalidInputError("a circuit needs elements, and there are none")
        if not self._stamps.has_ground:
            raise InvalidInputError(f"no element is connected to ground, node {GROUND!r}")

    def _refuse_loops(self) -> None:
        joined = Joined()
        for name, plus, minus in self._stamps.fixed:
            if not joined.join(plus, minus):
                others = [n for n, *ends in self._stamps.fixed if joined.are(plus, *ends)]
                raise InvalidInputError(
                    f"{name} closes a loop of given voltages, among {', '.join(others)}: "
                    "put a resistor into it"
                )

    def _refuse_floating_nodes(self) -> None:
        joined = Joined(self._stamps.paths)
        floating = [node for node in self._stamps.nodes if not joined.are(GROUND, node)]
        if floating:
            raise InvalidInputError(
                f"{counted(len(floating), 'node')} ({', '.join(floating)}) without a way for "
                "current to ground: current sources, gates and inputs of op-amps are none"
            )

    def _refuse_lone_nodes(self) -> None:
        """Refuse a node of a single element, except a node whose voltage is given."""
        users = [(node, element.name) for element in self.elements for node in _nodes(element)]
        times = Counter(node for node, _ in users)
        given = {node for _, *ends in self._stamps.fixed for node in ends}
        for node, name in users:
            if times[node] == 1 and node not in given:
                raise InvalidInputError(
                    f"node {node!r} is at {name} alone, which has an end in the air: "
                    "is the name of the node right?"
                )


def _nodes(element: Element) -> Iterable[str]:
    """Return the nodes of an element except ground, each once."""
    alone = Stamps()
    element.stamp(alone)
    return alone.nodes
