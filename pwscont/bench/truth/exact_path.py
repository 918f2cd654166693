"""The true pieces of a system with straight pieces and too many cells to try every cell.

Only the list of cells that the path visits is taken from ExactLinear. Each piece is then made again
from the character alone: the line that solves the frozen selection, and the stretch of this line on
which no bounding test is negative, in rational arithmetic, or by
:func:`~pwscont.bench.truth.refinement.refined` where the system is larger. A piece found is called
true if the piece agrees with the piece made again in the sign of the determinant and the ends, and
thereby in the tests that end the piece; all tests must be positive in between. Pieces must join,
and the signs must sum to the system's degree, if known.

Errors are measured against numbers that do not come from ExactLinear, and mean the same for
ExactLinear as for every other stepper. The verdict on ExactLinear means less: the cells come from
ExactLinear, and "right" only repeats that each piece is true. The verdict on PseudoArclength and
NaturalParameter compares two independent ways. The path is not claimed to be complete: a component
that the search of ``explore`` misses is missed here, unless the signs of the component are missing
in the sum.

Failure modes and answers
-------------------------
- A piece is not true, ends inside the interval without a following piece, or is vertical: refused.
- A test vanishes all along a piece, so that the piece belongs to several cells: refused.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction

import numpy as np

from pwscont import PiecewiseLinearSystem
from pwscont.bench.truth.known_answer import TruePiece, Truth, UnknownAnswerError
from pwscont.bench.truth.rational import line_of, piece_on, solve, tests_along
from pwscont.bench.truth.refinement import refined
from pwscont.extending import Array, Piece

KNOWN_BY = "the exact path, each piece verified"
#: Most unknowns for rational elimination, which then takes milliseconds; for 20 unknowns
#: elimination takes twenty times as long as refinement.
SMALL = 12
#: Distance, in the metric of the problem, up to which an end of a found piece agrees with the true
#: end.
AGREES = 1e-9
#: Part of a test's value and change over the interval up to which the test vanishes along a piece.
VANISHES = Fraction(1, 10**30)


def verified_path(
    system: PiecewiseLinearSystem,
    interval: tuple[float, float],
    scale: Array,
    pieces: Sequence[Piece],
) -> Truth:
    """Return the truth for the pieces of a graph, each piece verified.

    Parameters
    ----------
    system : PiecewiseLinearSystem
    interval : tuple of float
    scale : ndarray, shape (n + 1,)
        Typical magnitudes, of the problem's metric.
    pieces : sequence of Piece
        The pieces of a graph made by :class:`~pwscont.ExactLinear`.

    Raises
    ------
    UnknownAnswerError
        If there are no pieces, a piece is not true, or the pieces do not join.
    """
    if not pieces:
        raise UnknownAnswerError("the exact path has no pieces: its search found none")
    true = [_verified(system, interval, scale, piece) for piece in pieces]
    truth = Truth(true, interval, scale, KNOWN_BY)
    _check_cells(truth)
    _check_joints(truth)
    _check_balance(truth, system.degree)
    return truth


def _verified(
    system: PiecewiseLinearSystem, interval: tuple[float, float], scale: Array, piece: Piece
) -> TruePiece:
    true = _made_again(system, interval, piece)
    if true.det_sign != piece.det_sign:
        raise _refused(piece, f"its determinant has the sign {true.det_sign:+d}")
    found = piece.points[[0, -1]]
    off = (found[np.argsort(found[:, -1])] - true.ends()) / scale
    if not np.linalg.norm(off, axis=1).max() <= AGREES:  # also refuses nan
        raise _refused(piece, f"its ends are off by {np.abs(off).max():.1e}")
    return true


def _made_again(
    system: PiecewiseLinearSystem, interval: tuple[float, float], piece: Piece
) -> TruePiece:
    """Return the true piece in the cell of a found piece."""
    character = piece.character
    line, sign = line_of(system, character, solve if system.size <= SMALL else refined)
    true = piece_on(system, character, line, sign, interval) if sign else None
    if true is None:
        raise _refused(piece, "its cell has no isolated solutions there")
    middle, length = Fraction(0.5 * sum(true.span)), Fraction(interval[1] - interval[0])
    for value, rate in tests_along(system, character, line):
        if value + middle * rate <= VANISHES * (abs(value) + length * abs(rate)):
            raise _refused(piece, "one of its tests vanishes all along, or is not positive inside")
    return true


def _refused(piece: Piece, why: str) -> UnknownAnswerError:
    lo, hi = piece.interval
    return UnknownAnswerError(
        f"the exact path has a piece that is not true, {piece.id} from alpha = {lo:.6g} to "
        f"{hi:.6g} ({piece.label}): {why}"
    )


def _check_cells(truth: Truth) -> None:
    """Refuse a cell with two pieces: cells are convex, and hold at most one regular piece."""
    if len({piece.cell for piece in truth.pieces}) < len(truth.pieces):
        raise UnknownAnswerError("the exact path has a piece twice")


def _check_joints(truth: Truth) -> None:
    lo, hi = truth.interval
    for end in truth.loose_ends:
        if min(end[-1] - lo, hi - end[-1]) > AGREES * (hi - lo):
            raise UnknownAnswerError(f"the exact path breaks off at alpha = {end[-1]:.6g}")


def _check_balance(truth: Truth, degree: int | None) -> None:
    for alpha in truth.regular_alphas() if degree is not None else ():
        if (total := sum(piece.det_sign for piece in truth.over(alpha))) != degree:
            raise UnknownAnswerError(
                f"the exact path lacks a branch: its signs sum to {total} instead of {degree} "
                f"at alpha = {alpha:.6g}"
            )
