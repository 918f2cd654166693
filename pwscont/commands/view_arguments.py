"""The arguments of ``pwscont view``; :mod:`view` is imported when the command runs."""

from __future__ import annotations

import argparse
from importlib import import_module
from pathlib import Path

from pwscont.commands.options import with_examples


def add_to(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Register the sub-command with the sub-parsers of the command line."""
    words = "write a page that shows a graph in a browser"
    command = commands.add_parser("view", help=words, **with_examples("view"))
    command.set_defaults(command=_view)
    command.add_argument("graph", type=Path, metavar="FILE", help="written by 'pwscont run -o'")
    command.add_argument(
        "-o", "--output", type=Path, metavar="FILE", help="the page; default beside the graph"
    )
    command.add_argument("--open", action="store_true", help="open the page in a browser")


def _view(options: argparse.Namespace) -> int:
    return int(import_module("pwscont.commands.view").view_graph(options))
