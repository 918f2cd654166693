"""A tape on boxes: values, derivatives, and contraction of boxes that loses no solution.

Where a switch may be in either mode, a derivative is the hull of the derivatives of both branches,
so that the mean value form holds across kinks (docs/theory, F20). Hull consistency is HC4; interval
Newton multiplies a linear enclosure by a matrix that nearly makes unit columns of the n most
important of n + 1 coordinates, so that every row bounds one coordinate by the others (references on
the page "Proofs" of the manual).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from pwscont.basics.arrays import Array, Indices, Signs
from pwscont.proof.interval import Interval, together, upper
from pwscont.proof.operations import OPERATIONS, Rule
from pwscont.proof.tape import Tape

#: The least radius of an enclosure of solutions, far above all numbers that underflow.
LEAST = 1e-290


def values_of(tape: Tape, box: Interval, rules: Mapping[str, Rule] = OPERATIONS) -> list[Interval]:
    """Return the interval of every step of a tape on boxes, shape (n + 1, B)."""
    values: list[Interval] = []
    for place, step in enumerate(tape.steps):
        if place in tape.fixed:
            values.append(tape.fixed[place])
        elif step.name == "variable":
            values.append(box[step.numbers[0]])
        else:
            args = (values[arg] for arg in step.args)
            values.append(rules[step.name].values(*args, *step.numbers))
    return values


def evaluated(tape: Tape, box: Interval, rules: Mapping[str, Rule] = OPERATIONS) -> Interval:
    """Return the outputs of a tape on boxes (n + 1, B), shape (outputs, B)."""
    values, shape = values_of(tape, box, rules), (len(tape.outputs), *box.lo.shape[1:])
    found = Interval(np.empty(shape), np.empty(shape))
    for k, place in enumerate(tape.outputs):
        found.lo[k], found.hi[k] = values[place].lo, values[place].hi
    return found


def with_slopes(
    tape: Tape, box: Interval, rules: Mapping[str, Rule] = OPERATIONS
) -> tuple[Interval, Interval]:
    """Return m outputs and their derivatives by (z, alpha), shapes (m, B) and (m, n + 1, B).

    The tape is ``slopes`` or ``tests`` of another tape.
    """
    found, by = evaluated(tape, box, rules), tape.size + 1
    count = len(tape.outputs) // (by + 1)
    shape = (count, by, *box.lo.shape[1:])
    return found[:count], found[count:].arranged(lambda end: end.reshape(shape))


def consistent(tape: Tape, box: Interval) -> tuple[Interval, Signs]:
    """Return the parts of boxes in which the outputs may be zero, and which boxes are empty.

    What is known of a result bounds the arguments, from the outputs back to the variables.
    """
    values = values_of(tape, box)
    for place in tape.outputs:
        values[place] = values[place].meet(Interval(0.0))
    empty = np.zeros(box.lo.shape[1], dtype=bool)
    for place in range(len(values) - 1, -1, -1):
        step, y = tape.steps[place], values[place]
        empty |= y.lo > y.hi
        is_bound = step.args and place not in tape.fixed
        inverse = OPERATIONS[step.name].inverse if is_bound else None
        if inverse is not None:
            known = inverse(y, *(values[arg] for arg in step.args), *step.numbers)
            for arg, each in zip(step.args, known, strict=False):
                values[arg] = values[arg].meet(each)
    left = together(np.stack, *values[: tape.size + 1])  # the variables are written first
    return left, empty | (left.lo > left.hi).any(axis=0)


def newton(box: Interval, slopes: Interval, start: Interval) -> tuple[Interval, Signs]:
    """Return boxes contracted by one sweep of interval Newton, and which boxes are empty.

    On the boxes, H(x) lies in slopes (x - middle) + start, shapes (n, n + 1, B) and (n, B).
    """
    middle, each = box.middle(), np.arange(box.lo.shape[1])
    matrix, columns = eliminated(slopes.middle(), box.width())
    rows, rest = times(matrix, slopes), times(matrix, start)
    lo, hi = box.lo.copy(), box.hi.copy()
    empty = np.zeros(len(each), dtype=bool)
    for i, own in enumerate(columns):
        terms = rows[i] * (Interval(lo, hi) - middle)
        empty |= (rest[i] + terms.total()).excludes_zero()
        terms.lo[own, each] = terms.hi[own, each] = 0.0
        away = (rest[i] + terms.total()) / rows[i][own, each]
        found = middle[own, each] - away
        lo[own, each] = np.fmax(lo[own, each], found.lo)
        hi[own, each] = np.fmin(hi[own, each], found.hi)
    return Interval(lo, hi), empty | (lo > hi).any(axis=0)


def times(matrix: Array, right: Interval) -> Interval:
    """Return matrices of numbers (n, n, B) times intervals (n, ..., B)."""
    n, _, count = matrix.shape
    factors = Interval(matrix.reshape(n, n, *(1,) * (right.lo.ndim - 2), count))
    return (factors * right).total(axis=1)


def eliminated(middle: Array, width: Array) -> tuple[Array, Indices]:
    """Return finite matrices that turn the n largest columns into unit columns, and the columns.

    ``middle`` (n, n + 1, B) is about the derivatives, ``width`` (n + 1, B) how important each
    column is; no rule needs exact results, shapes (n, n, B) and (n, B).
    """
    n, _, count = middle.shape
    rows = np.where(np.isfinite(middle), middle, 0.0).transpose(2, 0, 1).copy()
    inverse = np.broadcast_to(np.eye(n), (count, n, n)).copy()
    columns, each = np.zeros((n, count), dtype=np.intp), np.arange(count)
    for i in range(n):
        size = np.abs(rows[:, i:, :]) * width.T[:, np.newaxis, :]
        best = size.reshape(count, (n - i) * (n + 1)).argmax(axis=1)
        row, columns[i] = i + best // (n + 1), best % (n + 1)
        for matrix in (rows, inverse):
            matrix[each, i], matrix[each, row] = matrix[each, row], matrix[each, i].copy()
        pivot = rows[each, i, columns[i]][:, np.newaxis]
        factors = rows[each, :, columns[i]] / pivot
        factors[:, i] = 0.0
        for matrix in (rows, inverse):
            matrix[:] -= factors[:, :, np.newaxis] * matrix[:, [i], :]
            matrix[:, i] /= pivot
    return np.where(np.isfinite(inverse), inverse, 0.0).transpose(1, 2, 0), columns


def inverse_of(middle: Array) -> Array:
    """Return about the inverse of square matrices (n, n, B); any numbers will do."""
    return inverses(middle.transpose(2, 0, 1)).transpose(1, 2, 0)


def inverses(matrices: Array) -> Array:
    """Return the inverses of matrices (B, n, n) to rounding, nan for singular matrices."""
    try:
        found: Any = np.linalg.inv(matrices)
    except np.linalg.LinAlgError:
        regular = np.linalg.slogdet(matrices)[0] != 0.0
        found = np.full_like(matrices, np.nan)
        found[regular] = np.linalg.inv(matrices[regular])
    inverse: Array = found
    return inverse


def solved(matrix: Interval, right: Interval) -> Interval:
    """Return x with matrix x + right = 0 for B systems, shapes (B, n, n) and (B, n, m).

    With R about the inverse, the error e of x solves e = (I - R K) e - R (K x + k): a radius v with
    |R (K x + k)| + |I - R K| v < v bounds the error, and K is regular (Rump 2010, section 10). Else
    nothing is said.
    """
    middle, n = matrix.middle(), matrix.lo.shape[-1]
    if matrix.lo.shape[-2] != n:
        return Interval(np.full((len(middle), n, right.lo.shape[-1]), np.nan))
    inverse = inverses(middle)
    x = -(inverse @ right.middle())
    x = x - inverse @ (middle @ x + right.middle())
    start = (Interval(inverse) @ (matrix @ Interval(x) + right)).reach()
    off = (Interval(inverse) @ matrix - np.eye(n)).reach()
    radius = 2.0 * (start + off @ (2.0 * start)) + LEAST
    image = upper(start + off @ radius, n + 1)
    holds: Signs = np.all(image < radius, axis=(-2, -1), keepdims=True)
    return Interval.rounded(x - image, x + image).where(holds)
