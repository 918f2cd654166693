"""The work of ``pwscont view`` and of ``pwscont run --html``: pages for a browser."""

from __future__ import annotations

import argparse
import sys
import webbrowser
from pathlib import Path

from pwscont import BranchGraph, GraphFileError, InvalidInputError, PwscontError
from pwscont.commands.origin import Origin, read_origin
from pwscont.scenes.answer import Answer, Runnable
from pwscont.scenes.registry import load_scene
from pwscont.scenes.scene import Scene
from pwscont.view.view import View, check_bokeh

#: Endings of the names of pages.
PAGES = (".html", ".htm")


def view_graph(options: argparse.Namespace) -> int:
    """Write the page of a graph, and return the exit status."""
    page = options.output or options.graph.parent / f"{options.graph.stem}.html"
    check_page(page)
    if page.resolve() == options.graph.resolve():
        raise InvalidInputError(f"cannot write {page}: it is the graph; name another file with -o")
    if options.output:
        check_named(page)
    view = _view_of(options.graph)
    view.save(page)
    print(f"written: {page}")  # noqa: T201
    if options.open:
        webbrowser.open(page.resolve().as_uri())
    return 0


def _view_of(path: Path) -> View:
    """Return the view of a graph with scene; without scene a plain view, and print the reason."""
    try:
        plain = BranchGraph.load(path)
    except GraphFileError as error:
        return _view_of_evolutions(path, error)
    origin = read_origin(path)
    if origin is None:
        _say(f"{path} names no scene: its numbers are shown, and no body")
        return View(plain, title=path.stem)
    try:
        scene = _scene_of(origin)
        graph = BranchGraph.load(path, scene.system, scene.record)
    except (PwscontError, ArithmeticError, ValueError) as error:
        _say(f"{error}; only the numbers of {path} are shown")
        return View(plain, title=path.stem)
    return View.of(scene, graph)


def _view_of_evolutions(path: Path, error: GraphFileError) -> View:
    """Return the view of a file of evolutions; raise the error of any other file."""
    from pwscont import EvolutionGraph  # noqa: PLC0415  for such files only

    try:
        return View(EvolutionGraph.load(path), title=path.stem)
    except GraphFileError:
        raise error from None


def _scene_of(origin: Origin) -> Scene:
    scene = load_scene(origin.scene, origin.settings).curve()
    if not isinstance(scene, Scene):
        raise InvalidInputError(f"scene {origin.scene} has no branches to show")
    return scene


def _say(words: str) -> None:
    print(f"pwscont: {words}", file=sys.stderr)  # noqa: T201


def check_page(page: Path) -> None:
    """Refuse, before any work, a page that cannot be written, or any page without Bokeh."""
    check_bokeh()
    if page.is_dir():
        raise InvalidInputError(f"cannot write {page}: it is a directory")
    if not page.absolute().parent.is_dir():
        raise InvalidInputError(f"cannot write {page}: there is no directory {page.parent}")


def check_named(page: Path) -> None:
    """Refuse a file whose name does not end like a page's, such as the name of a graph."""
    if page.suffix.lower() not in PAGES and not page.is_dir():
        raise InvalidInputError(f"cannot write {page}: the name of a page ends with .html")


def check_viewable(scene: Runnable, page: Path) -> None:
    """Refuse a page of a scene without branches; other errors as of :func:`check_page`."""
    if type(scene).curve is Runnable.curve and not scene.has_view:
        raise InvalidInputError(
            f"--html shows branches over a parameter; scene {scene.name} has none"
        )
    check_named(page)
    check_page(page)


def write_page(answer: Answer, page: Path) -> Path:
    """Write the page of an answer, and return the path."""
    explored, viewed = answer.explored(), answer.viewed()
    if viewed is not None:
        graph, what, title = viewed
        return View(graph, what, title=title).save(page)
    if explored is None:
        raise InvalidInputError("--html: this scene's answer has no branch graph to show")
    return View.of(*explored).save(page)
