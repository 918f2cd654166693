"""Corners: a solution, the tests that vanish there, and the cells that meet there.

A solution inside a cell is a corner at which no test vanishes, a solution on an interface a corner
at which a single test vanishes. :meth:`Corner.at` decides which tests vanish; the rays that leave
a corner are found in :mod:`pwscont.transitions.cone` (docs/theory, F8).
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from itertools import product
from typing import TypeAlias, final

import numpy as np

from pwscont.basics.arrays import Array, Indices, Matrix, Signs, generic, joined
from pwscont.basics.character import Character
from pwscont.basics.errors import InvalidSystemError
from pwscont.basics.rounding import EPS, GUARD
from pwscont.curve.error_samples import samples, slack_by_constants, zero_up_to
from pwscont.curve.metric import Metric
from pwscont.linear.factor import Factor
from pwscont.linear.factorise import bordered, largest_in_scaled_rows, last_unit
from pwscont.linear.jacobian import StructuredJacobian
from pwscont.system.selection import Selection
from pwscont.system.system import Block, PiecewiseSystem, SlicewiseLinearSystem
from pwscont.transitions.rays import SLANT

#: A direction d of length one in the metric, and the cells whose closures contain d.
Direction: TypeAlias = tuple[Array, tuple[Character, ...]]

#: Error of a component of a unit direction, in typical magnitudes and divided by SLANT, because
#: SLANT multiplies this error: a component that should be zero is not compared with itself.
NOISE = GUARD * EPS / SLANT
#: Refinements of a direction with components below rounding: each gains all digits of a double.
REFINEMENTS = 3


@final
@dataclass(frozen=True, slots=True, eq=False)
class Corner:
    """A solution, and the tests that vanish there: none inside a cell, one on an interface."""

    system: PiecewiseSystem
    metric: Metric
    x: Array  # shape (n + 1,)
    error: Array  # samples of the error of ``x``, shape (k, n + 1)
    zero: frozenset[int]  # the tests that vanish
    tests: Array  # all tests there, shape (m,); the signs of those that vanish mean nothing

    @classmethod
    def at(
        cls,
        system: PiecewiseSystem,
        metric: Metric,
        x: Array,
        error: Array,
        zero: frozenset[int] | None = None,
    ) -> Corner:
        """Return the corner at ``x``, by default with all tests that are zero there to rounding.

        Where only typical magnitudes say so, and H is linear in z, the constants of H and of the
        tests decide: the constants are what typical magnitudes stand for.
        """
        tests = np.array(system.test_functions(x[:-1], float(x[-1])), dtype=float)
        if zero is not None:
            return cls(system, metric, x, error, zero, tests)
        gradients, sizes = system.test_jacobian(x[:-1], float(x[-1])), np.abs(tests)
        vanish: Signs = sizes <= zero_up_to(gradients, np.abs(x) + metric.scale, error)
        surely = sizes <= zero_up_to(gradients, np.abs(x), error)
        if not surely[vanish].all() and isinstance(system, SlicewiseLinearSystem):  # seldom
            here = Selection(system, Character.of(tests))
            jacobian = here.jacobian(x)
            factor = bordered(jacobian, last_unit(len(x)), metric.binary)
            if not factor.is_singular():
                constants = here.residual_and(x, 0.0) - joined(jacobian @ x, 0.0)
                terms = gradients, tests, x, error, factor, jacobian, constants
                vanish &= sizes <= slack_by_constants(*terms)
        zero = frozenset(np.flatnonzero(vanish).tolist())
        return cls(system, metric, x, error, zero, tests)

    @classmethod
    def of_start(cls, system: PiecewiseSystem, metric: Metric, x: Array, error: Array) -> Corner:
        """Return where a start lies; refuse tests that are not finite.

        Tests that bound no cell there do not count.
        """
        corner = cls.at(system, metric, x, error)
        if len(corner.tests) and not np.isfinite(corner.tests).all():
            raise InvalidSystemError(
                f"{type(system).__name__}.test_functions returned {corner.tests} at a solution, "
                f"alpha = {x[-1]:.6g}: all must be finite"
            )
        here, zero = corner.character, corner.zero
        bounding = (system.bounding_tests(cell) for cell in (here, *map(here.flip, zero)))
        return replace(corner, zero=frozenset()) if all(map(zero.isdisjoint, bounding)) else corner

    @property
    def character(self) -> Character:
        """The character of the signs of the tests, those that vanish included."""
        return Character.of(self.tests)

    @property
    def which(self) -> Indices:
        """The tests that vanish, in order, shape (k,)."""
        return np.array(sorted(self.zero), dtype=np.intp)

    @property
    def gradients(self) -> Matrix:
        """The gradients of the tests that vanish, shape (k, n + 1)."""
        z, alpha = self.x[:-1], float(self.x[-1])
        return self.system.some_test_gradients(z, alpha, self.which)

    def all_cells(self) -> list[Character]:
        """Return a character for each cell, from all sign patterns of the vanishing tests."""
        cells: dict[bytes, Character] = {}
        here, tests = self.character, sorted(self.zero)
        for signs in product((False, True), repeat=len(tests)):
            character = here.with_signs(tests, signs)
            cells.setdefault(self.system.cell(character), character)
        return list(cells.values())

    def restricted(self, blocks: Iterable[Block]) -> list[Block]:
        """Return blocks of the system with only the modes of cells that meet at the corner."""
        here = self.character

        def meets(block: Block, mode: tuple[bool, ...]) -> bool:
            there, fixed = here.with_signs(block.tests, mode), set(block.tests) - self.zero
            bounding = fixed.intersection(self.system.bounding_tests(there))
            return all(there.array[i] == here.array[i] for i in bounding)

        return [Block(b.tests, b.rows, tuple(m for m in b.modes if meets(b, m))) for b in blocks]

    def vanishing(self, selection: Selection) -> tuple[Indices, Matrix]:
        """Return the tests that bound a cell and vanish, shape (k,), and the rows of gradients."""
        which = np.flatnonzero(np.isin(selection.bounding, list(self.zero)))
        return selection.bounding[which], selection.test_gradients(self.x)[which]

    def ray_in(self, selection: Selection) -> tuple[Array, Array] | None:
        """Return the null vector d of J_chi, and the slopes along d of vanishing bounding tests.

        None where J_chi has several null vectors to rounding. Slopes within rounding are 0.
        """
        x, scale = self.x, self.metric.scale
        jacobian, rows = selection.jacobian(x), self.vanishing(selection)[1]
        factor = bordered(jacobian, generic(len(x)) / scale, self.metric.binary)
        if factor.is_singular():
            return None
        direction = self.metric.normalised(factor.solve(last_unit(len(x))))
        slopes: Array = rows @ direction
        clear = np.abs(slopes) > zero_up_to(rows, np.abs(direction) + NOISE * scale, part=SLANT)
        if slopes[~clear].any():  # small components, as at the end of a ladder of diodes
            refined, error = self._refined(jacobian, factor, direction)
            tiny, sizes = rows @ refined, np.abs(refined)
            least = np.maximum(zero_up_to(rows, sizes, part=SLANT), zero_up_to(rows, sizes, error))
            if (resolved := ~clear & (np.abs(tiny) > least)).any():
                return refined, np.where(clear | resolved, tiny, 0.0)
        return direction, np.where(clear, slopes, 0.0)

    def _refined(self, jacobian: Matrix, factor: Factor, d: Array) -> tuple[Array, Array]:
        """Return a null vector d of J_chi with small components refined, and samples of the error.

        An entry of J_chi that is zero is exact. Any other entry errs by a part of the largest entry
        of the row: the entry may be rounding where symmetry makes zero.
        """
        for _ in range(REFINEMENTS):
            shift = factor.solve(joined(jacobian @ d, 0.0))
            d = d - shift
        lengths, entries = np.abs(d) / self.metric.scale, np.ones((1, len(d)))
        if not isinstance(jacobian, StructuredJacobian):
            entries = abs(jacobian).astype(bool)
        terms = largest_in_scaled_rows(jacobian, self.metric.scale) * (entries @ lengths)
        return d, np.vstack([factor.solve_all(EPS * joined(terms, 0.0) * samples(len(d))), shift])
