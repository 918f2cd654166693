"""The names of the unknowns of a body in contact."""

from __future__ import annotations

from collections.abc import Iterator

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
    for node in range(rows.shape[0]):
        row = rows[node]
        if row.nnz == 1 and row.data[0] == 1.0:
            yield node, int(row.indices[0])


def _suffix(node: int, p: int) -> str:
    return f",{node + 1}" if p > 1 else ""
