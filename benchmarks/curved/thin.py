"""Thin cells: how narrow a cell may be before a curve passes it unseen."""

from __future__ import annotations

from typing import Any

import numpy as np

from curved.case import Case, traced
from curved.planar import Rng, log_uniform, size_of, system_of
from curved.truth import Curve


def bumps(rng: Rng) -> Case:
    """Draw z = alpha^3 + m max(bump, 0): one to three tests that rise above zero for a short while.

    What is missed within a bump is a statement; all else must be right.
    """
    interval, count = (-1.0, 1.0), int(rng.integers(1, 4))
    width, m = log_uniform(rng, 1e-5, 1e-1), float(rng.uniform(-4, 4))
    first = float(rng.uniform(-0.8, 0.5))
    centers = first + width * rng.uniform(2.5, 8) * np.arange(count)
    centers = centers[centers < 0.9]
    bump = lambda x, c: np.exp(-(((x - c) / width) ** 2)) - 0.5  # noqa: E731
    half = width * np.sqrt(np.log(2))

    def f(x: Any, signs: Any) -> Any:
        return x**3 + sum(m * bump(x, c) for c, on in zip(centers, signs, strict=True) if on)

    near = [c + half * np.linspace(-3, 3, 61) for c in centers]
    samples = np.unique(np.clip(np.concatenate([np.linspace(*interval, 201), *near]), *interval))
    at = lambda s: np.array([float(f(s, [bump(s, c) >= 0 for c in centers]))])  # noqa: E731
    tests = [lambda s, c=c: bump(s, c) for c in centers]
    curve = Curve(lambda s: s, at, samples, tests)
    system = system_of(
        rng,
        lambda z, alpha, signs: z - f(alpha, signs),
        lambda z, alpha: [bump(alpha, c) for c in centers],
    )
    drawn = {"width": width, "m": m, "centers": centers.tolist()}
    thin = [(float(c - half), float(c + half)) for c in centers]
    everything = bool(rng.random() < 0.5)
    return traced(
        drawn, system, curve, interval, rng, size_of(rng), everything, thin=thin, width=2 * half
    )


def slabs(rng: Rng) -> Case:
    """Draw alpha = g(z) + sum of c (max(z - h, 0) - max(z - h - w, 0)): crossed, so never missed.

    One to three cells in a row, from 1e-1 down to 1e-9 wide, crossed once by a curve in z.
    """
    count, w = int(rng.integers(1, 4)), log_uniform(rng, 1e-9, 1e-1)
    heights = 0.5 + 2 * w * np.arange(count) * rng.uniform(0.6, 3) + rng.uniform(0, 0.5)
    c = rng.choice([-1, 1], count) * np.array([log_uniform(rng, 1e-1, 1e3) for _ in heights])
    c = np.where(w * np.abs(c) > 0.5, np.sign(c) * 0.5 / w, c)
    a, v = rng.uniform(0, 0.8), log_uniform(rng, 0.5, 6)
    g = lambda z: z + a / v * np.sin(v * z)  # noqa: E731

    def total(z: Any, signs: Any) -> Any:
        parts = (
            k * ((z - low if signs[2 * i] else 0.0) - (z - top if signs[2 * i + 1] else 0.0))
            for i, (low, top, k) in enumerate(zip(heights, heights + w, c, strict=True))
        )
        return g(z) + sum(parts)

    edges = np.column_stack([heights, heights + w]).ravel().tolist()
    alpha = lambda s: np.array([total(x, [x >= e for e in edges]) for x in s])  # noqa: E731
    near = np.concatenate([h + w * np.linspace(-1, 2, 61) for h in heights])
    samples = np.unique(np.concatenate([np.linspace(-3, 6, 1501), near, edges]))
    tests = [lambda s, e=e: s - e for e in edges]
    noise = 1e-16 * (1 + np.abs(c).max())
    curve = Curve(alpha, lambda s: np.array([s]), samples, tests, noise=noise)
    system = system_of(rng, lambda z, x, s: total(z, s) - x, lambda z, x: [z - e for e in edges])
    drawn = {"w": w, "heights": heights.tolist(), "c": c.tolist(), "a": a, "v": v}
    return traced(drawn, system, curve, (-1.0, 3.0), rng, size_of(rng), at=0.0)


def stripes(rng: Rng) -> Case:
    """Draw u - k clip(u, 0, w) = q(alpha) with u = z - m alpha - h, k < 1: a stripe."""
    interval, w, k = (0.0, 6.0), log_uniform(rng, 1e-6, 1e-1), float(rng.uniform(-20, 0.9))
    m, h, v = rng.normal(), rng.normal(), log_uniform(rng, 0.5, 5)
    a, slope = log_uniform(rng, 0.05, 2), rng.normal()
    f = lambda x: a * np.sin(v * x) + slope * x - slope * 3  # noqa: E731
    top = w * (1 - k)

    def solved(q: Any) -> Any:
        return np.where(q < 0, q, np.where(q < top, q / (1 - k), q + k * w))

    samples = np.linspace(*interval, 40001)
    curve = Curve(
        lambda s: s,
        lambda s: np.array([float(solved(f(s))) + m * s + h]),
        samples,
        [f, lambda s: f(s) - top],
    )
    u = lambda z, x: z - m * x - h  # noqa: E731
    system = system_of(
        rng,
        lambda z, x, s: (
            u(z, x) - k * ((u(z, x) if s[0] else 0) - (u(z, x) - w if s[1] else 0)) - f(x)
        ),
        lambda z, x: [u(z, x), u(z, x) - w],
    )
    drawn = {"w": w, "k": k, "m": m, "h": h, "v": v, "a": a, "slope": slope}
    return traced(drawn, system, curve, interval, rng, size_of(rng), bool(rng.random() < 0.3))
