"""The command line: ``pwscont scenes`` and ``pwscont run SCENE``."""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from pwscont.foundation.errors import InvalidInputError, PwscontError
from pwscont.graph import BranchGraph, Solution
from pwscont.interface.progress import Progress
from pwscont.interface.registry import load_scene, scene_names
from pwscont.interface.scene import Scene
from pwscont.interface.table import report


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command; returns the exit status: 0, 2 for wrong input, 130 if interrupted."""
    options = _parser().parse_args(arguments)
    try:
        return int(options.command(options))
    except (PwscontError, OSError) as error:
        print(f"pwscont: {error}", file=sys.stderr)  # noqa: T201
        return 2
    except KeyboardInterrupt:
        print("pwscont: interrupted", file=sys.stderr)  # noqa: T201
        return 130


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="pwscont", description="Follow the solutions of piecewise-smooth systems."
    )
    commands = parser.add_subparsers(required=True, metavar="COMMAND")
    scenes = commands.add_parser("scenes", help="list the scenes")
    scenes.set_defaults(command=_scenes)
    run = commands.add_parser("run", help="compute a scene and print what was found")
    run.set_defaults(command=_run)
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
        help="write the picture and the branch graph there",
    )
    run.add_argument("--json", action="store_true", help="print one JSON object instead of a table")
    return parser


def _scenes(options: argparse.Namespace) -> int:
    for name in scene_names():
        print(f"{name:<12} {load_scene(name).title}")  # noqa: T201
    return 0


def _run(options: argparse.Namespace) -> int:
    scene = load_scene(options.scene)
    at = scene.at if options.at is None else tuple(options.at)
    _check_values(scene, at)
    if options.output:
        options.output.mkdir(parents=True, exist_ok=True)
    begin = time.perf_counter()
    progress = Progress(scene.parameter)
    graph = scene.run(progress)
    progress.close()
    seconds = time.perf_counter() - begin
    if options.json:
        print(json.dumps(_as_json(scene, graph, at, seconds), ensure_ascii=False))  # noqa: T201
    else:
        print(report(scene, graph, at))  # noqa: T201
    if options.output:
        written = _write(scene, graph, options.output)
        print(f"written: {', '.join(map(str, written))}", file=sys.stderr)  # noqa: T201
    return 0


def _check_values(scene: Scene, at: Sequence[float]) -> None:
    """Refuse before any work what could not be answered after it."""
    lo, hi = scene.interval
    for alpha in at:
        if not lo <= alpha <= hi:
            raise InvalidInputError(
                f"--at {alpha} lies outside the interval [{lo}, {hi}] of scene {scene.name}"
            )


def _write(scene: Scene, graph: BranchGraph, directory: Path) -> list[Path]:
    from pwscont.interface.plotting import draw_scene  # noqa: PLC0415  only where asked for

    picture, file = directory / f"{scene.name}.png", directory / f"{scene.name}.npz"
    draw_scene(scene, graph).savefig(picture, dpi=150)
    graph.save(file)
    return [picture, file]


def _as_json(
    scene: Scene, graph: BranchGraph, at: Sequence[float], seconds: float
) -> dict[str, Any]:
    lo, hi = graph.interval
    head = {"scene": scene.name, "parameter": {"name": scene.parameter, "lo": lo, "hi": hi}}
    solutions = [_solution(solution) for alpha in at for solution in graph.solutions(alpha)]
    return head | graph.to_dict() | {"solutions": solutions, "seconds": seconds}


def _solution(solution: Solution) -> dict[str, Any]:
    return {
        "alpha": solution.alpha,
        "z": solution.z.tolist(),
        "label": solution.label,
        "det_sign": solution.det_sign,
    }
