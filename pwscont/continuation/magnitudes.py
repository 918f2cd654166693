"""Typical magnitudes of z for a system that gives none, from solutions.

Without ``scale()`` magnitudes of one are tried first. Where the first solutions are not far from
one in magnitude, these are kept.

Failure modes and answers
-------------------------
- Difference steps that fit unknowns of size one are too long for unknowns of size 1e-9: Newton then
  finds points that are no solutions, of any size. Magnitudes are accepted only if the solutions
  found with them have these magnitudes.
- Unknowns of different magnitudes: a second round gives each unknown its own.
- No solution but zero is found: each unknown is changed until the change of H equals H itself; the
  size of that change tells whether magnitudes of one are far off.
- An unknown that is zero in all solutions found has no magnitude: that of the largest unknown is
  taken.
- A solution that decays along a chain of unknowns: an unknown that is tiny beside the largest is
  not measured by its own size.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from pwscont.basics.arrays import Array, dense
from pwscont.basics.outcome import Failure
from pwscont.basics.rounding import CONFIDENCE
from pwscont.curve.error_samples import magnitude
from pwscont.curve.metric import Metric
from pwscont.curve.semismooth import semismooth_newton
from pwscont.search.enumeration import Found
from pwscont.system.contract import jacobian_at, residual_at
from pwscont.system.system import PiecewiseSystem

#: Magnitudes that differ by less than this factor are alike.
ALIKE = 100.0
#: Larger solutions would take too many steps of size one, smaller ones lose too many digits.
LARGE, SMALL = 1e3, 1e-6
#: Jacobians by two step lengths that differ by more than this part: one of them is wrong.
DIFFERENT = 1e-3
#: Magnitudes to try where solutions give no hint: from one outwards.
TRIED = tuple(10.0 ** (sign * k) for k in range(3, 16, 3) for sign in (-1, 1))
ROUNDS = 3
#: An unknown smaller than this part of the largest is not measured by its own size.
TAIL = 1e-30


@np.errstate(all="ignore")  # trial points may lie where H cannot be computed
def magnitudes(
    system: PiecewiseSystem, interval: tuple[float, float], guess: Array
) -> Array | None:
    """Return typical magnitudes of z where those of one do not fit, None where they do.

    Parameters
    ----------
    system : PiecewiseSystem
        Fitted to the interval.
    interval : tuple of float
    guess : ndarray, shape (n,)
        Where to look for solutions.

    Returns
    -------
    ndarray, shape (n,), or None
        None, too, where no magnitudes fit.
    """
    found = list(_solutions(system, interval, guess))
    if ones_fit(system, interval, found):
        return None
    hints = [size] if (size := _sizes(found).max(initial=0.0)) else []
    reach = _reach(system, interval, guess)
    if not hints and reach.min() >= 1.0 / LARGE and reach.max() <= LARGE:
        return None
    alike = (np.full(system.size, size) for size in (*hints, *TRIED))
    sizes = (reach, *alike)
    tried = (_settled(system, interval, size, guess) for size in sizes)
    return next((fitting for fitting in tried if fitting is not None), None)


def _reach(system: PiecewiseSystem, interval: tuple[float, float], guess: Array) -> Array:
    """Return by how much each unknown must change for H to change as much as H is off zero."""
    off = max(float(np.abs(_residual(system, guess, alpha)).max()) for alpha in interval)
    before = _residual(system, guess, interval[0])

    def reaches(j: int, size: float) -> bool:
        moved = guess.copy()
        moved[j] += size
        with np.errstate(all="ignore"):
            return bool(np.abs(_residual(system, moved, interval[0]) - before).max() >= off)

    sizes = ((size for size in sorted(TRIED) if reaches(j, size)) for j in range(system.size))
    return np.array([next(found, 1.0) for found in sizes])


def _residual(system: PiecewiseSystem, z: Array, alpha: float) -> Array:
    return residual_at(system, z, alpha, system.character(z, alpha))


@np.errstate(all="ignore")
def ones_fit(
    system: PiecewiseSystem, interval: tuple[float, float], found: Sequence[Found]
) -> bool:
    """Tell whether solutions found with magnitudes of one are solutions, and not far from them."""
    sizes = _sizes(found)
    if not SMALL < sizes.max() < LARGE or sizes[sizes > 0.0].min() < SMALL:
        return False
    usual = sizes[sizes > 0.0].min() > 1.0 / LARGE
    return bool(usual) or all(_sees(system, interval, sizes, x) for x, _ in found)


def _sees(system: PiecewiseSystem, interval: tuple[float, float], sizes: Array, x: Array) -> bool:
    """Tell whether difference steps of one give the same Jacobian as steps of the sizes found."""
    finer = system.within(*interval, np.where(sizes > 0.0, sizes, 1.0))
    character = system.character(x[:-1], float(x[-1]))
    J, K = (dense(jacobian_at(s, x[:-1], float(x[-1]), character)) for s in (system, finer))
    return bool((np.abs(J - K) <= DIFFERENT * np.abs(K).max()).all())


def _settled(
    system: PiecewiseSystem, interval: tuple[float, float], sizes: Array, guess: Array
) -> Array | None:
    """Return magnitudes that the solutions found with them confirm, beginning with ``sizes``."""
    for _ in range(ROUNDS):
        found = list(_solutions(system.within(*interval, sizes), interval, guess))
        new = _sizes(found)
        if not found or not (largest := new.max()):
            return None
        unseen = new == 0.0
        new = np.where(new > 0.0, np.maximum(new, TAIL * largest), largest)
        alike = (new <= ALIKE * sizes) & (sizes <= ALIKE * new) | unseen
        sizes = new
        if alike.all():
            return sizes
    return None


def _solutions(
    system: PiecewiseSystem, interval: tuple[float, float], guess: Array
) -> Iterator[Found]:
    """Yield solutions at both ends of the interval and in its middle."""
    metric = Metric.of(system, interval)
    for alpha in (interval[0], 0.5 * sum(interval), interval[1]):
        found = semismooth_newton(system, metric, guess, alpha)
        if not isinstance(found, Failure):
            yield found


def _sizes(found: Sequence[Found]) -> Array:
    """Return the largest magnitude of each unknown, zero where it is nothing but its error."""
    if not found:
        return np.zeros(1)
    sizes = [np.abs(x) * (np.abs(x) > CONFIDENCE * _error(x, error)) for x, error in found]
    largest: Array = np.max(sizes, axis=0)[:-1]
    return largest


def _error(x: Array, error: Array) -> Array:
    return magnitude(x, np.atleast_2d(error))
