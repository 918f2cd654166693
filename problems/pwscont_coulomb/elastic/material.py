"""Isotropic linear elastic materials, in plane strain or plane stress."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import final

import numpy as np

from pwscont import InvalidInputError
from pwscont_coulomb.elastic.arguments import check_number


class Material(ABC):
    """An isotropic linear elastic material."""

    @property
    @abstractmethod
    def lame(self) -> tuple[float, float]:
        """Lamé's parameters (lambda, mu) of the material in space, force per area."""


@final
@dataclass(frozen=True, slots=True)
class Lame(Material):
    """A material by Lamé's parameters.

    Attributes
    ----------
    lam, mu : float
        Force per area; mu > 0 and lam + 2 mu / 3 > 0, so that every strain costs energy.

    Raises
    ------
    InvalidInputError
        If a parameter is not finite or breaks a bound above.

    Examples
    --------
    >>> from pwscont_coulomb.elastic import Lame
    >>> Lame(lam=1.0, mu=0.5).mu
    0.5
    """

    lam: float
    mu: float

    def __post_init__(self) -> None:
        check_number("lam", self.lam)
        check_number("mu", self.mu)
        if not (np.isfinite(self.lam) and np.isfinite(self.mu)):
            raise InvalidInputError(f"lam and mu must be finite, got {self.lam} and {self.mu}")
        if self.mu <= 0.0:
            raise InvalidInputError(f"mu must be positive, got {self.mu:.6g}")
        if self.lam + 2.0 * self.mu / 3.0 <= 0.0:
            raise InvalidInputError(
                f"lam must be above -2 mu / 3 = {-2.0 * self.mu / 3.0:.6g}, got {self.lam:.6g}"
            )

    @property
    def lame(self) -> tuple[float, float]:
        """Return (lam, mu)."""
        return self.lam, self.mu


@final
@dataclass(frozen=True, slots=True)
class Young(Material):
    """A material by Young's modulus and Poisson's ratio.

    Attributes
    ----------
    E : float
        Young's modulus, positive, force per area.
    nu : float
        Poisson's ratio, above -1 and below 1/2.

    Raises
    ------
    InvalidInputError
        If a parameter is not finite or breaks a bound above.

    Examples
    --------
    >>> from pwscont_coulomb.elastic import Young
    >>> Young(E=2.1e5, nu=0.3).nu
    0.3
    """

    E: float
    nu: float

    def __post_init__(self) -> None:
        check_number("E", self.E)
        check_number("nu", self.nu)
        if not (np.isfinite(self.E) and self.E > 0.0):
            raise InvalidInputError(f"E must be positive and finite, got {self.E}")
        if not -1.0 < self.nu < 0.5:
            raise InvalidInputError(
                f"nu must be above -1 and below 0.5, got {self.nu}; "
                "take a ratio such as 0.499 for a nearly incompressible material"
            )

    @property
    def lame(self) -> tuple[float, float]:
        """Return (lambda, mu)."""
        shear = self.E / (2.0 * (1.0 + self.nu))
        return 2.0 * shear * self.nu / (1.0 - 2.0 * self.nu), shear


class PlaneState(ABC):
    """How the third direction is held."""

    @abstractmethod
    def in_plane(self, lam: float, mu: float) -> tuple[float, float]:
        """Return (lambda, mu) of the relation sigma = lambda tr(e) + 2 mu e in the plane."""


@final
@dataclass(frozen=True, slots=True)
class PlaneStrain(PlaneState):
    """A long body: no strain across the plane.

    Examples
    --------
    >>> from pwscont_coulomb.elastic import PlaneStrain
    >>> PlaneStrain()  # the default of ElasticBody
    PlaneStrain()
    """

    def in_plane(self, lam: float, mu: float) -> tuple[float, float]:
        """Return (lambda, mu) unchanged."""
        return lam, mu


@final
@dataclass(frozen=True, slots=True)
class PlaneStress(PlaneState):
    """A thin plate: no stress across the plane.

    Examples
    --------
    >>> from pwscont_coulomb.elastic import PlaneStress
    >>> PlaneStress()  # ElasticBody(..., state=PlaneStress())
    PlaneStress()
    """

    def in_plane(self, lam: float, mu: float) -> tuple[float, float]:
        """Return (2 lambda mu / (lambda + 2 mu), mu)."""
        return 2.0 * lam * mu / (lam + 2.0 * mu), mu
