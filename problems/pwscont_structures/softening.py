"""A bar of softening elements in series with a spring, under a given displacement of the end.

If an element softens faster than the rest of the bar can follow, the displacement of the end must
go back for equilibrium: a snap-back (Bazant and Cedolin, *Stability of Structures*, 1991, ch. 13).
Any of several equal elements may soften first, and deformation localises.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import final

import numpy as np

from pwscont import Block, Character, InvalidInputError, PiecewiseLinearSystem
from pwscont.extending import Array, finite_array

#: Modes of an element, by the signs of (e - e_peak, e - e_ultimate).
MODES = {(False, False): "elastic", (True, False): "softening", (True, True): "broken"}
#: (mode before, mode after) -> the event in words.
EVENTS = {
    ("elastic", "softening"): "reaches its strength",
    ("softening", "elastic"): "goes back to elastic",
    ("softening", "broken"): "breaks",
    ("broken", "softening"): "heals",
    ("elastic", "broken"): "breaks at once",
    ("broken", "elastic"): "heals at once",
}


@final
class SofteningBar(PiecewiseLinearSystem):
    """n softening elements and a spring in series; alpha is the displacement of the end.

    The unknowns are the elongations e_1, ..., e_n of the elements. Each carries
    sigma(e) = min(modulus e, max(remaining e, strength + softening (strength / modulus - e))), and
    the spring carries the same force: sigma(e_i) = spring (alpha - e_1 - ... - e_n).

    Parameters
    ----------
    spring : float
        The stiffness of the spring.
    strength, modulus, softening : float or sequence of float
        The largest force, the slope before the largest force, and minus the slope after the largest
        force, of each element; the longest sequence gives the number of elements.
    remaining : float
        The slope of broken elements, below the modulus; positive where there are several elements,
        because two elements without force could share an elongation in any way.

    Raises
    ------
    InvalidInputError
        If a number is not positive, lengths do not fit, or the remaining slope does not.

    Examples
    --------
    >>> from pwscont import explore
    >>> from pwscont_structures import SofteningBar
    >>> explore(SofteningBar(), (0.0, 5.0), parameter="displacement").count(2.5)
    3
    """

    degree = 1  # forces fall without bound with falling elongations, else stay bounded

    def __init__(
        self,
        spring: float = 0.5,
        strength: float | Sequence[float] = 1.0,
        modulus: float | Sequence[float] = 1.0,
        softening: float | Sequence[float] = 0.8,
        remaining: float = 0.0,
    ) -> None:
        self.strength, self.modulus, self.softening = _alike(strength, modulus, softening)
        self.size = len(self.strength)
        self.spring = float(_alike(finite_array("spring", spring, ()))[0][0])
        self.remaining = float(finite_array("remaining", remaining, ()))
        self._refuse_remaining()
        self.peak = self.strength / self.modulus
        rest = self.strength + self.softening * self.peak
        self.ultimate = rest / (self.softening + self.remaining)

    def _refuse_remaining(self) -> None:
        if not 0.0 <= self.remaining < self.modulus.min():
            raise InvalidInputError(
                f"remaining must be from 0 to the modulus, got {self.remaining}"
            )
        if self.size > 1 and not self.remaining:
            raise InvalidInputError(
                "several elements need a remaining slope: two broken ones that carry nothing could "
                "share their elongation in any way"
            )

    def test_functions(self, z: Array, alpha: float) -> Array:
        """Return e - e_peak of all elements, then e - e_ultimate."""
        return np.concatenate([z - self.peak, z - self.ultimate])

    def residual(self, z: Array, alpha: float, character: Character) -> Array:
        """Return the force of each element less the force of the spring."""
        soft, broken = character.array.reshape(2, -1)
        falling = self.strength + self.softening * (self.peak - z)
        softened = np.where(broken, self.remaining * z, falling)
        stress = np.where(soft, softened, self.modulus * z)
        balance: Array = stress - self.spring * (alpha - z.sum())
        return balance

    def bounding_tests(self, character: Character) -> list[int]:
        """Return e - e_peak of elements not broken, then e - e_ultimate of elements not elastic."""
        n, signs = self.size, character.signs
        peaks = [i for i in range(n) if not signs[n + i]]
        return peaks + [n + i for i in range(n) if signs[i]]

    def blocks(self) -> tuple[Block, ...]:
        """Return a block for each element, with three modes."""
        return tuple(Block((i, self.size + i), (i,), tuple(MODES)) for i in range(self.size))

    def scale(self, lo: float, hi: float) -> Array:
        """Return the elongations at which the elements break."""
        return self.ultimate

    def force(self, z: Array, alpha: float) -> float:
        """Return the force in the bar, for pictures."""
        return float(self.spring * (alpha - z.sum()))

    def names(self) -> tuple[str, ...]:
        """Return e_1, ..., e_n."""
        return tuple(f"e_{i + 1}" for i in range(self.size))

    def describe(self, character: Character) -> str:
        """Return the mode of each element."""
        return ", ".join(
            f"{self._element(i)}{mode}" for i, mode in enumerate(self.modes(character))
        )

    def modes(self, character: Character) -> list[str]:
        """Return the modes of the elements in words."""
        soft, broken = character.array.reshape(2, -1)
        return [MODES[bool(a or b), bool(b)] for a, b in zip(soft, broken, strict=True)]

    def test_name(self, test: int) -> str:
        """Return which strength a test is about."""
        what = "end" if test // self.size else "peak"
        return f"{what} of element {test % self.size + 1}"

    def describe_transition(self, before: Character, after: Character) -> str:
        """Return which elements begin to soften, break, or go back."""
        changes = zip(self.modes(before), self.modes(after), strict=True)
        return ", ".join(
            f"{self._element(i)}{EVENTS[was, now]}"
            for i, (was, now) in enumerate(changes)
            if was != now
        )

    def _element(self, i: int) -> str:
        return f"element {i + 1} " if self.size > 1 else ""


def _alike(*numbers: float | Sequence[float] | Array) -> list[Array]:
    """Return positive numbers in a common shape, (n,)."""
    try:
        given = np.broadcast_arrays(np.ones(1), *numbers)[1:]
    except ValueError as error:
        raise InvalidInputError(f"numbers of elements: {error}") from error
    checked = [finite_array("numbers of a softening bar", each) for each in given]
    for each in checked:
        if each.ndim != 1 or not len(each) or (each <= 0.0).any():
            words = "spring, strength, modulus and softening must be positive numbers"
            raise InvalidInputError(f"{words}, one for each element or one for all, got {each}")
    return checked
