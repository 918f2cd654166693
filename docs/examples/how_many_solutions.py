r"""
How many solutions?
===================

With large friction a body may have several states of rest under the same load. This page counts
them: under one load, over a whole interval of loads, and right beside a fold. And it asks how
much such a count is worth, because a search that stops looking always finds that nothing is
missing.
"""

# %%
# A body with two contact nodes
# -----------------------------
#
# The chain of Janovský and Ligurský (2012) touches the floor with two nodes. Each node is pressed
# against the floor with 1; the first is pulled sideways with :math:`\alpha`, the second with
# :math:`2\alpha`. The coefficient of friction is :math:`F = 4`.
import matplotlib.pyplot as plt
import numpy as np
from pwscont_coulomb import AffineLoad, ContactBody, CoulombLoad, FromFrictionless

from pwscont import (
    AllTransitions,
    EndPoints,
    MultiStart,
    PiecewiseLinearSystem,
    Slices,
    draw_counts,
    enumerate_solutions,
    explore,
    plot,
)

body = ContactBody(
    [[1.0, -1.0, 0.0, 0.0], [-1.0, 2.0, -1.0, 0.0], [0.0, -1.0, 2.0, -1.0], [0.0, 0.0, -1.0, 2.0]],
    N=[[1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]],
    T=[[0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]],
)
load = AffineLoad(f0=[1.0, 0.0, 1.0, 0.0], f1=[0.0, 1.0, 0.0, 2.0])
system = CoulombLoad(body, load, friction=4.0)

# %%
# Under one load
# --------------
#
# At fixed :math:`\alpha` the problem is piecewise linear in :math:`z`. Each node is in one of four
# modes, so there are :math:`4^2` linear systems, and a solution counts if it lies in the cell of
# its modes. :func:`~pwscont.enumerate_solutions` lists all of them. For more nodes it searches
# the tree of modes and cuts off what no state can satisfy: seven nodes have :math:`4^7`
# combinations and take a twentieth of a second, twelve take 2 to 7 s. No start and no
# continuation is involved.
for solution in enumerate_solutions(system, -1.5):
    print(f"det {solution.det_sign:+d}  {solution.label:<31}", solution.z[:4].round(4))

# %%
# The signs of :math:`\det(\partial H/\partial z)` sum to +1: fact F4 of :doc:`/theory`.
#
# Beside a fold
# -------------
#
# Where both nodes stick, the floor bears the loads directly: :math:`\lambda_\nu = -1` and
# :math:`\lambda_t = -\alpha,\ -2\alpha`. The second node holds as long as
# :math:`|2\alpha| \le F`, so at :math:`\alpha = -2` something ends. Look closely:
for distance in (-1e-12, 0.0, 1e-12):
    found = enumerate_solutions(system, -2.0 + distance)
    kinds = [str(solution.kind) for solution in found if solution.kind]
    print(f"alpha = -2 {distance:+g}: {len(found)} solutions", *kinds)

# %%
# Three, four, five: two solutions are born at the fold. At the fold itself the two are one
# solution, which is counted once. Its ``det_sign`` is 0, the sum of the two signs.
#
# How close to a fold may :math:`\alpha` come? Each candidate is refined on the full system, and
# the signs of its tests decide to within the rounding of their own terms. There is no fixed
# tolerance, so what holds here holds in other units, too.
#
# Under all loads
# ---------------
#
# :func:`~pwscont.explore` gives the number over an interval.
graph = explore(system, (-4.0, 3.0))
print(graph)

# %%
# The entries of ``multiplicity`` are triples that know whether their number holds at both of
# their ends. ``with_count`` asks the other way round: where are there exactly this many?
for stretch in graph.multiplicity():
    print(f"{stretch.ends:<13} {stretch[2]}")
for number in (2, 4, 5):
    print(f"exactly {number} on", *(stretch.ends for stretch in graph.with_count(number)))

# %%
# Even numbers occur at single values of alpha only: at folds.
#
# All five solutions lie on one curve. ``path`` tells the way from one to another: what the body
# goes through from "both nodes hang free" to "both nodes stick", if alpha is steered along the
# curve.
free, *_, stuck = graph.solutions(-1.5)
for piece in graph.path(free, stuck):
    lo, hi = piece.interval
    print(f"det {piece.det_sign:+d}  {piece.label:<31} {lo:g} < alpha < {hi:g}")

# %%
# Did we find all of them?
# ------------------------
#
# In the short interval below, the five solutions lie on five separate lines, so that a search has
# to find each of them. The table compares what searches find with what they promise.
short = (-1.9, -1.3)
searches = {
    "AllTransitions()": AllTransitions(),
    "EndPoints()": EndPoints(),
    "Slices((-1.5,))": Slices((-1.5,)),
    "MultiStart()": MultiStart(),
    "FromFrictionless()": FromFrictionless(),
}
for name, search in searches.items():
    part = explore(system, short, search=search)
    print(f"{name:<19} {part.count(-1.5)} found, balance {part.balance(-1.5):+d}: {part.guarantee}")

