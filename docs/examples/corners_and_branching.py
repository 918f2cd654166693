r"""
A symmetric body: corners and branching
=======================================

A body without load, and a body with identical nodes, have something in common: many things happen
at once. Several test functions vanish together, and it is no longer clear how many ways lead on,
let alone which. This page shows how all of them are found.
"""

# %%
# Starting from no load
# ---------------------
#
# One contact node with friction :math:`F = 4`. The load grows in proportion,
# :math:`f(\alpha) = \alpha\,(1, -3)`: the load presses the node against the floor and pulls
# sideways. Without load the body is in no definite mode: free, stick and slip hold at once, with
# zero forces. Every test function vanishes.
from itertools import product

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.lines import Line2D
from pwscont_coulomb import AffineLoad, ContactBody, CoulombLoad

from pwscont import EndPoints, enumerate_solutions, explore, trace


def identical_nodes(count):
    """Return a body of ``count`` equal, uncoupled parts with one contact node each."""
    each = np.eye(count)
    return ContactBody(
        np.kron(each, [[2.0, -1.0], [-1.0, 2.0]]),
        N=np.kron(each, [[1.0, 0.0]]),
        T=np.kron(each, [[0.0, 1.0]]),
    )


def from_no_load(count, direction):
    """Return the system whose nodes all carry alpha times ``direction``."""
    load = AffineLoad(f0=np.zeros(2 * count), f1=np.tile(direction, count))
    return CoulombLoad(identical_nodes(count), load, friction=4.0)


system = from_no_load(1, [1.0, -3.0])
print(system.test_functions(np.zeros(4), 0.0))

# %%
# Start there all the same:
one = trace(system, (np.zeros(4), 0.0), (-1.0, 1.0))
(unloaded,) = one.special_points("nonsmooth branch point")
print(unloaded.message)
for piece in one.pieces:
    print(f"det {piece.det_sign:+d}  {piece.label:<10}", piece.interval)

# %%
# Four pieces meet. Pulled one way the body has three states, pulled the other way it has one. All
# pieces are half-lines, because under a load twice as large everything is twice as large.
#
# How the ways on are found
# -------------------------
#
# At a simple transition one test function vanishes, two cells meet, and the way on is one linear
# solve (:doc:`paper_curve`). Where several tests vanish, all cells that meet at the point count.
# In each of them a direction :math:`d` leads on if :math:`J_\chi d = 0`, and if the derivatives
# of the vanishing test functions along :math:`d` have the signs of that cell. This is a
# piecewise-linear problem for :math:`d` (fact F8 of :doc:`/theory`), and it is solved by the same
# enumeration that lists solutions at one :math:`\alpha`. No direction is guessed, and none is
# left out.
#
# The node is then called by what was found: with two ways a *transition* or a *fold* if one node
# changes its mode, a *corner* if several do; with more than two, a *non-smooth branch point*.
#
# Identical nodes
# ---------------
#
# Take two such parts, or three, which know nothing of each other. A state of the whole is any
# combination of states of the parts: :math:`3^k` of them for :math:`\alpha > 0`, and the sign of
# the determinant of the whole is the product of the signs of the parts. The number of solutions
# is easy to predict, and the branches are hard to follow: at the unloaded body :math:`3^k + 1`
# pieces meet.
for count in (1, 2, 3):
    many = explore(from_no_load(count, [1.0, -3.0]), (-1.0, 1.0))
    (unloaded,) = many.special_points("nonsmooth branch point")
    pieces = many.nx.degree(unloaded.id)
    print(f"nodes: {count}, solutions: {many.count(1.0)}, pieces that meet: {pieces}")

# %%
# The balance is the product of balances: every part has +1, and so has the whole.
two = explore(from_no_load(2, [1.0, -3.0]), (-1.0, 1.0))
signs = [s.det_sign for s in enumerate_solutions(system, 1.0)]
print(sorted(a * b for a, b in product(signs, signs)))
print(sorted(s.det_sign for s in two.solutions(1.0)))

# %%
# Now press each node with 0.25 throughout and pull with :math:`\alpha`. This is the curve of
# :doc:`paper_curve`, whose folds at :math:`-1` and :math:`-1/2` enclose three solutions, twice.


def pressed(pulls):
    """Return the system whose nodes are pressed with 0.25 and pulled with alpha times a factor."""
    load = AffineLoad(
        f0=np.tile([0.25, 0.0], len(pulls)), f1=np.ravel([[0.0, pull] for pull in pulls])
    )
    return CoulombLoad(identical_nodes(len(pulls)), load, friction=4.0)


symmetric = explore(pressed([1.0, 1.0]), (-2.0, 2.0))
print(symmetric)
for point in symmetric.special_points():
    if point.kind not in ("start", "end"):
        print(f"alpha = {point.alpha:4.1f}  {point.kind}: {point.message}")

