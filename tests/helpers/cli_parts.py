"""The command line as tests run it."""

import json
from importlib.metadata import entry_points

import pytest

from pwscont import Scene
from pwscont.commands.cli import main
from pwscont.scenes.registry import GROUP, load_scene, scene_names

NAMES = scene_names()


CURVES = [name for name in NAMES if isinstance(load_scene(name), Scene)]


# with this scope tests of one scene follow each other, and share its answer
CONTACT = [point.name for point in entry_points(group=GROUP) if "coulomb" in point.value]


# a package whose scenes have answers of their own kind tests these itself
OTHERS = [name for name in CURVES if name not in CONTACT]


def run(capsys, *arguments):
    """Return status, standard output and standard error of a command."""
    status = main(arguments)
    printed = capsys.readouterr()
    return status, printed.out, printed.err


def run_json(capsys, *arguments):
    status, out, _ = run(capsys, "run", *arguments, "--json")
    assert status == 0
    assert out.count("\n") == 1  # one object and nothing else
    return json.loads(out, parse_constant=lambda word: pytest.fail(f"{word} is no JSON"))
