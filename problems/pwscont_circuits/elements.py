"""The elements of circuits, with characteristics in straight pieces.

Voltages are in volts, currents in amperes and resistances in ohms, or in other consistent units.
Node ``0`` is ground.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, fields
from types import MappingProxyType
from typing import ClassVar, TypeAlias, final

from pwscont import InvalidInputError
from pwscont.extending import checked_kind, finite_array
from pwscont_circuits.polyline import Polyline
from pwscont_circuits.stamps import Stamps

#: Segments of all characteristics of an element -> the state, and the event of entering the state.
States: TypeAlias = Mapping[tuple[int, ...], tuple[str, str]]


@dataclass(frozen=True)
class Element(ABC):
    """A named element between named nodes; all numbers of an element must be finite.

    Raises
    ------
    InvalidInputError
        If the name is no text, or a number is not finite or has the wrong sign.

    Examples
    --------
    >>> from pwscont_circuits import Element, Resistor
    >>> isinstance(Resistor("R", "in", "out", 100.0), Element)
    True
    """

    name: str
    #: The fields that must be positive, and the fields that must not be negative.
    positive: ClassVar[tuple[str, ...]] = ()
    not_negative: ClassVar[tuple[str, ...]] = ()
    states: ClassVar[States] = MappingProxyType({})

    def __post_init__(self) -> None:
        """Check the numbers."""
        if not self.name or not isinstance(self.name, str):
            raise InvalidInputError(f"the name of an element must be a text, got {self.name!r}")
        declared = {field.name: field.type for field in fields(self)}
        for field, value in vars(self).items():
            if declared.get(field) == "Polyline":
                checked_kind(f"{field} of {self.name}", value, Polyline, is_needed=True)
            if declared.get(field) == "str" and not isinstance(value, str):
                self._refuse(f"{field} must be a text, got {value!r}; ground is the node '0'")
            is_number = field in (*self.positive, *self.not_negative)
            is_number = is_number or declared.get(field) == "float"
            if is_number or not isinstance(value, str | Polyline):
                finite_array(f"{field} of {self.name}", value, ())
            if field in self.positive and not value > 0.0:
                self._refuse(f"{field} must be positive, got {value:g}")
            if field in self.not_negative and not value >= 0.0:
                self._refuse(f"{field} must not be negative, got {value:g}")

    def _refuse(self, what: str) -> None:
        raise InvalidInputError(f"{self.name}: {what}")

    def _check_kind(self, straight: str, reverse: str) -> None:
        if (kind := vars(self)["kind"]) not in (straight, reverse):
            self._refuse(f"kind must be {straight!r} or {reverse!r}, got {kind!r}")

    @abstractmethod
    def stamp(self, stamps: Stamps) -> None:
        """Add the equations of the element to the equations of a circuit."""

    def state(self, segments: tuple[int, ...]) -> tuple[str, str]:
        """Return the state of the element in words, and the event of entering that state."""
        return self.states[segments]


@final
@dataclass(frozen=True)
class Resistor(Element):
    """A linear resistor.

    Examples
    --------
    >>> from pwscont_circuits import Resistor
    >>> Resistor("R", "in", "out", 100.0).resistance
    100.0
    """

    plus: str
    minus: str
    resistance: float
    positive: ClassVar = ("resistance",)

    def stamp(self, stamps: Stamps) -> None:
        """Add v = resistance i."""
        stamps.resistor(self.plus, self.minus, self.resistance)


@dataclass(frozen=True)
class Source(Element):
    """A source whose value may be swept."""

    plus: str
    minus: str
    value: float


@final
class VoltageSource(Source):
    """A source of the voltage V(plus) - V(minus) = value.

    Examples
    --------
    >>> from pwscont_circuits import VoltageSource
    >>> VoltageSource("E", "in", "0", 5.0).value
    5.0
    """

    def stamp(self, stamps: Stamps) -> None:
        """Add the voltage."""
        stamps.voltage_source(self.name, self.plus, self.minus)


@final
class CurrentSource(Source):
    """A source of a current that flows from plus through the source to minus, as in SPICE.

    Examples
    --------
    >>> from pwscont_circuits import CurrentSource
    >>> CurrentSource("J", "0", "out", 1e-3).value
    0.001
    """

    def stamp(self, stamps: Stamps) -> None:
        """Add the current."""
        stamps.current_source(self.name, self.plus, self.minus)


@final
@dataclass(frozen=True)
class NonlinearResistor(Element):
    """Any polyline as the current of a voltage; slopes may be negative.

    Examples
    --------
    >>> from pwscont_circuits import NonlinearResistor, Polyline
    >>> NonlinearResistor("N", "a", "0", Polyline([1.0], [1.0, -0.5])).name
    'N'
    """

    plus: str
    minus: str
    characteristic: Polyline

    def stamp(self, stamps: Stamps) -> None:
        """Add i = characteristic(v)."""
        stamps.nonlinear_resistor(self.name, self.plus, self.minus, self.characteristic)

    def state(self, segments: tuple[int, ...]) -> tuple[str, str]:
        """Return the number of the segment, from the left."""
        return f"on segment {segments[0] + 1}", f"enters segment {segments[0] + 1}"


@final
@dataclass(frozen=True)
class Diode(Element):
    """A diode: beyond the threshold current grows by the resistance, below by the leakage.

    Attributes
    ----------
    anode, cathode : str
    threshold : float
        The voltage at which the diode turns on.
    resistance : float
        The slope dv/di of a diode that is on.
    leakage : float
        The slope di/dv of a diode that is off.

    Examples
    --------
    >>> from pwscont_circuits import Diode
    >>> Diode("D", "out", "0").threshold
    0.6
    """

    anode: str
    cathode: str
    threshold: float = 0.6
    resistance: float = 0.05
    leakage: float = 0.0
    positive: ClassVar = ("resistance",)
    not_negative: ClassVar = ("leakage",)
    states: ClassVar = {(0,): ("off", "turns off"), (1,): ("on", "turns on")}

    def stamp(self, stamps: Stamps) -> None:
        """Add the current and its characteristic."""
        slopes = self.leakage, 1.0 / self.resistance
        curve = Polyline([self.threshold], slopes, self.leakage * self.threshold)
        stamps.nonlinear_resistor(self.name, self.anode, self.cathode, curve)


@final
@dataclass(frozen=True)
class TunnelDiode(Element):
    """A tunnel diode: current grows from zero to a peak, falls to a valley, and grows again.

    Attributes
    ----------
    anode, cathode : str
    peak_voltage, peak_current, valley_voltage, valley_current : float
    resistance : float
        The slope dv/di beyond the valley.

    Examples
    --------
    >>> from pwscont import explore
    >>> from pwscont_circuits import Circuit, Resistor, TunnelDiode, VoltageSource
    >>> diode = TunnelDiode("D", "d", "0", 1.0, 1.0, 2.0, 0.5, resistance=1.0)
    >>> elements = [VoltageSource("E", "in", "0", 0.0), Resistor("R", "in", "d", 8.0), diode]
    >>> explore(Circuit(elements).sweep("E"), (0.0, 12.0), parameter="E").count(7.5)
    3
    """

    anode: str
    cathode: str
    peak_voltage: float = 0.065
    peak_current: float = 1e-3
    valley_voltage: float = 0.35
    valley_current: float = 1e-4
    resistance: float = 150.0
    positive: ClassVar = ("peak_voltage", "peak_current", "valley_voltage", "resistance")
    states: ClassVar = {
        (0,): ("below peak", "falls below its peak"),
        (1,): ("on negative slope", "enters its negative slope"),
        (2,): ("above valley", "rises above its valley"),
    }

    def __post_init__(self) -> None:
        """Refuse a valley that does not lie beyond and below the peak."""
        super().__post_init__()
        if not self.valley_voltage > self.peak_voltage:
            self._refuse("valley_voltage must be above peak_voltage")
        if not self.valley_current < self.peak_current:
            self._refuse("valley_current must be below peak_current")

    def stamp(self, stamps: Stamps) -> None:
        """Add the current and its characteristic."""
        fall = self.valley_current - self.peak_current
        slopes = (
            self.peak_current / self.peak_voltage,
            fall / (self.valley_voltage - self.peak_voltage),
            1.0 / self.resistance,
        )
        knots = self.peak_voltage, self.valley_voltage
        curve = Polyline(knots, slopes, self.peak_current)
        stamps.nonlinear_resistor(self.name, self.anode, self.cathode, curve)


@final
@dataclass(frozen=True)
class BipolarTransistor(Element):
    """A bipolar transistor after Ebers and Moll, with junctions in two straight pieces each.

    The junctions carry i_F = max(0, (v_BE - forward_threshold) / forward_resistance) and i_R, the
    same of v_BC. The collector takes i_C = forward_alpha i_F - i_R, the emitter gives
    i_E = i_F - reverse_alpha i_R (Ebers and Moll, *Large-signal behavior of junction transistors*,
    Proceedings of the IRE 42, 1954). A PNP transistor has all voltages and currents reversed.

    Raises
    ------
    InvalidInputError
        If ``kind`` is another word, a gain is 1 or more, or as for Element.

    Examples
    --------
    >>> from pwscont_circuits import BipolarTransistor
    >>> BipolarTransistor("Q1", "c", "b", "e", kind="pnp").kind
    'pnp'
    """

    collector: str
    base: str
    emitter: str
    kind: str = "npn"
    forward_alpha: float = 0.99
    reverse_alpha: float = 0.5
    forward_threshold: float = 0.6
    reverse_threshold: float = 0.5
    forward_resistance: float = 20.0
    reverse_resistance: float = 20.0
    positive: ClassVar = ("forward_resistance", "reverse_resistance")
    not_negative: ClassVar = ("forward_alpha", "reverse_alpha")
    states: ClassVar = {
        (0, 0): ("off", "turns off"),
        (1, 0): ("active", "becomes active"),
        (1, 1): ("saturated", "saturates"),
        (0, 1): ("reverse active", "becomes reverse active"),
    }

    def __post_init__(self) -> None:
        """Refuse gains of 1 and more."""
        super().__post_init__()
        self._check_kind("npn", "pnp")
        if max(self.forward_alpha, self.reverse_alpha) >= 1.0:
            self._refuse("forward_alpha and reverse_alpha must be below one")

    def stamp(self, stamps: Stamps) -> None:
        """Add the currents of the two junctions."""
        c, b, e = self.collector, self.base, self.emitter
        sign, f, r = 1.0 if self.kind == "npn" else -1.0, self.forward_alpha, self.reverse_alpha
        forward = Polyline([self.forward_threshold], (0.0, 1.0 / self.forward_resistance))
        reverse = Polyline([self.reverse_threshold], (0.0, 1.0 / self.reverse_resistance))
        into_emitter = [(c, sign * f), (b, sign * (1.0 - f)), (e, -sign)]
        into_collector = [(e, sign * r), (b, sign * (1.0 - r)), (c, -sign)]
        stamps.junction(f"{self.name}.F", into_emitter, [(b, sign), (e, -sign)], forward)
        stamps.junction(f"{self.name}.R", into_collector, [(b, sign), (c, -sign)], reverse)


@final
@dataclass(frozen=True)
class MosfetSwitch(Element):
    """A MOSFET as a switch, alike seen from drain and source.

    The current is i_D = g (max(0, v_GS - threshold) - max(0, v_GD - threshold)) with
    g = 1 / resistance: a resistor where drain and source conduct (on), a constant current where a
    single end conducts (saturated), no current where no end conducts (off). The gate takes no
    current. In a PMOS switch all voltages and currents are reversed.

    Raises
    ------
    InvalidInputError
        If ``kind`` is neither "nmos" nor "pmos", or as for Element.

    Examples
    --------
    >>> from pwscont_circuits import MosfetSwitch
    >>> MosfetSwitch("M1", "out", "in", "0").threshold
    1.0
    """

    drain: str
    gate: str
    source: str
    kind: str = "nmos"
    threshold: float = 1.0
    resistance: float = 10.0
    positive: ClassVar = ("resistance",)
    states: ClassVar = {
        (0, 0): ("off", "turns off"),
        (1, 0): ("saturated", "saturates"),
        (1, 1): ("on", "turns on"),
        (0, 1): ("saturated in reverse", "saturates in reverse"),
    }

    def __post_init__(self) -> None:
        """Refuse other kinds."""
        super().__post_init__()
        self._check_kind("nmos", "pmos")

    def stamp(self, stamps: Stamps) -> None:
        """Add the forward and the reverse part of the current."""
        d, g, s = self.drain, self.gate, self.source
        sign = 1.0 if self.kind == "nmos" else -1.0
        curve = Polyline([self.threshold], (0.0, 1.0 / self.resistance))
        stamps.junction(f"{self.name}.F", [(d, sign), (s, -sign)], [(g, sign), (s, -sign)], curve)
        stamps.junction(f"{self.name}.R", [(s, sign), (d, -sign)], [(g, sign), (d, -sign)], curve)


@final
@dataclass(frozen=True)
class OpAmp(Element):
    """An operational amplifier that saturates: V(out) = clip(gain (V(plus) - V(minus)), low, high).

    The inputs take no current; the output gives any current.

    Examples
    --------
    >>> from pwscont_circuits import OpAmp
    >>> OpAmp("X1", "in", "out", "out", low=-5.0, high=5.0).gain
    100000.0
    """

    plus: str
    minus: str
    out: str
    gain: float = 1e5
    low: float = -10.0
    high: float = 10.0
    positive: ClassVar = ("gain",)
    states: ClassVar = {
        (0,): ("at low rail", "reaches its low rail"),
        (1,): ("linear", "leaves its rail"),
        (2,): ("at high rail", "reaches its high rail"),
    }

    def __post_init__(self) -> None:
        """Refuse rails in the wrong order."""
        super().__post_init__()
        if not self.low < self.high:
            self._refuse(f"low must be below high, got {self.low:g} and {self.high:g}")

    def stamp(self, stamps: Stamps) -> None:
        """Add the voltage and the current of the output."""
        knots = self.low / self.gain, self.high / self.gain
        curve = Polyline(knots, (0.0, self.gain, 0.0), self.low)
        control = [(self.plus, 1.0), (self.minus, -1.0)]
        stamps.voltage_of(self.name, self.out, control, curve)
