r"""
Structures that snap, soften, touch and buckle
==============================================

A stop that is reached, a bar that begins to tear, a string that comes to rest, a strut that leans
on a wall: equilibria of such structures are piecewise smooth. The package ``pwscont_structures``
has such structures. Each answer on this page is set beside a closed form or a published one.
"""

# %%
# Von Mises trusses with a stop
# -----------------------------
#
# Two bars that meet in a shallow roof snap through under a load on the ridge. With the rise as the
# unit of length, the force of a displacement :math:`d` is :math:`k\,d\,(d-1)(d-2)` (von Mises,
# 1923): three equilibria under every load below the limit load :math:`2k/\sqrt{27}`. Trusses in
# series each have their own three, so K of them have :math:`3^K`. Their loads of snapping are the
# closed form, in the order of their stiffness:
import matplotlib.pyplot as plt
import numpy as np
from pwscont_structures import SofteningBar, Strut, membrane, string
from pwscont_structures.scenes import obstacle, strut_supports, truss_chain, truss_stop, waves

from pwscont import explore, plot

chain = truss_chain().run()
print(chain)
limits = sorted({round(point.alpha, 9) for point in chain.special_points("fold")})
print(np.array(limits) / (2.0 / 27.0**0.5))

# %%
# *Complete* is meant: each truss carries the whole load, so its state is a root of one cubic. The
# system brings a search that takes all roots at loads between all limit loads. Every branch turns
# at limit loads only, and passes such a load.
#
# A stop under the second truss, at 0.9 of its rise, cuts its curve short: the second truss has
# three states from 1.1 (0.9) (0.1) (1.1) = 0.1089 up, the highest of them on the stop. With the
# three of the first truss that makes nine. Four of the nine lie on a closed loop, to which no
# change of the load leads.
stopped = truss_stop().run()
for lo, hi, count in stopped.multiplicity():
    print(f"{count} equilibria from {lo:.6f} to {hi:.6f}")
path, loop = stopped.components()
pieces = {piece.id for piece in loop}
print("on the loop:", sum(solution.piece in pieces for solution in stopped.solutions(0.2)))


def legend_below(figure):
    """Join the legends of all diagrams below the diagrams."""
    handles = {}
    for ax in figure.axes:
        for handle in ax.get_legend().legend_handles:
            handles.setdefault(handle.get_label(), handle)
        ax.get_legend().remove()
    figure.legend(
        handles=[*handles.values()], loc="outside lower center", ncols=4, fontsize="small"
    )


figure, axes = plt.subplots(1, 2, figsize=(9.5, 4.8), layout="constrained")
plot(chain, "u_1", ax=axes[0])
plot(stopped, "u_1", ax=axes[1])
for ax, title in zip(axes, ("three trusses", "two trusses and a stop"), strict=True):
    ax.set_title(title, fontsize="medium")
    for text in list(ax.texts):  # the loads are printed above
        text.remove()
legend_below(figure)

# %%
# A bar that softens
# ------------------
#
# A bar that carries :math:`\sigma(e) = \min(e, \max(1.8 - 0.8e, 0))` is pulled through a spring of
# stiffness 0.5. It softens faster than the spring can follow, so the end has to go *back*:
# snap-back, between non-smooth folds at 3 and 2.25 (:math:`\alpha = e + 2\sigma(e)` with
# :math:`e = 1` and 2.25).
bar = explore(SofteningBar(), (0.0, 5.0), parameter="displacement")
for point in bar.special_points("nonsmooth fold"):
    print(point.alpha, point.message)

# %%
# Of several elements any may tear, and each does at a strength of its own. Bazant and Cedolin
# (*Stability of Structures*, 1991) call that localisation: there are states in which one element
# alone softens. Here are all states of two elements; broken ones keep a twentieth of their
# stiffness.
pair = SofteningBar(0.5, [1.0, 1.05], remaining=0.05)
torn = explore(pair, (0.0, 7.0), record={"force": pair.force}, parameter="displacement")
for solution in torn.solutions(3.9):
    print(f"force {solution['force']:.4f}: {solution.label}")

figure, axes = plt.subplots(1, 2, figsize=(10.0, 4.2), layout="constrained")
plot(bar, SofteningBar().force, ax=axes[0])
axes[0].set(title="one element", ylabel="force")
plot(torn, "force", ax=axes[1])
axes[1].set(title="two elements")
legend_below(figure)

# %%
# A string and a membrane over an obstacle
# ----------------------------------------
#
# Where the string touches, its height is known and the reaction is not; elsewhere the reaction is
# zero. The problem is a linear complementarity problem with exactly one solution (Kinderlehrer and
# Stampacchia, 1980), and its matrix is tridiagonal: a transition costs time in proportion to the
# number of nodes.
rest = explore(obstacle(200).system, (0.0, 8.0), parameter="load")
print(rest.guarantee, "-", len(rest.special_points("transition")), "transitions")

