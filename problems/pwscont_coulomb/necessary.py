"""Inequalities that all solutions fulfil, whatever the contact modes."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from pwscont.extending import Array, Matrix, dense
from pwscont_coulomb.body import ContactBody


def necessary(body: ContactBody, friction: Array) -> tuple[Matrix, Array]:
    """Return A and b of lam_nu <= 0, u_nu <= gap and |lam_t| <= F |lam_nu|: A z + b >= 0."""
    p = body.p
    offset = np.concatenate([np.zeros(p), body.gap, np.zeros(2 * p)])
    return _sparse(body, friction) if body.is_sparse else _dense(body, friction), offset


def _sparse(body: ContactBody, friction: Array) -> Matrix:
    one, N, slope = sp.identity(body.p), sp.csr_matrix(body.N), sp.diags(friction)
    rows = [[None, -one, None], [-N, None, None], [None, -slope, one], [None, -slope, -one]]
    return sp.bmat(rows).tocsr()


def _dense(body: ContactBody, friction: Array) -> Array:
    rows, node = np.zeros((4, body.p, body.n + 2 * body.p)), np.arange(body.p)
    normal, tangential = body.n + node, body.n + body.p + node
    rows[0, node, normal] = -1.0
    rows[1, :, : body.n] = -dense(body.N)
    rows[2:, node, normal] = -friction
    rows[2, node, tangential], rows[3, node, tangential] = 1.0, -1.0
    return rows.reshape(4 * body.p, -1)
