"""Load paths with derivatives."""

from __future__ import annotations

import math
from typing import Any, final

import numpy as np

from pwscont.extending import Array, finite_array, named
from pwscont_coulomb.fixed import Fixed


@final
class AffineLoad(Fixed):
    """The load path f(alpha) = f0 + alpha f1.

    Parameters
    ----------
    f0, f1 : array_like, shape (n,)
        Load at alpha = 0 and load per unit of alpha.

    Raises
    ------
    InvalidInputError
        If ``f0`` and ``f1`` are no finite arrays of one shape.

    Examples
    --------
    >>> from pwscont_coulomb import AffineLoad
    >>> AffineLoad([0.25, 0.0], [0.0, 1.0])(2.0)
    array([0.25, 2.  ])
    """

    _given = frozenset({"f0", "f1"})

    def __init__(self, f0: Any, f1: Any) -> None:
        self.f0 = finite_array("f0", f0)
        self.f1 = finite_array("f1", f1, self.f0.shape)

    def __repr__(self) -> str:
        return named(self, f"f0 + alpha f1, n = {len(self.f0)}")

    def __call__(self, alpha: float) -> Array:
        """Return f(alpha), shape (n,)."""
        return self.f0 + alpha * self.f1

    def derivative(self, alpha: float) -> Array:
        """Return df/dalpha, shape (n,), not to be written to."""
        return self.f1


@final
class HarmonicLoad(Fixed):
    """The cyclic load path f(alpha) = f0 + cos(w alpha + phase) fc + sin(w alpha + phase) fs.

    Parameters
    ----------
    f0, fc, fs : array_like, shape (n,)
        Load in the middle, and the amplitudes of cosine and sine.
    w : float, optional
        Angle per unit of alpha; default 1.
    phase : float, optional
        Angle at alpha = 0; default 0.

    Raises
    ------
    InvalidInputError
        If ``f0``, ``fc`` and ``fs`` are no finite arrays of one shape, or w or phase is no number.

    Examples
    --------
    >>> from pwscont_coulomb import HarmonicLoad
    >>> HarmonicLoad([0.25, 0.0], [0.0, 1.0], [1.0, 0.0])(0.0)
    array([0.25, 1.  ])
    """

    _given = frozenset({"_parts", "w", "phase"})

    def __init__(self, f0: Any, fc: Any, fs: Any, w: float = 1.0, phase: float = 0.0) -> None:
        f0 = finite_array("f0", f0)
        fc, fs = finite_array("fc", fc, f0.shape), finite_array("fs", fs, f0.shape)
        #: f0, fc and fs side by side, shape (n, 3), so that a load is a single product.
        self._parts = np.stack([f0, fc, fs], axis=-1)
        self.w = float(finite_array("w", w, ()))
        self.phase = float(finite_array("phase", phase, ()))

    def __repr__(self) -> str:
        return named(self, f"angle {self.w:g} alpha + {self.phase:g}, n = {len(self.f0)}")

    @property
    def f0(self) -> Array:
        """Load in the middle, shape (n,)."""
        f0: Array = self._parts.T[0]
        return f0

    @property
    def fc(self) -> Array:
        """Amplitude of the cosine, shape (n,)."""
        fc: Array = self._parts.T[1]
        return fc

    @property
    def fs(self) -> Array:
        """Amplitude of the sine, shape (n,)."""
        fs: Array = self._parts.T[2]
        return fs

    def __call__(self, alpha: float) -> Array:
        """Return f(alpha), shape (n,)."""
        angle = self.w * alpha + self.phase
        load: Array = self._parts.dot(np.array((1.0, math.cos(angle), math.sin(angle))))
        return load

    def derivative(self, alpha: float) -> Array:
        """Return df/dalpha, shape (n,)."""
        angle = self.w * alpha + self.phase
        rate = np.array((0.0, -self.w * math.sin(angle), self.w * math.cos(angle)))
        change: Array = self._parts.dot(rate)
        return change
