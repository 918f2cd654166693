"""Options for the look and the content of pictures."""

from __future__ import annotations

import argparse
from math import inf

from pwscont.basics.errors import InvalidInputError
from pwscont.scenes.answer import Runnable
from pwscont.scenes.look import FORMATS, Look

#: Dots per inch: fewer cannot be read, more do not fit into memory.
DPI = 20, 1200
OPTIONS = ("format", "dpi", "panels", "scale", "animate")


def add_looks(command: argparse.ArgumentParser) -> None:
    """Let a command say how pictures look."""
    group = command.add_argument_group("pictures", "how those that -o writes look")
    group.add_argument("--format", choices=FORMATS, help="of pictures; default png")
    group.add_argument("--dpi", type=_dots, help="dots per inch of pictures; default 150")
    group.add_argument(
        "--panels",
        nargs="+",
        metavar="NAME",
        help="draw these unknowns or recorded quantities, by name or index",
    )
    group.add_argument(
        "--scale",
        type=_factor,
        metavar="FACTOR",
        help="draw displacements of bodies so many times larger; 1 is true to scale",
    )
    group.add_argument(
        "--animate",
        action="store_true",
        default=None,
        help="write a moving picture of the body along branch 1, too",
    )


def _dots(text: str) -> int:
    least, most = DPI
    if not (text.strip().isdecimal() and least <= int(text) <= most):
        raise argparse.ArgumentTypeError(
            f"must be a whole number from {least} to {most}, got {text!r}"
        )
    return int(text)


def _factor(text: str) -> float:
    try:
        factor = float(text)
    except ValueError:
        factor = -1.0
    if not 0.0 < factor < inf:
        raise argparse.ArgumentTypeError(f"must be a positive number, got {text!r}")
    return factor


def look_of(options: argparse.Namespace, scene: Runnable) -> Look:
    """Return how the pictures of a scene are to look.

    Raises
    ------
    InvalidInputError
        If an option is about bodies, and the scene draws none.
    """
    given = {name: getattr(options, name) for name in OPTIONS if getattr(options, name) is not None}
    if given and not options.output:
        raise InvalidInputError(f"--{next(iter(given))} needs -o DIR: pictures are written there")
    for name in ("scale", "animate"):
        if name in given and not scene.has_body:
            raise InvalidInputError(f"--{name} is about bodies, and scene {scene.name} draws none")
    return Look(**{name: value for name, value in given.items() if name != "panels"})


def with_panels(options: argparse.Namespace, scene: Runnable) -> Runnable:
    """Return the scene with the panels that the user asks for."""
    return scene.with_panels(options.panels) if options.panels else scene