# %%
# Nine solutions between the folds, :math:`2^2 = 4` at either. Where both nodes are at their folds
# together, four pieces meet. Where one of the nodes is in its third state meanwhile, the fold stays
# simple. At :math:`\alpha = 1` both nodes begin to slip: a corner, with one way on.
print([symmetric.count(alpha) for alpha in (-1.5, -1.0, -0.75, -0.5, 1.5)])

# %%
# Break the symmetry
# ------------------
#
# Pull the second node by a fifth more. Nothing happens at the same time any more, and both branch
# points dissolve. What was one component falls into two, and one of them is a closed loop: it
# reaches no end of the interval. Complete solutions at both ends would not have shown it.
broken = explore(pressed([1.0, 1.2]), (-2.0, 2.0))
through, loop = broken.components()
print(f"{broken.guarantee}: {len(through)} pieces, and a loop of {len(loop)}")
at_ends = explore(pressed([1.0, 1.2]), (-2.0, 2.0), search=EndPoints())
print(f"{at_ends.guarantee}: at -0.75 {at_ends.count(-0.75)} of {broken.count(-0.75)} solutions")

# %%
# Along the boundary of a sector
# ------------------------------
#
# Under the load :math:`\alpha\,(1, 4)` the floor bears :math:`\lambda_\nu = -\alpha` and
# :math:`\lambda_t = -4\alpha`: the node sticks, but just so, since :math:`F = 4`. The load moves
# along the boundary between the sectors of stick and of slip. Here the test function that
# separates the modes is zero not at a point but all along.
boundary = explore(from_no_load(1, [1.0, 4.0]), (-1.0, 1.0))
print(boundary.special_points("degenerate")[0].message)
state = boundary.solutions(0.5)[0]
print(boundary.pieces[1].label, system.test_functions(state.z, 0.5).round(12))

# %%
# Such a path is not typical, a little noise would end it. So the corner is called *degenerate*;
# the piece that runs along the interface is followed once, not once per mode:
print(boundary.multiplicity(), boundary.balances())

# %%
# This is well defined as long as one solution moves along the boundary. Where two solutions
# coincide all along, as they do if the load moves along the edge of the sector with three
# solutions, there is no regular :math:`\alpha`, and neither the number of solutions nor the
# balance can be trusted. Move the load off the edge a little.
#
# The picture
# -----------
#
# One quantity must tell nine states apart. The sum of the sideways displacements with unequal
# weights does.


def draw(ax, graph, weights, title):
    """Draw a weighted sum of displacements over alpha: signs by colour, points by shape."""
    weights = np.asarray(weights)
    for piece in graph.pieces:
        values = piece.z[:, 1 : 2 * len(weights) : 2] @ weights
        positive = piece.det_sign > 0
        ax.plot(piece.alpha, values, color=BLUE if positive else RED, ls="-" if positive else "--")
    for point in graph.special_points():
        if point.kind in MARKS:
            value = point.z[1 : 2 * len(weights) : 2] @ weights
            ax.plot(point.alpha, value, "k", ls="none", **MARKS[point.kind])
    ax.set_title(title, fontsize="medium")
    ax.grid(alpha=0.25)


BLUE, RED = "#0072B2", "#D55E00"  # also for colour-blind readers
MARKS = {
    "transition": {"marker": "o", "markerfacecolor": "white", "markersize": 5},
    "nonsmooth fold": {"marker": "o", "markersize": 5},
    "corner": {"marker": "s", "markersize": 6},
    "nonsmooth branch point": {"marker": "^", "markersize": 8},
}
figure, axes = plt.subplots(2, 2, figsize=(9.0, 6.8), layout="constrained")
draw(axes[0, 0], one, [1.0], "one node from no load: 1 and 3 solutions")
draw(axes[0, 1], two, [1.0, 0.6], "two identical nodes from no load: 1 and 9")
draw(axes[1, 0], symmetric, [1.0, 0.6], "two identical pressed nodes")
draw(axes[1, 1], broken, [1.0, 0.6], "the second pulled by a fifth more")
axes[0, 0].set_ylabel("$u_t$")
axes[1, 0].set_ylabel("$u_{t,1} + 0.6\\,u_{t,2}$")
for ax in axes[1]:
    ax.set_xlim(-1.25, 1.25)
    ax.set_ylim(-1.25, 0.25)
    ax.set_xlabel("$α$")
for ax in axes.flat:
    ax.set_xticks([-1.0, -0.5, 0.0, 0.5, 1.0])
for piece in loop:
    values = piece.z[:, 1:4:2] @ [1.0, 0.6]
    axes[1, 1].plot(piece.alpha, values, color="0.85", lw=7.0, solid_capstyle="round", zorder=1)
handles = [
    Line2D([], [], color=BLUE, label="determinant positive"),
    Line2D([], [], color=RED, ls="--", label="negative"),
    Line2D([], [], color="0.85", lw=7.0, label="closed loop"),
    *(
        Line2D([], [], color="k", ls="none", label=kind.replace("nonsmooth", "non-smooth"), **mark)
        for kind, mark in MARKS.items()
    ),
]
figure.legend(handles=handles, loc="outside lower center", ncols=4, fontsize="small")
