"""Settings of a scene: texts for the parameters of the function that makes the scene."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping
from inspect import signature
from typing import Any, get_type_hints

from pwscont.basics.errors import InvalidInputError

TRUTH = {"true": True, "false": False}


def add_settings(command: argparse.ArgumentParser) -> None:
    """Let a command take settings of scenes."""
    command.add_argument(
        "-s",
        "--set",
        action="append",
        type=_setting,
        default=[],
        dest="settings",
        metavar="NAME=VALUE",
        help="settings of the scene, listed by 'pwscont scenes': -s A=1 B=2, or -s A=1 -s B=2",
    )


def _setting(text: str) -> tuple[str, str]:
    """Return name and value of a setting."""
    name, sign, value = text.strip().partition("=")
    if not (name and sign and value):
        raise argparse.ArgumentTypeError(f"{text!r} is not of the form NAME=VALUE")
    return name, value


def settings_of(scene: str, make: Callable[..., Any], given: Mapping[str, str]) -> dict[str, Any]:
    """Return the arguments for a function.

    The type of a parameter is its annotation. Without annotation it is a number where the default
    is a number, else a text.

    Raises
    ------
    InvalidInputError
        If there is no such parameter, or the text is not of its type.
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
    """Return the function that converts a text where only a default tells the type."""
    if isinstance(default, bool):
        return bool
    return _number if isinstance(default, int | float) else str


def described(make: Callable[..., Any]) -> str:
    """Return the parameters of a function with their defaults, such as ``nodes=20``."""
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
