"""Linear forms, and the simplex method that prunes the tree of choices by the signs of forms.

Equations and inequalities of all options, and of every cell, are affine forms of the unknowns; each
form is listed once, with either sign. To choose an option is to ask more signs: a form asked to be
>= 0 and <= 0 has to vanish. Each program asks whether some point has the signs that are asked.

A vertex is the point where q independent forms, the basis, vanish. The objective is any linear
function that is least at the vertex, for the signs asked of the basis. The vertex stays least when
more signs are asked: the dual simplex method (Lemke 1954) begins where the program of the parent
ended. In each step the form with the wrongest value enters the basis, for the form by which the
objective grows least. If no form can make the value right, the row is the proof (Farkas 1902) that
no point has the signs asked: form = constant + sum of coefficients times forms, and no term helps.

Rounding grows from step to step: a proof is checked against the forms themselves. If the check
fails, or after too many steps (ties may cycle), the program counts as feasible, which costs time,
and no more.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any, TypeAlias, final

import numpy as np
import numpy.typing as npt

from pwscont.basics.arrays import Array, Indices
from pwscont.enumeration.choices import SLACK, Choices
from pwscont.enumeration.options import Option, Problem

Asked: TypeAlias = npt.NDArray[np.int8]
Flags: TypeAlias = npt.NDArray[np.bool_]

#: Signs that may be asked of a form, as bits: a form asked for two signs vanishes.
ANY, NOT_NEGATIVE, NOT_POSITIVE, VANISHES = 0, 1, 2, 3
#: The signs that are asked of a form if these signs are asked of the negative form.
NEGATED = np.array([ANY, NOT_POSITIVE, NOT_NEGATIVE, VANISHES])
#: A block of which no option is picked yet.
OPEN = -1
#: Number of decimals to which the entries of two unit rows agree if the rows are the same form.
SAME_DECIMALS = 12


@final
@dataclass(frozen=True, slots=True, eq=False)
class Forms:
    """Affine forms ``rows @ s + constants`` of q unknowns s."""

    #: Shapes (N, q) and (N,): rows have length 1, or 0; the last q forms are the unknowns
    #: themselves.
    rows: Array
    constants: Array
    always: Asked  # the signs that every solution has, shape (N,)
    #: The signs that each option of each block asks; a block may have less than m options, shape
    #: (k, m, N).
    options: Asked
    numbers: npt.NDArray[np.intp]  # how many options each block has, shape (k,)

    @classmethod
    def of(cls, problem: Problem, blocks: Sequence[Sequence[Option]], first: Choices) -> Forms:
        """Return the forms of some blocks of a problem, on what a single choice leaves."""
        numbers = np.array([*map(len, blocks)])
        # the last row of the table of signs is for what holds in all options
        groups = [(len(blocks), 0, problem.A, problem.b, NOT_NEGATIVE)]
        for k, options in enumerate(blocks):
            for m, option in enumerate(options):
                groups.append((k, m, option.E, option.e, VANISHES))
                groups.append((k, m, option.G, option.g, NOT_NEGATIVE))
        lengths = [len(vector) for *_, vector, _ in groups]
        block, option_of, sign = (
            np.repeat([group[i] for group in groups], lengths) for i in (0, 1, 4)
        )
        matrix = np.vstack([group[2] for group in groups])
        vector = np.concatenate([group[3] for group in groups])
        forms, place, is_negative = _distinct(
            np.column_stack([matrix @ first.directions[0], matrix @ first.starts[0] + vector])
        )
        asked = np.zeros((len(blocks) + 1, numbers.max(), len(forms)), dtype=np.int8)
        sign = np.where(is_negative, NEGATED[sign], sign).astype(np.int8)
        np.bitwise_or.at(asked, (block, option_of, place), sign)
        return cls(forms[:, :-1].copy(), forms[:, -1].copy(), asked[-1, 0], asked[:-1], numbers)

    def values(self, points: Array) -> Array:
        """Return all forms at points, shapes (M, q) and (M, N)."""
        return points @ self.rows.T + self.constants


def _distinct(rows: Array) -> tuple[Array, Indices, Flags]:
    """Return unit forms, each once, then the unknowns, with the form of each row.

    The last array tells which rows are the negative of their form. The forms stand in the order in
    which blocks bring them: a sorted order makes half as many programs again.
    """
    lengths = np.linalg.norm(rows[:, :-1], axis=1)
    lengths[lengths <= 10.0**-SAME_DECIMALS] = 1.0
    rows = rows / lengths[:, np.newaxis]
    rounded = np.round(rows, SAME_DECIMALS)
    first = (rounded != 0.0).argmax(axis=1)[:, np.newaxis]
    is_negative = np.take_along_axis(rounded, first, axis=1)[:, 0] < 0.0
    side = np.where(is_negative, -1.0, 1.0)[:, np.newaxis]
    _, which, place = np.unique(
        side * rounded + 0.0, axis=0, return_index=True, return_inverse=True
    )
    order = np.argsort(which)
    place, which = np.argsort(order)[place.reshape(-1)], which[order]
    q = rows.shape[1] - 1
    return np.vstack([(side * rows)[which], np.eye(q, q + 1)]), place, is_negative


#: Largest coefficient that is taken for rounding, as a part of the largest in a row, or of 1.
ROUNDING_OF_COEFFICIENTS = 1e-9
#: Largest value of the wrong sign of a unit form at a solution: far above rounding.
SOLUTION_MARGIN = 1e-9
#: Largest reduced unknown of a solution; typical reduced unknowns are of the order of 1.
REACH = 1e4
#: Largest difference of costs that count as equal, so that steps divide by no small number.
EQUAL_COSTS = 1e-4
#: Most steps of a program, per unknown.
STEPS_PER_UNKNOWN = 20
#: The change of a form that is asked for a sign: free forms may change either way.
_WAY = np.array([0.0, 1.0, -1.0, 0.0])


@final
@dataclass(frozen=True, slots=True, eq=False)
class Vertices:
    """A vertex for each of N programs, which are choices that may leave blocks open."""

    points: Array  # shape (N, q)
    #: How the coordinates, and last the objective, change with the value of each form of the basis,
    #: shape (N, q + 1, q).
    directions: Array
    basis: Indices  # numbers of forms, shape (N, q)
    signs: Asked  # the signs asked of all forms, shape (N, forms)
    picks: Indices  # the option picked of each block, or OPEN, shape (N, blocks)

    def __len__(self) -> int:
        """Return the number of programs."""
        return len(self.points)

    def __getitem__(self, index: Any) -> Vertices:
        """Return some of the programs."""
        return Vertices(*(part[index] for part in _parts(self)))

    def asking(self, signs: Asked, picks: Indices) -> Vertices:
        """Return the programs with more signs asked, shape (N, forms), of other picks."""
        return Vertices(self.points, self.directions, self.basis, self.signs | signs, picks)


def _parts(vertices: Vertices) -> list[Any]:
    return [getattr(vertices, field.name) for field in fields(Vertices)]


def first_vertex(forms: Forms) -> Vertices:
    """Return a vertex near the signs that are always asked; the vertex may be infeasible."""
    q = forms.rows.shape[1]
    inverse, basis = np.eye(q), np.arange(len(forms.rows) - q, len(forms.rows))
    for form in np.flatnonzero(forms.always):
        row = forms.rows[form] @ inverse
        size = np.abs(row) * (forms.always[basis] == ANY)
        if size.size and size.max() > SLACK:
            j = int(size.argmax())
            column = inverse[:, j] / row[j]
            inverse = inverse - np.outer(column, row)
            inverse[:, j], basis[j] = column, form
    slopes = _WAY[forms.always[basis]] * np.linspace(1.0, 2.0, q)
    directions, points = np.vstack([inverse, slopes]), -inverse @ forms.constants[basis]
    picks = np.full((1, len(forms.numbers)), OPEN)
    return Vertices(points[None], directions[None], basis[None], forms.always[None], picks)


def feasible(forms: Forms, programs: Vertices) -> Vertices:
    """Return the feasible programs, each with a point of the signs asked as the new vertex."""
    undecided, done = programs, list[Vertices]()
    for _ in range(STEPS_PER_UNKNOWN * (1 + forms.rows.shape[1])):
        form, value = _most_wrong(forms, undecided)
        wrong = value != 0.0
        done.append(undecided[~wrong])
        undecided, form, value = undecided[wrong], form[wrong], value[wrong]
        if not len(undecided):
            break
        row = (forms.rows[form][:, np.newaxis] @ undecided.directions[:, :-1])[:, 0]
        # how much each form of the basis helps; less than zero for a change not allowed
        slopes = row * np.where(value < 0.0, 1.0, -1.0)[:, np.newaxis]
        asked = np.take_along_axis(undecided.signs, undecided.basis, axis=1)
        gain = np.where(asked == ANY, np.abs(slopes), slopes * _WAY[asked])
        can = (gain > _rounding(row)).any(axis=1)
        stuck = np.flatnonzero(~can)
        parts = form[stuck], value[stuck], row[stuck], gain[stuck]
        done.append(undecided[stuck[~_is_proved(forms, undecided[stuck], *parts)]])
        undecided = _pivoted(undecided[can], form[can], value[can], row[can], gain[can])
    return Vertices(*map(np.concatenate, zip(*map(_parts, [*done, undecided]), strict=True)))


def _most_wrong(forms: Forms, vertices: Vertices) -> tuple[Indices, Array]:
    """Return the form of each program with the most wrong sign, and the value; 0 if all hold."""
    values, signs = forms.values(vertices.points), vertices.signs
    wrong = np.maximum(
        np.where(signs & NOT_NEGATIVE, -values, 0.0), np.where(signs & NOT_POSITIVE, values, 0.0)
    )
    form, every = wrong.argmax(axis=1), np.arange(len(values))
    is_wrong = wrong[every, form] > slack_of(vertices)
    return form, np.where(is_wrong, values[every, form], 0.0)


def slack_of(vertices: Vertices) -> Array:
    """Return the size, shape (N,), up to which values of the wrong sign hold."""
    return SLACK * (1.0 + np.abs(vertices.points).max(axis=1, initial=0.0))


def _rounding(row: Array) -> Array:
    """Return the size, shape (N, 1), below which coefficients are rounding."""
    return ROUNDING_OF_COEFFICIENTS * np.maximum(
        1.0, np.abs(row).max(axis=1, initial=0.0, keepdims=True)
    )


def _pivoted(old: Vertices, form: Indices, value: Array, row: Array, gain: Array) -> Vertices:
    """Return the programs with a form in the basis instead of the form that costs least."""
    every = np.arange(len(form))
    can, cost = gain > _rounding(row), np.abs(old.directions[:, -1])
    gain = np.where(can, gain, 1.0)
    most = np.where(can, (cost + EQUAL_COSTS) / gain, np.inf).min(axis=1, keepdims=True)
    j = np.where(can & (cost <= most * gain), gain, 0.0).argmax(axis=1)
    column = old.directions[every, :, j] / row[every, j, np.newaxis]
    directions = column[:, :, np.newaxis] * row[:, np.newaxis]
    np.subtract(old.directions, directions, out=directions)
    directions[every, :, j] = column
    points = old.points - column[:, :-1] * value[:, np.newaxis]
    basis = old.basis.copy()
    basis[every, j] = form
    return Vertices(points, directions, basis, old.signs, old.picks)


def _is_proved(
    forms: Forms, vertices: Vertices, form: Indices, value: Array, row: Array, gain: Array
) -> Flags:
    """Tell whether form = constant + row @ basis, and no term makes up for the constant.

    At a solution within REACH, terms taken for rounding are at most the coefficients times REACH,
    and all other terms help by at most the coefficients times SOLUTION_MARGIN.
    """
    basis = forms.rows[vertices.basis]
    constant = forms.constants[form] - (row * forms.constants[vertices.basis]).sum(axis=1)
    off = np.abs(forms.rows[form] - (row[:, np.newaxis] @ basis)[:, 0]).sum(axis=1)
    off += np.maximum(gain, 0.0).sum(axis=1)
    most = SOLUTION_MARGIN * (1.0 + np.abs(row).sum(axis=1)) + REACH * off
    return constant * np.sign(value) > most
