"""The scenes that installed packages offer."""

from __future__ import annotations

from collections.abc import Mapping
from difflib import get_close_matches
from importlib.metadata import EntryPoint, entry_points

from pwscont.foundation.errors import SceneNotFoundError
from pwscont.interface.answer import Runnable
from pwscont.interface.settings import described, settings_of

GROUP = "pwscont.scenes"


def scene_names() -> list[str]:
    """Return the names of all scenes, without importing any."""
    return sorted((point.name for point in entry_points(group=GROUP)), key=_natural)


def load_scene(name: str, settings: Mapping[str, str] | None = None) -> Runnable:
    """Build a scene by name; imports only the package that offers it.

    Parameters
    ----------
    name : str
    settings : mapping, optional
        Values, as text, for parameters of the function that makes the scene.

    Raises
    ------
    SceneNotFoundError
        If no installed package offers it; the message names the nearest ones.
    InvalidInputError
        If the scene has no such parameter, or the value does not fit it.
    """
    make = _entry_point(name).load()
    return make(**settings_of(name, make, settings or {}))  # type: ignore[no-any-return]


def scene_settings(name: str) -> str:
    """Return the parameters of a scene with their defaults, such as ``nodes=20``."""
    return described(_entry_point(name).load())


def _entry_point(name: str) -> EntryPoint:
    found = entry_points(group=GROUP, name=name)
    if found:
        return next(iter(found))
    near = get_close_matches(name, scene_names(), n=3, cutoff=0.4)
    hint = f"did you mean {' or '.join(near)}?" if near else "see 'pwscont scenes'"
    raise SceneNotFoundError(f"there is no scene {name!r}; {hint}")


def _natural(name: str) -> tuple[str, int]:
    """Sort fig7 before fig10."""
    word = name.rstrip("0123456789")
    return word, int(name[len(word) :] or 0)
