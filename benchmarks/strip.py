"""A strip of elastic material with a rounded, slightly rough lower side, condensed to that side.

Plane strain, bilinear squares, the upper side moved as a whole: first pressed down, then also
sheared. The interior is eliminated with numpy alone. Whatever p, the strip is four
times as long as it is thick, so that all sizes are one problem.
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from pwscont_coulomb import AffineLoad, ContactBody

POISSON = 0.3
ROOT = 1.0 / np.sqrt(3.0)


def square() -> np.ndarray:
    """Return the stiffness of a bilinear square with E = 1, shape (8, 8), corner by corner."""
    a = 1.0 / ((1.0 + POISSON) * (1.0 - 2.0 * POISSON))
    D = a * np.array(
        [
            [1.0 - POISSON, POISSON, 0.0],
            [POISSON, 1.0 - POISSON, 0.0],
            [0.0, 0.0, 0.5 - POISSON],
        ]
    )
    K = np.zeros((8, 8))
    for x in (-ROOT, ROOT):
        for y in (-ROOT, ROOT):
            dx = 0.5 * np.array([y - 1.0, 1.0 - y, 1.0 + y, -1.0 - y])
            dy = 0.5 * np.array([x - 1.0, -1.0 - x, 1.0 + x, 1.0 - x])
            B = np.zeros((3, 8))
            B[0, 0::2], B[1, 1::2], B[2, 0::2], B[2, 1::2] = dx, dy, dy, dx
            K += 0.25 * B.T @ D @ B
    return K


def layer(p: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the blocks of one layer of squares: lower, coupling of lower with upper, upper."""
    blocks = [np.zeros((2 * p, 2 * p)) for _ in range(3)]
    K = square()
    for e in range(p - 1):
        low = [2 * e, 2 * e + 1, 2 * e + 2, 2 * e + 3]
        up = [2 * e + 2, 2 * e + 3, 2 * e, 2 * e + 1]
        blocks[0][np.ix_(low, low)] += K[:4, :4]
        blocks[1][np.ix_(low, up)] += K[:4, 4:]
        blocks[2][np.ix_(up, up)] += K[4:, 4:]
    return blocks[0], blocks[1], blocks[2]


def condensed(p: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the stiffness of the lower side, and its coupling with the upper side.

    A slab and its like make a slab twice as thick, so that thickness costs only its logarithm.
    """
    lower, across, upper = layer(p)
    for _ in range(max(1, round(np.log2(p / 4.0)))):
        solved = np.linalg.solve(upper + lower, np.hstack([across.T, across]))
        first, second = solved[:, : 2 * p], solved[:, 2 * p :]
        lower, across, upper = (
            lower - across @ first,
            -across @ second,
            upper - across.T @ second,
        )
    return 0.5 * (lower + lower.T), across


def strip(p: int, seed: int = 0) -> tuple[ContactBody, AffineLoad]:
    """Return the body and its load for alpha from 0 to 1."""
    stiffness, coupling = condensed(p)
    along = np.concatenate([np.arange(1, 2 * p, 2), np.arange(0, 2 * p, 2)])  # normals first
    A = stiffness[np.ix_(along, along)]
    x = np.linspace(-1.0, 1.0, p)
    rough = np.random.default_rng(seed).normal(size=p)
    gap = 0.5 * x**2 * p / 50.0 + 1e-3 * p / 50.0 * np.abs(rough)
    # normal displacement is positive downwards, towards the obstacle
    A[:p, p:] *= -1.0
    A[p:, :p] *= -1.0
    down, side = (np.tile(v, p) for v in ([0.0, -1.0], [1.0, 0.0]))
    forces = [(-coupling @ v)[along] for v in (down, side)]
    for f in forces:
        f[:p] *= -1.0
    size = p / 50.0
    N = sp.identity(2 * p, format="csr")[:p]
    T = sp.identity(2 * p, format="csr")[p:]
    body = ContactBody(A, N, T, gap)
    start = 0.02 * forces[0]
    return body, AffineLoad(size * start, size * (0.6 * forces[0] + 0.25 * forces[1]))
