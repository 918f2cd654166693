"""The parts of a scene that its answer shows."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Protocol, final

from pwscont.basics.character import Character
from pwscont.scenes.body_picture import BodyPicture
from pwscont.scenes.drawn import What
from pwscont.system.system import PiecewiseSystem


@final
@dataclass(frozen=True, slots=True)
class Panel:
    """One diagram: a quantity against the parameter.

    Attributes
    ----------
    component : int, str or callable
        Index into z, name of an unknown or of a recorded quantity, or function of (z, alpha).
    mode : callable, optional
        Character -> the word that chooses the line style; default the system's description.
        Transitions that do not change this word, in other parts of the system, are not marked.
    title : str

    Examples
    --------
    >>> from pwscont import Panel
    >>> Panel("λ_t", title="node 1").component
    'λ_t'
    """

    component: What
    mode: Callable[[Character], str] | None = None
    title: str = ""


@final
@dataclass(frozen=True, slots=True)
class ParameterPath:
    """A companion picture: two quantities along the parameter, such as a load path.

    Attributes
    ----------
    curve : callable
        alpha -> (horizontal, vertical).
    labels : tuple of str
        Names of both axes.
    title : str

    Examples
    --------
    >>> from pwscont import ParameterPath
    >>> ParameterPath(lambda alpha: (0.25, alpha), ("f_ν", "f_t")).curve(1.0)
    (0.25, 1.0)
    """

    curve: Callable[[float], tuple[float, float]]
    labels: tuple[str, str]
    title: str = ""


class Shown(Protocol):
    """The part of a :class:`pwscont.Scene` that tables and pictures know."""

    @property
    def name(self) -> str:
        """The name by which the scene is run."""

    @property
    def title(self) -> str:
        """The title that a reader sees."""

    @property
    def system(self) -> PiecewiseSystem:
        """The system that is explored."""

    @property
    def parameter(self) -> str:
        """Name of alpha."""

    @property
    def orientations(self) -> tuple[int, ...]:
        """The first is the direction in which the table reads every branch."""

    @property
    def panels(self) -> tuple[Panel, ...]:
        """The branch diagrams."""

    @property
    def paths(self) -> tuple[ParameterPath, ...]:
        """The companion pictures."""

    @property
    def styles(self) -> Mapping[str, Any]:
        """The line style for each mode."""

    @property
    def body(self) -> BodyPicture | None:
        """How solutions look on a body; None without a body."""
