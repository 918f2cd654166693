"""When rates are unique: a form that is positive definite (docs/theory, F17).

For two solutions with the differences dx and dphi, a normal rate gives dx_nu dphi_nu <= 0. A node
at its bound, in the direction s, gives dx_t dphi_t <= s F dphi_nu dx_t. A node without force gives
dx_t dphi_t <= F abs(dphi_nu dx_t). Each inequality may be multiplied by a positive weight. At most
one solution exists if

    sum w x_nu phi_nu + sum x_t phi_t - sum s F phi_nu x_t
        - sum F (theta phi_nu^2 + x_t^2 / theta) / 2

is positive definite for some weight w and some positive theta, one theta for each node without
force. Without such nodes this is the condition that M + M^T is positive definite, one Cholesky
factorisation. On blocks a weight of 4 admits 1.7 times as much friction as a weight of 1.

A known solution (x, phi) says more of a node without force. If the node is pressed, every other
solution has dx_t dphi_t <= q dphi_nu dx_t with q = phi_t / phi_nu, the part of the friction that is
used. If the node leaves, w dx_nu dphi_nu + dx_t dphi_t <= q dphi_nu dx_t holds with the sign of x_t
and abs(q) = max(0, F - w abs(x_nu / x_t)). With these q in place of s F no theta is needed, and far
more friction is certain: a form proves that there is no other solution.

Failure modes and answers
-------------------------
- The search for theta stops early: the rates are called uncertain, though they may be unique.
- Rounding: a form is positive definite only if the form stays so by more than rounding, and by more
  than the errors of all q together. A q that rounding hides lies between -F and F.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

import numpy as np
from scipy.linalg import lapack

from pwscont.extending import EPS, GUARD, Array, Indices

#: Numbers below this part of the magnitudes of their terms are zero.
ZERO = 2.0**10 * GUARD * EPS
#: Weights of the normal rates that are tried.
WEIGHTS = (1.0, 4.0)
#: Most steps of the search for theta, and the number of steps after which the gain is looked at.
MOST_THETAS, WAIT = 40, 6


@final
@dataclass(frozen=True, slots=True, eq=False)
class Choices:
    """The nodes of a rate problem.

    Attributes
    ----------
    friction, sign, normal, tangent
        As for :class:`pwscont_coulomb.quasi_static.rates.RateProblem`.
    scale : ndarray, shape (m,)
        The stiffness of each unknown.
    """

    friction: Array
    sign: Array
    normal: Indices
    tangent: Indices
    scale: Array

    @property
    def size(self) -> int:
        """The number of unknowns."""
        return len(self.scale)


@final
class Form:
    """The form whose positive definiteness makes rates unique, in the unknowns of some nodes.

    Parameters
    ----------
    choices : Choices
    phi : ndarray, shape (rows, k)
        Forces by the unknowns, with those of decided nodes eliminated.
    columns : ndarray of int, shape (k,)
        The unknowns.
    left : list of int
        The nodes that are not decided.
    """

    def __init__(self, choices: Choices, phi: Array, columns: Indices, left: list[int]) -> None:
        self._choices, self._phi, self._columns, self._left = choices, phi, columns, left
        place = np.full(choices.size + 1, -1)
        place[columns] = np.arange(len(columns))
        nodes = np.array(left, dtype=np.intp)
        self._tangent = place[choices.tangent[nodes]]
        self._friction = np.where(choices.tangent[nodes] >= 0, choices.friction[nodes], 0.0)
        #: The places, among the nodes left, of nodes without force and with friction.
        self.rubbing = np.flatnonzero((choices.sign[nodes] == 0) & (self._friction > 0.0))
        self._normal = phi[choices.normal[nodes]]
        self._is_normal = np.isin(columns, choices.normal[nodes])

    def whole(self, weight: float) -> Array:
        """Return the form without theta, shape (k, k)."""
        choices = self._choices
        form = _symmetric(self._weights(weight)[:, np.newaxis] * self._phi[self._columns])
        for k, i in enumerate(self._left):
            if choices.sign[i]:
                row, j = choices.sign[i] * choices.friction[i] * self._normal[k], self._tangent[k]
                form[j] -= 0.5 * row
                form[:, j] -= 0.5 * row
        return form

    def _weights(self, weight: float) -> Array:
        return np.where(self._is_normal, weight, 1.0)

    def _unit(self, weight: float) -> Array:
        """Return natural units of the unknowns."""
        return 1.0 / np.sqrt(self._weights(weight) * self._choices.scale[self._columns])

    def judged(self, weight: float, thetas: Array) -> tuple[float, Array | None]:
        """Return the least eigenvalue and its vector for the best theta found, or no vector.

        Without a vector the form is positive definite. The thetas of all nodes are written to.
        """
        choices, form = self._choices, self.whole(weight)
        nodes = np.array(self._left, dtype=np.intp)[self.rubbing]
        n, F, at = (some[self.rubbing] for some in (self._normal, self._friction, self._tangent))
        usual = F / choices.scale[choices.normal[nodes]]
        before = -np.inf
        for turn in range(MOST_THETAS):
            theta = thetas[nodes] * usual
            whole = form - 0.5 * (n.T * theta) @ n
            whole[at, at] -= 0.5 * F**2 / theta
            if self.is_positive(whole, weight):
                return np.inf, None
            least, worst = self._least(whole, weight)
            if turn % WAIT == WAIT - 1 and least < 0.8 * before:
                break
            before = least if turn % WAIT == WAIT - 1 else before
            gain = F**2 / theta * worst[at] ** 2 - theta * (n @ worst) ** 2
            step = 0.5 / (1 + 0.1 * turn) / max(float(np.abs(gain).max()), 1e-300)
            thetas[nodes] *= np.exp(step * gain)
        return least, worst

    def worst(self, weight: float) -> tuple[float, Array]:
        """Return the least eigenvalue of the form without theta, and its vector."""
        return self._least(self.whole(weight), weight)

    def _least(self, form: Array, weight: float) -> tuple[float, Array]:
        unit = self._unit(weight)
        values, vectors = np.linalg.eigh(unit[:, np.newaxis] * form * unit)
        return float(values[0]), unit * vectors[:, 0]

    def is_positive(self, form: Array, weight: float = 1.0, more: float = 0.0) -> bool:
        """Tell whether a form is positive definite by more than rounding, in natural units."""
        unit = self._unit(weight)
        scaled = unit[:, np.newaxis] * form * unit
        most = float(self._choices.friction.max(initial=0.0))
        scaled[np.diag_indices_from(scaled)] -= ZERO * (1.0 + most) + more
        return bool(lapack.dpotrf(scaled, lower=1)[1] == 0)

    def error(self, weight: float, errors: Array) -> float:
        """Return a bound of the error of the form, in natural units, from the errors of friction.

        The symmetric part of the product of two vectors has no eigenvalue above their lengths.
        """
        unit = self._unit(weight)
        lengths = np.linalg.norm(self._normal * unit, axis=1)
        sizes = np.where(self._tangent >= 0, unit[self._tangent], 0.0)
        return float((errors[self._left] * lengths * sizes).sum())

    def heaviest(self, x: Array) -> int:
        """Return the node that contributes most to a negative direction."""
        slip = np.where(self._tangent >= 0, x[self._tangent], 0.0)
        weights = self._friction * np.abs((self._normal @ x) * slip)
        return self._left[int(np.argmax(weights))]


@final
@dataclass(frozen=True, slots=True, eq=False)
class Known:
    """A solution of a rate problem.

    Attributes
    ----------
    x, phi : ndarray
        Rates and forces, by unknowns and rows.
    speed, force : ndarray
        Bounds of their errors.
    """

    x: Array
    phi: Array
    speed: Array
    force: Array

    def used(self, choices: Choices, weight: float) -> tuple[Choices, Array]:
        """Return the nodes with q of this solution in place of their friction, and errors of q."""
        q, errors = choices.sign * choices.friction, np.zeros(len(choices.friction))
        for i in np.flatnonzero((choices.sign == 0) & (choices.tangent >= 0)).tolist():
            q[i], errors[i] = self._used(choices, i, weight)
        used = Choices(np.abs(q), np.sign(q), choices.normal, choices.tangent, choices.scale)
        return used, errors

    def _used(self, choices: Choices, i: int, weight: float) -> tuple[float, float]:
        """Return q of a node without force, and a bound of the error of q."""
        n, t, F = int(choices.normal[i]), int(choices.tangent[i]), float(choices.friction[i])
        away, slip = max(-float(self.x[n]), 0.0), float(self.x[t])
        press, shear = -float(self.phi[n]), float(self.phi[t])
        if not (away or slip or press or shear):
            return 0.0, 0.0
        if press > 2.0 * self.force[n]:
            error = 2.0 * (self.force[t] + F * self.force[n]) / press
            return min(max(-shear / press, -F), F), float(error)
        slack = float(self.speed[n]), float(self.speed[t])
        most = max(F - weight * max(away - slack[0], 0.0) / (abs(slip) + slack[1]), 0.0)
        if abs(slip) <= slack[1]:
            return 0.0, most
        least = max(F - weight * (away + slack[0]) / (abs(slip) - slack[1]), 0.0)
        return float(np.sign(slip)) * 0.5 * (most + least), 0.5 * (most - least)


def _symmetric(matrix: Array) -> Array:
    return 0.5 * (matrix + matrix.T)
