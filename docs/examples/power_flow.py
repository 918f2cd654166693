r"""
Power flow with reactive limits
===============================

How much load can a network carry? While the loading :math:`\lambda` grows, voltages sink, and at
the *nose* of the curve the last two solutions meet. On the way generators reach the limits of their
reactive power, and give up their voltages: the curve has a kink, and may turn right there. This
page follows nose curves through such limits, and the place where limit and nose meet.
"""

# %%
# A network
# ---------
#
# Three buses in a ring, all per unit: a slack, a generator that holds 1.02 with at most
# 0.8 of reactive power, and a load :math:`\lambda (1 + 0.35j)`.
import matplotlib.pyplot as plt
import numpy as np
from pwscont_power import Branch, Generator, Network, PowerFlow
from pwscont_power.networks import ieee14, ieee118
from pwscont_power.scenes import three_bus_limits

from pwscont import plot, trace


def three_bus(Q_max):
    network = Network(
        buses=(1, 2, 3),
        branches=(Branch(1, 2, 0.02, 0.2), Branch(2, 3, 0.02, 0.15), Branch(1, 3, 0.04, 0.4)),
        generators=(Generator(1, 1.03), Generator(2, 1.02, Q_min=-0.2, Q_max=Q_max)),
        slack=1,
        load=[0, 0, 1 + 0.35j],
        generation=[0, 0.4, 0],
    )
    return PowerFlow(network, growing=-network.load, fixed=network.generation)


system = three_bus(0.8)
print(system.names())

# %%
# What the network takes equals what is injected, at every bus but the slack,
#
# .. math:: V_i e^{j\theta_i} \overline{\textstyle\sum_k Y_{ik} V_k e^{j\theta_k}}
#           = S_i + \lambda S'_i + j Q_i ,
#
# and at a generator either the voltage is held, or :math:`Q` is at a limit, with the voltage below
# (at :math:`Q_{max}`) or above (at :math:`Q_{min}`) the one to hold: a mixed complementarity
# problem.
#
# The nose curve
# --------------
#
# A flat start, equal voltages and no angles, is good enough to find the upper branch.
flat = [0, 0, 1, 1, 0]  # two angles, two voltages, one reactive power, in the order of names()
graph = trace(system, (flat, 0.2), (0.2, 3.2), parameter="lambda")
for point in graph.special_points():
    print(f"{point.kind:11} lambda = {point.alpha:.9f}  V3 = {point['V3']:.6f}  {point.message}")

# %%
# Solid is the branch on which the network works: the generator reaches its limit, the curve gets
# a kink, and turns at the nose. Below the nose there are two solutions, beyond it none.
figure = plot(graph, "V3").figure

# %%
# The lower branch goes on towards a short circuit at the load, :math:`V_3 = 0` at
# :math:`\lambda = 0`. There the *model* ends, not the search: at :math:`V_3 = 0` any angle solves
# the equations. A branch is ended, in words, where a voltage falls to a thousandth:
lower = trace(system, (flat, 0.0), (0.0, 3.2)).special_points("end")
print([point.message for point in lower])

# %%
# Where limit and nose meet
# -------------------------
#
# With more reactive power the limit moves up along the curve, and the nose, too, but more slowly.
# At :math:`Q_{max} = 2.6` the limit itself turns the curve, a *limit-induced* bifurcation: just
# before, a power flow shows a healthy network.
(turned,) = trace(three_bus(2.6), (flat, 0.2), (0.2, 3.2)).special_points("nonsmooth fold")
print(f"{turned.kind} at lambda = {turned.alpha:.6f}: {turned.message}")

# %%
# Both are loci in the plane of :math:`\lambda` and :math:`Q_{max}`, followed by
# :class:`~pwscont.TransitionLocus` and :class:`~pwscont.FoldLocus`. The nose ends where it reaches
# the limit; from there to the nose of a generator without limit, the two are one.
answer = three_bus_limits().solve((), lambda pieces, value: None)
for loading, limit in answer.loci.meetings:
    print(f"they meet at Q_max = {limit:.5f}, lambda = {loading:.5f}")

# %%
figure, ax = plt.subplots(figsize=(6.5, 4.5), layout="constrained")
colors = {"nose": "#D55E00", "limit and nose at once": "#CC79A7"}
for part in answer.loci.parts:
    color = colors.get(str(part.crossing), "0.3")
    ax.plot(*part.plane.T, color=color, linewidth=2.4 if color != "0.3" else 1.1)
ax.plot(*answer.loci.meetings.T, "ko")
ax.text(1.1, 0.55, "limit", ha="right")
ax.text(2.55, 1.2, "nose", color=colors["nose"])
ax.text(2.9, 2.75, "both at once", color=colors["limit and nose at once"], ha="right")
ax.set(xlabel="$λ$", ylabel="Q max", xlim=(0.2, 3.2), ylim=(0.0, 4.0))

# %%
# A test case
# -----------
#
# The IEEE 14-bus case, loads and generation scaled together. :func:`~pwscont_power.from_matpower`
# reads it from a MATPOWER file, :func:`~pwscont_power.from_pandapower` would take a pandapower net.
# A file may convert its own units, ohm and kW as case33bw does; a statement that is not understood
# is refused by its line. The start has the voltages that the generators hold.
network = ieee14()
system = PowerFlow(network)
graph = trace(system, (system.start(), 0.3), (0.3, 2.0), parameter="lambda")
for point in graph.special_points():
    print(f"{point.kind:11} lambda = {point.alpha:.6f}  {point.message}")

# %%
# pandapower, asked for a power flow with limits enforced, returns the same voltages at all loadings
# that were compared, 0.4 to 1.74 (differences below 1e-10). Two solutions remain below the nose:
for solution in graph.solutions(1.0):
    voltages = np.abs(system.voltages(solution.z))
    print(f"lowest voltage {voltages.min():.4f}, {solution.label}")

# %%
figure = plot(graph, "V14").figure

# %%
# With 118 buses and 54 generators the curve has 96 kinks. The largest load is where generator 10
# meets its limit, a non-smooth fold: no derivative vanishes there, and no step across it says so.
system = PowerFlow(ieee118())
graph = trace(system, (system.start(), 0.3), (0.3, 2.3), parameter="lambda")
(fold,) = graph.special_points("nonsmooth fold")
print(f"{len(graph.pieces)} pieces; {fold.message} at lambda = {fold.alpha:.6f}")

# %%
# At 14 of 17 loadings from 0.4 to 2.08 the voltages are those of pandapower (differences below
# 1e-9). At the others, 0.4, 0.5 and 1.1, pandapower leaves a generator at a limit whose voltage is
# on the wrong side of the one to hold: it enforces limits in turn, and never gives a voltage back.
#
# From the command line, with a search for further solutions beside the curve::
#
#     pwscont run three-bus -s Q_max=1.2 -o out
#     pwscont run three-bus-limits -o out
#     pwscont run ieee14 --at 1.0 1.5 -o out
#     pwscont run ieee118 -o out
#
# What is promised: nothing about completeness. Power flows may have more solutions than two, and
# Newton's method from many starts may miss some; the run says so.
