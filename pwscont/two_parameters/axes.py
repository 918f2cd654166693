"""The parts of a two-parameter scene that tables and pictures use."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol, final

from pwscont import SlicewiseLinearSystem
from pwscont.two_parameters.plane import Sector


@final
@dataclass(frozen=True, slots=True)
class Axes:
    """Names and directions of the axes of the plane of alpha and mu.

    Attributes
    ----------
    alpha, mu : str
        Names of the parameters; alpha is drawn to the right, mu upwards.
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
        """Names and directions of the axes."""

    @property
    def sectors(self) -> Callable[[tuple[str, ...]], str] | None:
        """The function from labels to the name of a region; None without names."""

    @property
    def lowest_fold(self) -> str:
        """The name of the smallest mu on all folds."""

    def sector_name(self, sector: Sector) -> str:
        """Return the name of a sector, empty without a name."""
