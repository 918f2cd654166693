r"""
The paper's curve, step by step
===============================

An elastic body touches a rigid floor with one node. We pull it sideways, slowly, and ask which
states of rest there are under each load. This is Fig. 7 of Janovský and Ligurský (2012), the
smallest problem that shows everything: stick, slip, lift-off, two non-smooth folds, and three
solutions under the same load.
"""

# %%
# The body and its load
# ---------------------
#
# The body has two displacements: :math:`u_\nu` towards the floor and :math:`u_t` along it. Its
# stiffness matrix couples both. ``N`` and ``T`` pick the normal and the tangential displacement
# of each contact node; here there is one node, hence one row each.
import matplotlib.pyplot as plt
import numpy as np
from pwscont_coulomb import AffineLoad, ContactBody, CoulombLoad

from pwscont import explore, plot, trace

body = ContactBody([[2.0, -1.0], [-1.0, 2.0]], N=[[1.0, 0.0]], T=[[0.0, 1.0]])

# %%
# The load presses the node against the floor with 0.25 and pulls it sideways with
# :math:`\alpha`. The coefficient of friction is :math:`F = 4`.
load = AffineLoad(f0=[0.25, 0.0], f1=[0.0, 1.0])  # f(alpha) = f0 + alpha f1
system = CoulombLoad(body, load, friction=4.0)
print(system.names())

# %%
# Tracing
# -------
#
# A state is :math:`z = (u_\nu, u_t, \lambda_\nu, \lambda_t)`: displacements, then the forces of
# the floor. :func:`~pwscont.trace` needs one state to begin with, and it may be a poor guess.
# Zeros will do: a semismooth Newton method finds the solution nearby.
graph = trace(system, (np.zeros(4), -2.0), (-2.0, 2.0))
print(graph)

# %%
# The curve consists of four straight pieces. Because the load is affine and the body linear,
# every piece is a segment, and the program takes it in one step: no step size, no corrector, and
# each transition is right to rounding.
for piece in graph.pieces:
    first, last = piece.alpha[[0, -1]]
    print(f"piece {piece.id}: {piece.label:<11} alpha {first:4g} -> {last:4g}")

# %%
# Both orientations
# -----------------
#
# A curve can be walked in two directions. The paper calls a tangent :math:`t` positively oriented
# where :math:`\det [\partial H; t^T] > 0` (Definition 1), and it walks Fig. 8 in the negative
# orientation. The graph holds the whole curve, so both directions are only two ways to read it.
(branch,) = graph.components()
for orientation, name in ((-1, "negative"), (+1, "positive")):
    print(f"{name} orientation")
    for point in graph.itinerary(branch, orientation):
        print(f"  alpha = {point.alpha:4g}  {point.kind:<14}  {point.passed(orientation)}")

# %%
# The three messages of the negative orientation are those that the paper prints. It reaches the
# transitions at its points 19, 36 and 55 of 65.
#
# Its point 44 lies on the slip piece, with the tangent (0, -0.2132, 0.2132, -0.8528, 0.4264). Here
# the tangent is the direction of the whole segment:
slip = graph.pieces[1]
step = slip.points[0] - slip.points[-1]  # negative orientation: from its end to its start
print(slip.label, (step / np.linalg.norm(step)).round(4))

# %%
# What a kink is
# --------------
#
# The signs of three test functions name the contact mode of the node, its *character*. On each
# cell of one character the equations are smooth. A piece ends where a test function that bounds
# its cell vanishes. At :math:`\alpha = -1/2` that is :math:`\kappa_1`: the slipping node lifts
# off.
kink = next(point for point in graph.special_points() if point.alpha == -0.5)
print(system.test_functions(kink.z, kink.alpha).round(12))

# %%
# Let :math:`J` and :math:`J'` be the Jacobians of both selections at that point. Off their common
# interface the two may differ, but on it they agree. So their difference only sees the direction
# across the interface: :math:`J' - J = c\,\nabla\kappa_1^T`, a matrix of rank one (fact F1 of
# :doc:`/theory`).
lifted, slipping = graph.pieces[0].character, slip.character
J = system.jacobian(kink.z, kink.alpha, slipping)
J_new = system.jacobian(kink.z, kink.alpha, lifted)
gradient = system.test_jacobian(kink.z, kink.alpha)[0]
print("rank of J' - J:", np.linalg.matrix_rank(J_new - J))

# %%
# Add the row :math:`\nabla\kappa_1^T` to both. Rank one along that very row cannot change the
# determinant (fact F2):
det, det_new = (np.linalg.det(np.vstack([matrix, gradient])) for matrix in (J, J_new))
print(f"det [J; grad] = {det:.6f}, det [J'; grad] = {det_new:.6f}")

# %%
# Now solve :math:`J' t = 0,\ \nabla\kappa_1^T t = 1`. The solution is the one tangent of the new
# piece that points into the new cell. The sign of the determinant is its orientation, and by the
# equality above the old tangent has the same one, negative here. So "go into the new cell" and
# "keep the orientation", the rule of the paper, are the same rule. The way on at a kink follows
# from one linear solve; nothing is tried.
t_new = np.linalg.solve(np.vstack([J_new, gradient]), [0, 0, 0, 0, 1])
print("into the new cell:", (t_new / np.linalg.norm(t_new)).round(4))

# %%
# The paper prints this tangent, (-0.2673, -0.5345, 0, 0, -0.8018), for its point 56.
#
# Folds and the number of solutions
# ---------------------------------
#
# The last entry of the tangent was 0.4264 before the kink and is -0.8018 after it: the parameter
# turns back. Such a kink is a *non-smooth fold*. The entry is proportional to
# :math:`\det(\partial H/\partial z)` (fact F3), so a fold is where this sign changes.
for piece in graph.pieces:
    print(f"piece {piece.id}: {piece.label:<11} sign of det(dH/dz) {piece.det_sign:+d}")
print([point.alpha for point in graph.special_points("nonsmooth fold")])

# %%
# Between both folds one load has three solutions: the body may hang free, slip, or stick.
for lo, hi, count in graph.multiplicity():
    print(f"{lo:4g} < alpha < {hi:4g}: {count}")
for solution in graph.solutions(-0.75):
    print(solution)

# %%
# The signs of the three determinants sum to +1. For Coulomb friction the sum is +1 under every
# load (fact F4), whatever the number of solutions. If the sum were not constant, a branch
# would be missing. The converse does not hold: two missing solutions of opposite sign go unnoticed.
print(graph.balances(), graph.is_balanced())

# %%
# Is there another branch?
# ------------------------
#
# :func:`~pwscont.explore` does not need a start. It lists all solutions at both ends of the
# interval, mode by mode, and follows each solution: every branch except closed loops.
everything = explore(system, (-2.0, 2.0))
print(len(everything.components()), "component,", len(everything.pieces), "pieces")

# %%
# The picture
# -----------
#
# The open circle marks a transition, filled ones non-smooth folds, with alpha beside them.
figure, axes = plt.subplots(1, 2, figsize=(9.0, 4.0), layout="constrained")
plot(graph, system.names().index("λ_ν"), ax=axes[0])
plot(graph, system.names().index("u_t"), ax=axes[1])
axes[0].get_legend().remove()

# %%
# The same from the command line, with the load path beside it::
#
#     pwscont run fig7 -o out