# %%
# From the strongest promise to none:
#
# * :class:`~pwscont.AllTransitions` lists every point at which any node changes its mode, in the
#   whole interval, and all solutions at its lower end. On straight pieces this leaves nothing
#   out: *complete*. The default for small piecewise-linear systems.
# * :class:`~pwscont.EndPoints` lists all solutions at both ends. Every branch but a closed loop
#   reaches an end (fact F5): *complete but for closed loops*. The default for larger
#   systems that are affine in :math:`z`, such as curved load paths or a varying :math:`F`.
# * :class:`~pwscont.Slices` looks at the values of alpha that you name. What passes between the
#   slices is missed, so slices promise nothing.
# * :class:`~pwscont.MultiStart` runs Newton from random starts and divides out what was found.
#   ``FromFrictionless`` follows the only solution at :math:`F = 0` up to the :math:`F` asked for.
#   The last two searches work for any size and promise nothing; the default for large systems adds
#   them up.
#
# If a search promises nothing, paths that leave the interval are followed a little further. So the
# one solution from :math:`F = 0` became two: its path leaves at -1.3, turns at the fold at -1.2 and
# comes back. The other three lie farther along the curve, and were not reached.
#
# Then the balance is left as a check. The balance may tell that a branch is missing, as here. The
# balance cannot tell that nothing is missing: a single solution of sign +1 has the right sum as
# well, and the four other solutions here cancel. Then the graph says "balanced", and means no
# more.
#
# ``graph.searched`` keeps the words and the promise of the search, and is saved with the graph.
print(graph.searched.what, "->", graph.guarantee)


# %%
# A closed loop
# -------------
#
# Here is a system in which an end of the interval does not tell all. Its solutions are the curve
# :math:`|z| + |\alpha| = 1` and, beside it, :math:`z = 3 + |\alpha|`:
class LoopBesideLine(PiecewiseLinearSystem):
    """H = 1 - |z| - |alpha| + 2 max(z - 2, 0)."""

    size = 1
    degree = 1  # H goes from -infinity to +infinity with z

    def test_functions(self, z, alpha):
        return np.array([z[0], alpha, z[0] - 2.0])

    def residual(self, z, alpha, character):
        right, later, above = character.signs
        z_size = z if right else -z
        alpha_size = alpha if later else -alpha
        return 1.0 - z_size - alpha_size + (2.0 * (z - 2.0) if above else 0.0)

    def describe(self, character):
        return "line" if character.signs[2] else "loop"


loop_system = LoopBesideLine()
loop_searches = {
    "EndPoints()": EndPoints(),
    "EndPoints() + Slices((0.3,))": EndPoints() + Slices((0.3,)),
    "AllTransitions()": AllTransitions(),
}
for name, search in loop_searches.items():
    part = explore(loop_system, (-2.0, 2.0), search=search)
    print(f"{name:<29} {part.count(0.0)} at 0, balance {part.balance(0.3)}: {part.guarantee}")

# %%
# At :math:`\alpha = \pm 2` there is no trace of the loop, and the balance does not miss the loop
# either: the loop adds +1 - 1. Searches add up with ``+``; a slice through the loop finds the
# loop, if the user knows where to cut, and the promise stays the same. A closed polygon has
# corners, and corners are transitions: ``AllTransitions`` finds every loop of a piecewise-linear
# system.
loop_graph = explore(loop_system, (-2.0, 2.0))  # AllTransitions by default
print(len(loop_graph.components()), "components,", loop_graph.guarantee)

# %%
# No way leads from the line to the loop:
on_loop, on_line = sorted(loop_graph.solutions(0.5), key=lambda s: s.z[0])[1:]
print(on_loop.label, "to", on_line.label, loop_graph.path(on_loop, on_line))

# %%
# The picture
# -----------
#
# Above the branches, below what was counted: dots are the numbers at the folds themselves.
figure, axes = plt.subplots(
    2, 2, figsize=(9.5, 6.2), layout="constrained", sharex="col", height_ratios=(2, 1)
)
plot(graph, 3, ax=axes[0, 0])  # tangential displacement of the second node
plot(loop_graph, 0, ax=axes[0, 1])
handles = axes[0, 0].get_legend().legend_handles
axes[0, 0].get_legend().remove()
figure.legend(handles=handles, title="left", loc="outside lower center", ncols=3, fontsize="small")
axes[0, 0].set_title("two contact nodes", fontsize="medium")
axes[0, 1].set_title("a loop beside a line", fontsize="medium")
axes[0, 1].set_ylabel("$z$")

for ax, counted in zip(axes[1], (graph, loop_graph), strict=True):
    draw_counts(counted, ax)
    ax.set_ylim(0.0, 5.8)
    ax.set_xlabel("$α$")
for ax in axes[0]:
    ax.set_xlabel("")
