"""The arguments of ``pwscont view``, ``sweep`` and ``bench``, which are imported when they run."""

from __future__ import annotations

import argparse
from importlib import import_module
from math import isfinite
from pathlib import Path
from typing import Any

from pwscont.commands.options import add_scene, with_examples
from pwscont.scenes.registry import add_settings

FORM = "NAME=LO:HI:COUNT, or NAME=VALUE,VALUE,..."
#: Most values between LO and HI: more cases would take weeks.
MOST_VALUES = 1_000_000


def add_view(commands: Any) -> None:
    """Register ``view`` with the sub-parsers of the command line."""
    words = "write a page that shows a graph in a browser"
    view = commands.add_parser("view", help=words, **with_examples("view"))
    view.set_defaults(command=_view)
    view.add_argument("graph", type=Path, metavar="FILE", help="written by 'pwscont run -o'")
    view.add_argument(
        "-o", "--output", type=Path, metavar="FILE", help="the page; default beside the graph"
    )
    view.add_argument("--open", action="store_true", help="open the page in a browser")


def add_bench(commands: Any) -> None:
    """Register ``bench`` with the sub-parsers of the command line."""
    words = "measure accuracy and time of the steppers"
    bench = commands.add_parser("bench", help=words, **with_examples("bench"))
    bench.set_defaults(command=_bench)
    add_scene(bench, "default: all with a known answer", nargs="*")
    bench.add_argument(
        "-o", "--output", type=Path, metavar="DIR", help="write picture and data there"
    )
    add_settings(bench)
    bench.add_argument("--quick", action="store_true", help="few problems, few runs")


def _view(options: argparse.Namespace) -> int:
    return int(import_module("pwscont.commands.view").view_graph(options))


def _sweep(options: argparse.Namespace) -> int:
    return int(import_module("pwscont.commands.sweep").run(options))


def _bench(options: argparse.Namespace) -> int:
    run = import_module("pwscont.commands.bench").run
    return int(run(options.scene, options.output, options.quick, dict(options.settings)))


def add_sweep(commands: Any) -> None:
    """Register ``sweep`` with the sub-parsers of the command line."""
    words = "compute a scene under many settings, and measure each"
    sweep = commands.add_parser("sweep", help=words, **with_examples("sweep"))
    sweep.set_defaults(command=_sweep)
    add_scene(sweep, "a name from 'pwscont scenes'")
    sweep.add_argument(
        "--over",
        action="append",
        required=True,
        type=_range,
        metavar="RANGE",
        help=f"values of a setting: {FORM}",
    )
    sweep.add_argument(
        "--measure",
        action="append",
        metavar="WHAT",
        help="max-count (default), first-fold, non-unique, non-unique-length, count-at=ALPHA, "
        "largest=QUANTITY@ALPHA, smallest=QUANTITY@ALPHA, critical=SETTING:LO:HI; "
        "repeat the option for several",
    )
    add_settings(sweep)
    sweep.add_argument(
        "-o", "--output", type=Path, metavar="DIR", help="write table, pictures and store there"
    )
    sweep.add_argument("--graphs", action="store_true", help="write the graph of each case, too")
    sweep.add_argument("--workers", type=int, default=1, metavar="N", help="processes; default 1")
    sweep.add_argument(
        "--scheduler", metavar="ADDRESS", help="of a Dask cluster, such as tcp://10.0.0.1:8786"
    )
    sweep.add_argument(
        "--resume", action="store_true", help="go on with an interrupted sweep that wrote to DIR"
    )


def _range(text: str) -> tuple[str, list[Any]]:
    """Return the name and the values of a setting from ``NAME=LO:HI:COUNT`` or a list."""
    name, sign, values = text.strip().partition("=")
    if not (name and sign and values):
        raise argparse.ArgumentTypeError(f"{text!r} is not of the form {FORM}")
    parts = values.split(":")
    if len(parts) == 1:
        return name, [_value(word) for word in values.split(",")]
    try:
        lo, hi, count = parts
        return name, _between(float(lo), float(hi), int(count))
    except ValueError as error:
        raise argparse.ArgumentTypeError(f"{text!r} is not of the form {FORM}") from error


def _between(lo: float, hi: float, count: int) -> list[float]:
    """Return ``count`` values, evenly spaced from lo to hi."""
    if not 1 <= count <= MOST_VALUES:
        raise argparse.ArgumentTypeError(f"COUNT must be from 1 to {MOST_VALUES}, got {count}")
    if not (isfinite(lo) and isfinite(hi)):
        raise argparse.ArgumentTypeError(f"LO and HI must be finite, got {lo}:{hi}")
    inner = [lo + (hi - lo) * step / (count - 1) for step in range(1, count - 1)]
    return [lo, *inner, hi][:count]


def _value(word: str) -> int | float | str:
    for kind in (int, float):
        try:
            return kind(word)
        except ValueError:
            continue
    return word
