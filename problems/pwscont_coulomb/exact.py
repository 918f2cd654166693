"""The rows of a contact problem at one load, as the numbers that they are, for proofs."""

from __future__ import annotations

from typing import Any

import numpy as np

from pwscont.extending import Array, ExactMode, dense
from pwscont_coulomb.body import ContactBody


def exact_rows(
    body: ContactBody, load: Array, slope: Array, friction: Array
) -> tuple[Array, list[list[ExactMode]]]:
    """Return equilibrium, shape (n, n + 2 p + 2), and the modes of every node.

    Columns are (u, lam_nu, lam_t, alpha, 1), and the load is load + alpha slope. No coefficient is
    rounded: r is left out.
    """
    n, p = body.n, body.p
    A, N, T = dense(body.A), dense(body.N), dense(body.T)
    common = np.column_stack([A, -N.T, -T.T, -slope, -load])
    return common, [_modes(N[i], T[i], body, float(friction[i]), i, n, p) for i in range(p)]


def _modes(
    N: Array, T: Array, body: ContactBody, friction: float, i: int, n: int, p: int
) -> list[ExactMode]:
    """Return the modes of node i: no contact, stick, slip+, slip-; of a guided node the first two.

    The equations are those of the paper, section 2.
    """
    zero, unit = np.zeros(n + 2 * p + 2), np.eye(n + 2 * p + 2)
    pressed, shear = unit[n + i], unit[n + p + i]  # lam_nu, lam_t
    apart, slid = zero.copy(), zero.copy()
    apart[:n], apart[-1], slid[:n] = -N, body.gap[i], T
    free = _mode([pressed, shear], [apart])
    if body.guided[i]:
        return [free, _mode([-apart, shear], [-pressed])]
    upper, lower = -friction * pressed - shear, -friction * pressed + shear
    return [
        free,
        _mode([apart, slid], [-pressed, upper, lower]),
        _mode([apart, lower], [-pressed, slid]),
        _mode([apart, upper], [-pressed, -slid]),
    ]


def _mode(equations: list[Any], sides: list[Any]) -> ExactMode:
    return ExactMode(np.array(equations), np.array(sides))
