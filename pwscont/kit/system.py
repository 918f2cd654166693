"""check_system: mistakes in a user's formulas."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from difflib import get_close_matches
from itertools import combinations
from typing import Any, final

import numpy as np

from pwscont.basics.arrays import Array, dense, finite_array, generic
from pwscont.basics.errors import InvalidInputError
from pwscont.basics.printing import counted, named, short
from pwscont.basics.rounding import EPS
from pwscont.kit.inspection import (
    TOLERANCE,
    Defect,
    closer_look,
    defect,
    is_solution,
    kinks,
    relative,
)
from pwscont.system.abilities import ABILITIES, completed_point, end_of, shown_size
from pwscont.system.box import Box
from pwscont.system.contract import check_cells, check_contract, check_declaration, checked_scale
from pwscont.system.selection import Selection
from pwscont.system.system import PiecewiseLinearSystem, PiecewiseSystem

#: Two names are nearly one if difflib's ratio is at least this.
NEARLY_ONE_NAME = 0.86
#: Most Newton steps to the interface of a test function.
STEPS_TO_INTERFACE = 20


@final
@dataclass(frozen=True, slots=True)
class Report:
    """The outcome of :func:`check_system`; a report is true when there are no defects."""

    defects: tuple[Defect, ...]
    points: int

    def __bool__(self) -> bool:
        return not self.defects

    def __repr__(self) -> str:
        found = counted(len(self.defects), "defect")
        return named(self, f"{found} at {counted(self.points, 'point')}")

    def __str__(self) -> str:
        if not self.defects:
            return f"no defects found at {counted(self.points, 'point')}"
        return "\n".join(
            [f"{counted(len(self.defects), 'defect')}:", *(f"- {d}" for d in self.defects)]
        )


def check_system(
    system: PiecewiseSystem, points: Iterable[tuple[Any, float]], radius: float = 0.1
) -> Report:
    """Check the promises of a system, at and near some points.

    - Jacobians agree with differences.
    - From every point each test function is followed to the zero set; there the selections of the
      two sides must agree (H is continuous), and the Jacobians may differ only by a rank-one matrix
      ``c grad(kappa_i)^T`` (F1): otherwise tracing would turn the wrong way at a kink.
    - Within ``radius`` of every point selections and tests are smooth: a kink that no test
      announces, such as a maximum in a residual, is found by steps of different lengths.
    - Signs of tests that :meth:`~PiecewiseSystem.bounding_tests` leaves out change nothing.
    - Functions that are promised to be affine are affine; every row that depends on a block's modes
      belongs to the block.
    - At the solutions among the points ``necessary`` holds, ``scale`` is not far off, and a system
      that says ``unique`` has no two solutions at the same alpha.
    - At the alphas of the points, for a slicewise linear system of at most a few thousand cells:
      the signs of all solutions sum to ``degree``, and a system that says ``unique`` has at most 1
      solution. For any other system a run shows the fault: the graph is not balanced, or the run
      refuses the promise.

    Parameters
    ----------
    system : PiecewiseSystem
    points : iterable of (array_like, shape (n,)) and float
        Pairs (z, alpha), on the curve or off the curve; a handful of random pairs is enough. Give
        some solutions too, such as ``(s.z, s.alpha)`` of a graph: what holds for solutions only is
        checked there.
    radius : float
        How far from the points is looked, relative to typical magnitudes.

    Returns
    -------
    Report
        ``bool(report)`` is True if nothing is wrong; ``print(report)`` names the defects.

    Raises
    ------
    InvalidSystemError
        If a method returns an array of the wrong shape, or magnitudes, bounds, periods or names
        that do not fit the unknowns, or would never be called.
    InvalidInputError
        If the radius is not positive, or a point is no pair (z, alpha).

    Examples
    --------
    >>> from pwscont import Switched, check_system
    >>> print(check_system(Switched(1, lambda z, t, sw: z - sw.relu(t)), [([0.0], 0.5)]))
    no defects found at 1 point
    """
    check_declaration(system)
    check_cells(system)
    if not 0.0 < finite_array("radius", radius, ()) < np.inf:
        raise InvalidInputError(f"radius must be positive, got {radius}")
    defects: list[Defect] = []
    solutions: list[Array] = []
    count = 0
    for x in _checked_points(system, points):
        z, alpha = x[:-1], float(x[-1])
        checked_scale(system, system.scale(alpha, alpha))
        Box.of(system)
        check_contract(system, z, alpha)
        defects += [*_wrong_jacobians(system, x), *_wrong_interfaces(system, x, float(radius))]
        defects += closer_look(system, x, float(radius))
        solutions += [x] if is_solution(system, x) else []
        count += 1
        defects += _misspelt(system, x) if count == 1 else []
    defects += _not_unique(system, solutions)
    return Report(tuple(_shown(system, found) for found in defects), count)


def _shown(system: PiecewiseSystem, found: Defect) -> Defect:
    """Return a defect without unknowns that the system hides."""
    return replace(found, z=found.z[: shown_size(system)])


def _checked_points(system: PiecewiseSystem, points: Any) -> list[Array]:
    """Return points (z, alpha) as vectors, or say which entry is no point."""
    if not isinstance(points, Iterable):
        raise InvalidInputError(f"points must be pairs (z, alpha), got {points!r}")
    size = shown_size(system)
    checked = (_checked_point(f"points[{i}]", point, size) for i, point in enumerate(points))
    return [completed_point(system, x) for x in checked]


def _checked_point(name: str, point: Any, size: int) -> Array:
    if not isinstance(point, Sequence) or isinstance(point, str) or len(point) != 2:
        raise InvalidInputError(
            f"{name} must be a pair (z, alpha), got {short(repr(point))}; give one point as "
            "[(z, alpha)]"
        )
    z = finite_array(f"z of {name}", point[0], (size,))
    return np.append(z, finite_array(f"alpha of {name}", point[1], ()))


def _not_unique(system: PiecewiseSystem, solutions: list[Array]) -> Iterator[Defect]:
    """Compare the solutions found at the same alpha with the promise of uniqueness."""
    for x, y in combinations(solutions, 2) if system.unique else ():
        apart = np.abs((x - y) / system.differences(float(x[-1])).scale).max()
        if x[-1] == y[-1] and apart > TOLERANCE:
            yield defect("unique is True, but there is another solution at this alpha", x, apart)


def _wrong_jacobians(system: PiecewiseSystem, x: Array) -> Iterator[Defect]:
    z, alpha = x[:-1], float(x[-1])
    here = Selection(system, system.character(z, alpha))
    compared = {
        f"jacobian in {system.describe(here.character)}": (here.jacobian(x), here.residual),
        "test_jacobian": (
            system.test_jacobian(z, alpha),
            lambda y: system.test_functions(y[:-1], float(y[-1])),
        ),
    }
    for what, (matrix, function) in compared.items():
        expected = system.differences(alpha).jacobian(function, x)
        size = relative(dense(matrix) - expected, expected)
        if not size <= TOLERANCE:
            yield defect(f"{what} does not match differences", x, size)


def _misspelt(system: PiecewiseSystem, x: Array) -> Iterator[Defect]:
    """Yield methods of a user's class whose names are nearly those of methods that are called."""
    called = {name for each in (PiecewiseSystem, *ABILITIES) for name in vars(each)}
    for each in type(system).__mro__:
        if each.__module__.partition(".")[0] in ("pwscont", "builtins", "abc"):
            continue
        for name in sorted(vars(each).keys() - called):
            near = (
                () if name.startswith("_") else get_close_matches(name, called, 1, NEARLY_ONE_NAME)
            )
            if near and name != f"{near[0]}s":  # a name of many may be a helper of the user
                yield defect(f"{name} is never asked for; is {near[0]} meant?", x, np.nan)


