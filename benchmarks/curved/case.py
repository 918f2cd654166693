"""One case of the sweep: a system, where to begin, and what is true of it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from curved.truth import Component, Curve
from pwscont import Character, PiecewiseSystem
from pwscont.curve.stepper import Stepper

Scalar = Callable[[float, float, Sequence[bool]], float]


@dataclass
class Truth:
    """All components of interest.

    Attributes
    ----------
    components : list of Component
        The one through the start comes first.
    solutions : callable
        (component, alpha) -> list of (n,), or None where the truth cannot tell.
    has_specials : bool
        Whether the special points are known; not where a test nearly touches zero.
    """

    components: list[Component]
    solutions: Callable[[Component, float], list[np.ndarray] | None]
    has_specials: bool = True


@dataclass
class Case:
    """What is followed, and how.

    Attributes
    ----------
    parameters : dict
        All that was drawn.
    system : PiecewiseSystem
    interval : tuple of float
    truth : Truth
    start : (z, alpha) or None
        Where ``trace`` begins; ``explore`` is called where it is None.
    stepper : Stepper or None
    thin : list of (lo, hi)
        Values of alpha of cells so thin that a curve may pass them unseen: a statement, no fault.
    width : float or None
        Their width.
    """

    parameters: dict[str, Any]
    system: PiecewiseSystem
    interval: tuple[float, float]
    truth: Truth
    start: tuple[Any, float] | None = None
    stepper: Stepper | None = None
    thin: list[tuple[float, float]] = field(default_factory=list)
    width: float | None = None

    @property
    def has_folds(self) -> bool:
        """Whether a component turns smoothly."""
        return any(p.kind == "fold" for c in self.truth.components for p in c.specials)

    def by(self, stepper: Stepper, name: str) -> Case:
        """Return the same case with a stepper."""
        return replace(self, stepper=stepper, parameters={**self.parameters, "stepper": name})


class Planar(PiecewiseSystem):
    """One equation h(z, alpha, signs) = 0 with tests k(z, alpha)."""

    size = 1

    def __init__(self, h: Scalar, tests: Callable[[float, float], Sequence[float]]) -> None:
        self.h, self.k = h, tests

    def test_functions(self, z: np.ndarray, alpha: float) -> np.ndarray:
        return np.array(self.k(float(z[0]), alpha), dtype=float)

    def residual(self, z: np.ndarray, alpha: float, character: Character) -> np.ndarray:
        return np.array([self.h(float(z[0]), alpha, character.signs)])


class Differentiated(Planar):
    """The same with derivatives: by complex steps, exact to rounding."""

    def jacobian(self, z: np.ndarray, alpha: float, character: Character) -> np.ndarray:
        s, x = character.signs, float(z[0])
        by_z = np.imag(self.h(x + STEP * 1j, alpha, s)) / STEP  # type: ignore[arg-type]
        by_alpha = np.imag(self.h(x, alpha + STEP * 1j, s)) / STEP  # type: ignore[arg-type]
        return np.array([[by_z, by_alpha]])

    def test_jacobian(self, z: np.ndarray, alpha: float) -> np.ndarray:
        x = float(z[0])
        by_z = np.imag(np.array(self.k(x + STEP * 1j, alpha), dtype=complex)) / STEP  # type: ignore[arg-type]
        by_alpha = np.imag(np.array(self.k(x, alpha + STEP * 1j), dtype=complex)) / STEP  # type: ignore[arg-type]
        return np.column_stack([by_z, by_alpha])


#: Complex steps have no cancellation: so small that their square is nothing.
STEP = 1e-40


class Turned(PiecewiseSystem):
    """A planar system with unknowns added and all of them mixed: z = Q (y, w), w_k = bend(y, k).

    Parameters
    ----------
    planar : PiecewiseSystem
        Of one unknown y.
    Q, B : ndarray, shape (n, n)
        Mix unknowns and equations.
    """

    def __init__(self, planar: PiecewiseSystem, Q: np.ndarray, B: np.ndarray) -> None:
        self.planar, self.Q, self.B, self.size = planar, Q, B, len(Q)

    def test_functions(self, z: np.ndarray, alpha: float) -> np.ndarray:
        return self.planar.test_functions((self.Q.T @ z)[:1], alpha)

    def residual(self, z: np.ndarray, alpha: float, character: Character) -> np.ndarray:
        y = self.Q.T @ z
        first = self.planar.residual(y[:1], alpha, character)
        return self.B @ np.concatenate([first, y[1:] - self.bend(y[0])])

    def bend(self, y: float) -> np.ndarray:
        """Return the added unknowns."""
        return np.sin(y + np.arange(1, self.size))

    def lifted(self, y: np.ndarray) -> np.ndarray:
        """Return z."""
        return self.Q @ np.concatenate([y, self.bend(float(y[0]))])


def traced(
    parameters: dict[str, Any],
    system: PiecewiseSystem,
    curve: Curve,
    interval: tuple[float, float],
    rng: np.random.Generator,
    size: int = 1,
    everything: bool = False,
    at: float | None = None,
    **more: Any,
) -> Case:
    """Return the case that traces one component of a curve, or explores all of them.

    Parameters
    ----------
    size : int
        Number of unknowns to have; more than one turns a planar system.
    everything : bool
        Whether to explore.
    at : float, optional
        Curve parameter of the start; default random.
    """
    components = curve.components(interval)
    z = curve.z
    if size > 1:
        Q = np.linalg.qr(rng.normal(size=(size, size)))[0]
        B = rng.normal(size=(size, size)) + 2.0 * np.eye(size)
        turned = system = Turned(system, Q, B)
        z = lambda s: turned.lifted(curve.z(s))  # noqa: E731
    length = interval[1] - interval[0]
    mapped = Curve(curve.alpha, z, curve.samples, noise=curve.noise)
    solutions = lambda c, alpha: mapped.solutions(c, alpha, length)  # noqa: E731
    drawn = {**parameters, "interval": interval, "size": size}
    start = None
    if not everything:
        first, s = _somewhere(components, rng, at)
        components = [first]
        start = (z(s), min(max(float(curve.alpha(np.array([s]))[0]), interval[0]), interval[1]))
        drawn["start"] = start
    truth = Truth(components, solutions, not curve.touches)
    return Case(drawn, system, interval, truth, start, **more)


def _somewhere(
    components: list[Component], rng: np.random.Generator, at: float | None
) -> tuple[Component, float]:
    """Return a component and the parameter of a point on it."""
    if at is not None:
        return next((c, at) for c in components for x in c.stretches if x.a <= at <= x.b)
    chosen = components[int(rng.integers(len(components)))]
    stretch = chosen.stretches[int(rng.integers(len(chosen.stretches)))]
    return chosen, float(stretch.a + rng.uniform(0.05, 0.95) * (stretch.b - stretch.a))
