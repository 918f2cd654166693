"""What is proved of systems of linear pieces; evolutions: at most one rate and one state.

The theorem stands on the page "Proofs" of the manual: rates and states are unique, at every state
and under every load, if the form w . A w - sum over i of s_i F_i (N A w)_i (T w)_i is positive
definite for all signs s_i. The form is affine in s: the signs are enough.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any, final

import numpy as np

from pwscont.basics.arrays import Array
from pwscont.basics.printing import counted
from pwscont.proof.interval import Interval, upper

ASSUMED = "assumed: arithmetic of IEEE 754 to nearest; {} count as the doubles that they are"
#: Most nodes with friction, whose signs are all tried.
MOST_NODES = 10


@final
@dataclass(frozen=True, slots=True, repr=False)
class Certificate:
    """What :func:`pwscont.prove` has proved.

    Attributes
    ----------
    holds : bool
        Whether all that was given is proved: solutions and their number at one alpha, all pieces
        and transitions of a graph, or that there is exactly one evolution.
    statements : tuple of str
        A sentence for what is proved, and a sentence for the data of the proof.
    open : sequence
        What is not decided: at one alpha, cells (for every part of the system, the number of a
        mode); of a graph, pieces, special points and cells in words; of an evolution, what stands
        in the way.
    count : int or None
        The proved number of solutions at one alpha; None where a cell is not decided.
    is_complete : bool
        Whether a graph is proved to have all solutions on its interval.
    """

    holds: bool
    statements: tuple[str, str]
    open: Sequence[Any]
    count: int | None = None
    is_complete: bool = False

    def __repr__(self) -> str:
        return f"Certificate({self.statements[0]})"


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
