r"""
Active sets: LASSO, quadratic programs, games, layers
=====================================================

Conditions for an optimum are piecewise smooth: which constraints are active, which features are
used, which player is at a bound, chooses the equations. This page follows four such problems with
the package ``pwscont_optimisation``, each beside a published result.
"""

# %%
# The LASSO path
# --------------
#
# Tibshirani's LASSO minimises :math:`\frac12|Xb - y|^2 + \lambda |b|_1`. A minimiser has
# correlations :math:`c = X^\top(y - Xb)` with :math:`c_j = \pm\lambda` where :math:`b_j` is
# positive or negative, and :math:`|c_j| \le \lambda` where it is zero: three modes for each
# feature, all affine in :math:`(b, \lambda)`. So the path is a polygon, and pwscont takes one step
# for each piece. These are the diabetes data of Efron, Hastie, Johnstone and Tibshirani (*Least
# angle regression*, Annals of Statistics 32, 2004), whose Figure 1 shows the same path.
import matplotlib.pyplot as plt
import numpy as np
from pwscont_optimisation import BestReplies, QuadraticProgram, ReluLayer
from pwscont_optimisation.scenes import CIRCLE, GAINS, lasso, layer, parametric_qp

from pwscont import explore, plot

path = lasso().run()
print(path)
(branch,) = path.components()
for point in path.itinerary(branch, -1):
    print(f"lambda = {point.alpha:10.6f}  {point.passed(-1)}")

# %%
# Feature s3 enters with a negative coefficient, leaves, and comes back with a positive one, as in
# the paper. The picture of the paper has :math:`|b|_1` on its axis, which the scene records; it
# is read off at the points where something happens, since nothing bends in between.
nodes = sorted(path.special_points(), key=lambda point: point.alpha)
length = [point["|b|_1"] for point in nodes]
figure, ax = plt.subplots(figsize=(7.5, 4.5), layout="constrained")
for name in path.names:
    ax.plot(length, [point[name] for point in nodes], label=name)
ax.set(xlabel="$|b|_1$", ylabel="coefficient")
ax.legend(ncols=2, fontsize="small", loc="lower left")

# %%
# Model predictive control
# ------------------------
#
# A controller that looks two moves ahead solves a small quadratic program at every state of its
# plant. Bemporad, Morari, Dua and Pistikopoulos (*The explicit linear quadratic regulator for
# constrained systems*, Automatica 38, 2002) solve it once for all: the states fall into regions,
# one for each active set, with an affine law in each. Along a line of states the
# regions are pieces.
controller = parametric_qp()
law = controller.run()
for piece in law.pieces:
    print(f"{piece.alpha.min():9.6f} to {piece.alpha.max():9.6f}  {piece.label}")

# %%
# A program that is not convex may have several stationary points; the search lists them all, and
# the thin line is a saddle point.
well = QuadraticProgram(
    [[-1.0, 0.0], [0.0, 1.0]],
    [0.0, 0.0],
    [[1.0, 0.0], [-1.0, 0.0], [0.0, -1.0]],
    [1.0, 1.0, 0.0],
    [1.0, 0.3],
    constraints=["right", "left", "floor"],
)
stationary = explore(well, (-2.0, 2.0))
print(stationary)
ax = plot(stationary, "x1")
ax.figure.set_size_inches(8.5, 4.0)

# %%
# Four players on a circle
# ------------------------
#
# Each player acts the more, the less the two neighbours do:
# :math:`x_i = \mathrm{clip}(\alpha + g_i - \delta \sum_{j \sim i} x_j,\ 0,\ 1)`. Bramoullé, Kranton
# and D'Amours (*Strategic interaction and networks*, American Economic Review 104, 2014) show that
# there is one equilibrium, whatever the gains, if :math:`\delta` is below one over the modulus of
# the smallest eigenvalue of the network, here :math:`1/2`.
for delta in (0.45, 0.55, 0.9):
    graph = explore(BestReplies(-delta * CIRCLE, GAINS, np.ones(4)), (-0.5, 3.5))
    most = max(count for _, _, count in graph.multiplicity())
    print(f"delta = {delta}: at most {most}, {graph.guarantee}")
ax = plot(graph, "x1")

# %%
# Above the threshold opposite players specialise: either 1 and 3 act and their neighbours rest, or
# the other way round. The equilibrium between the two, the thin line, is unstable.
for solution in graph.solutions(1.5):
    print(solution)

# %%
# A layer that feeds back to itself
# ---------------------------------
#
# Fixed points :math:`z = \max(0, Wz + b + \alpha c)` are the states of an equilibrium layer, or the
# rest states of a threshold-linear network. Here four units excite themselves with weight 1.6. Such
# a unit, driven below zero, may be off or on. Two more units see :math:`\alpha`, and drive the
# four above zero where it is large; then there is no fixed point. So all :math:`2^4` states lie on
# closed loops, which no search at the ends of the interval can find.
network = ReluLayer(*layer(8, seed=0))
states = explore(network, (-1.0, 1.0), record={"activity": lambda z, alpha: float(z[:4].sum())})
print(len(states.components()), "loops,", states.count(0.0), "states at alpha = 0")
print(states.guarantee)
ax = plot(states, "activity")
ax.get_legend().remove()
