"""The branch graph: smooth pieces joined at special points, with all queries as methods."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from pathlib import Path
from typing import Any, final

from pwscont.basics.outcome import Guarantee
from pwscont.basics.quantities import Function
from pwscont.graph import balance as signs
from pwscont.graph import exports, queries, storage
from pwscont.graph.balance import WORDS, verdict
from pwscont.graph.proved import BoxProof
from pwscont.graph.structure import ConnectedPieces
from pwscont.system.system import PiecewiseSystem


@final
class BranchGraph(ConnectedPieces):
    """All that was found of the solutions of a system in an interval of the parameter.

    Made by :func:`pwscont.trace` and :func:`pwscont.explore`; not changed afterwards.

    Parameters
    ----------
    points : iterable of SpecialPoint
    pieces : iterable of Piece
    interval : tuple of float
    starts : iterable of SpecialPoint
        Points within pieces at which tracing began.
    system : PiecewiseSystem, optional
        Needed to answer to full accuracy between the points of a curved piece.
    parameter : str
        Name of the parameter, for tables and axes.
    searched : SearchScope
        Where starts were searched, and what that promises.
    record : mapping of str to callable, optional
        Quantities to have at hand by name, such as ``solution["power"]``: functions of (z, alpha)
        that return a finite float. A function is evaluated when the quantity is asked for; a
        function that fails raises then, and nothing else of the graph is lost.
    names : sequence of str, optional
        Names of the unknowns; default those of the system.
    infinite : sequence of Stretch
        Where solutions fill a segment or more.

    Raises
    ------
    InvalidInputError
        If a recorded quantity has the name of an unknown or of something else, or is no function.

    Examples
    --------
    >>> from pwscont import LCP, explore
    >>> graph = explore(LCP([[1, 2], [2, 1]], q=[-1, -1], d=[1, 0]), (-1.0, 2.0))
    >>> graph.count(0.0), graph.guarantee
    (3, 'complete')
    >>> [(round(lo, 6), round(hi, 6), n) for lo, hi, n in graph.multiplicity()]
    [(-1.0, 0.5, 3), (0.5, 2.0, 1)]
    >>> graph.nx.number_of_edges()
    3
    """

    #: What is proved of the solutions, see :class:`pwscont.Everywhere`; None for nothing.
    proof: Any = None

    count = queries.count_at
    solutions = queries.solutions_at
    solution_at = queries.solution_at
    multiplicity = queries.multiplicity
    with_count = queries.with_count
    is_beside_infinite = queries.is_beside_infinite
    balance = signs.balance_at
    balances = signs.balances
    balance_values = signs.balance_values
    is_balanced = signs.is_balanced
    unbalanced = signs.unbalanced
    nx = cached_property(exports.networkx_graph)
    to_dataframe = exports.data_frame

    @cached_property
    def guarantee(self) -> str:
        """What is known about the completeness of the graph, in words.

        The text begins with "complete", "complete but for closed loops", "balanced", or "not
        balanced", and goes on with what stands in the way, and where: a branch is missing, a
        solution stands twice, a piece was stopped, the model ends, a branch ends on purpose. No
        graph is called complete with a special point that is stopped, searched in part, left by a
        piece that could not be followed, or known to less than two digits. Where the run was
        interrupted or its limits ran out, the text says so instead. Balance is necessary for
        completeness, not sufficient, and says nothing of stretches shorter than the uncertainty of
        the ends, see :meth:`balance_values`. What :attr:`proof` proves is said as well, and where
        the number of solutions found is not the number proved.
        """
        words = verdict(self)
        return words if self.proof is None else str(self.proof.judged(self, words))

    @property
    def is_complete(self) -> bool:
        """Whether nothing can be missing, no closed loop either; else counts are least numbers."""
        words = verdict(self).split(";")[0]
        promised = words in (WORDS[Guarantee.EVERYTHING], WORDS[Guarantee.UNIQUE])
        return promised and not self.guarantee.startswith("not ")

    def save(self, path: str | Path) -> None:
        """Write the graph to one portable file (a zip of arrays and JSON; no pickle).

        Raises
        ------
        GraphFileError
            If the file cannot be written.
        """
        storage.write(path, self, self.proof if isinstance(self.proof, BoxProof) else None)

    @classmethod
    def load(
        cls,
        path: str | Path,
        system: PiecewiseSystem | None = None,
        record: Mapping[str, Function] | None = None,
    ) -> BranchGraph:
        """Read a graph written by :meth:`save`.

        Parameters
        ----------
        path : str or Path
        system : PiecewiseSystem, optional
            The system that the graph belongs to; without a system, solutions between the stored
            points of a curved piece cannot be corrected and are refused.
        record : mapping of str to callable, optional
            Quantities to have at hand by name. Without ``record`` the special points keep the
            quantities that were recorded when the graph was saved; solutions between special points
            need the functions.

        Raises
        ------
        GraphFileError
            If the file is missing, damaged, or no branch graph.
        InvalidInputError
            If the system has another number of unknowns or tests than the graph, or other
            solutions, or names and functions of ``record`` do not fit.
        """
        contents, proof = storage.read(path)
        if system is not None:
            own = storage.adopted(path, contents, system)
            contents |= {"system": own, "names": None}
        graph = cls(**contents, record=record)
        if proof is not None and (system is None or proof.is_of(system)):
            graph.proof = proof
        return graph

    def to_dict(self) -> dict[str, Any]:
        """Return the graph as plain lists and numbers."""
        return exports.as_dict(self, self.guarantee)

    def __repr__(self) -> str:
        return exports.as_text(self, self._promise)

    def _repr_html_(self) -> str:
        return exports.as_html(self, self._promise)

    @property
    def _promise(self) -> str:
        """The guarantee, and the box of the proof where a proof holds."""
        words = self.guarantee
        is_of_box = self.pieces and "in the box, proved" in words
        return f"{words}\n  {self.proof.where}" if is_of_box else words
