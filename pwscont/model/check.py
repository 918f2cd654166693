"""Does a new system keep its promises? For authors of plug-ins."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any, final

import numpy as np
import scipy.sparse as sp

from pwscont.foundation.arrays import Array, Matrix, finite_array
from pwscont.foundation.character import Character
from pwscont.foundation.rounding import EPS
from pwscont.model.contract import check_contract, checked_size
from pwscont.model.system import PiecewiseSystem

#: Central differences are right to about EPS^(2/3); what differs by more than this is wrong.
TOLERANCE = EPS**0.4
#: Newton steps to the interface of a test function.
STEPS_TO_INTERFACE = 20


@final
@dataclass(frozen=True, slots=True)
class Defect:
    """One broken promise.

    Attributes
    ----------
    what : str
        Which promise, and which method or test function broke it.
    z, alpha
        Where.
    size : float
        How far off, relative to the size of what was compared.
    """

    what: str
    z: Array
    alpha: float
    size: float

    def __str__(self) -> str:
        z = np.array2string(self.z, precision=6)
        return (
            f"{self.what} at z = {z}, alpha = {self.alpha:.6g}: off by {self.size:.1e} (relative)"
        )


@final
@dataclass(frozen=True, slots=True)
class Report:
    """The outcome of :func:`check_system`; it is true when there are no defects."""

    defects: tuple[Defect, ...]
    points: int

    def __bool__(self) -> bool:
        return not self.defects

    def __str__(self) -> str:
        if not self.defects:
            return f"no defects found at {self.points} points"
        return "\n".join([f"{len(self.defects)} defects:", *(f"- {d}" for d in self.defects)])


def check_system(system: PiecewiseSystem, points: Iterable[tuple[Any, float]]) -> Report:
    """Check a system's Jacobians, its continuity and fact F1 at and near some points.

    From every point each test function is followed to its zero set; there the selections of
    both sides must agree (H is continuous), and their Jacobians may differ only by a rank-one
    matrix c grad(kappa_i)^T (F1): otherwise tracing would turn the wrong way at a kink.

    Parameters
    ----------
    system : PiecewiseSystem
    points : iterable of (array_like, shape (n,)) and float
        Pairs (z, alpha), on the curve or not; a handful of random ones does.

    Returns
    -------
    Report
        ``bool(report)`` is True where nothing is wrong; ``print(report)`` names the defects.

    Raises
    ------
    InvalidSystemError
        If a method returns an array of the wrong shape.
    """
    size = checked_size(system)
    defects: list[Defect] = []
    count = 0
    for values, alpha in points:
        z = finite_array("z of a point", values, (size,))
        check_contract(system, z, float(alpha))
        x = np.append(z, float(alpha))
        defects += [*_wrong_jacobians(system, x), *_wrong_interfaces(system, x)]
        count += 1
    return Report(tuple(defects), count)


def _wrong_jacobians(system: PiecewiseSystem, x: Array) -> Iterator[Defect]:
    z, alpha = x[:-1], float(x[-1])
    character, differences = system.character(z, alpha), system.differences(alpha)
    compared = {
        f"jacobian in {system.describe(character)}": (
            system.jacobian(z, alpha, character),
            differences.jacobian(lambda y: system.residual(y[:-1], float(y[-1]), character), x),
        ),
        "test_jacobian": (
            system.test_jacobian(z, alpha),
            differences.jacobian(lambda y: system.test_functions(y[:-1], float(y[-1])), x),
        ),
    }
    for what, (given, expected) in compared.items():
        size = _relative(_dense(given) - expected, expected)
        if not size <= TOLERANCE:
            yield Defect(f"{what} does not match differences", z, alpha, size)


def _wrong_interfaces(system: PiecewiseSystem, x: Array) -> Iterator[Defect]:
    for test in range(len(system.test_functions(x[:-1], float(x[-1])))):
        y = _on_interface(system, x, test)
        if y is not None:
            yield from _wrong_interface(system, y, test)


def _on_interface(system: PiecewiseSystem, x: Array, test: int) -> Array | None:
    """Return a point near x with kappa_test = 0, None where Newton finds none."""
    for _ in range(STEPS_TO_INTERFACE):
        value = float(system.test_functions(x[:-1], float(x[-1]))[test])
        gradient = _dense(system.test_jacobian(x[:-1], float(x[-1])))[test]
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
    sides = [here.with_sign(test, sign) for sign in (True, False)]
    if not any(test in system.bounding_tests(side) for side in sides):
        return
    if any(system.end(side, frozenset({test})) for side in sides):
        return  # nothing is promised beyond
    one, other = (system.residual(z, alpha, side) for side in sides)
    if not (jump := _relative(one - other, np.append(np.abs(one), 1.0))) <= TOLERANCE:
        yield Defect(
            f"H jumps across test function {test} ({_names(system, sides)})", z, alpha, jump
        )
    J, K = (_dense(system.jacobian(z, alpha, side)) for side in sides)
    gradient = _dense(system.test_jacobian(z, alpha))[test]
    c = (K - J) @ gradient / (gradient @ gradient)
    if not (rest := _relative(K - J - np.outer(c, gradient), J)) <= TOLERANCE:
        what = f"F1: the Jacobians across test function {test} ({_names(system, sides)}) differ by"
        yield Defect(f"{what} more than c grad(kappa)^T", z, alpha, rest)


def _many_vanish(system: PiecewiseSystem, x: Array, test: int) -> bool:
    """Tell whether another test vanishes too: then four or more cells meet, not two."""
    gradients = np.abs(_dense(system.test_jacobian(x[:-1], float(x[-1]))))
    near = np.abs(system.test_functions(x[:-1], float(x[-1])))
    zero = near <= TOLERANCE * (gradients @ (np.abs(x) + EPS))
    zero[test] = False
    return bool(zero.any())


def _names(system: PiecewiseSystem, sides: list[Character]) -> str:
    return " | ".join(system.describe(side) for side in sides)


def _relative(difference: Array, reference: Array) -> float:
    """Return the largest entry of the difference relative to the largest of the reference."""
    size = float(np.abs(reference).max(initial=0.0)) or 1.0
    return float(np.abs(difference).max(initial=0.0)) / size


def _dense(matrix: Matrix) -> Array:
    return matrix.toarray() if sp.issparse(matrix) else np.asarray(matrix)
