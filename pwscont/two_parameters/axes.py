"""The parts of a scene with two parameters that its answer shows."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol, final

from pwscont.system.system import SlicewiseLinearSystem
from pwscont.two_parameters.plane import Sector


@final
@dataclass(frozen=True, slots=True)
class Axes:
    """How the plane of alpha and mu is drawn.

    Attributes
    ----------
    alpha, mu : str
        Names of both parameters; alpha is drawn to the right, mu upwards.
    to_the_left : bool
        Whether alpha grows to the left, as in Figs. 4 to 6 of the paper.
    equal : bool
        Whether alpha and mu have the same unit of length in the picture.

    Examples
    --------
    >>> from pwscont import Axes
    >>> Axes(alpha="f_t", mu="F").mu
    'F'
    """

    alpha: str = "alpha"
    mu: str = "mu"
    to_the_left: bool = False
    equal: bool = False


class PlaneShown(Protocol):
    """The part of a :class:`pwscont.PlaneScene` that tables and pictures know."""

    @property
    def name(self) -> str:
        """The name by which the scene is run."""

    @property
    def title(self) -> str:
        """The title that a reader sees."""

    @property
    def family(self) -> Callable[[float], SlicewiseLinearSystem]:
        """The system for each value of mu."""

    @property
    def alphas(self) -> tuple[float, float]:
        """The window in alpha."""

    @property
    def mus(self) -> tuple[float, float]:
        """The window in mu."""

    @property
    def axes(self) -> Axes:
        """How the plane is drawn."""

    @property
    def sectors(self) -> Callable[[tuple[str, ...]], str] | None:
        """The names of the regions."""

    @property
    def lowest_fold(self) -> str:
        """The name of the smallest mu on all folds."""

    def sector_name(self, sector: Sector) -> str:
        """Return the name of a sector, empty where it has none."""
