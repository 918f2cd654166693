"""Parametric quadratic programs: stationary points with multipliers."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, final

import numpy as np

from pwscont import InvalidInputError
from pwscont.extending import EPS, Array, finite_array
from pwscont_optimisation.active_sets import ActiveSets, is_symmetric
from pwscont_optimisation.numbered import numbered


@final
class QuadraticProgram(ActiveSets):
    r"""Stationary points of x^T Q x / 2 + (q + alpha d)^T x subject to A x <= b + alpha e.

    The unknowns are x and the multipliers mu >= 0 (Karush, Kuhn and Tucker):

    Q x + q + alpha d + A^T mu = 0,  s = b + alpha e - A x >= 0,  mu_j s_j = 0.

    For a positive definite Q the stationary points are the minimisers; for other Q there may be
    maxima and saddle points of the feasible set, too. Constraint j is active where mu_j >= r_j s_j,
    with r_j = |Q| / |A_j|^2 for the sake of units.

    If Q is positive definite and the rows of A are linearly independent, x and mu are unique.

    Parameters
    ----------
    Q : array_like, shape (n, n)
        Symmetric.
    q : array_like, shape (n,)
    A : array_like, shape (m, n)
        A row for each constraint.
    b : array_like, shape (m,)
    d : array_like, shape (n,), optional
    e : array_like, shape (m,), optional
        How the linear term and the bounds change with alpha; default not at all.
    names : sequence of str, length n, optional
        Default x1, x2, ...
    constraints : sequence of str, length m, optional
        Default g1, g2, ...; the multipliers are called mu_g1, ...
    unique : bool, optional
        The promise that x and mu are unique at each alpha; default whether the conditions above
        hold.

    Raises
    ------
    InvalidInputError
        If shapes do not fit, Q is zero or not symmetric, or a row of A is zero.

    Examples
    --------
    >>> from pwscont import explore
    >>> from pwscont_optimisation import QuadraticProgram
    >>> program = QuadraticProgram([[1.0]], [0.0], A=[[1.0]], b=[1.0], d=[-1.0])  # x <= 1
    >>> [round(p.alpha, 6) for p in explore(program, (0.0, 2.0)).special_points("transition")]
    [1.0]
    """

    active = (None, "")
    enters, leaves = "becomes active", "becomes inactive"

    def __init__(
        self,
        Q: Any,
        q: Any,
        A: Any,
        b: Any,
        d: Any = None,
        e: Any = None,
        *,
        names: Sequence[str] | None = None,
        constraints: Sequence[str] | None = None,
        unique: bool | None = None,
    ) -> None:
        q, b = finite_array("q", q), finite_array("b", b)
        n, m = q.size, b.size
        Q, A = finite_array("Q", Q, (n, n)), finite_array("A", A, (m, n))
        d = np.zeros(n) if d is None else finite_array("d", d, (n,))
        e = np.zeros(m) if e is None else finite_array("e", e, (m,))
        parts = numbered("constraints", constraints, "g", m)
        self._names = (*numbered("names", names, "x", n), *(f"mu_{part}" for part in parts))
        _check(Q, A, parts)
        self.unique = _is_unique(Q, A) if unique is None else unique
        super().__init__(parts, *_conditions(Q, q, d, A, b, e))

    def names(self) -> tuple[str, ...]:
        """Return the names of the variables and of the multipliers."""
        return self._names


def _is_unique(Q: Array, A: Array) -> bool:
    """Tell whether Q is positive definite and the rows of A are independent."""
    independent = not len(A) or np.linalg.matrix_rank(A) == len(A)
    return bool(independent and np.linalg.eigvalsh(Q)[0] > len(Q) * EPS * np.abs(Q).max())


def _check(Q: Array, A: Array, constraints: Sequence[str]) -> None:
    if not is_symmetric(Q) or not Q.any():
        raise InvalidInputError("Q must be symmetric, and not zero; (Q + Q.T) / 2 has the same x")
    empty = ~A.any(axis=1)
    if empty.any():
        name = constraints[int(np.argmax(empty))]
        raise InvalidInputError(f"constraint {name} is on no variable: its row of A is zero")


def _conditions(
    Q: Array, q: Array, d: Array, A: Array, b: Array, e: Array
) -> tuple[Array, Array, Array]:
    """Return rows, tests and necessary inequalities in (x, mu, alpha, 1).

    The rows of constraints are multipliers: mu_j, and r_j s_j where constraint j is active.
    """
    m, n = A.shape
    stationary = np.hstack([Q, A.T, d[:, np.newaxis], q[:, np.newaxis]])
    slack = np.hstack([-A, np.zeros((m, m)), e[:, np.newaxis], b[:, np.newaxis]])
    slack *= (np.linalg.norm(Q, 2) / (A**2).sum(axis=1))[:, np.newaxis]
    multiplier = np.hstack([np.zeros((m, n)), np.eye(m), np.zeros((m, 2))])
    rows = np.stack([np.vstack([stationary, part]) for part in (multiplier, slack)])
    return rows, (multiplier - slack)[:, np.newaxis], np.vstack([multiplier, slack])