def _wrong_interfaces(system: PiecewiseSystem, x: Array, radius: float) -> Iterator[Defect]:
    for test in range(len(system.test_functions(x[:-1], float(x[-1])))):
        y = _on_interface(system, x, test)
        if y is not None:
            yield from _wrong_interface(system, y, test)
            which = "on the boundary of its own cell: decide by character.signs, not by z"
            yield from kinks(system, y, radius, which)


def _on_interface(system: PiecewiseSystem, x: Array, test: int) -> Array | None:
    """Return a point near x with kappa_test = 0, None where Newton finds none."""
    for _ in range(STEPS_TO_INTERFACE):
        value = float(system.test_functions(x[:-1], float(x[-1]))[test])
        gradient = dense(system.test_jacobian(x[:-1], float(x[-1])))[test]
        slope = float(gradient @ gradient)
        if slope == 0.0 or not np.isfinite(value):
            return None
        step = value / slope * gradient
        x = x - step
        if np.linalg.norm(step) <= EPS * (1.0 + np.linalg.norm(x)) * 8.0:
            return x
    return None


def _wrong_interface(system: PiecewiseSystem, x: Array, test: int) -> Iterator[Defect]:
    z, alpha = x[:-1], float(x[-1])
    here = system.character(z, alpha)
    if not system.domain[0] <= alpha <= system.domain[1] or _many_vanish(system, x, test):
        return
    cells = [here.with_sign(test, sign) for sign in (True, False)]
    one, other = sides = [Selection(system, cell) for cell in cells]
    names = f"({' | '.join(system.describe(cell) for cell in cells)})"
    if not any(side.is_bounded_by(test) for side in sides):
        what = f"bounding_tests leaves out {system.test_name(test)}, whose sign changes H {names}"
        yield from _differing(one, other, x, what)
        return
    if any(end_of(system, cell, frozenset({test})) for cell in cells):
        return  # nothing is promised beyond
    across = f"across test function {test} {names}"
    value = one.residual(x)
    if (
        not (jump := relative(value - other.residual(x), np.append(np.abs(value), 1.0)))
        <= TOLERANCE
    ):
        yield defect(f"H jumps {across}", x, jump)
    J, K = (dense(side.jacobian(x)) for side in sides)
    gradient = dense(system.test_jacobian(z, alpha))[test]
    c = (K - J) @ gradient / (gradient @ gradient)
    if not (rest := relative(K - J - np.outer(c, gradient), J)) <= TOLERANCE:
        what = f"F1: the Jacobians {across} differ by more than c grad(kappa)^T"
        yield defect(what, x, rest)
    elif not (size := _wrong_kink(one, other, test, c)) <= TOLERANCE:
        yield defect(f"kink {across}", x, size)


