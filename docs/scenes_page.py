"""The manual's page of scenes: one picture each, grouped by package, drawn when it is built."""

from __future__ import annotations

from concurrent.futures import ProcessPoolExecutor
from functools import partial
from pathlib import Path
from shutil import move
from tempfile import TemporaryDirectory

from pwscont.scenes.answer import Look, Runnable
from pwscont.scenes.registry import described_package, load_scene, scene_names, scenes_by_package

LOOK = Look(dpi=80)
HEAD = """\
Scenes
======

Every scene of every package, as `pwscont run` draws it from its own settings. `pwscont run NAME`
prints the table behind a picture, `pwscont run NAME -o out` writes picture, graph and more. Click
on a picture to see it in full size, on the name of a tutorial to read on.

"""
CONTACT, LOADS = "gallery/paper_curve", "gallery/how_many_solutions"
#: Where to read on: by scene, or by package.
TUTORIALS = {
    "block": "elastic",
    "press": "elastic",
    "wedge": "elastic",
    "triangle": "elastic",
    "hysteresis": "histories",
    "shakedown": "histories",
    "cattaneo": "histories",
    "block-cycle": "histories",
    "play": "histories",
    "example1": LOADS,
    "example2": LOADS,
    "example3": LOADS,
    "example1-critical-friction": "gallery/critical_friction",
    "example1-load-plane": "gallery/exact_map",
    "fig4": "gallery/exact_map",
    "fig5": "gallery/exact_map",
    "fig6": "gallery/exact_map",
    "pwscont_circuits": "gallery/circuits",
    "pwscont_coulomb": CONTACT,
    "pwscont_dynamics": "gallery/dynamics",
    "pwscont_optimisation": "gallery/optimisation",
    "pwscont_power": "gallery/power_flow",
    "pwscont_structures": "gallery/structures",
}


def draw_scenes(into: Path) -> None:
    """Draw every scene into files scene-NAME.png; of bodies the body itself."""
    with ProcessPoolExecutor() as pool:
        list(pool.map(partial(_draw_scene, into), scene_names()))


def _draw_scene(into: Path, name: str) -> None:
    with TemporaryDirectory() as aside:
        move(_drawn(load_scene(name), Path(aside)), into / f"scene-{name}.png")


def _drawn(scene: Runnable, into: Path) -> Path:
    answer = scene.solve(scene.values(None), lambda *_: None)
    # the last picture shows the body, if there is one
    return [path for path in answer.write(into, LOOK) if path.suffix == ".png"][-1]


def scenes_page(images: str) -> str:
    """Return the page; ``images`` is the folder of the pictures, as the page sees it."""
    packages = scenes_by_package().items()
    return HEAD + "\n".join(_package(package, names, images) for package, names in packages)


def _package(package: str, names: list[str], images: str) -> str:
    _, _, words = described_package(package).partition(": ")
    title = f":mod:`{package}`"
    figures = "\n".join(_figure(name, package, images) for name in names)
    return f"{title}\n{'-' * len(title)}\n\n{words}\n\n.. container:: scenes\n\n{figures}"


def _figure(name: str, package: str, images: str) -> str:
    tutorial = TUTORIALS.get(name, TUTORIALS[package])
    return (
        f"   .. figure:: {images}/scene-{name}.png\n"
        f"      :target: _images/scene-{name}.png\n"
        f"      :alt: {name}\n\n"
        f"      `{name}`: {load_scene(name).title}; :doc:`{tutorial}`\n"
    )
