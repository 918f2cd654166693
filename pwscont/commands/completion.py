"""Completion by the tab key, where argcomplete is installed (the extra ``completion``).

The shell asks by running the program with the variable ``_ARGCOMPLETE`` set; without that variable
argcomplete is not imported, so that no other run waits for it.
"""

from __future__ import annotations

import argparse
import os
from importlib import import_module
from typing import Any

from pwscont.scenes.registry import scene_names


def complete(parser: argparse.ArgumentParser) -> None:
    """If the shell asks for completions, answer and leave."""
    if "_ARGCOMPLETE" in os.environ:
        import_module("argcomplete").autocomplete(parser)


def add_scene(command: argparse.ArgumentParser, help: str, **options: Any) -> None:
    """Let a command take names of scenes, and the shell complete them."""
    scene: Any = command.add_argument("scene", metavar="SCENE", help=help, **options)
    scene.completer = lambda **_: scene_names()
