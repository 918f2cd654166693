"""Exact maps of the number of solutions over two parameters."""

from __future__ import annotations

from pwscont.two_parameters.arrangement import shapely
from pwscont.two_parameters.exact_plane import ExactPlane
from pwscont.two_parameters.family import MakeSystem
from pwscont.two_parameters.window import Window


def plane(family: MakeSystem, alphas: tuple[float, float], mus: tuple[float, float]) -> ExactPlane:
    """Return the map of all solutions over a window of the plane of two parameters.

    Both parameters must enter affinely: in every cell H and the tests are affine in z, alpha and mu
    together, as with two components of a load. Then the solutions of a regular cell lie over a
    convex polygon of the plane. All of them are cut with each other; nothing is sampled.

    Parameters
    ----------
    family : callable
        mu -> :class:`~pwscont.PiecewiseLinearSystem`, all of one size and with the same tests; its
        parameter is alpha.
    alphas, mus : tuple of float
        The window, (lo, hi) for each parameter.

    Returns
    -------
    ExactPlane

    Raises
    ------
    InvalidInputError
        If a range is none or has too few digits, or a parameter does not enter affinely.
    InvalidSystemError
        If the family does not return systems, one of them is not what its class promises, or a
        singular cell has solutions by rounding only.
    MissingPackageError
        If Shapely is not installed.

    Examples
    --------
    >>> from pwscont import LCP, plane
    >>> def family(mu):
    ...     return LCP([[1, 2], [2, 1]], q=[mu, -1], d=[0, 1])
    >>> found = plane(family, (-2.0, 2.0), (-2.0, 2.0))
    >>> found.count(0.0, -1.0), found.guarantee
    (3, 'complete')
    """
    shapely()
    return ExactPlane.of(family, Window.of(alphas, mus))
