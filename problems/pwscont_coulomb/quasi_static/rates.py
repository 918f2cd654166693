"""The rate problem at an event: which nodes slip, stick, touch and leave (docs/theory, F17).

The unknowns x are the normal rates of nodes that touch without force, and the tangential rates of
nodes that may slip; all other rates of nodes in contact are zero. With the forces of the body as
phi = K x - h, each node is in one of its modes, and each mode asks for one equation per unknown.

Uniqueness is the topic of :mod:`.uniqueness`. Where a form is not positive definite, the node that
contributes most to the most negative direction is decided: each of its modes leaves a smaller
problem with the same question.

Failure modes and answers
-------------------------
- A problem has one solution at most, and the search for this solution does not settle: a node is
  decided, and the search goes on in the smaller problems.
- The equations of a mode are singular and have a solution: infinitely many rates may exist, and the
  answer is called incomplete.
- Too many problems: the modes are searched by linear programs (:mod:`.rate_law`); of too many
  nodes a solution is found by pivoting, and the answer is called incomplete.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import final

import numpy as np
from scipy.linalg import lapack

from pwscont.extending import EPS, Array, Indices, check_budget
from pwscont_coulomb.modes import Mode
from pwscont_coulomb.quasi_static.rate_law import RateLaw
from pwscont_coulomb.quasi_static.uniqueness import WEIGHTS, ZERO, Choices, Form, Known

#: A matrix in natural units whose inverse is larger than one over this is singular.
SINGULAR = 2.0**10 * EPS
#: Most work on one rate problem: the sum of the cubes of the sizes of all problems looked at.
MOST_WORK = 1e8
#: Most problems looked at where linear programs can search the modes instead.
MOST_LOOKS = 100
#: Most choices of two, with two for each node without force, for a search by linear programs.
MOST_BITS = 44
#: Most steps of a search for one solution.
MOST_PIVOTS = 60
#: Largest number of changes of all wrong nodes at once after which no fewer nodes are wrong.
PATIENCE = 8
#: A ratio of forces with a larger error is not known: the node is decided first.
HIDDEN = 1e-3
NO_CONTACT, STICK = int(Mode.NO_CONTACT), int(Mode.STICK)
SLIP = {1: int(Mode.SLIP_PLUS), -1: int(Mode.SLIP_MINUS)}
SIGN = {int(Mode.SLIP_PLUS): 1.0, int(Mode.SLIP_MINUS): -1.0}


@final
@dataclass(frozen=True, slots=True, eq=False)
class Rates:
    """One solution: the mode of each node, the unknowns x, and the forces.

    Attributes
    ----------
    modes : ndarray of int, shape (k,)
    x : ndarray, shape (m,)
    forces : ndarray
        phi at all rows of the problem.
    """

    modes: Indices
    x: Array
    forces: Array


@final
@dataclass(frozen=True, slots=True, eq=False)
class RateSolutions:
    """All solutions found, and what may be missing, in words."""

    found: tuple[Rates, ...]
    remark: str = ""


@final
class RateProblem:
    """The rate problem of nodes at their bound and nodes that touch without force.

    Parameters
    ----------
    K : ndarray, shape (rows, m)
        Forces by rates.
    h : ndarray, shape (rows,)
    friction : ndarray, shape (k,)
    sign : ndarray, shape (k,)
        Direction of slip of a node at the bound, 0 for a node without force.
    normal, tangent : ndarray of int, shape (k,)
        The row of each node's normal and tangential force; unknown j belongs to row j. A normal
        row from m on is no unknown. A tangential row -1: the node has no friction.
    """

    def __init__(
        self,
        K: Array,
        h: Array,
        friction: Array,
        sign: Array,
        normal: Indices,
        tangent: Indices,
    ) -> None:
        self.K, self.h, self.friction, self.sign = K, h, friction, sign
        self.normal, self.tangent = normal, tangent
        self.size, self.count = K.shape[1], len(friction)
        self.scale = np.abs(np.diag(K))
        self._choices = Choices(friction, sign, normal, tangent, self.scale)
        self._absolute = np.abs(K)
        #: The rate that the load alone would cause.
        self._usual = float((np.abs(h[: self.size]) / self.scale).max(initial=0.0))
        #: The last theta of each node for each weight, in units of F over its stiffness.
        self._theta = {weight: np.full(len(friction), weight**0.5) for weight in WEIGHTS}
        #: The weights that are still tried.
        self._weights: tuple[float, ...] = WEIGHTS

    # -- the equations of some modes --------------------------------------------------------

    def options(self, node: int) -> tuple[int, ...]:
        """Return the modes that a node may be in."""
        if self.sign[node]:
            return (SLIP[int(self.sign[node])], STICK)
        if self.tangent[node] < 0:
            return (NO_CONTACT, STICK)
        return (NO_CONTACT, STICK, SLIP[1], SLIP[-1])

    def equations(self, modes: Mapping[int, int]) -> tuple[Indices, Array, Array]:
        """Return the unknowns that are not zero in some modes, and their equations E x = e.

        Unknowns of nodes whose mode is not given have no equation.
        """
        unknowns: list[int] = []
        rows: list[Array] = []
        right: list[float] = []
        for node, mode in modes.items():
            n, t = int(self.normal[node]), int(self.tangent[node])
            if mode == NO_CONTACT:
                for j in (n, t):
                    if j >= 0:
                        unknowns.append(j)
                        rows.append(self.K[j])
                        right.append(self.h[j])
            elif mode != STICK:
                s, F = SIGN[mode], self.friction[node]
                unknowns.append(t)
                rows.append(s * self.K[t] - F * self.K[n])
                right.append(s * self.h[t] - F * self.h[n])
        matrix = np.array(rows).reshape(len(rows), self.size)
        return np.array(unknowns, dtype=np.intp), matrix, np.array(right)

    def solve(self, modes: Mapping[int, int]) -> Array | None:
        """Return x in the modes of all nodes, None where the equations are singular."""
        unknowns, E, e = self.equations(modes)
        x = np.zeros(self.size)
        if not len(unknowns):
            return x
        found = self._followed(unknowns, E[:, unknowns], e)
        if found is None:
            return None
        x[unknowns] = found
        return x

    def _followed(self, unknowns: Indices, square: Array, right: Array) -> Array | None:
        """Return the solution of some equations, None where the equations are singular.

        Unknown and equation j are measured by the root of the stiffness of j.
        """
        unit = 1.0 / np.sqrt(self.scale[unknowns])
        lu, pivots, failed = lapack.dgetrf(unit[:, np.newaxis] * square * unit)
        if failed or _is_singular(lu, unit[:, np.newaxis] * np.abs(square) * unit):
            return None
        columns = right.reshape(len(unknowns), -1)
        solved: Array = (
            unit[:, np.newaxis] * lapack.dgetrs(lu, pivots, unit[:, np.newaxis] * columns)[0]
        )
        return solved.reshape(right.shape)

    def is_consistent(self, modes: Mapping[int, int]) -> bool:
        """Tell whether singular equations have solutions, in natural units.

        Singular values below rounding are zero: the rest of an equation that such a value would
        have to balance is compared with the largest force that the load asks for.
        """
        unknowns, E, e = self.equations(modes)
        unit = 1.0 / np.sqrt(self.scale[unknowns])
        square, right = unit[:, np.newaxis] * E[:, unknowns] * unit, unit * e
        left, values, _ = np.linalg.svd(square)
        kept = left[:, values > len(unknowns) * SINGULAR]
        rest = right - kept @ (kept.T @ right)
        largest = float((np.abs(self.h[: self.size]) / np.sqrt(self.scale)).max(initial=0.0))
        return bool((np.abs(rest) <= EPS**0.5 * max(largest, float(np.abs(right).max()))).all())

    # -- the inequalities -------------------------------------------------------------------

    def forces(self, x: Array) -> tuple[Array, Array]:
        """Return phi, and the magnitudes of the terms of each."""
        return self.K @ x - self.h, self._absolute @ np.abs(x) + np.abs(self.h)

    def _known(self, x: Array) -> Known:
        """Return a solution with bounds of the errors of rates and forces."""
        phi, terms = self.forces(x)
        speed = ZERO * (np.abs(x) + float(np.abs(x).max(initial=0.0)) + self._usual)
        return Known(x, phi, speed, ZERO * terms)

    def next_modes(self, x: Array, modes: Mapping[int, int]) -> dict[int, int]:
        """Return for each node the mode that its forces and rates ask for."""
        known = self._known(x)
        return {node: self._asked(node, mode, known) for node, mode in modes.items()}

    def _asked(self, node: int, mode: int, known: Known) -> int:
        """Return the same mode where its inequalities hold up to rounding, else another one."""
        n, t, F = int(self.normal[node]), int(self.tangent[node]), self.friction[node]
        x, phi, speed, force = known.x, known.phi, known.speed, known.force
        if self.sign[node]:
            s = self.sign[node]
            if mode == STICK:
                holds = s * phi[t] - F * phi[n] >= -(force[t] + F * force[n])
            else:
                holds = s * x[t] >= -speed[t]
            return mode if holds else self._other(node, mode)
        if mode == NO_CONTACT:
            return mode if x[n] <= speed[n] else STICK
        if phi[n] > force[n]:
            return NO_CONTACT
        if mode == STICK:
            if t < 0 or abs(phi[t]) <= -F * phi[n] + force[t] + F * force[n]:
                return mode
            return SLIP[1] if phi[t] < 0.0 else SLIP[-1]
        return mode if SIGN[mode] * x[t] >= -speed[t] else STICK

    def _other(self, node: int, mode: int) -> int:
        first, second = self.options(node)
        return second if mode == first else first

    def checked(self, modes: Mapping[int, int], x: Array | None) -> Rates | None:
        """Return the solution in the modes of all nodes, None where an inequality fails."""
        if x is None or self.next_modes(x, modes) != dict(modes):
            return None
        ordered = np.array([modes[i] for i in range(self.count)], dtype=np.intp)
        return Rates(ordered, x, self.K @ x - self.h)

    # -- one solution -----------------------------------------------------------------------

    def settled(
        self, fixed: Mapping[int, int], guess: Mapping[int, int]
    ) -> tuple[dict[int, int], Array] | None:
        """Return modes and x at which pivoting settles, whatever the fixed nodes ask for.

        At first all nodes change to the modes that are asked for. If these changes do not settle,
        only the node with the least number changes: this rule ends for every P-matrix (Murty 1974).
        None if the pivoting does not settle.
        """
        modes = {**guess, **fixed}
        fewest, patience = self.count + 1, PATIENCE
        for _ in range(MOST_PIVOTS + 4 * self.count):
            x = self.solve(modes)
            if x is None:
                return None
            asked = self.next_modes(x, modes)
            wrong = [i for i in modes if i not in fixed and asked[i] != modes[i]]
            if not wrong:
                return modes, x
            fewer = len(wrong) < fewest
            fewest, patience = (len(wrong), PATIENCE) if fewer else (fewest, patience - 1)
            modes.update({i: asked[i] for i in (wrong if patience > 0 else [min(wrong)])})
        return None

    # -- uniqueness -------------------------------------------------------------------------

    def doubt(self, fixed: Mapping[int, int]) -> int | None:
        """Return the node to decide next, None where at most one solution has the fixed modes."""
        left = [i for i in range(self.count) if i not in fixed]
        if not left:
            return None
        phi, columns = self._eliminated(fixed, left)
        if phi is None:
            return left[0]
        form = Form(self._choices, phi, columns, left)
        if not len(form.rubbing):
            return None if form.is_positive(form.whole(1.0)) else form.heaviest(form.worst(1.0)[1])
        judged = {weight: form.judged(weight, self._theta[weight]) for weight in self._weights}
        best = max(judged, key=lambda weight: judged[weight][0])
        self._weights, worst = (best,), judged[best][1]
        return None if worst is None else form.heaviest(worst)

    def others(self, fixed: Mapping[int, int], x: Array) -> int | None:
        """Return the node to decide next, None where x is certainly the only solution.

        Parameters
        ----------
        fixed : mapping
            The modes of some nodes, whose inequalities need not hold.
        x : ndarray, shape (m,)
            A solution with the fixed modes.
        """
        left = [i for i in range(self.count) if i not in fixed]
        phi, columns = self._eliminated(fixed, left) if left else (None, np.arange(0))
        if phi is None:
            return left[0] if left else None
        known = self._known(x)
        for weight in WEIGHTS:
            used, errors = known.used(self._choices, weight)
            form = Form(used, phi, columns, left)
            if form.is_positive(form.whole(weight), weight, form.error(weight, errors)):
                return None
        if errors[left].max() > HIDDEN:
            return left[int(np.argmax(errors[left]))]
        return form.heaviest(form.worst(weight)[1])

    def _eliminated(
        self, fixed: Mapping[int, int], left: list[int]
    ) -> tuple[Array | None, Indices]:
        """Return phi by the unknowns of the nodes left, with those of fixed nodes eliminated."""
        mine = {int(j) for i in left for j in (self.normal[i], self.tangent[i])}
        columns = np.array(sorted(j for j in mine if 0 <= j < self.size), dtype=np.intp)
        unknowns, E, _ = self.equations(fixed)
        if not len(unknowns):
            return self.K[:, columns], columns
        follow = self._followed(unknowns, E[:, unknowns], E[:, columns])
        if follow is None:
            return None, columns
        return self.K[:, columns] - self.K[:, unknowns] @ follow, columns

    # -- all solutions ----------------------------------------------------------------------

    def all_rates(self, guess: Mapping[int, int]) -> RateSolutions:
        """Return all solutions, or say what may be missing.

        Parameters
        ----------
        guess : mapping
            For every node a mode at which the search for a solution begins.
        """
        search = _Search(self, dict(guess))
        try:
            search.look({})
        except _TooManyError:
            if self.can_be_listed():
                return self.listed()
            settled = self.settled({}, guess)
            one = self.checked(*settled) if settled else None
            found = [*search.found, *([one] if one else [])]
            return RateSolutions(self._different(found), "one of possibly several ways on")
        return RateSolutions(self._different(search.found), search.remark)

    def _different(self, found: list[Rates]) -> tuple[Rates, ...]:
        """Return each solution once: several modes hold where an inequality is an equation."""
        different: list[Rates] = []
        for rates in found:
            if not any(self._are_same(rates, other) for other in different):
                different.append(rates)
        return tuple(different)

    def _are_same(self, a: Rates, b: Rates) -> bool:
        """Tell whether two solutions are the same up to rounding, multiplied by steep equations."""
        apart, size = np.abs(a.x - b.x), float(np.abs(a.x).max(initial=0.0)) + self._usual
        if (apart <= ZERO * size).all():
            return True
        near = bool((apart <= EPS**0.5 * size).all())
        return near and (self._fulfils(a.modes, b.x) or self._fulfils(b.modes, a.x))

    def _fulfils(self, modes: Indices, x: Array) -> bool:
        """Tell whether x fulfils the equations of the modes of all nodes up to rounding."""
        unknowns, E, e = self.equations(dict(enumerate(modes.tolist())))
        passive = np.delete(np.abs(x), unknowns)
        terms = np.abs(E) @ np.abs(x) + np.abs(e)
        rest = np.abs(E @ x - e)
        return bool((rest <= ZERO * terms).all() and (passive <= ZERO * self._usual).all())

    def can_be_listed(self) -> bool:
        """Tell whether the modes are few enough for linear programs, and programs can cut some."""
        if not self.h.any() or (self.tangent < 0).any():  # without load all modes meet at zero
            return False
        return bool(2 * self.count - np.count_nonzero(self.sign) <= MOST_BITS)

    def listed(self) -> RateSolutions:
        """Return all solutions by the search over modes that linear programs cut."""
        parts = self.friction, self.sign, self.normal, self.tangent
        all_modes, unknowns, remark = RateLaw(self.K, self.h, *parts).solutions()
        pairs = zip(all_modes, unknowns, strict=True)
        found = [Rates(np.array(m, dtype=np.intp), x, self.K @ x - self.h) for m, x in pairs]
        return RateSolutions(self._different(found), remark)


class _TooManyError(Exception):
    """There are too many problems."""


@final
class _Search:
    """The search for all solutions of a rate problem."""

    def __init__(self, problem: RateProblem, guess: dict[int, int]) -> None:
        self._problem, self._guess, self._work = problem, guess, 0.0
        self._least = MOST_WORK / MOST_LOOKS if problem.can_be_listed() else 0.0
        self.found: list[Rates] = []
        self.remark = ""

    def look(self, fixed: dict[int, int]) -> None:
        """Find all solutions with some modes fixed."""
        problem = self._problem
        self._work += max(float(problem.size) ** 3, self._least)
        if self._work > MOST_WORK:
            raise _TooManyError
        check_budget()
        if len(fixed) == problem.count:
            self._last(fixed)
            return
        settled = problem.settled(fixed, self._guess)
        if settled is None:
            node: int | None = next(i for i in range(problem.count) if i not in fixed)
        else:
            node = problem.others(fixed, settled[1])
        if settled is not None and node is None:
            solution = problem.checked(*settled)
            self.found += [solution] if solution else []
        elif node is not None:
            for mode in problem.options(node):
                self.look({**fixed, node: mode})

    def _last(self, modes: dict[int, int]) -> None:
        """Look at the solution in the modes of all nodes."""
        x = self._problem.solve(modes)
        solution = self._problem.checked(modes, x)
        if solution is not None:
            self.found.append(solution)
        elif x is None and self._problem.is_consistent(modes):
            self.remark = "there may be infinitely many ways on"


def _is_singular(lu: Array, sizes: Array) -> bool:
    """Tell whether a matrix in natural units is singular to rounding, by its factorisation.

    The inverse is compared with one: a small matrix is singular, too, if its terms cancel.
    """
    norm = float(sizes.sum(axis=0).max())
    return bool(norm * lapack.dgecon(lu, norm)[0] < SINGULAR)
