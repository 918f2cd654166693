"""The names of the unknowns of a body in contact."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import scipy.sparse as sp

from pwscont.extending import Matrix
from pwscont_coulomb.body import ContactBody


def names(body: ContactBody) -> tuple[str, ...]:
    """Return u[i], or u_nu and u_t where N and T pick single unknowns, and the multipliers."""
    p = body.p
    u = [f"u[{i}]" for i in range(body.n)]
    for symbol, picks in (("ν", body.N), ("t", body.T)):
        for node, column in _single_unknowns(picks):
            u[column] = f"u_{symbol}{_suffix(node, p)}"
    lam = [f"λ_{symbol}{_suffix(node, p)}" for symbol in "νt" for node in range(p)]
    return (*u, *lam)


def _single_unknowns(picks: Matrix) -> Iterator[tuple[int, int]]:
    """Yield (node, column) for the rows of N or T that are unit vectors."""
    rows = sp.csr_matrix(picks)
    for node in np.flatnonzero(np.diff(rows.indptr) == 1).tolist():
        entry = rows.indptr[node]
        if rows.data[entry] == 1.0:
            yield node, int(rows.indices[entry])


def _suffix(node: int, p: int) -> str:
    return f",{node + 1}" if p > 1 else ""
