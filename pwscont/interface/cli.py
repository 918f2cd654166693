"""The command line: ``pwscont scenes`` and ``pwscont run SCENE``."""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Sequence
from importlib import import_module
from importlib.metadata import version
from io import TextIOWrapper
from pathlib import Path

from pwscont.foundation.errors import PwscontError
from pwscont.interface.registry import load_scene, scene_names, scene_settings
from pwscont.interface.running import run_scene
from pwscont.interface.settings import add_settings


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command; returns the exit status: 0, 2 for wrong input, 130 if interrupted."""
    given = sys.argv[1:] if arguments is None else arguments
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, TextIOWrapper):
            stream.reconfigure(errors="replace")  # terminals that do not know Greek letters
    options = _parser().parse_args([_as_value(argument) for argument in given])
    try:
        status = int(options.command(options))
        sys.stdout.flush()
        return status
    except BrokenPipeError:  # who reads, such as head, has seen enough
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except (PwscontError, OSError) as error:
        print(f"pwscont: {error}", file=sys.stderr)  # noqa: T201
        return 2
    except KeyboardInterrupt:
        print("pwscont: interrupted", file=sys.stderr)  # noqa: T201
        return 130


def _as_value(argument: str) -> str:
    """Return a negative number so that it is a value: with a space before it, it is no option."""
    try:
        return f" {argument}" if float(argument) < 0.0 else argument
    except ValueError:
        return argument


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="pwscont", description="Follow the solutions of piecewise-smooth systems."
    )
    parser.add_argument("--version", action="version", version=f"pwscont {version('pwscont')}")
    commands = parser.add_subparsers(required=True, metavar="COMMAND")
    scenes = commands.add_parser("scenes", help="list the scenes")
    scenes.set_defaults(command=_scenes)
    run = commands.add_parser("run", help="compute a scene and print what was found")
    run.set_defaults(command=run_scene)
    run.add_argument("scene", metavar="SCENE", help="a name from 'pwscont scenes'")
    run.add_argument(
        "--at",
        nargs="+",
        action="extend",
        type=float,
        metavar="ALPHA",
        help="list the solutions at these parameter values",
    )
    run.add_argument(
        "-o",
        "--output",
        type=Path,
        metavar="DIR",
        help="write picture and data there",
    )
    add_settings(run)
    run.add_argument("--json", action="store_true", help="print one JSON object instead of a table")
    run.add_argument(
        "--explain", action="store_true", help="say what the scene leaves out, and why"
    )
    run.add_argument(
        "--resume", action="store_true", help="go on with an interrupted run that wrote to DIR"
    )
    import_module("pwscont.bench.arguments").add_to(commands)  # by name: it stands above us
    return parser


def _scenes(options: argparse.Namespace) -> int:
    for name in scene_names():
        settings = scene_settings(name)
        more = f" [-s {settings.replace(', ', ' ')}]" if settings else ""
        print(f"{name:<26} {load_scene(name).title}{more}")  # noqa: T201
    return 0
