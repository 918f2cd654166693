"""The index of a solution that moves along interfaces: the sum of signs if H changes a little.

Where tests vanish all along a path, small changes of H move the path into one cell or into several,
or leave no solution there. They cannot change the index (the local degree), the sum of the signs of
det(dH/dz) over the solutions nearby. At fixed alpha these are the solutions w of
H'(x; (w, 0)) = e for a generic e (docs/theory, "Degenerate paths"): a problem like that of a
corner, in which the tests that vanish along the path choose the cell.

With one test the index is the sign on both sides if the signs agree, else 0. With several tests it
must be computed: all cells may have the sign +1 and the index be 2, or signs differ and it be 1.

Failure modes and answers
-------------------------
- e is not generic, so that a solution lies on an interface or in a singular cell: another e is
  tried.
- More cells than can be tried: the sign in the first cell is taken, and the corner is called
  searched in part, so that nothing is promised.
- The solution is not isolated: solutions fill a face at one alpha, whose extreme rays are not
  followed along interfaces, see :mod:`pwscont.transitions.corner.cone`.
"""

from __future__ import annotations

import numpy as np

from pwscont.basics.arrays import generic
from pwscont.basics.rounding import EPS
from pwscont.curve.metric import Metric
from pwscont.enumeration import Slice, solve_slice
from pwscont.linear.factorise import last_unit
from pwscont.transitions.corner.linearised import Linearised
from pwscont.transitions.rays import Ray

#: A test whose slope along the path is below this part of its terms vanishes all along.
LEVEL = EPS**0.5
#: Right-hand sides that are tried until one is generic.
MOST_TRIES = 3


def index_along(ray: Ray, zero: frozenset[int]) -> int:
    """Return the index of the solutions on a ray from a point where the tests ``zero`` vanish.

    Parameters
    ----------
    ray : Ray
        A ray along interfaces.
    zero : frozenset of int
        All tests that vanish where the ray starts; tests that grow along it choose no cell.

    Returns
    -------
    int
        The sum of the signs of det(dH/dz) over the solutions nearby, when H is changed a little.
    """
    for shift in range(MOST_TRIES):
        near = _nearby(ray, zero, shift)
        if not near.is_small:
            break
        metric = Metric(np.append(ray.curve.metric.scale, 1.0))
        found = solve_slice(near, metric, 0.0)
        if _is_regular(found):
            return sum(point.det_sign for point in found.points)
    return ray.state.orientation * int(np.sign(ray.curve.slope(ray.state)))


def _is_regular(found: Slice) -> bool:
    """Tell whether all solutions are isolated and lie inside their cells."""
    return not found.faces and all(
        len(point.characters) == 1 and point.det_sign for point in found.points
    )


def _nearby(ray: Ray, zero: frozenset[int], shift: int) -> Linearised:
    """Return the equations at fixed alpha near the ray, for one right-hand side."""
    selection, x, tangent = ray.curve.selection, ray.state.x, ray.state.tangent
    system, metric = selection.system, ray.curve.metric
    slopes = _slopes(ray, zero)
    level = frozenset(test for test, slope in slopes.items() if slope == 0.0)
    signs = system.test_functions(x[:-1], float(x[-1])) >= 0.0
    for test, slope in slopes.items():
        signs[test] = slope > 0.0
    size = abs(selection.jacobian(x)) @ metric.scale
    right = generic(len(size), float(shift)) * size
    return Linearised(system, metric, x, level, signs, last_unit(len(tangent)), right)


def _slopes(ray: Ray, zero: frozenset[int]) -> dict[int, float]:
    """Return the slopes along a ray of the tests that vanish, 0 for slopes that are rounding."""
    x, tangent, scale = ray.state.x, ray.state.tangent, ray.curve.metric.scale
    which = np.array(sorted(zero), dtype=np.intp)
    rows = ray.curve.selection.system.some_test_gradients(x[:-1], float(x[-1]), which)
    slopes = np.asarray(rows @ tangent)
    least = LEVEL * (abs(rows) @ (np.abs(tangent) + LEVEL * scale))
    return dict(zip(which.tolist(), np.where(np.abs(slopes) <= least, 0.0, slopes), strict=True))
