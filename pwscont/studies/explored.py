"""A case whose graph is being measured: its settings, its graph, and graphs beside it."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from typing import final

from pwscont.graph import BranchGraph
from pwscont.studies.grid import Setting
from pwscont.studies.problem import Problem, explored


@final
class ExploredCase:
    """What a measure works on.

    Parameters
    ----------
    problem : callable
        Settings -> a problem.
    settings : mapping of str to value

    Attributes
    ----------
    settings : mapping of str to value
    guarantee : str
        The guarantee of the first graph, or of the first graph that is not complete.
    is_proven : bool
        Whether all graphs that were asked for are complete.
    failure : BaseException or None
        Why the case has no graph, once that was asked for.
    """

    def __init__(self, problem: Problem, settings: Mapping[str, Setting]) -> None:
        self._problem = problem
        self.settings = settings
        self.guarantee, self.is_proven = "", False
        self.failure: BaseException | None = None

    @cached_property
    def graph(self) -> BranchGraph:
        """The graph of the case; the first access explores the case."""
        if self.failure is None:
            try:
                return self._noted(explored(self._problem(**self.settings)))
            except (Exception, SystemExit) as error:
                self.failure = error
        raise self.failure

    def beside(self, **changed: Setting) -> BranchGraph:
        """Return the graph with some settings changed or added."""
        where = ", ".join(f"{name} = {_word(value)}" for name, value in changed.items())
        return self._noted(explored(self._problem(**{**self.settings, **changed})), where)

    def _noted(self, graph: BranchGraph, where: str = "") -> BranchGraph:
        """Note what is known of the completeness of a graph."""
        if not self.guarantee or (self.is_proven and not graph.is_complete):
            self.is_proven = graph.is_complete
            at = "" if self.is_proven or not where else f"at {where}: "
            self.guarantee = f"{at}{graph.guarantee}"
        return graph


def _word(value: Setting) -> str:
    return f"{value:.8g}" if isinstance(value, float) else str(value)
