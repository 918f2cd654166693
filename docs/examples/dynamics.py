r"""
Equilibria at a border, orbits that collide with it
===================================================

Vector fields and maps that change their formula at a border have equilibria and periodic points
that appear, disappear and multiply where they meet it. The package ``pwscont_dynamics`` writes both
as continuous piecewise-smooth systems, which are followed like any other.
"""

# %%
# Boundary equilibria
# -------------------
#
# A Filippov system follows :math:`f^+` where :math:`h(x) > 0` and :math:`f^-` where :math:`h(x) <
# 0`. On the border it slides along the combination :math:`s f^+ + (1-s) f^-` that is tangent to
# it; where this vanishes with :math:`0 < s < 1` there is a *pseudo-equilibrium*. With one more
# unknown :math:`y` and :math:`s = \mathrm{clip}(y, 0, 1)` all equilibria are the solutions of the
# system :class:`~pwscont_dynamics.FilippovEquilibria` of :math:`f^+`, :math:`f^-` and :math:`h`,
#
# .. math:: s f^+(x) + (1 - s) f^-(x) = 0, \qquad h(x) = y - s.
#
# A focus that meets the border at :math:`\mu = 0` either goes on as a pseudo-equilibrium, or
# meets a pseudo-equilibrium and the two vanish: the two cases of M. di Bernardo, A. Nordmark and
# G. Olivar (*Discontinuity-induced bifurcations of equilibria in piecewise-smooth and impacting
# dynamical systems*, Physica D 237, 2008). Here the field beyond the border decides which.
import matplotlib.pyplot as plt
import numpy as np
from pwscont_dynamics import AffinePeriodicPoints, PeriodicPoints
from pwscont_dynamics.scenes import boundary_equilibrium, normal_form

from pwscont import explore, plot

figure, axes = plt.subplots(1, 2, figsize=(9.5, 4.0), layout="constrained")
for ax, c2 in zip(axes, (0.3, -2.0), strict=True):
    graph = boundary_equilibrium(1.0, c2).run()
    for point in graph.special_points():
        print(f"mu = {point.alpha + 0.0:.4f}  {point.kind}: {point.message}")
    plot(graph, "x2", ax=ax)
    ax.set_title(f"$f^- = (1, {c2:g})$")
    print()
marks = {mark.get_label(): mark for ax in axes for mark in ax.get_legend().legend_handles}
axes[0].get_legend().remove()
axes[1].legend(handles=[*marks.values()], loc="upper left", bbox_to_anchor=(1.0, 1.0))

# %%
# Stability is recorded with every state: ``growth`` is the largest real part of an eigenvalue, for
# a pseudo-equilibrium along the border, and ``pull`` is positive where sliding attracts. The focus
# is stable; the pseudo-equilibrium that it meets is a saddle.
for solution in graph.solutions(0.5):
    print(f"{solution.label}: growth {solution['growth']:+.4f}, pull {solution['pull']:+.4f}")

# %%
# Border collisions
# -----------------
#
# The normal form of H. Nusse and J. Yorke (*Border-collision bifurcations including "period two to
# period three" for piecewise smooth systems*, Physica D 57, 1992) is
#
# .. math:: x \mapsto A x + \mu \begin{pmatrix} 1 \\ 0 \end{pmatrix}, \qquad
#    A = \begin{pmatrix} \tau & 1 \\ -\delta & 0 \end{pmatrix},
#
# with :math:`(\tau, \delta)` on either side of :math:`x_1 = 0`. All points of period :math:`k` are
# solutions of :math:`x_{i+1} = f(x_i)` around the orbit. Each is named by its *word*, the side of
# each of its points. With numbers for which the map is chaotic, sixteen points of period four leave
# :math:`\mu = 0` together. This point is a corner of the system: four tests vanish, and all ways on
# are found.
left, right = normal_form(1.6, 0.4), normal_form(-2.2, 0.5)
system = AffinePeriodicPoints(left, right, [1.0, 0.0], period=4)
record = {"|multiplier|": system.largest_multiplier, "period": system.least_period}
graph = explore(system, (-1.0, 1.0), parameter="mu", record=record)
print(graph)
for solution in graph.solutions(0.5):
    print(f"{solution.label}  period {solution['period']:g}  {solution['|multiplier|']:.4f}")

# %%
# None of them is stable: all multipliers are larger than one in modulus. Orbits therefore wander
# among them.
x = np.array([0.1, 0.0])
orbit = []
for _ in range(3000):
    x = (right if x[0] >= 0.0 else left) @ x + [0.5, 0.0]
    orbit.append(x)
points = np.array([solution.z[:2] for solution in graph.solutions(0.5)])
figure, ax = plt.subplots(figsize=(6.0, 4.2), layout="constrained")
ax.plot(*np.array(orbit[100:]).T, ",", color="0.5", label="an orbit")
ax.plot(*points.T, "o", mfc="none", color="#D55E00", label="points of period 1, 2 and 4")
ax.set(xlabel="$x_1$", ylabel="$x_2$")
ax.legend()

# %%
# Curved maps
# -----------
#
# A map need not be affine: give both formulas and the border. Here the slope is gentle on the left
# and -3 on the right; period two is born at the border.
curved = PeriodicPoints(
    left=lambda x, mu: mu - x**2,
    right=lambda x, mu: mu - 3.0 * x,
    border=lambda x, mu: x[0],
    n=1,
    period=2,
)
graph = explore(curved, (-0.2, 1.0), parameter="mu")
print(graph)
ax = plot(graph, "x1 at 0")
ax.figure.set_size_inches(8.0, 4.0)
