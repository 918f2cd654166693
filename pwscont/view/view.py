"""The object that shows a branch graph in a browser or a notebook, and writes the page."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property
from html import escape
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Protocol, final

from pwscont import BranchGraph, InvalidInputError, MissingPackageError
from pwscont.extending import Quantities, checked_kind, counted, named, write_file
from pwscont.scenes.panels import BodyPicture, Panel, Shown, quantity_named
from pwscont.view.body import body_records
from pwscont.view.numbers import Numbers
from pwscont.view.records import graph_records, marks, style_records

#: Height of a view in a notebook, in pixels.
TALL = 780


class Viewable(Protocol):
    """Another graph than a branch graph that knows what the page shows of the graph."""

    @property
    def names(self) -> Sequence[str]:
        """The names of the unknowns."""

    @property
    def quantities(self) -> Quantities:
        """The recorded quantities."""

    @property
    def pieces(self) -> Sequence[Any]:
        """The pieces."""

    def page_records(self, wanted: str) -> dict[str, Any]:
        """Return the records of the page; ``wanted`` is the quantity that is shown first."""


@final
class View:
    """A graph to look at in a browser: a page in one file, without server and network.

    The page has the branch diagram with pan and zoom and any quantity on either axis; a slider over
    the parameter with all solutions at the value; the clicked solution as a table, and as a picture
    of the body if any; and the number of solutions. In a notebook the view shows itself. For a
    graph of evolutions the page shows each evolution in a colour of its own over the time t.

    Parameters
    ----------
    graph : BranchGraph or EvolutionGraph
    what : int or str, optional
        The quantity that the diagram shows first: index or name of an unknown, or name of a
        recorded quantity.
    title : str
    panels : sequence of Panel
        Each panel with a ``mode`` is a way to tell modes apart by line styles.
    styles : mapping
        The line style for each mode.
    body : BodyPicture, optional
        The picture of the body.

    Raises
    ------
    InvalidInputError
        If ``graph`` is no graph, or evolutions are to be shown on a body.
    UnknownNameError
        If there is no such quantity.
    MissingPackageError
        If Bokeh is not installed.

    Examples
    --------
    >>> View(graph, "u_t").save("curve.html")  # doctest: +SKIP
    """

    def __init__(
        self,
        graph: BranchGraph | Viewable,
        what: int | str = 0,
        *,
        title: str = "",
        panels: Sequence[Panel] = (),
        styles: Mapping[str, Any] | None = None,
        body: BodyPicture | None = None,
    ) -> None:
        check_bokeh()
        self.graph, self.title, self.panels, self.body = graph, title, tuple(panels), body
        self.styles = dict(styles or {})
        if not hasattr(graph, "page_records"):
            checked_kind("graph", graph, BranchGraph, is_needed=True)
        elif body is not None:
            raise InvalidInputError("only solutions of a branch graph are shown on a body")
        self.what = quantity_named(str(what), graph.names, graph.quantities.record)

    @classmethod
    def of(cls, scene: Shown, graph: BranchGraph) -> View:
        """Return the view of a scene's graph, with title, panels and body of the scene."""
        drawn = [panel.component for panel in scene.panels]
        first = next((what for what in drawn if isinstance(what, int | str)), 0)
        title = f"{scene.name}: {scene.title}"
        return cls(
            graph,
            graph.names[first] if isinstance(first, int) else first,
            title=title,
            panels=scene.panels,
            styles=scene.styles,
            body=scene.body,
        )

    @cached_property
    def records(self) -> dict[str, Any]:
        """The records of the page, as lists, texts and packed arrays."""
        told: dict[str, Any] = {"title": self.title, "what": self.what, "body": None}
        if not isinstance(self.graph, BranchGraph):
            return told | self.graph.page_records(self.what)
        numbers = Numbers.of(self.graph)
        told |= graph_records(self.graph, numbers, [self.what])
        told["marks"] = marks(self.graph)
        told["styles"] = style_records(self.graph, self.panels, self.styles)
        told["body"] = body_records(self.graph, numbers, self.body) if self.body else None
        return told

    @cached_property
    def html(self) -> str:
        """The HTML page."""
        page = import_module("pwscont.view.figures")
        return str(page.page_of(self.records, self.title or "branches"))

    def save(self, path: str | Path) -> Path:
        """Write the page to a file, which appears whole or not at all, and return the path.

        Raises
        ------
        InvalidInputError
            If the file cannot be written.
        """
        target, content = Path(path), self.html.encode("utf-8")
        if not target.name:
            raise InvalidInputError(f"cannot write {str(path)!r}: it names no file")
        try:
            write_file(target, content)
        except OSError as error:
            raise InvalidInputError(f"cannot write {path}: {error.strerror or error}") from error
        return target

    def __repr__(self) -> str:
        return named(self, self.title or "branches", counted(len(self.graph.pieces), "piece"))

    def _repr_html_(self) -> str:
        """Return a frame with the page, for notebooks."""
        style = f"width: 100%; height: {TALL}px; border: none"
        return f'<iframe srcdoc="{escape(self.html)}" style="{style}"></iframe>'


def check_bokeh() -> None:
    """Refuse a view if Bokeh is not installed."""
    if find_spec("bokeh") is None:
        raise MissingPackageError(
            "a view in the browser needs Bokeh: pip install bokeh, or pip install '.[view]' in a "
            "checkout of pwscont"
        )
