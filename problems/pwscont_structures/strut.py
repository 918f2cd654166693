"""A strut under an axial load, between one-sided supports.

Euler's elastica with hinged ends: the energy of an inextensible rod with bending stiffness EI is
the integral of EI (theta' - kappa_0)^2 / 2 + P cos(theta), under the constraint that the ends stay
on the line of the load. Supports let the rod go to one side only.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import final

import numpy as np
from scipy.interpolate import CubicHermiteSpline

from pwscont import Character, InvalidInputError, PiecewiseSystem
from pwscont.extending import Array, finite_array
from pwscont_structures.rod import Rod

#: Largest angle at a node, in radians: beyond, the ends of a free elastica have passed each other.
LARGEST_ANGLE = np.radians(150.0)
#: The midspan force, in EI / L^2, per deflection, in L, of a hinged rod in the linear theory:
#: REACTION turns reactions into lengths, as gaps are.
REACTION = 48.0


@final
@dataclass(frozen=True)
class Support:
    """A support that a strut may touch from one side, without friction.

    A support stands at a point of the rod, and follows when the point moves along the chord.

    Attributes
    ----------
    place : float
        Along the rod, between 0 and 1, moved to the next end of an element.
    height : float
        Height of the support, in units of length: above the straight rod if positive.

    Examples
    --------
    >>> from pwscont_structures import Strut, Support
    >>> Strut(4, supports=[Support(0.5, 0.1)]).size
    11
    """

    place: float
    height: float

    @property
    def side(self) -> float:
        """The side of the support: 1.0 above the rod, -1.0 below."""
        return 1.0 if self.height > 0.0 else -1.0


@final
class Strut(PiecewiseSystem):
    """A strut with hinged ends; alpha is the axial load, positive in compression.

    Lengths are in units of the length of the rod L, forces in EI / L^2: Euler's load is pi^2. The
    unknowns are the angles at the nodes, the transverse force V of the hinge at the end, and the
    reactions R_1, R_2, ... of the supports, positive if the supports push.

    Parameters
    ----------
    elements : int
        Quadratic elements of equal length.
    supports : sequence of Support
    bow : float or sequence of float
        Amplitudes of the first, second, ... sine half-waves of the unloaded, slightly bent rod.

    Raises
    ------
    InvalidInputError
        If a support is at no inner end of an element, at height zero, or meets the unloaded rod.

    Examples
    --------
    >>> from pwscont import explore
    >>> from pwscont_structures import Strut
    >>> buckled = explore(Strut(4), (5.0, 15.0), parameter="P")
    >>> [round(p.alpha, 3) for p in buckled.special_points("branch point")]  # pi^2 = 9.870
    [9.875]
    """

    def __init__(
        self,
        elements: int = 10,
        supports: Sequence[Support] = (),
        bow: float | Sequence[float] = (),
    ) -> None:
        if not isinstance(elements, int | np.integer):
            words = f"a strut needs a whole number of elements, got {elements!r}"
            raise InvalidInputError(words)
        if elements < 2:
            raise InvalidInputError(f"a strut needs at least two elements, got {elements}")
        for each in supports if isinstance(supports, Sequence) else [supports]:
            if not (isinstance(supports, Sequence) and isinstance(each, Support)):
                raise InvalidInputError(f"supports must be several Support(...), got {each!r}")
        self.rod, self.supports = Rod(elements), tuple(supports)
        self.size = self.rod.n + 1 + len(self.supports)
        self.places = _ends_of_elements(self.supports, elements)
        self.heights = finite_array("heights of supports", [s.height for s in self.supports])
        self.sides = np.array([s.side for s in self.supports])
        self._sums = self.rod.up_to(np.append(1.0, self.places))
        self._stiffness = self.rod.curvature.T * self.rod.weights @ self.rod.curvature
        self.bow = np.atleast_1d(finite_array("bow", bow))
        self._rest = self.rod.curvature.T @ (self.rod.weights * self._initial_curvature())
        self._refuse_touching()

    def _initial_curvature(self) -> Array:
        waves = np.pi * np.arange(1, len(self.bow) + 1)
        return -np.sin(np.outer(self.rod.s, waves)) @ (self.bow * waves**2)

    def _refuse_touching(self) -> None:
        waves = np.pi * np.arange(1, len(self.bow) + 1)
        gaps = self.sides * (self.heights - np.sin(np.outer(self.places, waves)) @ self.bow)
        if (gaps <= 0.0).any() or not self.heights.all():
            number = int(np.argmin(gaps)) + 1
            raise InvalidInputError(f"support {number} must be off the unloaded rod: change height")

    def test_functions(self, z: Array, alpha: float) -> Array:
        """Return reaction less gap of all supports, positive in contact."""
        return self._reactions(z) - self.gaps(z)

    def test_jacobian(self, z: Array, alpha: float) -> Array:
        """Return the derivatives of the tests."""
        return self._reaction_rows() - self._gap_rows(z)

    def residual(self, z: Array, alpha: float, character: Character) -> Array:
        """Return the balance of moments, the height of the end, and gaps or reactions."""
        theta = self.rod.angle @ z[: self.rod.n]
        vertical = self._transverse(z) * np.cos(theta)
        axial = alpha * self.rod.weights * np.sin(theta)
        moments = self._stiffness @ z[: self.rod.n] - self._rest
        moments -= self.rod.angle.T @ (axial + vertical)
        end = self._sums[:1] @ np.sin(theta)
        contact = np.where(character.array, self.gaps(z), self._reactions(z))
        return np.concatenate([moments, end, contact])

    def jacobian(self, z: Array, alpha: float, character: Character) -> Array:
        """Return the derivatives of the residual, dense."""
        n, B = self.rod.n, self.rod.angle
        theta = B @ z[:n]
        bent = alpha * self.rod.weights * np.cos(theta) - self._transverse(z) * np.sin(theta)
        lifts = self._sums * np.cos(theta) @ B
        jacobian = np.zeros((self.size, self.size + 1))
        jacobian[:n, :n] = self._stiffness - (B.T * bent) @ B
        jacobian[:n, n:-1] = -(np.append(1.0, -self.sides)[:, np.newaxis] * lifts).T
        jacobian[:n, -1] = -(self.rod.weights * np.sin(theta)) @ B
        jacobian[n, :n] = lifts[0]
        on = character.array[:, np.newaxis]
        jacobian[n + 1 :] = np.where(on, self._gap_rows(z), self._reaction_rows())
        return jacobian

    def _transverse(self, z: Array) -> Array:
        """Return weight times transverse force beyond each Gauss point, shape (q,)."""
        n = self.rod.n
        forces: Array = np.append(z[n], -self.sides * z[n + 1 :]) @ self._sums
        return forces

    def gaps(self, z: Array) -> Array:
        """Return how far the rod is from each support."""
        sines = np.sin(self.rod.angle @ z[: self.rod.n])
        gaps: Array = self.sides * (self.heights - self._sums[1:] @ sines)
        return gaps

    def _reactions(self, z: Array) -> Array:
        """Return the reactions in the unit of length that gaps have."""
        return z[self.rod.n + 1 :] / REACTION

    def _gap_rows(self, z: Array) -> Array:
        n, B = self.rod.n, self.rod.angle
        rows = np.zeros((len(self.supports), self.size + 1))
        cosines = np.cos(B @ z[:n])
        rows[:, :n] = -self.sides[:, np.newaxis] * (self._sums[1:] * cosines @ B)
        return rows

    def _reaction_rows(self) -> Array:
        picks = np.eye(self.size, self.size + 1)[self.rod.n + 1 :]
        return picks / REACTION

    def deflection(self, z: Array, place: float) -> float:
        """Return w at the end of an element, positive upwards."""
        sums = self.rod.up_to(np.array([place]))
        return float(sums[0] @ np.sin(self.rod.angle @ z[: self.rod.n]))

    def shortening(self, z: Array) -> float:
        """Return by how much the ends have come closer."""
        return float(self.rod.weights @ (1.0 - np.cos(self.rod.angle @ z[: self.rod.n])))

    def shape(self, z: Array, points: int = 101) -> tuple[Array, Array]:
        """Return the places (x, w) of points along the rod, for pictures."""
        theta, ends = z[: self.rod.n], self.rod.nodes[::2]
        sums, s = self.rod.up_to(ends), np.linspace(0.0, 1.0, points)
        x, w = (
            CubicHermiteSpline(ends, sums @ along(self.rod.angle @ theta), along(theta[::2]))(s)
            for along in (np.cos, np.sin)
        )
        return x, w

    def scale(self, lo: float, hi: float) -> Array:
        """Return 1.0 for angles, and Euler's load for forces."""
        forces = np.full(self.size - self.rod.n, np.pi**2)
        return np.append(np.ones(self.rod.n), forces)

    def bounds(self) -> tuple[Array, Array]:
        """Return bounds of the angles: a rod turned round is none of the states of a strut."""
        largest = np.full(self.size, np.inf)
        largest[: self.rod.n] = LARGEST_ANGLE
        return -largest, largest

    def names(self) -> tuple[str, ...]:
        """Return names: angles with places, the force of the hinge, and the reactions."""
        angles = (f"theta({s:g})" for s in self.rod.nodes.round(6))
        return (*angles, "V", *(f"R_{i + 1}" for i in range(len(self.supports))))

    def describe(self, character: Character) -> str:
        """Return which supports the rod touches."""
        touched = [str(i + 1) for i, touches in enumerate(character.signs) if touches]
        if not touched:
            return "free"
        return f"support{'s' if len(touched) > 1 else ''} {' and '.join(touched)}"

    def test_name(self, test: int) -> str:
        """Return which support a test is about."""
        return f"contact at support {test + 1}"

    def describe_transition(self, before: Character, after: Character) -> str:
        """Return which supports are touched or left."""
        return ", ".join(
            f"{'touches' if now else 'leaves'} support {i + 1}"
            for i, (was, now) in enumerate(zip(before.signs, after.signs, strict=True))
            if was != now
        )


def _ends_of_elements(supports: Sequence[Support], elements: int) -> Array:
    """Return the inner ends of elements next to the places of supports."""
    numbers = np.rint(np.array([s.place for s in supports]) * elements)
    if ((numbers < 1) | (numbers > elements - 1)).any():
        raise InvalidInputError("supports must be between the ends of the rod, 0 < place < 1")
    ends: Array = numbers / elements
    return ends
