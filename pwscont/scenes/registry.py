"""The scenes that installed packages offer, and the settings of a scene.

Failure modes and answers
-------------------------
- A package cannot be imported, or offers something that is no scene: the message names the package,
  and the scenes of all other packages go on working.
- Two packages offer scenes of one name: the name is refused, and the message names the packages.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping
from difflib import get_close_matches
from importlib import import_module
from importlib.metadata import EntryPoint, entry_points
from inspect import signature
from typing import Any, get_type_hints

from pwscont import InvalidInputError, PwscontError, SceneNotFoundError
from pwscont.scenes.answer import Runnable

TRUTH = {"true": True, "false": False}


class BrokenSceneError(PwscontError, RuntimeError):
    """A package offers a scene that cannot be made, or whose name is taken."""


def add_settings(command: argparse.ArgumentParser) -> None:
    """Add the option ``-s NAME=VALUE`` to a command."""
    command.add_argument(
        "-s",
        "--set",
        action=_Settings,
        type=_setting,
        default=[],
        dest="settings",
        metavar="NAME=VALUE",
        help="settings of the scene, listed by 'pwscont scenes': -s A=1 B=2, or -s A=1 -s B=2",
    )


class _Settings(argparse.Action):
    """Collects settings, and refuses a setting that is given twice."""

    def __call__(self, parser: Any, namespace: Any, values: Any, option: Any = None) -> None:
        if values[0] in dict(namespace.settings):
            parser.error(f"argument -s/--set: {values[0]} is set twice")
        namespace.settings = [*namespace.settings, values]


def _setting(text: str) -> tuple[str, str]:
    """Return name and value of a setting."""
    name, sign, value = text.strip().partition("=")
    if not (name and sign and value):
        raise argparse.ArgumentTypeError(f"{text!r} is not of the form NAME=VALUE")
    return name, value


def settings_of(scene: str, make: Callable[..., Any], given: Mapping[str, str]) -> dict[str, Any]:
    """Return the arguments for the function that makes a scene, from settings as text.

    The annotation of a parameter is the type. Without annotation a parameter is a number if the
    default is a number, else a text.

    Raises
    ------
    InvalidInputError
        If there is no such parameter, or the text does not fit the type.
    """
    hints, parameters = get_type_hints(make), signature(make).parameters
    kinds = {name: hints.get(name) or _kind(what.default) for name, what in parameters.items()}
    for name in given:
        if name not in kinds:
            known = f"it has {described(make)}" if kinds else "it has none"
            raise InvalidInputError(f"scene {scene} has no setting {name!r}; {known}")
    return {name: _value(scene, name, text, kinds[name]) for name, text in given.items()}


def _number(text: str) -> float:
    """Return an int for a whole number, a float for any other number."""
    try:
        return int(text)
    except ValueError:
        return float(text)


def _kind(default: Any) -> Callable[[str], Any]:
    """Return the function that converts a text to the type of a default."""
    if isinstance(default, bool):
        return bool
    return _number if isinstance(default, int | float) else str


def described(make: Callable[..., Any]) -> str:
    """Return the parameters of a function with defaults, such as ``nodes=20``, as text."""
    parameters = signature(make).parameters.values()
    return ", ".join(f"{parameter.name}={parameter.default}" for parameter in parameters)


WORDS: Mapping[Any, str] = {
    int: "a whole number",
    float: "a number",
    _number: "a number",
    str: "a text",
    bool: "true or false",
}


def _value(scene: str, name: str, text: str, kind: Callable[[str], Any]) -> Any:
    try:
        return TRUTH[text.lower()] if kind is bool else kind(text)
    except (ValueError, KeyError) as error:
        word = WORDS.get(kind, kind)
        raise InvalidInputError(f"{name} of scene {scene} must be {word}, got {text!r}") from error


GROUP = "pwscont.scenes"
#: A name counts as misspelt if the similarity to a known name, 0 to 1 (difflib), is at least this.
NEAR = 0.6


def scene_names() -> list[str]:
    """Return the names of all scenes, without importing a package."""
    return sorted({point.name for point in entry_points(group=GROUP)}, key=_natural)


def scenes_by_package() -> dict[str, list[str]]:
    """Return {package: names of the offered scenes}, without importing a package."""
    package = {point.name: point.module.split(".")[0] for point in entry_points(group=GROUP)}
    grouped: dict[str, list[str]] = {package: [] for package in sorted({*package.values()})}
    for name in scene_names():
        grouped[package[name]].append(name)
    return grouped


def described_package(package: str) -> str:
    """Return a package's name with the first line of the docstring, or only the name."""
    try:
        words = import_module(package).__doc__
    except (Exception, SystemExit):  # each scene of the package says why
        words = None
    return f"{package}: {words.strip().splitlines()[0]}" if words and words.strip() else package


