"""What is proved of systems of linear pieces and of evolutions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, final

ASSUMED = "assumed: arithmetic of IEEE 754 to nearest; {} count as the doubles that they are"


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
