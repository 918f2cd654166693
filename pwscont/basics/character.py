"""The character of a point: the signs of all test functions there."""

from __future__ import annotations

from collections.abc import Iterable
from typing import final

import numpy as np

from pwscont.basics.arrays import Array, Indices, Signs
from pwscont.basics.errors import InvalidInputError
from pwscont.basics.printing import MOST_LETTERS, short

#: From bytes 0 and 1 to the printed signs, and back.
AS_TEXT = bytes.maketrans(b"\x00\x01", b"-+")
FROM_TEXT = bytes.maketrans(b"-+", b"\x00\x01")


@final
class Character:
    """Name of a cell: ``signs[i]`` is True where ``kappa_i >= 0``.

    Parameters
    ----------
    signs : iterable of bool, length m
        The sign of each test function (Janovsky and Ligursky 2012, section 3.1; there the
        signs are stored as a triple of 0 and 1 per contact node).

    Raises
    ------
    InvalidInputError
        If an entry is none of True, False, 1 and 0.

    Examples
    --------
    >>> from pwscont import Character
    >>> Character([True, False]).flip(1)
    Character(++)
    >>> Character([True, False]).signs
    (True, False)
    """

    __slots__ = ("_array", "_signs")
    #: A byte per sign, 0 or 1: a block of memory, which is compared, hashed and copied fast.
    _signs: bytes
    #: The same signs as an array of bool.
    _array: Signs

    def __init__(self, signs: Iterable[bool]) -> None:
        found = tuple(signs) if isinstance(signs, Iterable) else (None,)
        if not all(sign in (0, 1) for sign in found):
            words = "signs must be True or False for each test function; Character.read takes '+-'"
            raise InvalidInputError(f"{words}; got {short(repr(signs))}")
        self._set(bytes(map(bool, found)))

    def _set(self, signs: bytes) -> None:
        object.__setattr__(self, "_signs", signs)
        object.__setattr__(self, "_array", np.frombuffer(signs, np.bool_))

    @property
    def signs(self) -> tuple[bool, ...]:
        """The sign of each test function."""
        return tuple(self._array.tolist())

    @property
    def array(self) -> Signs:
        """The signs as an array of bool, shape (m,), not to be written to."""
        return self._array

    @classmethod
    def of(cls, tests: Array) -> Character:
        """Return the character of a point with test function values ``tests``, shape (m,)."""
        return cls._of_bytes((tests >= 0.0).tobytes())

    @classmethod
    def read(cls, text: str) -> Character:
        """Return the character from the printed form, ``+`` and ``-``; refuse any other text."""
        if not isinstance(text, str) or not set(text) <= {"+", "-"}:
            raise InvalidInputError(f"signs are written as '+' and '-', got {short(repr(text))}")
        return cls._of_bytes(text.encode("ascii").translate(FROM_TEXT))

    @classmethod
    def _of_bytes(cls, signs: bytes) -> Character:
        character: Character = object.__new__(cls)
        character._set(signs)
        return character

    def flip(self, i: int) -> Character:
        """Return the character on the other side of ``kappa_i = 0``."""
        return self.with_sign(i, not self._signs[i])

    def with_sign(self, i: int, sign: bool) -> Character:
        """Return the character in which test function ``i`` has the given sign."""
        return self.with_signs((i,), (sign,))

    def with_signs(self, tests: Iterable[int], chosen: Iterable[bool]) -> Character:
        """Return the character in which some test functions have the given signs."""
        signs = bytearray(self._signs)
        for i, sign in zip(tests, chosen, strict=True):
            signs[i] = bool(sign)
        return self._of_bytes(bytes(signs))

    def among(self, tests: Indices) -> bytes:
        """Return the signs of some tests as bytes: 1 or 2, and 0 for every other test."""
        some = np.zeros(len(self._signs), np.uint8)
        some[tests] = self._array.view(np.uint8).take(tests) + np.uint8(1)
        return some.tobytes()

    def __bytes__(self) -> bytes:
        """Return a byte per sign, 0 or 1."""
        return self._signs

    def __setattr__(self, name: str, value: object) -> None:
        raise AttributeError(f"{name}: a Character does not change; use flip or with_sign")

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Character) and self._signs == other._signs

    def __hash__(self) -> int:
        return hash(self._signs)

    def __repr__(self) -> str:
        size = self.array.size
        number = f", {size} signs" if size > MOST_LETTERS else ""
        return f"Character({short(str(self))}{number})"

    def __reduce__(self) -> tuple[type[Character], tuple[tuple[bool, ...]]]:
        return Character, (self.signs,)

    def __str__(self) -> str:
        return self._signs.translate(AS_TEXT).decode("ascii")
