r"""
Your own piecewise-smooth system
================================

A shallow arch carries a load at its apex. Under too large a load it snaps through.
Below it waits a spring pad, and below the pad a stop. This page writes the equations down, checks
them, finds all states of rest in an interval of loads, asks questions, and draws them.
"""

# %%
# Write the system
# ----------------
#
# The load is the parameter :math:`\alpha`. The unknowns are the deflection :math:`w` of the apex
# and the deflection :math:`v` of the pad.
# The arch alone resists with :math:`w(w-1)(w-2)`, which rises, falls and rises again. The
# pad is a hardening spring. Two things can happen, and each is the sign of a test function:
#
# * the arch lands on the pad where :math:`\kappa_1 = w - v - g` becomes positive,
# * the pad meets the stop where :math:`\kappa_2 = v - d` becomes positive.
#
# A system needs ``size``, ``test_functions`` and ``residual``. The residual gets the *character*,
# the signs of all test functions, and evaluates the formula that belongs to it wherever it is
# asked, even outside the cell of that character. Therefore it must not look at the signs itself:
# no ``max(0, ...)`` in there.
import tempfile
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

from pwscont import (
    BranchGraph,
    Panel,
    PiecewiseSystem,
    PseudoArclength,
    Scene,
    StepSize,
    check_system,
    explore,
    plot,
    trace,
)


class ArchOverPad(PiecewiseSystem):
    """A shallow arch over a hardening pad over a stop, z = (w, v)."""

    size = 2
    gap, travel = 0.7, 0.35
    contact, pad, hardening, stop = 20.0, 0.1, 1.0, 20.0

    def test_functions(self, z, alpha):
        w, v = z
        return np.array([w - v - self.gap, v - self.travel])

    def residual(self, z, alpha, character):
        w, v = z
        lands, stops = character.signs
        push = self.contact * (w - v - self.gap) if lands else 0.0
        block = self.stop * (v - self.travel) if stops else 0.0
        arch = w * (w - 1.0) * (w - 2.0)
        spring = self.pad * v + self.hardening * v**3
        return np.array([arch + push - alpha, spring + block - push])

    # from here on: words for tables and pictures, not needed to compute

    def describe(self, character):
        lands, stops = character.signs
        if not lands:
            return "free"
        return "on the stop" if stops else "on the pad"

    def names(self):
        return ("w", "v")


system = ArchOverPad()

# %%
# Derivatives come from differences unless you override ``jacobian`` and ``test_jacobian``. If your
# formulas are affine in :math:`(z, \alpha)`, derive from
# :class:`~pwscont.PiecewiseLinearSystem`, and the pieces are followed exactly; if they are affine
# in :math:`z` alone, from :class:`~pwscont.SlicewiseLinearSystem`. With linear pieces, ``kink`` may
# say how H changes where a test changes its sign, which makes long paths faster.
#
# Check it
# --------
#
# Neighbouring selections must agree where they meet. :func:`~pwscont.check_system` walks from the
# points you give to every interface nearby and compares both sides, their values and their
# Jacobians. Around each point it also looks for kinks that no test function announces.
random = np.random.default_rng(0)
points = [(random.uniform(-1.0, 1.0, size=2), random.uniform(-1.0, 1.0)) for _ in range(10)]
print(check_system(system, points))


# %%
# Suppose we had forgotten the gap:
class Forgetful(ArchOverPad):
    def residual(self, z, alpha, character):
        w, v = z
        push = self.contact * (w - v) if character.signs[0] else 0.0
        return np.array([w - alpha + push, v - push])


print(str(check_system(Forgetful(), points[:1])))

# %%
# Explore it
# ----------
#
# :func:`~pwscont.explore` looks for solutions at both ends of the interval and follows every branch
# from there.
graph = explore(system, (-0.3, 0.7))
print(graph)
for point in graph.special_points():
    print(f"{point.kind:<14} alpha = {point.alpha:.6f}  {point.message}")

# %%
# The arch snaps at the smooth *fold*, its limit load. Landing on the pad is a mere *transition*:
# the pad is too soft to stop the arch. The stop is hard enough, and there the load rises again: a
# *non-smooth fold*.
#
# One thing to know about completeness. For a nonlinear system like this one the search tries Newton
# at both ends, once per cell and from random starts, which may miss solutions. The balance helps to
# judge: the deflections are bounded under bounded loads, so the signs of
# :math:`\det(\partial H/\partial z)` must have the same sum at every :math:`\alpha`. A constant
# sum is necessary, not sufficient: a missed pair of opposite signs goes unnoticed.
print(graph.balances(), graph.is_balanced())

# %%
# If you know one state at least roughly, such as the unloaded one, :func:`~pwscont.trace` follows
# the branch through it, in both directions.
through_start = trace(system, ([0.0, 0.0], 0.0), (-0.3, 0.7))
print(len(through_start.pieces), "pieces")

# %%
# Ask it
# ------
#
# How many states of rest are there under a load, and which?
print(graph.count(0.2))
for solution in graph.solutions(0.2):
    print(solution)

# %%
# The sign of the determinant is the sign of the stiffness determinant here: the state with
# ``det -1`` is unstable under dead load.
#
# The load under which the arch snaps, and the load under which it snaps back:
(snap,) = graph.special_points("fold")
(back,) = graph.special_points("nonsmooth fold")
print(f"snaps at {snap.alpha:.6f}, back at {back.alpha:.6f}")
for lo, hi, count in graph.multiplicity():
    print(f"{lo:.4f} < alpha < {hi:.4f}: {count}")

# %%
# ``graph.nx`` is a plain networkx graph for everything else, ``graph.to_dataframe("points")`` a
# pandas data frame (:doc:`/data`). ``graph.save`` writes one file;
# hand the system to ``load`` to have solutions between its stored points corrected again.
with tempfile.TemporaryDirectory() as folder:
    file = Path(folder) / "arch.npz"
    graph.save(file)
    loaded = BranchGraph.load(file, system=system)
print(loaded.count(0.2), "solutions in", loaded.nx)

# %%
# Draw it
# -------
#
# Pieces are stored by as many points as Newton needs. A picture asks for more: behaviour is chosen
# by fields, here the longest step of the stepper.
fine = PseudoArclength(step_size=StepSize(largest=0.02))
smooth = explore(system, (-0.3, 0.7), stepper=fine)

figure, axes = plt.subplots(1, 2, figsize=(9.0, 4.0), layout="constrained")
plot(smooth, 0, ax=axes[0])
plot(smooth, 1, ax=axes[1])
axes[0].get_legend().remove()

# %%
# Offer it as a scene
# -------------------
#
# A scene is a system with an interval and a wish list: at which parameter values to list the
# solutions, which components to draw.


def arch() -> Scene:
    """Return the arch over its pad."""
    return Scene(
        "arch",
        "a shallow arch over a pad and a stop",
        ArchOverPad(),
        (-0.3, 0.7),
        at=(0.2,),
        stepper=fine,
        panels=(Panel(0), Panel(1)),
    )


print(arch().run().is_balanced())

# %%
# Put this function into a module of your own package, say ``my_package/scenes.py``, and name it in
# that package's ``pyproject.toml``:
#
# .. code-block:: toml
#
#     [project.entry-points."pwscont.scenes"]
#     arch = "my_package.scenes:arch"
#
# Once the package is installed beside pwscont, the scene stands in the list, and it runs::
#
#     pwscont scenes
#     pwscont run arch -o out
