"""Families of curves in the plane (z, alpha), each in closed form, some lifted to more unknowns."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from curved.case import Case, Differentiated, Planar, traced
from curved.truth import EPS, Curve

Rng = np.random.Generator
Function = Callable[[Any], Any]


def log_uniform(rng: Rng, lo: float, hi: float) -> float:
    """Return a number whose logarithm is uniformly distributed."""
    return float(np.exp(rng.uniform(np.log(lo), np.log(hi))))


def system_of(rng: Rng, h: Any, tests: Any) -> Planar:
    """Return the system, every other time with derivatives of its own."""
    return (Planar, Differentiated)[int(rng.integers(2))](h, tests)


def size_of(rng: Rng) -> int:
    """Return how many unknowns: mostly one."""
    return int(rng.choice([1, 1, 1, 2, 4]))


def graph_of(f: Function, interval: tuple[float, float], frequency: float, **more: Any) -> Curve:
    """Return the curve z = f(alpha), with samples for this highest frequency."""
    lo, hi = interval
    count = int(200 + 60 * frequency * (hi - lo))
    one = lambda s: np.array([float(np.real(f(s)))])  # noqa: E731
    return Curve(lambda s: s, one, np.linspace(lo, hi, count), **more)


# -- functions of alpha ------------------------------------------------------------------------


def oscillation(rng: Rng) -> tuple[Function, float, float, dict[str, Any]]:
    """Return f, its largest frequency on (0, 6), its amplitude, and what was drawn."""
    a, w, phase = log_uniform(rng, 0.05, 8), log_uniform(rng, 0.3, 20), rng.uniform(0, 6)
    kind = str(rng.choice(["sine", "sine", "two sines", "chirp"]))
    drawn = {"kind": kind, "a": a, "w": w, "phase": phase}
    if kind == "sine":
        return lambda x: a * np.sin(w * x + phase), w, a, drawn
    if kind == "chirp":
        w = log_uniform(rng, 0.1, 2.5)
        return lambda x: a * np.sin(w * x**2 + phase), 12 * w, a, {**drawn, "w": w}
    b, v = a * log_uniform(rng, 0.02, 1), log_uniform(rng, 0.3, 30)
    f = lambda x: a * np.sin(w * x + phase) + b * np.sin(v * x)  # noqa: E731
    return f, max(w, v), a + b, {**drawn, "b": b, "v": v}


def waves(rng: Rng) -> Case:
    """Draw z - c max(z - h, 0) = f(alpha): one solution; no kink where c = 0."""
    interval = (0.0, 6.0)
    f, frequency, amplitude, drawn = oscillation(rng)
    h = amplitude * rng.choice([rng.uniform(-1, 1), 1 - log_uniform(rng, 1e-6, 1e-1)])
    c = float(rng.choice([0.0, rng.uniform(-3, 0.8)]))
    above = lambda y: h + (y - h) / (1 - c) if np.real(y) > h else y  # noqa: E731
    curve = graph_of(lambda x: above(f(x)), interval, frequency, tests=[lambda s: f(s) - h])
    system = system_of(
        rng,
        lambda z, alpha, signs: z - (c * (z - h) if signs[0] else 0.0) - f(alpha),
        lambda z, alpha: [z - h],
    )
    drawn |= {"h": h, "c": c}
    everything = bool(rng.random() < 0.25)
    return traced(drawn, system, curve, interval, rng, size_of(rng), everything)


def sheets(rng: Rng) -> Case:
    """Draw sin(k (z - f(alpha))) = 0: copies pi / k apart; one of them is followed."""
    interval, k = (0.0, 6.0), log_uniform(rng, 3, 300)
    f, frequency, amplitude, drawn = oscillation(rng)
    h = float(rng.uniform(-1.2, 1.2)) * amplitude
    curve = graph_of(f, interval, frequency, tests=[lambda s: f(s) - h])
    system = system_of(
        rng,
        lambda z, alpha, signs: np.sin(k * (z - f(alpha))),
        lambda z, alpha: [z - h],
    )
    return traced({**drawn, "k": k, "h": h}, system, curve, interval, rng, size_of(rng))


def near_sheets(rng: Rng) -> Case:
    """(z - f)(z - f - d) = 0, d from 1e-1 to 1e-4: two sheets; one of them is followed."""
    interval, d = (0.0, 6.0), log_uniform(rng, 1e-4, 1e-1) * rng.choice([-1, 1])
    f, frequency, amplitude, drawn = oscillation(rng)
    h = float(rng.uniform(-1.2, 1.2)) * amplitude
    curve = graph_of(f, interval, frequency, tests=[lambda s: f(s) - h])
    system = system_of(
        rng,
        lambda z, alpha, signs: (z - f(alpha)) * (z - f(alpha) - d),
        lambda z, alpha: [z - h],
    )
    return traced({**drawn, "d": d, "h": h}, system, curve, interval, rng, size_of(rng))


# -- curves that turn --------------------------------------------------------------------------


def arches(rng: Rng) -> Case:
    """Draw alpha = c (z - r_1) ... (z - r_k): up to six smooth folds, a test at a height."""
    degree = int(rng.integers(2, 8))
    width = log_uniform(rng, 0.3, 5)
    roots = np.sort(rng.uniform(0, width, degree)) - rng.uniform(0, width)
    inner = np.linspace(roots[0], roots[-1], 400)
    c = (
        log_uniform(rng, 0.2, 5)
        / np.abs(np.poly(roots) @ inner ** np.arange(degree, -1, -1)[:, None]).max()
    )
    p = lambda z: c * np.prod([z - r for r in roots], axis=0)  # noqa: E731
    extremes = np.abs(p(inner)).max() * rng.uniform(0.2, 2, 2)
    interval = (-float(extremes[0]), float(extremes[1]))
    reach = width
    while min(abs(p(roots[0] - reach)), abs(p(roots[-1] + reach))) < max(extremes):
        reach *= 1.5
    h = float(rng.uniform(roots[0], roots[-1]))
    samples = np.linspace(roots[0] - reach, roots[-1] + reach, 6000)
    apart = np.sort([*np.roots(np.polyder(np.poly(roots))).real, h])
    samples = np.union1d(samples, 0.5 * (apart[1:] + apart[:-1]))  # between a fold and the test
    curve = Curve(p, lambda s: np.array([s]), samples, tests=[lambda s: s - h])
    system = system_of(rng, lambda z, alpha, signs: p(z) - alpha, lambda z, alpha: [z - h])
    drawn = {"roots": roots.tolist(), "c": c, "h": h}
    return traced(drawn, system, curve, interval, rng, size_of(rng))


def ellipses(rng: Rng) -> Case:
    """Draw a turned ellipse, half axes from 0.01 to 10: a closed loop, perhaps cut."""
    A, B, turn = log_uniform(rng, 1e-2, 10), log_uniform(rng, 1e-2, 10), rng.uniform(0, np.pi)
    cos, sin, center = np.cos(turn), np.sin(turn), rng.normal(size=2)
    alpha = lambda s: center[1] + A * np.cos(s) * cos - B * np.sin(s) * sin  # noqa: E731
    z = lambda s: np.array([center[0] + A * np.cos(s) * sin + B * np.sin(s) * cos])  # noqa: E731
    widest = float(np.hypot(A * cos, B * sin))
    reach = widest * rng.uniform(0.5, 3, 2)
    interval = (float(center[1] - reach[0]), float(center[1] + reach[1]))
    h = float(center[0] + rng.uniform(-1.2, 1.2) * np.hypot(A * sin, B * cos))

    def equation(x: Any, a: Any, signs: Any) -> Any:
        u, v = a - center[1], x - center[0]
        return ((u * cos + v * sin) / A) ** 2 + ((v * cos - u * sin) / B) ** 2 - 1.0

    first = rng.uniform(0, 1)
    samples = np.linspace(first, first + 2 * np.pi, 2001)
    tests = [lambda s: z(s)[0] - h]
    curve = Curve(alpha, z, samples, tests, closed=True, noise=EPS * (A + B) * max(A / B, B / A))
    system = system_of(rng, equation, lambda x, a: [x - h])
    drawn = {"A": A, "B": B, "turn": turn, "center": center.tolist(), "h": h}
    return traced(drawn, system, curve, interval, rng, size_of(rng))


def spirals(rng: Rng) -> Case:
    """Draw z cos(r / c) = alpha sin(r / c), r^2 = z^2 + alpha^2: two spiral arms, pi c apart."""
    c, radius = log_uniform(rng, 0.03, 0.6), rng.uniform(0.5, 2)
    alpha = lambda s: s * np.cos(np.abs(s) / c)  # noqa: E731
    z = lambda s: np.array([float(s * np.sin(np.abs(s) / c))])  # noqa: E731
    reach = radius + 2 * np.pi * c
    samples = np.linspace(-reach, reach, int(400 + 120 * reach / c) | 1)
    h = float(rng.uniform(-1.1, 1.1)) * radius
    curve = Curve(alpha, z, samples, [lambda s: s * np.sin(np.abs(s) / c) - h])

    def equation(x: Any, a: Any, signs: Any) -> Any:
        r = np.sqrt(x * x + a * a) / c
        return x * np.cos(r) - a * np.sin(r)

    system = system_of(rng, equation, lambda x, a: [x - h])
    drawn = {"c": c, "radius": radius, "h": h}
    interval = (-radius, radius * rng.uniform(0.5, 1))
    return traced(drawn, system, curve, interval, rng, size_of(rng), at=0.1 * c)


def kinks(rng: Rng) -> Case:
    """Draw alpha = cubics or quintics of z, joined continuously at up to six heights."""
    count, order = int(rng.integers(1, 7)), int(rng.choice([1, 3, 5]))
    knots = np.cumsum(rng.choice([1.0, 0.2, 0.02], count) * rng.uniform(0.5, 1.5, count))
    slopes = rng.normal(size=(count + 1, order)) / np.arange(1, order + 1) ** 2
    values = np.zeros(count + 1)

    def selection(k: int, z: Any) -> Any:
        """Return the k-th polynomial, about the knot at its lower end."""
        u = z - knots[max(k - 1, 0)]
        return values[k] + sum(a * u ** (i + 1) for i, a in enumerate(slopes[k]))

    for side in (0, -1):
        slopes[side, 0] += np.copysign(0.2, slopes[side, 0])
    slopes[0, 1:] = slopes[-1, 1:] = 0.0  # straight outside, so that the curve ends
    for k in range(1, count + 1):
        values[k] = selection(k - 1, knots[k - 1])
    at = lambda z: selection(int(np.searchsorted(knots, z, side="right")), z)  # noqa: E731
    alpha = lambda s: np.array([at(x) for x in s])  # noqa: E731
    inner = alpha(np.linspace(knots[0] - 0.5, knots[-1] + 0.5, 500))
    middle, half = 0.5 * (inner.max() + inner.min()), 0.5 * np.ptp(inner) + 0.01
    interval = tuple(float(x) for x in middle + half * rng.uniform(0.4, 1.3, 2) * [-1, 1])
    reach = 3 * half / min(abs(slopes[0, 0]), abs(slopes[-1, 0])) + 1.0
    near = np.linspace(knots[0], knots[-1], 3000)
    far = [knots[0] - reach, knots[-1] + reach]
    samples = np.unique(np.concatenate([near, knots, np.linspace(*far, 200)]))
    tests = [lambda s, k=k: s - k for k in knots]
    curve = Curve(alpha, lambda s: np.array([s]), samples, tests)
    system = system_of(
        rng,
        lambda z, a, signs: selection(int(sum(signs)), z) - a,
        lambda z, a: [z - k for k in knots],
    )
    drawn = {"knots": knots.tolist(), "slopes": slopes.tolist()}
    return traced(drawn, system, curve, interval, rng, size_of(rng))  # type: ignore[arg-type]


# -- branches that saturate --------------------------------------------------------------------

FLAT: dict[str, tuple[Function, float, float]] = {
    "tanh z": (np.tanh, -16.0, 16.0),
    "logistic z": (lambda z: 1 / (1 + np.exp(-z)), -16.0, 30.0),
    "z^2 exp(-z)": (lambda z: z * z * np.exp(-z), -3.0, 35.0),
    "z / (1 + z^2)": (lambda z: z / (1 + z * z), -1e5, 1e5),
    "exp(-|z|) sin 5z": (lambda z: np.exp(-np.sqrt(z * z)) * np.sin(5 * z), -36.0, 36.0),
}


def flat(rng: Rng) -> Case:
    """Draw alpha = a g(b z) where g saturates or decays: no fold is invented, nothing hangs."""
    name = str(rng.choice(list(FLAT)))
    g, first, last = FLAT[name]
    a, b = log_uniform(rng, 0.1, 10), log_uniform(rng, 0.2, 5)
    alpha = lambda s: a * g(b * s)  # noqa: E731
    peak = a * float(np.abs(g(np.linspace(0, 5, 999))).max())
    interval = tuple(float(x) for x in peak * rng.uniform(0.3, 1.5, 2) * [-1, 1])
    half = np.geomspace(1e-8, 1.0, 6000)
    samples = np.unique(np.concatenate([first * half, [0.0], last * half])) / b
    if name.startswith("exp"):
        samples = np.linspace(first, last, 12001) / b

    def equation(z: Any, x: Any, signs: Any) -> Any:
        if name.startswith("exp"):
            y = b * z if signs[0] else -b * z
            return a * np.exp(-y) * np.sin(5 * b * z) - x
        return alpha(z) - x

    h = 0.0 if name.startswith("exp") else 0.3 / b
    tries = [x / b for x in (0.1, 1.0, -1.0, -3.0, -8.0)]
    at = next(x for x in tries if 0.6 * interval[0] < alpha(x) < 0.6 * interval[1])
    curve = Curve(alpha, lambda s: np.array([s]), samples, [lambda s: s - h])
    system = system_of(rng, equation, lambda z, x: [z - h])
    drawn = {"g": name, "a": a, "b": b}
    return traced(drawn, system, curve, interval, rng, at=at)  # type: ignore[arg-type]
