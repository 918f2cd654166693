"""Scenes with two parameters: the plane of both, cut into regions by the loci of transitions."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from importlib.util import find_spec
from typing import final

from pwscont.basics.errors import InvalidInputError, MissingPackageError
from pwscont.continuation.plan import Report, silent
from pwscont.scenes.answer import Answer, Runnable
from pwscont.system.system import SlicewiseLinearSystem
from pwscont.two_parameters.affine import is_affine
from pwscont.two_parameters.answer import PlaneAnswer
from pwscont.two_parameters.axes import Axes
from pwscont.two_parameters.loci_plane import LociPlane
from pwscont.two_parameters.maps import plane
from pwscont.two_parameters.plane import Plane, Sector
from pwscont.two_parameters.window import Window


@final
@dataclass(frozen=True, slots=True, repr=False)
class PlaneScene(Runnable):
    """A family of systems, and the window of the plane of its two parameters to look at.

    Offered by an entry point of the group ``pwscont.scenes``, as a :class:`~pwscont.Scene` is.

    Attributes
    ----------
    name, title : str
    family : callable
        mu -> :class:`~pwscont.SlicewiseLinearSystem`, all of one size and with the same tests.
    alphas, mus : tuple of float
        The window.
    levels : tuple of float
        Values of mu; where loci are followed, those that meet these values are.
    axes : Axes
    sectors : callable, optional
        Labels of the solutions in a region -> its name; default none.
    lowest_fold : str
        Name of the smallest mu on all folds; default: not reported.

    Examples
    --------
    >>> from pwscont import Axes, LCP, PlaneScene
    >>> def family(mu):
    ...     return LCP([[1, 2], [2, 1]], q=[mu, -1], d=[0, 1])
    >>> scene = PlaneScene("plane", "two loads", family, (-2.0, 2.0), (-2.0, 2.0), (0.0,), Axes())
    >>> sorted(sector.count for sector in scene.run().sectors)
    [1, 1, 1, 3]
    """

    name: str
    title: str
    family: Callable[[float], SlicewiseLinearSystem]
    alphas: tuple[float, float]
    mus: tuple[float, float]
    levels: tuple[float, ...]
    axes: Axes = field(default_factory=Axes)
    sectors: Callable[[tuple[str, ...]], str] | None = None
    lowest_fold: str = ""

    parameter: str = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "parameter", self.axes.mu)

    def run(self, report: Report = silent) -> Plane:
        """Return the exact map where both parameters enter affinely, else the plane of the loci.

        The exact map needs Shapely; without it loci are followed as well, and a remark says so.
        """
        if not self.is_affine:
            return self._by_loci(report)
        try:
            return plane(self.family, self.alphas, self.mus)
        except MissingPackageError as missing:
            return replace(self._by_loci(report), remarks=(f"Loci were followed: {missing}",))

    @property
    def is_affine(self) -> bool:
        """Whether both parameters enter the systems affinely."""
        return is_affine(self.family, Window.of(self.alphas, self.mus))

    def _by_loci(self, report: Report) -> LociPlane:
        """Follow the loci and list the solutions of every region between them."""
        return LociPlane.between(
            self.family, self.alphas, self.mus, self.levels, parameter=self.axes.mu, report=report
        )

    def sector_name(self, sector: Sector) -> str:
        """Return the scene's name of a sector, empty where it gives none."""
        return self.sectors(sector.labels) if self.sectors else ""

    def values(self, wanted: Sequence[float] | None) -> tuple[float, ...]:
        """Return nothing: solutions are listed for every region.

        Raises
        ------
        InvalidInputError
            If values were asked for: one number is no point of the plane.
        """
        if wanted is not None:
            raise InvalidInputError(
                f"--at needs a scene with one parameter, and {self.name} has two "
                f"({self.axes.alpha} and {self.axes.mu}); run it without --at: it lists the "
                "solutions of every region"
            )
        return ()

    def plan(self) -> dict[str, str]:
        """Return the parts of the run in words."""
        if self.is_affine and find_spec("shapely"):
            return {
                "cut": "the polygons over which cells have their solutions, with each other",
                "solved": "every cell, once for the whole plane; no point is sampled",
            }
        return {
            "followed": "loci of transitions, between which modes stay what they are",
            "solved": "one point of each region, in which the number of solutions is one",
        }

    def solve(self, at: Sequence[float], report: Report) -> Answer:
        """Run the scene."""
        return PlaneAnswer(self, self.run(report))
