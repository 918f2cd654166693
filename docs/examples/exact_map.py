r"""
An exact map of two loads
=========================

How many states of rest are there under *any* load of a family with two parameters? If both enter
affinely, the answer is a picture of polygons, and it is exact. The body is again that of Example 1
of Janovský and Ligurský (2012), with two contact nodes and the friction coefficient 4.
"""

# %%
# Two parameters
# --------------
#
# The paper loads its body by :math:`f(\alpha) = (0.4,\ \alpha,\ 1.8 + 0.2\alpha,\ \alpha)`. We let
# the normal load on the first node vary, too. A family is a function from the second parameter to a
# system.
import matplotlib.pyplot as plt
import numpy as np
from pwscont_coulomb import AffineLoad, ContactBody, CoulombLoad

from pwscont import enumerate_solutions, plane

A = np.array([[1.0, -1, 0, 0], [-1, 2, -1, 0], [0, -1, 2, -1], [0, 0, -1, 2]])
body = ContactBody(A, N=np.eye(4)[[0, 2]], T=np.eye(4)[[1, 3]])


def family(f_nu):
    return CoulombLoad(body, AffineLoad([f_nu, 0, 1.8, 0], [0, 1, 0.2, 1]), 4.0)


# %%
# One call
# --------
#
# While the nodes keep their contact modes, displacements and forces are affine functions of both
# parameters. So the loads at which a choice of modes solves the equations are a convex polygon of
# the plane. :func:`~pwscont.plane` finds the polygons of all choices and cuts them with each other.
found = plane(family, (-8.0, 2.0), (-2.0, 3.0))
print(found)
print(found.searched)
print(found.guarantee)

# %%
# Nothing was sampled, so a small region is found like a large one. The paper's path, 0.4, meets up
# to five solutions; a little above it there are seven.
most = max(found.sectors, key=lambda sector: sector.count)
for solution in most.solutions:
    print(f"{solution.label}, det {solution.det_sign:+d}")

# %%
# Any point can be asked, and enumeration agrees.
alpha, f_nu = most.regions[0].inside
print(found.count(alpha, f_nu), len(enumerate_solutions(family(f_nu), alpha)))

# %%
# The picture
# -----------
#
# Regions are polygons, edges are segments. Across a fold two solutions meet and end; across any
# other edge one of them changes its modes only.
figure, ax = plt.subplots(figsize=(6.5, 4.5), layout="constrained")
shades = {1: "white", 3: "#cfe0ee", 5: "#94bcdb", 7: "#6fa3cc"}
for sector in found.sectors:
    for region in sector.regions:
        ax.fill(*region.polygon.T, color=shades[sector.count])
for edge in found.transitions:
    ax.plot(*edge.plane.T, color="0.4", linewidth=0.9)
for edge in found.folds:
    ax.plot(*edge.plane.T, color="#D55E00", linewidth=2.0)
ax.axhline(0.4, color="0.3", linestyle="--", linewidth=0.8)
ax.annotate("the paper's path", (-7.8, 0.4), (0, 4), textcoords="offset points")
ax.set(xlabel="$α$", ylabel="normal load on node 1", xlim=(-8, 2), ylim=(-2, 3))

# %%
# The same from the command line, with the solutions of every region as text::
#
#     pwscont run example1-load-plane -o out
#
# Friction does not enter affinely: it multiplies normal forces, which are unknowns. For the plane
# of load and friction see :doc:`/gallery/critical_friction`.
