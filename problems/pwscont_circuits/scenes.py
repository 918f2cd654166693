"""Circuits as scenes, written as netlists."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from pwscont import InvalidInputError, Panel, Scene
from pwscont_circuits.elements import VoltageSource
from pwscont_circuits.netlist import Netlist, parse_netlist, read_netlist

#: The netlist that the scene ``netlist`` reads by default.
INVERTER = Path(__file__).parent / "inverter.cir"
#: Most sections of a ladder: 100,000 sections already take more than a minute.
MOST_SECTIONS = 100_000


def scene_of(name: str, netlist: Netlist, shown: Sequence[str], at: Sequence[float] = ()) -> Scene:
    """Return the sweep of a netlist as a scene that shows the given unknowns."""
    if netlist.sweep is None:
        raise InvalidInputError(f"scene {name}: the netlist needs a line .dc source from to")
    source, *between = netlist.sweep
    lo, hi = sorted(between)  # the branches are the same in either direction
    system = netlist.circuit.sweep(source)
    panels = tuple(Panel(unknown) for unknown in shown)
    return Scene(
        name, netlist.title, system, (lo, hi), parameter=source, at=tuple(at), panels=panels
    )


def tunnel_diode(resistance: float = 8.0) -> Scene:
    """Return a tunnel diode behind a resistor: three operating points between two folds."""
    netlist = f"""tunnel diode behind {resistance:g} ohms
        VE in 0 0
        R  in d {resistance}
        D1 d 0 TD
        .model TD TUNNEL(vp=1 ip=1 vv=2 iv=0.5 ron=1)
        .dc VE 0 12"""
    return scene_of("tunnel-diode", parse_netlist(netlist), ["V(d)", "I(D1)"], [7.5])


def schmitt_trigger(emitter: float = 500.0) -> Scene:
    """Return a Schmitt trigger of two transistors, whose common emitter resistor is a setting."""
    netlist = f"""Schmitt trigger of two transistors, emitter resistor of {emitter:g} ohms
        VCC cc 0 10
        VIN in 0 0
        RB  in b1 1k
        RC1 cc c1 4k
        RC2 cc out 1.5k
        RE  e 0 {emitter}
        R1  c1 b2 10k
        R2  b2 0 10k
        Q1  c1  b1 e T
        Q2  out b2 e T
        .model T NPN(af=0.99 ar=0.5 vf=0.6 vr=0.5 rf=20 rr=20)
        .dc VIN 0 6"""
    return scene_of("schmitt-trigger", parse_netlist(netlist), ["V(out)", "V(e)"], [2.0])


def chua(resistance: float = 1800.0, gain: float = 1e5) -> Scene:
    """Return Chua's circuit at rest, with a diode of two op-amps as in Kennedy (1992).

    At rest the inductor is a wire and the capacitors are gaps. A source E in series with the
    inductor moves the load line of the resistor.
    """
    netlist = f"""Chua's circuit at rest, resistor of {resistance:g} ohms
        VE coil 0 0          ; in series with the inductor
        R  coil c1 {resistance}
        R1 c1 o1 220         ; the first negative resistance
        R2 o1 m1 220
        R3 m1 0 2.2k
        X1 c1 m1 o1 A
        R4 c1 o2 22k         ; the second
        R5 o2 m2 22k
        R6 m2 0 3.3k
        X2 c1 m2 o2 A
        .model A OPAMP(gain={gain} low=-8.3 high=8.3)
        .dc VE -2 2"""
    return scene_of("chua", parse_netlist(netlist), ["V(c1)", "V(o2)"], [0.0])


def diode_ladder(sections: int = 10, rise: float = 0.0) -> Scene:
    """Return a ladder of series resistors and shunt diodes, with thresholds that grow by a rise.

    Without rise all diodes turn on at once.
    """
    if not 1 <= sections <= MOST_SECTIONS:
        raise InvalidInputError(f"sections must be from 1 to {MOST_SECTIONS}, got {sections}")
    lines = [f"ladder of {sections} diodes", "VE n0 0 0", ".dc VE 0 3"]
    for k in range(1, sections + 1):
        threshold = 0.6 + (k - 1) * rise
        lines += [f"R{k} n{k - 1} n{k} 1", f"D{k} n{k} 0 M{k}"]
        lines += [f".model M{k} D(von={threshold!r} ron=0.05)"]
    shown = ["V(n1)", f"V(n{sections})"] if sections > 1 else ["V(n1)"]
    return scene_of("diode-ladder", parse_netlist("\n".join(lines)), shown, [2.0])


def netlist(file: str = "inverter.cir") -> Scene:
    """Return the sweep of a netlist in a file; default a CMOS inverter that comes with the package.

    All voltages are shown except the voltages that sources give directly.
    """
    path = INVERTER if file == INVERTER.name and not Path(file).exists() else Path(file)
    read = read_netlist(path)
    given = {
        node
        for element in read.circuit.elements
        if isinstance(element, VoltageSource)
        for node in (element.plus, element.minus)
    }
    nodes = [name for name in read.circuit.unknowns if name.startswith("V(")]
    return scene_of("netlist", read, [name for name in nodes if name[2:-1] not in given] or nodes)
