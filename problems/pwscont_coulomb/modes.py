"""Contact modes of a node: the meaning of the signs of the node's test functions.

With kappa1 = lam_nu - r (u_nu - gap) and x = lam_t - r u_t the tests of a node are
(kappa1, kappa2, kappa3) with kappa2 = x - F kappa1 and kappa3 = x + F kappa1. The paper
(section 3.1) writes F lam_nu for F kappa1, which is the same on solutions in contact; only with
kappa1 the selections agree on the interfaces between the cells.
"""

from __future__ import annotations

import re
from enum import IntEnum
from functools import lru_cache
from itertools import groupby, product
from typing import TypeAlias, final

import numpy as np
import numpy.typing as npt

from pwscont import Character
from pwscont.extending import Indices
from pwscont_coulomb.fixed import protected

Flags: TypeAlias = npt.NDArray[np.bool_]


@final
class Mode(IntEnum):
    """Contact mode of a node."""

    NO_CONTACT = 0
    STICK = 1
    SLIP_PLUS = 2
    SLIP_MINUS = 3

    @property
    def word(self) -> str:
        """The short name, with the direction of slip."""
        return WORDS[self]


WORDS = ("no contact", "stick", "slip+", "slip-")
#: A part of a label: first node, last node of several, word.
LISTED = re.compile(r"nodes? (\d+)(?: to (\d+))? (.*)")
#: The names in the paper's messages.
CLASS_NAMES = ("no contact", "contact-stick", "contact-slip", "contact-slip")
#: Line styles; the paper draws slip+ and slip- alike.
LINE_STYLES = {"no contact": "-", "stick": "--", "slip-": "-.", "slip+": ":"}

#: Mode -> the signs (kappa1 >= 0, kappa2 >= 0, kappa3 >= 0) of the node.
SIGNS = {
    Mode.NO_CONTACT: (True, True, True),
    Mode.STICK: (False, True, False),
    Mode.SLIP_PLUS: (False, False, False),
    Mode.SLIP_MINUS: (False, True, True),
}

#: Whether a node touches, and whether a node sticks, in each mode.
TOUCHES = np.array([False, True, True, True])
STICKS = np.array([False, True, False, False])

#: Which of the three tests of a node bound the cell, in each mode.
BOUNDS = np.array(
    [[True, False, False], [False, True, True], [True, True, False], [True, False, True]]
)

#: The mode for every combination of the three signs, read as a binary number.
MODE_OF_SIGNS = np.repeat(
    [Mode.SLIP_PLUS, Mode.STICK, Mode.SLIP_MINUS, Mode.NO_CONTACT], [2, 1, 1, 4]
)
DIGITS = np.array([4, 2, 1], dtype=np.uint8)
#: Bytes of the three signs -> the mode.
MODE_OF_BYTES = {
    bytes(signs): int(mode)
    for signs, mode in zip(product((0, 1), repeat=3), MODE_OF_SIGNS, strict=True)
}


@lru_cache(maxsize=32)
def modes(character: Character) -> Indices:
    """Return the mode of each node, shape (p,), not to be written to.

    Beyond the cells that solutions can lie in (kappa2 < 0 and kappa3 >= 0 in contact) slip+
    and slip- overlap; there the sign of kappa2 decides.
    """
    signs = character.array.view(np.uint8).reshape(-1, 3)
    return protected(MODE_OF_SIGNS.take(signs @ DIGITS))


def mode_of(node: int, character: Character) -> int:
    """Return the mode of a node, counted from zero, without computing all modes."""
    return MODE_OF_BYTES[character.array[3 * node : 3 * node + 3].tobytes()]


def bounds(mode: Indices, without_friction: Flags, guided: Flags) -> Flags:
    """Tell which tests bound the cell of these modes, shape (3 p,)."""
    found = BOUNDS.take(mode, axis=0)
    if np.count_nonzero(without_friction):
        found[:, 0] |= without_friction
    if np.count_nonzero(guided):
        found[guided, 1:] = False
    return found.ravel()


#: The paper's character of each mode: (kappa1 <= 0, kappa2 >= 0, kappa3 <= 0).
TRIPLES = {
    Mode.NO_CONTACT: "(0, *, *)",
    Mode.STICK: "(1, 1, 1)",
    Mode.SLIP_PLUS: "(1, 0, 1)",
    Mode.SLIP_MINUS: "(1, 1, 0)",
}


def label(character: Character) -> str:
    """Return the modes of all nodes: ``node 1 slip-, nodes 2 to 5 stick``."""
    return listed([WORDS[mode] for mode in modes(character).tolist()])


def word(node: int, character: Character) -> str:
    """Return the mode of a node, counted from zero, in words."""
    return WORDS[mode_of(node, character)]


def describe(character: Character) -> str:
    """Return the modes with triples, such as ``node 1 slip- (1, 1, 0)``."""
    found = [Mode(mode) for mode in modes(character)]
    return listed([f"{mode.word} {TRIPLES[mode]}" for mode in found])


def listed(words: list[str]) -> str:
    """Return the word of each node; three or more equal words in a row are put together."""
    if len(words) == 1:
        return words[0]
    runs, first = [], 1
    for word, group in groupby(words):
        last = first + len(list(group)) - 1
        runs += _run(first, last, word)
        first = last + 1
    return ", ".join(runs)


def modes_in(label: str, p: int) -> Indices:
    """Return the mode of each of p nodes from words made by :func:`listed`, shape (p,)."""
    number = {word: mode for mode, word in enumerate(WORDS)}
    if p == 1:
        return np.array([number[label]], dtype=np.intp)
    found = np.empty(p, dtype=np.intp)
    for part in label.split(", "):
        first, last, word = LISTED.fullmatch(part).groups()  # type: ignore[union-attr]
        found[int(first) - 1 : int(last or first)] = number[word]
    return found


def _run(first: int, last: int, word: str) -> list[str]:
    if last - first >= 2:
        return [f"nodes {first} to {last} {word}"]
    return [f"node {i} {word}" for i in range(first, last + 1)]


def describe_change(before: Character, after: Character) -> str:
    """Return the paper's message, such as ``contact-slip → contact-stick``."""
    old, new = modes(before), modes(after)
    changes = [
        (i, f"{CLASS_NAMES[old[i]]} → {CLASS_NAMES[new[i]]}")
        for i in (old != new).nonzero()[0].tolist()
    ]
    if len(old) == 1:
        return "".join(text for _, text in changes)
    return ", ".join(f"node {i + 1}: {text}" for i, text in changes)
