"""Operating points of piecewise-linear circuits, a plug-in of pwscont."""

from pwscont_circuits.circuit import Circuit
from pwscont_circuits.elements import (
    BipolarTransistor,
    CurrentSource,
    Diode,
    Element,
    MosfetSwitch,
    NonlinearResistor,
    OpAmp,
    Resistor,
    TunnelDiode,
    VoltageSource,
)
from pwscont_circuits.netlist import Netlist, parse_netlist, read_netlist
from pwscont_circuits.polyline import Polyline
from pwscont_circuits.stamps import Stamps
from pwscont_circuits.sweep import SourceSweep

__all__ = [
    "BipolarTransistor",
    "Circuit",
    "CurrentSource",
    "Diode",
    "Element",
    "MosfetSwitch",
    "Netlist",
    "NonlinearResistor",
    "OpAmp",
    "Polyline",
    "Resistor",
    "SourceSweep",
    "Stamps",
    "TunnelDiode",
    "VoltageSource",
    "parse_netlist",
    "read_netlist",
]