def _wrong_kink(one: Selection, other: Selection, test: int, c: Array) -> float:
    """Return the differences between c and the two statements of a system about a kink."""
    system = one.system
    if not (isinstance(system, PiecewiseLinearSystem) and system.knows_kinks):
        return 0.0
    if not (one.is_bounded_by(test) and other.is_bounded_by(test)):
        return 0.0
    told = other.kink(one, test).copy(), -one.kink(other, test)
    return max(relative(known - c, np.append(np.abs(c), EPS)) for known in told)


def _differing(one: Selection, other: Selection, x: Array, what: str) -> Iterator[Defect]:
    """Compare two selections beside a point of their interface."""
    y = x + one.system.differences(float(x[-1])).scale * np.append(generic(len(x) - 1), 0.0)
    value = one.residual(y)
    size = relative(value - other.residual(y), np.append(np.abs(value), EPS))
    if not size <= TOLERANCE:
        yield defect(what, y, size)


def _many_vanish(system: PiecewiseSystem, x: Array, test: int) -> bool:
    """Tell whether another test vanishes too: then four or more cells meet, not two."""
    gradients = np.abs(dense(system.test_jacobian(x[:-1], float(x[-1]))))
    near = np.abs(system.test_functions(x[:-1], float(x[-1])))
    zero = near <= TOLERANCE * (gradients @ (np.abs(x) + EPS))
    zero[test] = False
    return bool(zero.any())
