"""The branch graph: smooth pieces joined at special points, with all queries as methods."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, final

from pwscont.basics.errors import InvalidSystemError
from pwscont.basics.outcome import Guarantee
from pwscont.basics.quantities import Function
from pwscont.graph import balance, exports, queries, storage
from pwscont.graph.balance import WORDS, verdict
from pwscont.graph.proved import BoxProof
from pwscont.graph.records import Solution, Stretch
from pwscont.graph.structure import Structure
from pwscont.system.system import PiecewiseSystem

if TYPE_CHECKING:
    import networkx as nx


@final
class BranchGraph(Structure):
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

    def count(self, alpha: float) -> int | float:
        """Return the number of solutions at ``alpha``; infinite where they fill a segment or more.

        A solution at which two pieces meet counts once.
        """
        return queries.count_at(self, alpha)

    def solutions(self, alpha: float) -> list[Solution]:
        """Return all solutions at ``alpha`` that the graph holds, corrected to full accuracy.

        Where solutions are infinitely many, as on a vertical piece, the ends of the segments are
        returned.

        Raises
        ------
        InvalidInputError
            If alpha lies outside the interval.
        SystemNeededError
            If a curved piece must be corrected and the graph was loaded without a system.
        """
        return queries.solutions_at(self, alpha)

    def solution_at(self, node: int) -> Solution:
        """Return a special point as one of the solutions at its alpha."""
        return queries.solution_at(self, node)

    def multiplicity(self) -> list[Stretch]:
        """Return ``(lo, hi, count)`` for successive stretches with the same number of solutions.

        ``lo_closed`` and ``hi_closed`` say whether the number holds at the ends as well. A single
        value of alpha is an entry of its own where solutions are infinitely many, and where the
        numbers on both sides agree and another number holds between, as at a branch point. A fold
        lies in no stretch: :meth:`with_count` and :meth:`count` tell the number there.
        """
        return queries.multiplicity(self)

    def with_count(self, count: int | float) -> list[Stretch]:
        """Return all stretches and single values of alpha with exactly ``count`` solutions."""
        return queries.with_count(self, count)

    def is_beside_infinite(self, alpha: float) -> bool:
        """Tell whether there are infinitely many solutions at ``alpha`` or next to ``alpha``."""
        return queries.is_beside_infinite(self, alpha)

    def balance(self, alpha: float) -> int:
        """Return the sum of the signs of det(dH/dz) over all solutions at ``alpha``.

        Where solutions stay bounded the sum is the same at every regular alpha; if not, a
        branch is missing. The converse does not hold: a missed pair cancels.
        """
        return balance.balance_at(self, alpha)

    def balances(self) -> list[int]:
        """Return the balance within each interval between successive special points."""
        return balance.balances(self)

    def balance_values(self) -> list[int]:
        """Return the different values of the balance, ascending: one value if nothing is missing.

        A stretch of alpha that is no longer than the uncertainty of the special points around it
        does not count: such a stretch may not exist, for the ends may be in the opposite order.
        """
        return balance.balance_values(self)

    def is_balanced(self) -> bool:
        """Tell whether the balance is the same at every regular alpha of the interval.

        Where the system knows the degree (+1 for Coulomb friction), the balance must equal the
        degree. Stretches too short to be judged do not count, see :meth:`balance_values`.
        """
        return not balance.unbalanced(self)

    def unbalanced(self) -> list[tuple[float, float]]:
        """Return the stretches in which the balance is not what the balance must be.

        Without a known degree: the stretches whose balance differs from the most frequent one, each
        without the signs of branches that end on purpose.
        """
        return balance.unbalanced(self)

    @cached_property
    def nx(self) -> nx.MultiGraph:
        """The branch graph as a new networkx graph with plain attributes.

        All attributes are numbers and texts, which :func:`networkx.write_graphml` and the like can
        write. The networkx graph is made when first asked for; changing the networkx graph does not
        change the branch graph.

        Nodes are the ids of special points. Nodes have ``kind``, ``alpha``, ``message``, ``name``,
        the recorded quantities, and ``z``, the state as a JSON list. (The array is
        ``graph.point(node).z``; a single unknown is ``graph.point(node)["u_t"]``.)

        The key of an edge is the id of the piece. Edges have this ``piece``, ``label``,
        ``det_sign``, ``character`` (a text of + and -), ``alpha_lo``, ``alpha_hi``, and ``length``:
        the sum of the chords between stored points in (z, alpha), where alpha is measured by the
        interval and each unknown by the largest magnitude in the graph.
        """
        return exports.networkx_graph(self)

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
        storage.write(
            path,
            storage.Contents(
                self.nodes,
                self.pieces,
                self.starts,
                self.interval,
                self.parameter,
                self.searched,
                self._names_to_keep(),
                self.infinite,
                self.proof if isinstance(self.proof, BoxProof) else None,
            ),
        )

    def _names_to_keep(self) -> tuple[str, ...] | None:
        """Return the names for a file, None for names that do not fit: the numbers are kept."""
        try:
            return self.names if self.quantities.is_named and self.nodes else None
        except InvalidSystemError:
            return None

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
        file = storage.read(path)
        own = system and storage.adopted(path, file.pieces, file.points, file.interval, system)
        graph = cls(
            file.points,
            file.pieces,
            file.interval,
            starts=file.starts,
            system=own,
            parameter=file.parameter,
            searched=file.searched,
            record=record,
            names=None if system else file.names,
            infinite=file.infinite,
        )
        if file.pieces or system is None:  # no point would show that the system is another one
            graph.proof = file.proof
        return graph

    def to_dataframe(self, rows: str) -> Any:
        """Return a pandas data frame.

        Parameters
        ----------
        rows : {"pieces", "points", "special"}
            "pieces": one row for each piece, with id, component, start, end, label, character,
            det_sign, alpha_lo, alpha_hi, number of points and length (see :attr:`nx`).
            "points": one row for each stored point of every piece, with piece, component, label,
            alpha, all unknowns by name and the recorded quantities.
            "special": one row for each special point, with id (-1 for a start within a piece),
            kind, name, alpha, message, all unknowns by name, the recorded quantities, the
            estimated error of alpha and the number of digits known.

            An unknown whose name is that of another column, such as ``alpha`` or ``name``, is
            called by the place among the unknowns, ``z[i]``.

        Returns
        -------
        pandas.DataFrame

        Raises
        ------
        InvalidInputError
            If ``rows`` is another word, or a recorded quantity fails.
        MissingPackageError
            If pandas is not installed.
        """
        return exports.data_frame(self, rows)

    def to_dict(self) -> dict[str, Any]:
        """Return the graph as plain lists and numbers."""
        return exports.as_dict(self, self.guarantee)

    def __repr__(self) -> str:
        return exports.as_text(self, self.guarantee)

    def _repr_html_(self) -> str:
        return exports.as_html(self, self.guarantee)
