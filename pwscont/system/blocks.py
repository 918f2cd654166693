"""Parts of a system whose modes do not depend on one another."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import chain, product
from math import prod
from typing import final

from pwscont.basics.character import Character


@final
@dataclass(frozen=True, slots=True)
class Block:
    """A part of a system that is in one of several modes, whatever the others do.

    Attributes
    ----------
    tests : tuple of int
        The test functions whose signs choose the mode.
    rows : tuple of int
        The rows of H that depend on the mode.
    modes : tuple of tuple of bool
        For every mode the signs of these tests in some character that has it.

    Examples
    --------
    >>> from pwscont import Block
    >>> Block(tests=(0,), rows=(1,), modes=((True,), (False,)))
    Block(tests=(0,), rows=(1,), modes=((True,), (False,)))
    """

    tests: tuple[int, ...]
    rows: tuple[int, ...]
    modes: tuple[tuple[bool, ...], ...]


def number_of_cells(blocks: Iterable[Block]) -> int:
    """Return the number of combinations of the modes of some blocks."""
    return prod(len(block.modes) for block in blocks)


def characters(blocks: Sequence[Block], tests: int) -> Iterator[Character]:
    """Yield one character for each combination of the modes of some blocks.

    Of so many tests, those that no block decides are positive.
    """
    positive = Character([True] * tests)
    decided = [test for block in blocks for test in block.tests]
    for modes in product(*(block.modes for block in blocks)):
        yield positive.with_signs(decided, chain.from_iterable(modes))
