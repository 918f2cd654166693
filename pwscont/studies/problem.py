"""The problems that a study varies, and the grid of cases."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass, field
from difflib import get_close_matches
from functools import partial
from inspect import Parameter, signature
from math import isfinite, prod
from typing import Any, TypeAlias, final

from pwscont import BranchGraph, InvalidInputError, PiecewiseSystem, UnknownNameError, explore
from pwscont.extending import short, uninterrupted
from pwscont.scenes.answer import Runnable
from pwscont.scenes.registry import load_scene, scene_settings
from pwscont.scenes.scene import Scene

#: The value of a setting.
Setting: TypeAlias = bool | int | float | str
#: Columns of the table of a study besides settings and measures.
FIXED = ("case", "proven", "guarantee", "seconds", "failure")


@final
class Grid:
    """All combinations of values, numbered from 0; the last setting changes fastest.

    Parameters
    ----------
    over : mapping of str to iterable
        The values of each setting: numbers, texts or truth values.

    Attributes
    ----------
    values : dict of str to tuple
        The values of each setting.

    Raises
    ------
    InvalidInputError
        If there is no setting, or a setting has no values, a value that is not finite, or a value
        twice.
    """

    def __init__(self, over: Mapping[str, Iterable[Any]]) -> None:
        if not isinstance(over, Mapping) or not over:
            raise InvalidInputError(f"over must map settings to their values, got {over!r}")
        self.values = {checked_column("over", name): _values(name, over[name]) for name in over}

    @property
    def shape(self) -> tuple[int, ...]:
        """The number of values of each setting."""
        return tuple(map(len, self.values.values()))

    def __len__(self) -> int:
        """Return the number of cases."""
        return prod(self.shape)

    def settings(self, number: int) -> dict[str, Setting]:
        """Return the settings of a case."""
        found: dict[str, Setting] = {}
        for name, values in reversed(self.values.items()):
            number, place = divmod(number, len(values))
            found[name] = values[place]
        return {name: found[name] for name in self.values}


def checked_column(what: str, name: Any) -> str:
    """Return the name of a setting or a measure; refuse a name that no column can have."""
    if not isinstance(name, str) or not name:
        raise InvalidInputError(f"{what}: names are texts that are not empty, got {name!r}")
    if name in FIXED:
        raise InvalidInputError(f"{what}: the name {name!r} is that of another column")
    return name


def _values(name: str, given: Any) -> tuple[Setting, ...]:
    if isinstance(given, str) or not isinstance(given, Iterable):
        words = f"over {name!r} must be several values, as in [0.1, 0.2], got"
        raise InvalidInputError(f"{words} {short(repr(given))}")
    values = tuple(_plain(name, value) for value in given)
    if not values:
        raise InvalidInputError(f"over {name!r} is empty: give at least one value")
    twice = [value for value, times in Counter(values).items() if times > 1]
    if twice:
        raise InvalidInputError(f"over {name!r} has the value {twice[0]!r} twice")
    return values


def _plain(name: str, value: Any) -> Setting:
    """Return a value as a plain Python object, which files and processes keep unchanged."""
    plain = value.item() if hasattr(value, "item") and getattr(value, "ndim", 0) == 0 else value
    finite = isinstance(plain, float) and isfinite(plain)
    if not (finite or isinstance(plain, bool | int | str)):
        words = f"over {name!r}: values are finite numbers, texts, True or False, got"
        raise InvalidInputError(f"{words} {short(repr(value))}")
    return plain


#: Settings, by keyword -> a scene, a pair of system and interval, or a graph.
Problem: TypeAlias = Callable[..., Any]
KINDS = (Parameter.POSITIONAL_OR_KEYWORD, Parameter.KEYWORD_ONLY)
WANTED = "a Scene, a system with its interval as in (system, (lo, hi)), or a BranchGraph"


@final
@dataclass(frozen=True, slots=True)
class RegisteredScene:
    """A scene that a package offers, as a function of the settings.

    Attributes
    ----------
    name : str
    fixed : mapping of str to str
        Settings that all cases share, with values as texts of the command line.
    """

    name: str
    fixed: Mapping[str, str] = field(default_factory=dict)

    def __call__(self, **settings: Setting) -> Runnable:
        """Return the scene with the fixed settings and the given settings."""
        varied = {name: _as_text(value) for name, value in settings.items()}
        return load_scene(self.name, {**self.fixed, **varied})

    def __str__(self) -> str:
        fixed = [f"{name}={value}" for name, value in self.fixed.items()]
        return ", ".join([f"scene {self.name}", *fixed])


def _as_text(value: Setting) -> str:
    """Return a setting as text of the command line; 8.0 becomes 8, which fits int as well."""
    whole = isinstance(value, float) and value.is_integer()
    return str(int(value)) if whole else str(value)


def checked_problem(given: Any) -> Problem:
    """Return the problem, a function of settings, from a function or the name of a scene.

    Raises
    ------
    InvalidInputError, SceneNotFoundError
    """
    if isinstance(given, str):
        scene_settings(given)
        return RegisteredScene(given)
    if isinstance(given, Runnable | PiecewiseSystem) or not callable(given):
        words = "a study needs the name of a scene, or a function that takes settings by keyword"
        raise InvalidInputError(f"{words} and returns {WANTED}; got {short(repr(given))}")
    return given


def check_settings(problem: Problem, names: Collection[str]) -> None:
    """Refuse fixed settings, settings that a problem does not take, and settings left out.

    Raises
    ------
    UnknownNameError, InvalidInputError
    """
    fixed = problem.fixed if isinstance(problem, RegisteredScene) else {}
    for name in [*names, *fixed]:
        known = _settings_of(problem)
        if known is not None and name not in known:
            near = get_close_matches(name, known, n=2, cutoff=0.5)
            hint = f"; did you mean {' or '.join(near)}?" if near else ""
            has = f"it has {', '.join(known)}" if known else "it has none"
            raise UnknownNameError(f"{described(problem)} has no setting {name!r}; {has}{hint}")
    if missing := [name for name in _needed(problem) if name not in names]:
        raise InvalidInputError(
            f"{described(problem)} needs the setting {missing[0]!r}: vary it, or give it a default"
        )
    if varied := [name for name in names if name in fixed]:
        raise InvalidInputError(f"{varied[0]} cannot be fixed and varied at once")


def _settings_of(problem: Problem) -> list[str] | None:
    """Return the names of the settings of a problem; None for a problem that takes any setting."""
    if isinstance(problem, RegisteredScene):
        return list(scene_settings(problem.name))
    try:
        parameters = signature(problem).parameters.values()
    except (TypeError, ValueError):  # a built-in function
        return None
    if any(parameter.kind is Parameter.VAR_KEYWORD for parameter in parameters):
        return None
    return [parameter.name for parameter in parameters if parameter.kind in KINDS]


def _needed(problem: Problem) -> list[str]:
    """Return the names of the settings of a function that have no default."""
    known = [] if isinstance(problem, RegisteredScene) else _settings_of(problem)
    parameters = signature(problem).parameters if known else {}
    return [name for name in known or () if parameters[name].default is Parameter.empty]


def described(thing: Any) -> str:
    """Return the name of a function or an object, equal in every process."""
    if isinstance(thing, partial):
        fixed = [*thing.args, *(f"{name}={value!r}" for name, value in thing.keywords.items())]
        return f"{described(thing.func)}({', '.join(map(_without_address, fixed))})"
    if hasattr(thing, "__qualname__"):
        return f"{thing.__module__}.{thing.__qualname__}"
    return _without_address(thing)


def _without_address(thing: object) -> str:
    return re.sub(r" at 0x[0-9a-f]+", "", str(thing))


def explored(made: Any) -> BranchGraph:
    """Return the graph of a scene, a pair of system and interval, or a graph.

    Raises
    ------
    InvalidInputError
        If there is no graph, as for a scene with two parameters.
    KeyboardInterrupt
        If Ctrl-C was pressed: half a graph is no case.
    """
    if isinstance(made, BranchGraph):
        return uninterrupted(made)
    if isinstance(made, Runnable):
        scene = made.curve()
        if not isinstance(scene, Scene):
            raise InvalidInputError(f"scene {made.name} has no curve: a study needs one parameter")
        return uninterrupted(scene.run())
    if isinstance(made, tuple) and len(made) == 2 and isinstance(made[0], PiecewiseSystem):
        return uninterrupted(explore(*made))
    words = f"the function of a study must return {WANTED}; got {short(repr(made))}"
    raise InvalidInputError(words)
