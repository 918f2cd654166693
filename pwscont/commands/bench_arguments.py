"""The arguments of ``pwscont bench``; :mod:`bench` is imported when the command runs."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from pwscont.commands.options import add_scene, with_examples
from pwscont.scenes.registry import add_settings


def add_to(commands: Any) -> None:
    """Register the sub-command with the sub-parsers of the command line."""
    words = "measure accuracy and time of the steppers"
    bench = commands.add_parser("bench", help=words, **with_examples("bench"))
    bench.set_defaults(command=_bench)
    add_scene(bench, "default: all with a known answer", nargs="*")
    bench.add_argument(
        "-o", "--output", type=Path, metavar="DIR", help="write picture and data there"
    )
    add_settings(bench)
    bench.add_argument("--quick", action="store_true", help="few problems, few runs")


def _bench(options: argparse.Namespace) -> int:
    from pwscont.commands.bench import run  # noqa: PLC0415  only where asked for

    return run(options.scene, options.output, options.quick, dict(options.settings))
