"""Options that several commands share, with completion and help.

``run --at 1 2 fig7`` is read as ``run --at 1 --at 2 fig7``: arguments after an option belong to the
option as long as the arguments have the form of values of the option.

The shell asks for completions by running the program with the variable ``_ARGCOMPLETE`` set;
without that variable no run waits for the import of argcomplete.
"""

from __future__ import annotations

import argparse
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from difflib import get_close_matches
from importlib import import_module
from math import inf
from typing import Any

from pwscont import InvalidInputError
from pwscont.scenes.answer import FORMATS, Look, Runnable
from pwscont.scenes.registry import scene_names


class Parser(argparse.ArgumentParser):
    """A parser, also of each command, that refuses what it does not know, with similar options."""

    def parse_known_args(self, args: Any = None, namespace: Any = None) -> Any:
        """Return the options and no further arguments: the usage shown is that of the command."""
        options, unknown = super().parse_known_args(args, namespace)
        if unknown:
            near = get_close_matches(unknown[0], self._option_string_actions, n=1)
            hint = f"; did you mean {near[0]}?" if near else ""
            self.error(f"unrecognized arguments: {' '.join(map(str.strip, unknown))}{hint}")
        return options, unknown


def _is_number(argument: str) -> bool:
    try:
        float(argument)
    except ValueError:
        return False
    return True


def _is_setting(argument: str) -> bool:
    name, sign, _ = argument.partition("=")
    return bool(sign) and name.strip().isidentifier()


#: Option -> whether an argument has the form of a value of the option.
FORMS: Mapping[str, Callable[[str], bool]] = {
    "--at": _is_number,
    "-s": _is_setting,
    "--set": _is_setting,
    "--over": _is_setting,
}


def spread(arguments: Sequence[str]) -> Iterator[str]:
    """Yield the arguments, with the option repeated before every value of an option."""
    option, first = "", True
    for argument in arguments:
        if option and FORMS[option](argument):
            yield from (_as_value(argument),) if first else (option, _as_value(argument))
            first = False
        else:
            option, first = argument if argument in FORMS else "", True
            yield _as_value(argument)


def _as_value(argument: str) -> str:
    """Return an argument; a negative number gets a space in front, unlike any option."""
    return f" {argument}" if _is_number(argument) and float(argument) < 0.0 else argument


def complete(parser: argparse.ArgumentParser) -> None:
    """Print completions and exit, if the shell asks for completions."""
    if "_ARGCOMPLETE" in os.environ:
        import_module("argcomplete").autocomplete(parser)


def add_scene(command: argparse.ArgumentParser, help: str, **options: Any) -> None:
    """Add the argument SCENE, which the shell completes, to a command."""
    scene: Any = command.add_argument("scene", metavar="SCENE", help=help, **options)
    scene.completer = lambda **_: scene_names()


#: Command, "" for the program itself -> {example: effect}.
EXAMPLES: dict[str, dict[str, str]] = {
    "": {
        "pwscont scenes": "what is ready to run",
        "pwscont run example3 -o out": "branches and numbers of solutions, with picture and graph",
        "pwscont run fig7 --at 0.3": "all solutions at one value of the parameter, too",
    },
    "run": {
        "pwscont run fig7 --at -0.7 0.3": "solutions at two values of the parameter",
        "pwscont run block -s nodes=8 --at 0.7": "with a setting of the scene",
        "pwscont run example3 -o out": "write picture and graph into the directory out",
        "pwscont run fig7 --json": "for other programs",
        "pwscont run fig7 --html fig7.html": "a page to look at in a browser",
        "pwscont run example1 --explain": "say which parts the run is made of",
    },
    "view": {
        "pwscont view out/fig7.npz": "a page beside the graph that 'run fig7 -o out' wrote",
        "pwscont view out/fig7.npz -o fig7.html": "a page of another name",
    },
    "sweep": {
        "pwscont sweep wedge -s nodes=2 --over friction=0.5:2:4": "most solutions",
        "pwscont sweep wedge -s nodes=2 --over angle=10,20 --measure first-fold": "a fold",
        "pwscont sweep wedge -s nodes=2 --over friction=0.5,1 --over angle=9:40:2 -o out": "map",
    },
    "bench": {
        "pwscont bench --quick": "few problems, few runs",
        "pwscont bench fig13 -o out": "one problem; write picture and data, too",
    },
}

STATUS = """\
exit status:
  0    done, or the reader of the output has seen enough
  1    every case of a sweep failed
  2    wrong input, or files that cannot be read or written: standard error says which
  130  interrupted; with -o what is finished is kept, and --resume goes on"""


def with_examples(command: str, **more: Any) -> dict[str, Any]:
    """Return the arguments of a parser whose help ends with examples and exit statuses."""
    width = max(map(len, EXAMPLES[command]))
    lines = [f"  {line:<{width}}  {what}" for line, what in EXAMPLES[command].items()]
    epilog = "\n".join(["examples:", *lines, "", STATUS])
    return more | {"epilog": epilog, "formatter_class": argparse.RawDescriptionHelpFormatter}


#: Dots per inch: fewer cannot be read, more do not fit into memory.
DPI = 20, 1200
OPTIONS = ("format", "dpi", "panels", "scale", "animate")


def add_looks(command: argparse.ArgumentParser) -> None:
    """Add the options for the look of pictures to a command."""
    group = command.add_argument_group("pictures", "the look of the pictures that -o writes")
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
        help="draw displacements of bodies larger by this factor; 1 is true to scale",
    )
    group.add_argument(
        "--animate",
        action="store_true",
        default=None,
        help="write a moving picture of the body along branch 1, or of evolutions over t, too",
    )


def _dots(text: str) -> int:
    least, most = DPI
    if not (text.strip().isdecimal() and least <= int(text) <= most):
        raise argparse.ArgumentTypeError(
            f"must be a whole number from {least} to {most}, got {text.strip()!r}"
        )
    return int(text)


def _factor(text: str) -> float:
    try:
        factor = float(text)
    except ValueError:
        factor = -1.0
    if not 0.0 < factor < inf:
        raise argparse.ArgumentTypeError(f"must be a positive number, got {text.strip()!r}")
    return factor


def look_of(options: argparse.Namespace, scene: Runnable) -> Look:
    """Return the look of pictures that the options ask for."""
    given = {name: getattr(options, name) for name in OPTIONS if getattr(options, name) is not None}
    if given and not options.output:
        raise InvalidInputError(f"--{next(iter(given))} needs -o DIR: pictures are written there")
    for name in ("scale", "animate"):
        if name in given and not scene.has_body:
            raise InvalidInputError(f"--{name} is about bodies, and scene {scene.name} draws none")
    return Look(**{name: value for name, value in given.items() if name != "panels"})


def with_panels(options: argparse.Namespace, scene: Runnable) -> Runnable:
    """Return the scene with the panels that the user asks for."""
    return scene.with_panels([*map(str.strip, options.panels)]) if options.panels else scene