# %%
# A flat table at depth :math:`g` leaves two parabolas of length :math:`\sqrt{2g/\alpha}`:
table = explore(string(399, lambda x: -0.05), (0.0, 8.0))
(state,) = table.solutions(8.0)
lying = np.flatnonzero(state.z < -0.05 + 1e-12) + 1
print(f"on the table from {lying[0] / 400:.4f}, exactly {(0.1 / 8.0) ** 0.5:.4f}")

# %%
# Membranes have a mesh of scikit-fem, the optional extra ``fem``.
from skfem import MeshTri

mesh = MeshTri().refined(4)
sheet, inside = membrane(mesh, lambda x: -0.02 - 0.2 * (x[0] - 0.6) ** 2 - 0.3 * (x[1] - 0.4) ** 2)
pressed = explore(sheet, (0.0, 4.0), parameter="load")
(state,) = pressed.solutions(4.0)
heights, touched = np.zeros(mesh.nvertices), state.character.array
heights[inside] = state.z

figure, axes = plt.subplots(1, 2, figsize=(10.0, 4.2), layout="constrained")
x = np.linspace(0.0, 1.0, 202)
axes[0].fill_between(x[1:-1], waves(x[1:-1]), -0.2, color="0.85")
for load in (0.4, 1.0, 3.0, 8.0):
    (hanging,) = rest.solutions(load)
    axes[0].plot(x, [0.0, *hanging.z, 0.0], label=f"load {load:g}", lw=1.2)
axes[0].set(xlabel="x", ylabel="height", ylim=(-0.2, 0.01), title="string of 200 nodes")
axes[0].legend(fontsize="small", loc="lower left")
levels = axes[1].tricontourf(*mesh.p, mesh.t.T, heights, levels=12, cmap="Blues_r")
axes[1].plot(*mesh.p[:, inside[touched]], "k.", ms=4, label="on the obstacle")
axes[1].set(aspect="equal", xlabel="x", ylabel="y", title="membrane at load 4")
axes[1].legend(fontsize="small", loc="upper left")
figure.colorbar(levels, ax=axes[1], label="height")

# %%
# A strut between supports
# ------------------------
#
# The strut is Euler's elastica, an inextensible rod, in quadratic finite elements. Timoshenko and
# Gere (*Theory of Elastic Stability*, 1961, section 2.7) tabulate its way beyond the buckling load
# :math:`P_E`: :math:`P/P_E` is 1.063, 1.152 and 1.293 with the ends turned by 40, 60, 80 degrees.
euler, free = np.pi**2, Strut(10)
buckled = explore(free, (5.0, 15.0), parameter="P")
(point,) = buckled.special_points("branch point")
print(f"buckles at {point.alpha / euler:.5f} P_E")
for ratio in (1.063, 1.152, 1.293):
    angles = {round(abs(np.degrees(s["theta(0)"])), 1) for s in buckled.solutions(ratio * euler)}
    print(f"{ratio} P_E: ends turned by {max(angles)} degrees")

# %%
# Now let a slightly bent strut stand between a support above its middle and one below, each at a
# tenth of the length (*constrained Euler buckling*: Domokos, Holmes and Royce, 1997). Buckling up,
# it touches the upper one. The state on the lower one begins at a non-smooth fold: there the strut
# would leave the support and snap up. With the middle held, buckling in two half-waves comes next,
# near :math:`4 P_E = 39.5`; because the strut is bent, folds appear instead of branch points.
held = strut_supports().run()
print(held)
for point in held.special_points():
    if point.kind in ("transition", "nonsmooth fold", "fold"):
        print(f"{point.kind} at P = {point.alpha:.4f}: {point.message}")

# %%
# *Balanced* is no promise. The equations are curved, and Newton from many starts may miss
# states; what can be said is that the signs of the determinants sum to +1 throughout, as they must.
figure, axes = plt.subplots(1, 2, figsize=(10.0, 5.4), layout="constrained")
plot(held, "w(0.25)", ax=axes[0])
axes[0].set_title("deflection at a quarter of the length", fontsize="medium")
strut = strut_supports().system
for solution in held.solutions(20.0):
    style = "-" if solution.det_sign > 0 else "--"
    axes[1].plot(*strut.shape(solution.z), style, label=solution.label)
for support in strut.supports:
    axes[1].plot([0.5], [support.height * 1.08], "kv" if support.height > 0 else "k^", ms=9)
axes[1].legend()
legend_below(figure)
axes[1].set(xlabel="x", ylabel="w")
axes[1].set_title("the three states at P = 20, height exaggerated", fontsize="medium")
axes[1].legend(fontsize="small", loc="upper right")
