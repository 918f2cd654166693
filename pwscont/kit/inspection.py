"""The part of check_system beyond Jacobians and F1: kinks, affine models, blocks, scale.

Failure modes and answers
-------------------------
- A kink between samples: second differences shrink like the step at a kink, like the square of the
  step for a smooth function; a bump as narrow as a step shrinks in the end, so three lengths of
  steps are compared.
- Rounding looks like a kink: differences below a part of the values are left alone.
- What holds for solutions only is checked only where H is zero to rounding.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import final

import numpy as np

from pwscont.basics.arrays import Array, dense, generic
from pwscont.basics.character import Character
from pwscont.basics.errors import InvalidSystemError
from pwscont.basics.printing import UNNAMED, named, state
from pwscont.basics.rounding import EPS
from pwscont.enumeration.options import measured_at
from pwscont.search.enumeration import solve_surely
from pwscont.system.abilities import all_names
from pwscont.system.contract import check_contract, residual_at
from pwscont.system.promises import check_blocks, check_promises, checked_necessary
from pwscont.system.selection import Selection
from pwscont.system.system import (
    Block,
    PiecewiseSystem,
    SlicewiseLinearSystem,
    number_of_cells,
)

#: Largest relative difference that is no defect: central differences are right to about EPS^(2/3).
TOLERANCE = EPS**0.4
#: Directions along which kinks are looked for, and samples along each.
KINK_DIRECTIONS, KINK_SAMPLES = 4, 33
#: The steps are divided by STEP_RATIO, twice; second differences of a smooth function then shrink
#: at least by the factor SHRINK, half way between a kink's and a parabola's, on a log scale.
STEP_RATIO = 8
SHRINK = float(STEP_RATIO) ** 1.5
#: Factor by which a solution exceeds a typical magnitude that is refuted.
MOST_MAGNITUDES = 1e3
#: Most modes of a block that are compared, and most cells that are searched for solutions.
MOST_MODES, MOST_CELLS = 64, 4096


@final
@dataclass(frozen=True, slots=True)
class Defect:
    """A broken promise.

    Attributes
    ----------
    what : str
        The broken promise, and the method or test function that breaks the promise.
    z, alpha
        The point.
    size : float
        The difference, relative to the size of the compared values; nan without comparison.
    """

    what: str
    z: Array
    alpha: float
    size: float

    def __str__(self) -> str:
        where = f"{state(UNNAMED, self.z)}, alpha = {self.alpha:.6g}".replace("z=", "z = ")
        off = "" if np.isnan(self.size) else f": off by {self.size:.1e} (relative)"
        return f"{self.what} at {where}{off}"

    def __repr__(self) -> str:
        return named(self, self)


def defect(what: str, x: Array, size: float) -> Defect:
    """Return the defect at a point (z, alpha)."""
    return Defect(what, x[:-1], float(x[-1]), float(size))


def closer_look(system: PiecewiseSystem, x: Array, radius: float) -> Iterator[Defect]:
    """Yield the defects at and around a point."""
    yield from kinks(system, x, radius, "that no test function announces")
    if isinstance(system, SlicewiseLinearSystem):
        yield from _wrong_classes(system, x)
    if is_solution(system, x):
        yield from _wrong_scale(system, x)
        if isinstance(system, SlicewiseLinearSystem):
            yield from _wrong_necessary(system, x)


def relative(difference: Array, reference: Array) -> float:
    """Return the largest entry of the difference relative to the largest of the reference."""
    size = float(np.abs(reference).max(initial=0.0)) or 1.0
    return float(np.abs(difference).max(initial=0.0)) / size


def is_solution(system: PiecewiseSystem, x: Array) -> bool:
    """Tell whether H is zero to rounding of the terms."""
    here = Selection(system, system.character(x[:-1], float(x[-1])))
    return bool((np.abs(here.residual(x)) <= TOLERANCE**2 * _terms(here, x)).all())


def _terms(selection: Selection, x: Array) -> Array:
    """Return the magnitude of the terms of each equation."""
    scale = selection.system.differences(float(x[-1])).scale
    terms: Array = np.abs(dense(selection.jacobian(x))) @ (np.abs(x) + scale)
    return terms


def kinks(system: PiecewiseSystem, x: Array, radius: float, which: str) -> Iterator[Defect]:
    """Look for kinks of the selection and of the tests along some lines through a point."""
    alpha = float(x[-1])
    character, differences = system.character(x[:-1], alpha), system.differences(alpha)
    functions: dict[str, Callable[[Array], Array]] = {
        f"residual in {system.describe(character)} has": Selection(system, character).residual,
        "test_functions have": lambda y: np.array(system.test_functions(y[:-1], float(y[-1]))),
    }
    for what, function in functions.items():
        for shift in range(KINK_DIRECTIONS):
            step = radius * differences.scale * generic(len(x), float(shift))
            if not all(differences.contains(alpha + sign * step[-1]) for sign in (-1.0, 1.0)):
                step[-1] = 0.0
            at = _kink(lambda t, f=function, d=step: f(x + t * d))  # type: ignore[misc]
            if at is not None:
                yield defect(f"{what} a kink or jump {which}", x + at * step, np.nan)
                break


def _kink(function: Callable[[float], Array]) -> float | None:
    """Return the place in (-1, 1) of a kink of a function, None without a kink."""
    lo, hi, before, size = -1.0, 1.0, None, 0.0
    for _ in range(3):
        t = np.linspace(lo, hi, KINK_SAMPLES)
        with np.errstate(all="ignore"):
            values = np.array([function(float(s)) for s in t])
        if not np.isfinite(values).all():
            return None
        seconds = np.abs(np.diff(values, 2, axis=0)).max(axis=1, initial=0.0)
        i, size = int(np.argmax(seconds)), max(size, float(np.abs(values).max(initial=0.0)))
        if seconds[i] <= EPS**0.75 * size or (before and seconds[i] * SHRINK < before):
            return None
        step, before = t[1] - t[0], seconds[i]
        lo, hi = t[i + 1] - 2.0 * step, t[i + 1] + 2.0 * step
    return float(t[i + 1])


def _wrong_classes(system: SlicewiseLinearSystem, x: Array) -> Iterator[Defect]:
    """Check that H and the tests are affine as promised, and that blocks own the rows of modes."""
    z, alpha = x[:-1], float(x[-1])
    differences = system.differences(alpha)
    interval = (max(alpha - 1.0, differences.lo), min(alpha + 1.0, differences.hi))
    try:
        check_promises(system, interval, x, check_contract(system, z, alpha))
        check_blocks(system, len(system.test_functions(z, alpha)))
        yield from _wrong_number(system, x)
    except InvalidSystemError as error:
        yield defect(str(error), x, 1.0)
        return
    here = system.character(z, alpha)
    for number, block in enumerate(system.blocks()):
        others = np.setdiff1d(np.arange(system.size), block.rows)
        first, *further = (residual_at(system, z, alpha, c) for c in _in_each_mode(here, block))
        for second in further:
            size = relative((second - first)[others], np.append(np.abs(first), EPS))
            if not size <= TOLERANCE:
                what = f"blocks(): a mode of block {number} changes rows that it does not own"
                yield defect(what, x, size)
                break
    yield from _forgotten(system, x, here)


def _forgotten(system: SlicewiseLinearSystem, x: Array, here: Character) -> Iterator[Defect]:
    """Look for a mode that no block has, and for a test that matters and is in no block."""
    selection = Selection(system, here)
    value, terms = selection.residual(x), _terms(selection, x)

    def change(other: Character, rows: Sequence[int]) -> float:
        return relative((Selection(system, other).residual(x) - value)[list(rows)], terms)

    for number, block in enumerate(system.blocks()):
        size = min(change(other, block.rows) for other in _in_each_mode(here, block))
        if size > TOLERANCE and len(block.modes) <= MOST_MODES:
            what = f"blocks(): block {number} does not have the mode of {system.describe(here)}"
            yield defect(what, x, size)
    known = {test for block in system.blocks() for test in block.tests}
    for test in sorted(set(range(len(here.signs))) - known):
        size = change(here.flip(test), range(system.size))
        if size > TOLERANCE:
            what = f"blocks(): {system.test_name(test)} changes H, and is in no block"
            yield defect(what, x, size)


def _in_each_mode(character: Character, block: Block) -> list[Character]:
    """Return a character for each mode of a block."""
    return [character.with_signs(block.tests, mode) for mode in block.modes[:MOST_MODES]]


def _wrong_number(system: SlicewiseLinearSystem, x: Array) -> Iterator[Defect]:
    """Compare all solutions at the alpha of x with the promises ``unique`` and ``degree``."""
    if system.degree is None and not system.unique:
        return
    if number_of_cells(system.blocks()) > MOST_CELLS:
        return
    alpha = float(x[-1])
    found = solve_surely(*measured_at(system, alpha), alpha)
    if found.faces or found.undecided or found.singular:
        return
    if any(len(point.characters) > 1 for point in found.points):
        return  # on an interface the sign is that of no cell
    signs = [point.det_sign for point in found.points]
    if system.degree is not None and sum(signs) != system.degree:
        what = f"degree is {system.degree}, but the signs of all solutions sum to {sum(signs)}"
        yield defect(what, x, abs(sum(signs) - system.degree))
    if system.unique and len(signs) > 1:
        what = f"unique is True, but there are {len(signs)} solutions at this alpha"
        yield defect(what, x, len(signs) - 1)


def _wrong_scale(system: PiecewiseSystem, x: Array) -> Iterator[Defect]:
    """Compare a solution with the typical magnitudes that ``scale`` returns."""
    scale = system.differences(float(x[-1])).scale[:-1]
    ratios = np.abs(x[:-1]) / scale
    j = int(np.argmax(ratios))
    if system.gives_scale and ratios[j] > MOST_MAGNITUDES:
        what = f"scale() says {scale[j]:.3g} for {all_names(system)[j]}, which is {x[j]:.3g}"
        yield defect(what, x, ratios[j])


def _wrong_necessary(system: SlicewiseLinearSystem, x: Array) -> Iterator[Defect]:
    """Check the inequalities of ``necessary`` at a solution."""
    z, alpha = x[:-1], float(x[-1])
    (rows, b), scale = checked_necessary(system, alpha), system.differences(alpha).scale[:-1]
    terms = np.abs(rows) @ (np.abs(z) + scale) + np.abs(b)
    short = -(rows @ z + b) / np.where(terms > 0.0, terms, 1.0)
    for row in np.flatnonzero(short > TOLERANCE):
        yield defect(f"necessary(): a solution breaks inequality {row}", x, short[row])
