"""The character of a point: the signs of all test functions there."""

from __future__ import annotations

from collections.abc import Iterable
from typing import final

import numpy as np

from pwscont.basics.arrays import Array
from pwscont.basics.looks import MOST_LETTERS, short

#: More signs than this are stored as bits.
MANY = 64


@final
class Character:
    """Name of a cell: ``signs[i]`` is True where ``kappa_i >= 0``.

    Parameters
    ----------
    signs : iterable of bool, length m
        One sign per test function (Janovsky and Ligursky 2012, section 3.1; there the
        signs are stored as a triple of 0 and 1 per contact node).
    """

    __slots__ = ("_length", "_signs")
    _length: int
    _signs: bytes  # one byte per sign, one bit where they are many

    def __init__(self, signs: Iterable[bool]) -> None:
        self._store(bytes(map(bool, signs)))

    def _store(self, signs: bytes) -> None:
        object.__setattr__(self, "_length", len(signs))
        object.__setattr__(self, "_signs", _in_bits(signs) if len(signs) > MANY else signs)

    @property
    def signs(self) -> tuple[bool, ...]:
        """One sign per test function, a new tuple: take it once where many are needed."""
        return tuple(map(bool, bytes(self)))

    @classmethod
    def of(cls, tests: Array) -> Character:
        """Return the character of a point with test function values ``tests``, shape (m,)."""
        return cls((tests >= 0.0).tolist())

    def flip(self, i: int) -> Character:
        """Return the character on the other side of ``kappa_i = 0``."""
        return self.with_sign(i, not bytes(self)[i])

    def with_sign(self, i: int, sign: bool) -> Character:
        """Return the character in which test function ``i`` has the given sign."""
        signs = bytearray(bytes(self))
        signs[i] = bool(sign)
        return Character(map(bool, signs))

    def __bytes__(self) -> bytes:
        """Return one byte per sign, 0 or 1."""
        if self._length <= MANY:
            return self._signs
        bits = np.frombuffer(self._signs, dtype=np.uint8)
        return np.unpackbits(bits, count=self._length).tobytes()

    def __setattr__(self, name: str, value: object) -> None:
        raise AttributeError(f"{name}: a Character does not change; use flip or with_sign")

    def __eq__(self, other: object) -> bool:
        return (
            isinstance(other, Character)
            and self._length == other._length
            and self._signs == other._signs
        )

    def __hash__(self) -> int:
        return hash(self._signs)

    def __repr__(self) -> str:
        number = f", {self._length} signs" if self._length > MOST_LETTERS else ""
        return f"Character({short(str(self))}{number})"

    def __reduce__(self) -> tuple[type[Character], tuple[tuple[bool, ...]]]:
        return Character, (self.signs,)

    def __str__(self) -> str:
        return "".join("+" if sign else "-" for sign in bytes(self))


def _in_bits(signs: bytes) -> bytes:
    return np.packbits(np.frombuffer(signs, dtype=np.uint8)).tobytes()