def load_scene(name: str, settings: Mapping[str, str] | None = None) -> Runnable:
    """Return the scene of a name, built; imports only the package that offers the scene.

    Parameters
    ----------
    name : str
    settings : mapping, optional
        Values, as text, for parameters of the function that makes the scene.

    Raises
    ------
    SceneNotFoundError
        If no installed package offers the scene; the message lists similar names.
    BrokenSceneError
        If the package cannot make the scene, or several packages offer a scene of this name.
    InvalidInputError
        If the function has no such parameter, or a value does not fit.
    """
    point = _entry_point(name)
    make = _loaded(point)
    try:
        scene = make(**settings_of(name, make, settings or {}))
    except PwscontError:
        raise
    except Exception as error:
        raise _broken(point, error) from error
    if not _is_scene(scene):
        raise _broken(point, f"it returns {type(scene).__name__}, not a scene")
    return scene


def scene_settings(name: str) -> tuple[str, ...]:
    """Return the names of a scene's settings; errors as of :func:`load_scene`."""
    return tuple(signature(_loaded(_entry_point(name))).parameters)


def described_scene(name: str) -> str:
    """Return a scene's title and settings, or the error of building the scene, as one line."""
    try:
        title, settings = load_scene(name).title, described(_loaded(_entry_point(name)))
    except PwscontError as error:
        return f"({error})"
    return f"{title} [-s {settings.replace(', ', ' ')}]" if settings else title


def _is_scene(scene: object) -> bool:
    words = [getattr(scene, name, None) for name in ("name", "title", "parameter")]
    return isinstance(scene, Runnable) and all(isinstance(word, str) for word in words)


def _entry_point(name: str) -> EntryPoint:
    found = list(entry_points(group=GROUP, name=name))
    if len(found) == 1:
        return found[0]
    if found:
        offered = " and ".join(sorted(map(_package, found)))
        raise BrokenSceneError(f"scene {name} is offered by {offered}; uninstall one of them")
    near = get_close_matches(name, scene_names(), n=3, cutoff=NEAR)
    near = near or [known for known in scene_names() if name and name in known][:3]
    hint = f"; did you mean {' or '.join(near)}?" if near else ""
    raise SceneNotFoundError(f"there is no scene {name!r}{hint}; see 'pwscont scenes'")


def _loaded(point: EntryPoint) -> Callable[..., Any]:
    """Return the function that makes a scene."""
    try:
        make = point.load()
    except (Exception, SystemExit) as error:
        raise _broken(point, error) from error
    if not callable(make):
        raise _broken(point, f"{point.value} is no function")
    return make


def _broken(point: EntryPoint, why: object) -> BrokenSceneError:
    kind = f"{type(why).__name__}: " if isinstance(why, BaseException) else ""
    words = " ".join(f"{kind}{why}".split())  # in one line
    return BrokenSceneError(f"scene {point.name} of {_package(point)} cannot be made: {words}")


def _package(point: EntryPoint) -> str:
    return f"package {point.dist.name}" if point.dist else point.value


def _natural(name: str) -> tuple[str, int]:
    """Return the key by which fig7 sorts before fig10."""
    word = name.rstrip("0123456789")
    return word, int(name[len(word) :] or 0)
