"""The scene that made a graph, named in the file of the graph.

Readers that do not know the member of the scene ignore this member.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import final
from zipfile import ZipFile

from pwscont import GraphFileError

MEMBER = "scene.json"


@final
@dataclass(frozen=True, slots=True)
class Origin:
    """The name of a scene and its settings, as texts."""

    scene: str
    settings: Mapping[str, str]


def write_origin(path: Path, origin: Origin) -> None:
    """Add the scene to the file of a graph."""
    text = json.dumps({"scene": origin.scene, "settings": dict(origin.settings)})
    with ZipFile(path, "a") as file:
        file.writestr(MEMBER, text)


def read_origin(path: Path) -> Origin | None:
    """Return the scene that a file of a graph names, None where the file names no scene."""
    with ZipFile(path) as file:
        if MEMBER not in file.namelist():
            return None
        text = file.read(MEMBER)
    try:
        said = json.loads(text)
        settings = {str(name): str(value) for name, value in dict(said["settings"]).items()}
        return Origin(str(said["scene"]), settings)
    except (ValueError, KeyError, TypeError) as error:
        raise GraphFileError(f"{path} names its scene in a damaged way") from error
