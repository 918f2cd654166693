"""The branch graph: smooth pieces joined at special points, with all queries as methods.

GraphML and the like know numbers and texts only: states and characters are written as texts.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from functools import cached_property
from html import escape
from math import isinf
from pathlib import Path
from typing import TYPE_CHECKING, Any, final

import numpy as np

from pwscont.basics.arguments import checked_kind, pandas_for, wrong_result
from pwscont.basics.arrays import Array
from pwscont.basics.outcome import NOTHING_FOUND, Guarantee
from pwscont.basics.printing import apart, counted, number
from pwscont.basics.quantities import Function
from pwscont.graph import balance as signs
from pwscont.graph import queries, storage
from pwscont.graph.balance import WORDS, verdict
from pwscont.graph.proved import BoxProof
from pwscont.graph.records import Piece, SpecialPoint, Stretch, attempted
from pwscont.graph.structure import ConnectedPieces
from pwscont.system.system import PiecewiseSystem

if TYPE_CHECKING:
    import networkx as nx

#: The columns beside those of states, in data frames that have states.
FIXED = frozenset(
    ("piece", "component", "label", "alpha", "id", "kind", "name", "message", "error", "digits")
)
#: A value below this part of the largest value of the same kind is rounding, and reads as zero.
DUST = 1e-12


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
        said = words if self.proof is None else self.proof.judged(self, words)
        if not isinstance(said, str):
            raise wrong_result(self.proof, "judged", "words", said)
        return said

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
        checked_kind("system", system, PiecewiseSystem)
        contents, proof = storage.read(path)
        if system is not None:
            contents |= {"system": storage.adopted(path, contents, system), "names": None}
        graph = cls(**contents, record=record)
        if proof is not None and (system is None or proof.is_of(system)):
            graph.proof = proof
        return graph

    @cached_property
    def nx(self) -> nx.MultiGraph:
        """The branch graph as a networkx graph with plain attributes.

        All attributes are numbers and texts, which :func:`networkx.write_graphml` and the like can
        write. Changing the networkx graph does not change the branch graph.

        Nodes are the ids of special points. Nodes have ``kind``, ``alpha``, ``message``, ``name``,
        the recorded quantities, and ``z``, the state as a JSON list. (The array is
        ``graph.point(node).z``; a single unknown is ``graph.point(node)["u_t"]``.)

        The key of an edge is the id of the piece. Edges have this ``piece``, ``label``,
        ``det_sign``, ``character`` (a text of + and -), ``alpha_lo``, ``alpha_hi``, and ``length``:
        the sum of the chords between stored points in (z, alpha), where alpha is measured by the
        interval and each unknown by the largest magnitude in the graph.
        """
        import networkx as nx  # noqa: PLC0415  it takes longer to import than most paths to follow

        plain, scale = nx.MultiGraph(), magnitudes(self)
        for point in self.nodes:
            recorded = {k: v for k, v in attempted(point).items() if not isinstance(v, str)}
            words = {"kind": str(point.kind), "message": point.message, "name": point.name}
            state = {"alpha": point.alpha, "z": json.dumps(point.z.tolist())}
            plain.add_node(point.id, **(words | state | recorded))
        for piece in self.pieces:
            plain.add_edge(piece.start, piece.end, key=piece.id, **_of_edge(piece, scale))
        return plain

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
        tables = {"pieces": _pieces, "points": _points, "special": _special}
        pandas = pandas_for(rows, tables)
        return tables[rows](self, pandas)

    def to_dict(self) -> dict[str, Any]:
        """Return nodes, pieces, multiplicity and balance as lists and numbers.

        ``between`` has the single values of alpha with another number of solutions than the
        ``stretches`` around. Infinitely many, and a ``recorded`` quantity that failed, are None;
        ``not_recorded`` says why quantities failed, if any did.
        """
        sums, found, component = self.balance_values(), queries.runs(self), _component(self)
        rows = [run for run in found if run[0] < run[1]]
        attempts = [attempted(point) for point in self.nodes]
        failures = [v for some in attempts for v in some.values() if isinstance(v, str)]
        (lo, hi), known = self.interval, len(sums) == 1
        return {
            "parameter": {"name": self.parameter, "lo": lo, "hi": hi},
            "components": len(self.components()),
            "names": list(self.names),
            "nodes": [
                _plain(point, "id kind name alpha z")
                | {"recorded": {k: None if isinstance(v, str) else v for k, v in some.items()}}
                | _plain(point, "message error digits")
                for point, some in zip(self.nodes, attempts, strict=True)
            ],
            "pieces": [
                {"id": piece.id, "component": component[piece.id]}
                | _plain(piece, "start end label det_sign alpha")
                | {"points": piece.z.tolist()}
                for piece in self.pieces
            ],
            "multiplicity": [[*row[:2], _finite(row[2])] for row in rows],
            "stretches": [
                _plain(row, "lo hi count lo_closed hi_closed") | {"count": _finite(row[2])}
                for row in rows
            ],
            "between": [[lo, _finite(count)] for lo, hi, count in found if lo == hi],
            "balance": {"value": sums[0] if known else None, "constant": len(sums) <= 1},
            "searched": self.searched.what,
            "unseen": self.searched.unseen,
            "guarantee": self.guarantee,
        } | ({"not_recorded": failures} if failures else {})

    def __repr__(self) -> str:
        name, words = self.parameter, self.guarantee
        lines = [
            f"BranchGraph: {name} in [{', '.join(apart(*self.interval))}], "
            f"components: {len(self.components())}, pieces: {len(self.pieces)}, "
            f"special points: {len(self.special_points())}"
        ]
        if not words.startswith(NOTHING_FOUND):  # no number is known otherwise
            counts = ((counted(row[2], "solution"), row.ends) for row in self.multiplicity())
            lines += [f"  {count} for {name} in {ends}" for count, ends in counts]
        lines.append(f"  {words}")
        if self.pieces and isinstance(self.proof, BoxProof) and "in the box, proved" in words:
            lines.append(f"  {self.proof.where}")
        return "\n".join(lines)

    def _repr_html_(self) -> str:
        """Return the summary and the pieces as an HTML table."""
        rows = "".join(
            f"<tr><td>{piece.id}</td><td>{escape(piece.label)}</td>"
            f"<td>{' → '.join(number(piece.alpha[i], self.interval) for i in (0, -1))}</td>"
            f"<td>{piece.det_sign:+d}</td></tr>"
            for piece in self.pieces
        )
        head = f"<tr><th>piece</th><th>mode</th><th>{escape(self.parameter)}</th><th>det</th></tr>"
        return f"<pre>{escape(repr(self))}</pre><table>{head}{rows}</table>"


def _of_edge(piece: Piece, scale: Array) -> dict[str, Any]:
    """Return the attributes of an edge."""
    lo, hi = piece.interval
    return {
        "piece": piece.id,
        "label": piece.label,
        "det_sign": int(piece.det_sign),
        "character": str(piece.character),
        "length": float(np.linalg.norm(np.diff(piece.points / scale, axis=0), axis=1).sum()),
        "alpha_lo": lo,
        "alpha_hi": hi,
    }


def magnitudes(graph: ConnectedPieces) -> Array:
    """Return the largest magnitude of each unknown, 1 for zero, and the interval's length."""
    each = [np.abs(piece.z).max(axis=0) for piece in graph.pieces]
    largest = np.max(each, axis=0) if each else np.zeros(0)
    return np.append(np.where(largest > 0.0, largest, 1.0), np.ptp(graph.interval))


