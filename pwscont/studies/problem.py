"""What a study varies: a function of settings that returns a problem, or a scene by its name."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from difflib import get_close_matches
from functools import partial
from inspect import Parameter, signature
from typing import Any, TypeAlias, final

from pwscont.basics.errors import InvalidInputError, UnknownNameError
from pwscont.basics.looks import short
from pwscont.continuation import explore
from pwscont.continuation.plan import uninterrupted
from pwscont.graph import BranchGraph
from pwscont.scenes.answer import Runnable
from pwscont.scenes.registry import load_scene, scene_settings
from pwscont.scenes.scene import Scene
from pwscont.studies.grid import Setting
from pwscont.system.system import PiecewiseSystem

#: Settings, by keyword -> a scene, a system with its interval, or a graph.
Problem: TypeAlias = Callable[..., Any]
KINDS = (Parameter.POSITIONAL_OR_KEYWORD, Parameter.KEYWORD_ONLY)
WANTED = "a Scene, a system with its interval as in (system, (lo, hi)), or a BranchGraph"


@final
@dataclass(frozen=True, slots=True)
class RegisteredScene:
    """A scene that a package offers, as a function of its settings.

    Attributes
    ----------
    name : str
    fixed : mapping of str to str
        Settings that stay, as the command line takes them.
    """

    name: str
    fixed: Mapping[str, str] = field(default_factory=dict)

    def __call__(self, **settings: Setting) -> Runnable:
        """Return the scene with some settings."""
        varied = {name: _as_text(value) for name, value in settings.items()}
        return load_scene(self.name, {**self.fixed, **varied})

    def __str__(self) -> str:
        fixed = [f"{name}={value}" for name, value in self.fixed.items()]
        return ", ".join([f"scene {self.name}", *fixed])


def _as_text(value: Setting) -> str:
    """Return a setting as the command line takes it; 8.0 is 8, which a whole number may be."""
    whole = isinstance(value, float) and value.is_integer()
    return str(int(value)) if whole else str(value)


def checked_problem(given: Any) -> Problem:
    """Return a function of settings, or say what is wrong with it.

    Raises
    ------
    InvalidInputError, SceneNotFoundError
    """
    if isinstance(given, str):
        scene_settings(given)
        return RegisteredScene(given)
    if isinstance(given, Runnable | PiecewiseSystem) or not callable(given):
        raise InvalidInputError(
            "a study needs the name of a scene, or a function that takes settings by keyword and "
            f"returns {WANTED}; got {short(repr(given))}"
        )
    return given  # type: ignore[no-any-return]


def check_settings(problem: Problem, names: Iterable[str]) -> None:
    """Refuse fixed settings, and settings that a problem does not take.

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
    if varied := [name for name in names if name in fixed]:
        raise InvalidInputError(f"{varied[0]} cannot be fixed and varied at once")


def _settings_of(problem: Problem) -> list[str] | None:
    """Return the names of the settings of a problem; None for a problem that takes any setting."""
    if isinstance(problem, RegisteredScene):
        return list(scene_settings(problem.name))
    try:
        parameters = signature(problem).parameters.values()
    except (TypeError, ValueError):  # something built in
        return None
    if any(parameter.kind is Parameter.VAR_KEYWORD for parameter in parameters):
        return None
    return [parameter.name for parameter in parameters if parameter.kind in KINDS]


def described(thing: Any) -> str:
    """Return what a function or an object is called, the same in every process."""
    if isinstance(thing, partial):
        fixed = [*thing.args, *(f"{name}={value!r}" for name, value in thing.keywords.items())]
        return f"{described(thing.func)}({', '.join(map(_without_address, fixed))})"
    if hasattr(thing, "__qualname__"):
        return f"{thing.__module__}.{thing.__qualname__}"
    return _without_address(thing)


def _without_address(thing: object) -> str:
    return re.sub(r" at 0x[0-9a-f]+", "", str(thing))


def explored(made: Any) -> BranchGraph:
    """Return the graph of what a problem returned.

    Raises
    ------
    InvalidInputError
        If the problem has no graph, as a scene with two parameters has none.
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
    raise InvalidInputError(
        f"the function of a study must return {WANTED}; got {short(repr(made))}"
    )
