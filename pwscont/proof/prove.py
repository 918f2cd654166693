"""The door to proofs from exact data, and proofs that evolutions are the only ones."""

from __future__ import annotations

from itertools import product
from typing import Any

import numpy as np

from pwscont.basics.arrays import Array, finite_array
from pwscont.basics.errors import InvalidInputError
from pwscont.basics.printing import counted
from pwscont.graph.branch_graph import BranchGraph
from pwscont.proof.interval import Interval, upper
from pwscont.proof.pieces import ASSUMED, Certificate, certified_count, certified_pieces
from pwscont.search.enumeration import Solutions
from pwscont.system.abilities import ExactData, ExactRates

#: Most nodes with friction, whose signs are all tried.
MOST_NODES = 10


def prove(given: Any, alpha: float | None = None) -> Certificate:
    """Prove how many solutions a system of linear pieces has at one alpha, or all of a graph.

    For an evolution of ``QuasiStaticCoulomb``, prove that no other evolution exists.

    Every cell gets a certificate: floating point with bounds of all rounding, or rational numbers
    where the bounds decide nothing. The data of the system count as exact (docs/proofs).

    Parameters
    ----------
    given : BranchGraph, Solutions or EvolutionGraph
        The answer to be proved: a graph, or what :func:`pwscont.enumerate_solutions` returned. The
        system must be a :class:`~pwscont.extending.ExactData`: contact with Coulomb friction, and
        formulas with ``linear=True`` such as :func:`pwscont.LCP`.
    alpha : float, optional
        The value at which solutions of a graph are counted. Without alpha every piece and
        transition of the graph is proved; if cells are few, also that nothing is missing.

    Returns
    -------
    Certificate
        With ``holds``, ``statements`` and ``open``, and ``count`` or ``is_complete``.

    Raises
    ------
    InvalidInputError
        If ``given`` is something else, the system hands over no exact data, or
        has too many cells, or a solution is listed at another alpha.

    Examples
    --------
    >>> from pwscont import LCP, enumerate_solutions, explore, prove
    >>> problem = LCP([[1, 2], [2, 1]], q=[-1, -1], d=[0, 0])
    >>> prove(enumerate_solutions(problem, 0.0)).statements[0]
    'exactly 3 solutions at alpha = 0, proved'
    >>> prove(explore(LCP([[1, 2], [2, 1]], q=[-1, -1], d=[1, 0]), (-1.0, 2.0))).statements[0]
    'complete, proved: 3 pieces and 2 transitions'
    """
    system: Any = getattr(given, "system", None)
    if isinstance(system, ExactRates):
        return certified_rates(given)
    is_graph = isinstance(given, BranchGraph)
    if not is_graph and (not isinstance(given, Solutions) or given.alpha is None):
        raise InvalidInputError(
            f"prove takes a graph or what enumerate_solutions returned, got {type(given).__name__}"
        )
    if not isinstance(system, ExactData):
        raise InvalidInputError(
            f"{type(system).__name__} hands over no exact data: prove takes contact problems and "
            "formulas with linear=True; formulas of curved systems are proved by Everywhere"
        )
    if not is_graph:
        if strange := [each.alpha for each in given if each.alpha != given.alpha]:
            raise InvalidInputError(
                f"a solution at alpha = {strange[0]} is listed among those at alpha = {given.alpha}"
            )
        return certified_count(system, given.alpha, given, len(given))
    if alpha is not None:
        alpha = float(finite_array("alpha", alpha, ()))
        return certified_count(system, alpha, given.solutions(alpha), given.count(alpha))
    rows = system.exact_lines()
    if rows is None:
        raise InvalidInputError(
            f"the data of {type(system).__name__} are not affine in alpha: "
            "prove(graph, alpha) needs the alpha at which to count"
        )
    return certified_pieces(given, rows)


def certified_rates(evolution: Any) -> Certificate:
    """Return whether exactly one evolution with finitely many events is proved to exist."""
    doubts = _doubts(evolution)
    words = "exactly one evolution with finitely many events, proved: rates are unique at every "
    words = f"not proved: {'; '.join(doubts)}" if doubts else words + "state"
    return Certificate(not doubts, (words, ASSUMED.format("A, N, T and F")), doubts)


def _doubts(evolution: Any) -> list[str]:
    paths, losses = len(evolution.paths()), len(evolution.losses())
    if paths != 1 or losses or not evolution.is_complete:
        return [f"{counted(paths, 'evolution')} found: {evolution.guarantee}"]
    A, N, T, F = evolution.system.exact_rates()
    rubs = np.flatnonzero(F > 0.0)
    rows = np.vstack([N, T[rubs]])
    is_unit = (np.abs(rows).sum(axis=1) == 1.0) & ((rows != 0.0).sum(axis=1) == 1)
    if not is_unit.all() or (np.abs(rows).sum(axis=0) > 1.0).any():
        return ["the rows of N and T are no unit vectors of unknowns of their own"]
    if len(rubs) > MOST_NODES:
        return [f"{len(rubs)} nodes with friction are more than {MOST_NODES}"]
    frictions = (np.array(signs) * F[rubs] for signs in product((-1.0, 1.0), repeat=len(rubs)))
    if all(is_unique(A, N[rubs], T[rubs], friction) for friction in frictions):
        return []
    return ["rates may not be unique at some state: a form is not positive definite"]


def is_unique(A: Array, N: Array, T: Array, friction: Array) -> bool:
    """Tell whether the form of some signs, with friction times signs, is positive definite."""
    work = Interval(friction[:, np.newaxis]) * (Interval(N) @ Interval(A))
    return is_positive_definite(Interval(A) - Interval(T.T) @ work)


@np.errstate(all="ignore")
def is_positive_definite(form: Interval) -> bool:
    """Tell whether the symmetric parts of all matrices K between two are positive definite.

    With any numbers R, best the inverse of a Cholesky factor, they are if R (K + K') R' is, whose
    eigenvalues differ from 2 by less than 2 if the rows of R (K + K') R' - 2 I do (Gershgorin).
    """
    both = form + form.arranged(np.transpose)
    try:
        R = np.linalg.inv(np.linalg.cholesky(0.5 * both.middle()))
    except np.linalg.LinAlgError:
        return False
    off = (Interval(R) @ both @ Interval(R.T) - 2.0 * np.eye(len(R))).reach()
    return bool((upper(off.sum(axis=1), len(R)) < 2.0).all())
