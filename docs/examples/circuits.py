r"""
Operating points of circuits
============================

A circuit may be at rest in several ways under the same supply: that is what latches, Schmitt
triggers and memory cells are made of. :mod:`pwscont_circuits` finds all these operating points
while the value of one source varies, and the transfer characteristic with its hysteresis. Diodes,
transistors, MOSFET switches and op-amps have characteristics of straight pieces, so that every
answer is exact and, for circuits of moderate size, complete.

The equations are those of modified nodal analysis (Ho, Ruehli and Brennan 1975): the currents that
leave a node sum to zero, and each voltage source and each nonlinear element adds a current and its
law. A characteristic changes its slope at *knots*; on which side of each knot an element is, its
state, makes the cells.
"""

# %%
# A tunnel diode behind a resistor
# --------------------------------
#
# Its current grows up to the peak, falls up to the valley, and grows again. The elements meet where
# their nodes have the same name; node ``"0"`` is ground.
import matplotlib.pyplot as plt
from pwscont_circuits import (
    Circuit,
    OpAmp,
    Resistor,
    TunnelDiode,
    VoltageSource,
    parse_netlist,
)
from pwscont_circuits.scenes import chua, diode_ladder, netlist

from pwscont import InvalidInputError, explore, plot

circuit = Circuit(
    [
        VoltageSource("E", "in", "0", 0.0),
        Resistor("R", "in", "d", 8.0),
        TunnelDiode(
            "D1",
            anode="d",
            cathode="0",
            peak_voltage=1.0,
            peak_current=1.0,
            valley_voltage=2.0,
            valley_current=0.5,
            resistance=1.0,
        ),
    ]
)
graph = explore(circuit.sweep("E"), (0.0, 12.0), parameter="E")
print(graph.guarantee)
for lo, hi, count in graph.multiplicity():
    print(f"{lo:g} < E < {hi:g}: {count}")
for point in graph.special_points("nonsmooth fold"):
    print(f"E = {point.alpha:g}: {point.message}")

# %%
# Between both folds there are three operating points, the one on the negative slope unstable. Going
# up and down with E, the circuit jumps at one fold and comes back at the other.
for solution in graph.solutions(7.5):
    print(f"V(d) = {solution['V(d)']:.4f}, I(D1) = {solution['I(D1)']:.4f}")

figure, axes = plt.subplots(1, 2, figsize=(9.0, 4.0), layout="constrained")
plot(graph, "V(d)", ax=axes[0])
plot(graph, "I(D1)", ax=axes[1])
axes[0].get_legend().remove()

# %%
# A Schmitt trigger
# -----------------
#
# Two transistors after Ebers and Moll, each junction in two pieces, share an emitter resistor. The
# circuit is given as a netlist in the notation of SPICE, with ``.model`` cards for the pieces and a
# ``.dc`` card for the sweep; :func:`~pwscont_circuits.parse_netlist` lists all elements and models.
read = parse_netlist("""Schmitt trigger
VCC cc 0 10
VIN in 0 0
RB  in b1 1k
RC1 cc c1 4k
RC2 cc out 1.5k
RE  e 0 500
R1  c1 b2 10k
R2  b2 0 10k
Q1  c1  b1 e T
Q2  out b2 e T
.model T NPN(af=0.99 ar=0.5 vf=0.6 vr=0.5 rf=20 rr=20)
.dc VIN 0 6
""")
source, *interval = read.sweep
trigger = explore(read.circuit.sweep(source), tuple(interval), parameter=source)
print(trigger.guarantee)
for point in trigger.special_points():
    print(f"{point.kind:<15} VIN = {point.alpha:.10f}  {point.message}")

figure, ax = plt.subplots(figsize=(6.5, 4.2), layout="constrained")
plot(trigger, "V(out)", ax=ax)

# %%
# Chua's circuit
# --------------
#
# At rest the inductor is a wire and the capacitors are gaps. What is left is a resistor and the
# diode of Chua, here made of two op-amps that saturate, with the values of M. P. Kennedy, *Robust
# op amp realization of Chua's circuit*, Frequenz 46 (1992). The slopes of his diode, -50/66 and
# -9/22 mA/V, and its three operating points without source follow from the op-amps:
attractor = chua().run()
inner, outer, knot = -50.0 / 66e3, -9.0 / 22e3, 8.3 * 3.3 / 25.3
print(f"closed form: {(outer - inner) * knot / (1.0 / 1800.0 + outer):.4f} V")
for solution in attractor.solutions(0.0):
    print(f"V(c1) = {solution['V(c1)']:+.4f} V: {attractor.system.label(solution.character)}")

figure, ax = plt.subplots(figsize=(6.5, 4.2), layout="constrained")
plot(attractor, "V(c1)", ax=ax)

# %%
# The outer two are the centres of the wings of the double scroll. (The small difference is the
# finite gain of the op-amps.)
#
# A ladder, and what uniqueness is worth
# --------------------------------------
#
# A circuit of sources, resistors and elements whose current never falls while voltage grows has one
# operating point at most: the products of the differences of voltage and current between two
# operating points would be nowhere negative and sum to zero (Duffin 1947). Such a circuit says so
# (``unique``), and one branch from end to end is then everything, however many diodes there are.
ladder = diode_ladder(sections=50, rise=0.002).run()
print(ladder.guarantee, len(ladder.pieces), "pieces")
print([point.message for point in ladder.special_points("transition")])

# %%
# With equal thresholds all fifty diodes turn on at once: one corner at which fifty test functions
# vanish. (From the eleventh diode on, the excess over the threshold is below the rounding errors of
# the voltage itself; the corner is then called degenerate.)
print([(point.kind, point.alpha) for point in diode_ladder(sections=50).run().special_points()])

# %%
# MOSFET switches
# ---------------
#
# From the command line ``pwscont run netlist -s file=my.cir -o out`` sweeps a netlist in a file;
# without a file, a CMOS inverter.
inverter = netlist().run()
figure, ax = plt.subplots(figsize=(6.5, 4.2), layout="constrained")
plot(inverter, "V(out)", ax=ax)

# %%
# What is wrong with a circuit
# ----------------------------
#
# Names used twice, nodes without a way for current to ground, loops of voltage sources, an
# end in the air and impossible values are refused; in a netlist the line is named.
E, R = VoltageSource("E", "in", "0", 1.0), Resistor("R", "in", "a", 2.0)
wrong = [
    lambda: Circuit([E, R]),
    lambda: Circuit([E, VoltageSource("E2", "in", "0", 2.0)]),
    lambda: Circuit([E, R, OpAmp("X", "b", "a", "a")]),
    lambda: parse_netlist("a title\nV1 a 0 1\nL1 a 0 1m"),
    lambda: parse_netlist("a title\nV1 a 0 1\nR1 a 0 -1k"),
]
for make in wrong:
    try:
        make()
    except InvalidInputError as error:
        print(error)
