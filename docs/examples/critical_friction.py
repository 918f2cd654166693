r"""
The critical friction
=====================

With little friction a body under a load has one state of rest; with much friction it may have
several. Where is the limit? Along one load path it is the smallest :math:`F` at which the solution
curve folds back. We find it by following each fold while :math:`F` shrinks, until it stops being
one. The body is that of Example 1 of Janovský and Ligurský (2012), with two contact nodes.
"""

# %%
# A family of systems
# -------------------
#
# The load path stays the same, :math:`f(\alpha) = (0.4,\ \alpha,\ 1.8 + 0.2\alpha,\ \alpha)`. The
# second parameter is :math:`F`: every value of it gives one system, with one solution curve.
import matplotlib.pyplot as plt
import numpy as np
from pwscont_coulomb import AffineLoad, ContactBody, CoulombLoad

from pwscont import TransitionLocus, explore, trace
from pwscont.two_parameters.loci import follow_transitions, parts_of, turning

A = np.array([[1.0, -1, 0, 0], [-1, 2, -1, 0], [0, -1, 2, -1], [0, 0, -1, 2]])
body = ContactBody(A, N=np.eye(4)[[0, 2]], T=np.eye(4)[[1, 3]])
load = AffineLoad([0.4, 0, 1.8, 0], [0, 1, 0.2, 1])


def family(F):
    return CoulombLoad(body, load, F)


# %%
# At :math:`F = 4` there are up to five solutions, and four non-smooth folds.
graph = explore(family(4.0), (-8.0, 2.0))
print(graph)
folds = graph.special_points("nonsmooth fold")
for fold in folds:
    print(f"alpha = {fold.alpha:.6f}  {fold.message}")

# %%
# A fold that moves
# -----------------
#
# At a transition one test function :math:`\kappa_i` vanishes. While :math:`F` moves, the transition
# does, too, and the points
#
# .. math:: H_\chi(z, \alpha; F) = 0, \qquad \kappa_i(z, \alpha; F) = 0
#
# are a curve in one more unknown: :math:`(z, \alpha)`, with :math:`F` as the parameter. The
# curve is piecewise smooth again, because other test functions may vanish along the curve. So these
# equations are one more system for :func:`~pwscont.trace`, and nothing new has to be invented.
fold = min(folds, key=lambda point: point.alpha)
vanishing = int(np.argmin(np.abs(family(4.0).test_functions(fold.z, fold.alpha))))
locus = TransitionLocus(family, vanishing, mu=4.0, alphas=(-8.0, 2.0))
start = (np.append(fold.z, fold.alpha), 4.0)
curve = trace(locus, start, (0.5, 4.0), parameter="F")
for piece in curve.pieces:
    print(f"{piece.label}: F {piece.alpha.min():g} to {piece.alpha.max():g}")

# %%
# The left fold is where node 1 begins to slip beside the stuck node 2. By hand this is at
# :math:`\alpha = -0.4\,F`:
for F in (1.0, 2.0, 3.0, 4.0):
    (point,) = curve.solutions(F)
    print(f"F = {F:g}: alpha = {point.z[-1]:.12f}")

# %%
# Where it stops being a fold
# ---------------------------
#
# A transition is a fold if :math:`\alpha` turns there. That depends on both pieces that meet:
# :math:`\alpha` turns exactly if :math:`\det \partial H/\partial z` has different signs on both
# sides. :func:`~pwscont.two_parameters.loci.turning` is positive at a fold, negative at a
# transition that :math:`\alpha` passes, and zero where one determinant vanishes.
for F in (3.0, 2.5, 2.1, 1.9, 1.5):
    (point,) = curve.solutions(F)
    print(f"F = {F:g}: {turning(locus, point.z, F, point.character):+.4f}")

# %%
# It changes its sign at :math:`F = 2`. There the slipping selection becomes singular: its piece,
# which runs backwards for :math:`F > 2`, is vertical at :math:`F = 2` and runs forwards below.
# Both folds at its ends meet at one :math:`\alpha` and vanish together.
#
# Every fold of the path
# ----------------------
#
# :func:`~pwscont.two_parameters.loci.follow_transitions` does this for all transitions that there
# are at :math:`F = 4`, and :func:`~pwscont.two_parameters.loci.parts_of` cuts each locus where
# ``turning`` changes its sign.
loci = follow_transitions(family, (-8.0, 2.0), (0.5, 4.0), levels=[4.0], parameter="F")
parts = [part for one in loci for part in parts_of(one)]
for part in (part for part in parts if part.crossing == "fold"):
    alpha, F = part.lowest[-2:]
    print(f"{part.label}: a fold down to F = {F:.12f}, alpha = {alpha:.12f}")
critical = min(part.lowest[-1] for part in parts if part.crossing == "fold")
print(f"critical F = {critical:.12f}")

# %%
# The formula
# -----------
#
# Let the other nodes keep their mode, and let :math:`S` be the stiffness that one node still
# feels: the Schur complement of :math:`A` on its two displacements, with the nodes that stick held
# fixed and the free ones left to follow. While it slips to the negative side,
#
# .. math:: (S_{tt} + F S_{\nu t})\, u_t = f_t + F f_\nu ,
#
# which is singular at :math:`F = S_{tt} / (-S_{\nu t})`. For one node this is the paper's
# :math:`a/b`.


def critical_ratio(node, others_free):
    here, others = [2 * node, 2 * node + 1], [i for i in range(4) if i // 2 != node]
    S = A[np.ix_(here, here)]
    if others_free:
        coupling = A[np.ix_(here, others)]
        S = S - coupling @ np.linalg.solve(A[np.ix_(others, others)], coupling.T)
    return S[1, 1] / -S[0, 1]


for node in (0, 1):
    for others_free in (False, True):
        words = "is free" if others_free else "sticks"
        print(f"node {node + 1}, while the other {words}: {critical_ratio(node, others_free):.6f}")

# %%
# Our path meets node 1 beside a stuck node 2, and node 2 beside a free node 1: 2 in either case.
# The smaller 4/3 is for loads that lift node 2 while node 1 slips. That never happens on this path,
# but happens on other paths: the critical friction belongs to a load path, not to a body alone.
#
# Just above, there are loads with three solutions; just below, every load of the path has one.
for F in (2.01, 1.99):
    system = family(F)
    counts = {count for _, _, count in explore(system, (-8.0, 2.0)).multiplicity()}
    print(f"F = {F}: numbers of solutions {sorted(counts)}")

# %%
# The picture
# -----------
#
# Thick lines are folds, thin ones transitions. Between two folds there are two solutions more.
figure, ax = plt.subplots(figsize=(6.5, 4.5), layout="constrained")
for part in parts:
    thick = part.crossing == "fold"
    ax.plot(*part.plane.T, color="#D55E00" if thick else "0.4", linewidth=2.2 if thick else 0.9)
ax.axhline(critical, color="0.3", linestyle="--", linewidth=0.8)
ax.annotate(f"critical F = {critical:g}", (0.1, critical), (0, 4), textcoords="offset points")
for text, alpha, F in (("3", -1.0, 3.4), ("5", -1.4, 3.83), ("3", -1.37, 2.8), ("1", 0.2, 3.2)):
    ax.text(alpha, F, text, ha="center", va="center")
ax.set(xlabel="$α$", ylabel="$F$", ylim=(0.5, 4.0), title="number of solutions")

# %%
# The same from the command line, with the regions shaded by their exact counts; ``fig4``, ``fig5``
# and ``fig6`` are the load planes of the paper::
#
#     pwscont run example1-critical-friction -o out
