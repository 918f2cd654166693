"""The command line: ``pwscont scenes``, ``run``, ``view``, ``sweep`` and ``bench``."""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Sequence
from importlib.metadata import version
from io import TextIOWrapper
from pathlib import Path

from pwscont import PwscontError
from pwscont.commands.options import Parser, add_looks, add_scene, complete, spread, with_examples
from pwscont.commands.run import run_scene
from pwscont.commands.subcommands import add_bench, add_sweep, add_view
from pwscont.scenes.registry import (
    add_settings,
    described_package,
    described_scene,
    scenes_by_package,
)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command and return the exit status; ``--help`` lists the statuses."""
    given = sys.argv[1:] if arguments is None else arguments
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, TextIOWrapper):
            stream.reconfigure(errors="replace")  # terminals that do not know Greek letters
    if sys.stdout is None:  # closed by the program that started pwscont
        return _failed("standard output is closed: redirect it to a file, or to /dev/null")
    try:
        parser = _parser()
        complete(parser)
        options = parser.parse_args(list(spread(given)))
        status = int(options.command(options))
        sys.stdout.flush()
        return status
    except BrokenPipeError:  # the reader, such as head, has seen enough
        _close_output()
        return 0
    except BaseException as error:
        if _is_interruption(error):
            print("pwscont: interrupted", file=sys.stderr)  # noqa: T201
            return 130
        if not isinstance(error, (PwscontError, OSError, MemoryError)):
            raise
        _close_output()
        return _failed(_in_words(error))


def _is_interruption(error: BaseException | None) -> bool:
    """Tell whether an error is an interruption, or was caused by an interruption.

    Until Python 3.12 a class that is being made turns an interruption into a RuntimeError.
    """
    while error is not None and not isinstance(error, KeyboardInterrupt):
        error = error.__cause__
    return error is not None


def _in_words(error: Exception) -> str:
    if isinstance(error, MemoryError):
        return f"not enough memory; try smaller settings. {error}".strip()
    if isinstance(error, OSError) and error.strerror:
        return f"{error.filename}: {error.strerror}" if error.filename else error.strerror
    return str(error)


def _failed(message: str) -> int:
    """Print an error message on standard error, and return the exit status 2."""
    if sys.stderr is not None:
        print(f"pwscont: {message}", file=sys.stderr)  # noqa: T201
    return 2


def _close_output() -> None:
    """Flush standard output, or redirect a broken pipe, which Python would flush again at exit."""
    try:
        sys.stdout.flush()
    except OSError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _parser() -> argparse.ArgumentParser:
    words = "Follow the solutions of piecewise-smooth systems."
    parser = Parser(prog="pwscont", **with_examples("", description=words))
    parser.add_argument("--version", action="version", version=f"pwscont {version('pwscont')}")
    commands = parser.add_subparsers(required=True, metavar="COMMAND")
    scenes = commands.add_parser("scenes", help="list the scenes")
    scenes.set_defaults(command=_scenes)
    words = "compute a scene and print what was found"
    run = commands.add_parser("run", help=words, **with_examples("run"))
    run.set_defaults(command=run_scene)
    add_scene(run, "a name from 'pwscont scenes'")
    run.add_argument(
        "--at",
        action="append",
        type=float,
        metavar="ALPHA",
        help="list the solutions at these parameter values: --at 1 2, or --at 1 --at 2",
    )
    run.add_argument(
        "-o",
        "--output",
        type=Path,
        metavar="DIR",
        help="write picture and data there",
    )
    run.add_argument(
        "--html",
        type=Path,
        metavar="FILE",
        help="write a page that shows branches and solutions in a browser",
    )
    add_settings(run)
    add_looks(run)
    run.add_argument("--json", action="store_true", help="print one JSON object instead of a table")
    run.add_argument("--full", action="store_true", help="print long lines in full")
    run.add_argument("--explain", action="store_true", help="say which parts the run is made of")
    run.add_argument(
        "--resume",
        action="store_true",
        help="go on with the interrupted run that wrote to DIR; begin where there is none",
    )
    add_view(commands)
    add_sweep(commands)
    add_bench(commands)
    return parser


def _scenes(options: argparse.Namespace) -> int:
    for package, names in scenes_by_package().items():
        print(described_package(package))  # noqa: T201
        for name in names:
            print(f"  {name:<26} {described_scene(name)}")  # noqa: T201
    return 0