def _component(graph: ConnectedPieces) -> dict[int, int]:
    """Return the number of the component of each piece."""
    return {piece.id: i for i, some in enumerate(graph.components()) for piece in some}


def _pieces(graph: ConnectedPieces, pandas: Any) -> Any:
    component, scale = _component(graph), magnitudes(graph)
    rows = [
        {"id": p.id, "component": component[p.id], "start": p.start, "end": p.end}
        | {"points": len(p.points), **_of_edge(p, scale)}
        for p in graph.pieces
    ]
    names = "id component start end label character det_sign alpha_lo alpha_hi points length"
    return pandas.DataFrame(rows, columns=names.split())


def _points(graph: ConnectedPieces, pandas: Any) -> Any:
    component, empty = _component(graph), np.zeros((0, len(graph.names) + 1))
    points = np.vstack([empty, *(piece.points for piece in graph.pieces)])
    heads = [
        row
        for piece in graph.pieces
        for row in [(piece.id, component[piece.id], piece.label)] * len(piece.points)
    ]
    head = pandas.DataFrame(heads, columns=["piece", "component", "label"])
    head["alpha"] = points[:, -1]
    states = pandas.DataFrame(points[:, :-1], columns=columns(graph.names))
    values = [graph.quantities.recorded(x[:-1], float(x[-1])) for x in points]
    names = list(graph.quantities.record)
    recorded = pandas.DataFrame(values, columns=names, dtype=float)
    return pandas.concat([head, states, recorded], axis=1)


def _special(graph: ConnectedPieces, pandas: Any) -> Any:
    points = graph.special_points()
    rows = [(p.id, str(p.kind), p.name, p.alpha, p.message) for p in points]
    head = pandas.DataFrame(rows, columns=["id", "kind", "name", "alpha", "message"])
    z = np.array([p.z for p in points]).reshape(len(points), len(graph.names))
    states = pandas.DataFrame(z, columns=columns(graph.names))
    values = [p.quantities.recorded(p.z, p.alpha) for p in points]
    names = list(dict.fromkeys(name for row in values for name in row))
    recorded = pandas.DataFrame(values, columns=names, dtype=float)
    errors = [(p.error[-1] if len(p.error) else np.nan, p.digits) for p in points]
    tail = pandas.DataFrame(errors, columns=["error", "digits"])
    return pandas.concat([head, states, recorded, tail], axis=1)


def columns(names: Sequence[str]) -> list[str]:
    """Return for each unknown a name that no other column has: the own name, or the place."""
    other = FIXED.union(f"z[{i}]" for i in range(len(names)))
    return [
        f"z[{i}]" if name in other or name in names[:i] else name for i, name in enumerate(names)
    ]


def _plain(record: SpecialPoint | Piece | Stretch, names: str) -> dict[str, Any]:
    """Return attributes of a record by name: arrays as lists, kinds as texts."""
    values = {name: getattr(record, name) for name in names.split()}
    arrays = {name: v.tolist() for name, v in values.items() if isinstance(v, np.ndarray)}
    return values | arrays | ({"kind": str(values["kind"])} if "kind" in values else {})


def _finite(count: int | float) -> int | None:
    """Return a count, None for infinitely many, which JSON cannot say."""
    return None if isinf(count) else int(count)
