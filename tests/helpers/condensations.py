"""What every elimination of a matrix must do."""

import numpy as np
import pytest
import scipy.sparse as sp
from pwscont_coulomb.elastic import (
    SuperLU,
)

from pwscont.basics.errors import InvalidInputError


def grid(nx, ny, seed=0):
    """Return a random s.p.d. matrix coupled as a grid with two unknowns per node, and positions."""
    rng = np.random.default_rng(seed)
    x, y = (c.ravel() for c in np.meshgrid(np.arange(nx), np.arange(ny), indexing="ij"))
    node = np.arange(nx * ny).reshape(nx, ny)
    pairs = np.vstack(
        [
            np.column_stack([node[:-1].ravel(), node[1:].ravel()]),
            np.column_stack([node[:, :-1].ravel(), node[:, 1:].ravel()]),
            np.column_stack([node[:-1, :-1].ravel(), node[1:, 1:].ravel()]),
        ]
    )
    blocks = rng.uniform(-1.0, 1.0, (len(pairs), 2, 2))
    A = np.zeros((2 * nx * ny, 2 * nx * ny))
    for (i, j), block in zip(pairs, blocks, strict=True):
        A[2 * i : 2 * i + 2, 2 * j : 2 * j + 2] = block
        A[2 * j : 2 * j + 2, 2 * i : 2 * i + 2] = block.T
    A += np.diag(np.abs(A).sum(axis=1) + 0.1)
    return sp.csr_matrix(A), np.repeat(np.stack([x, y]).astype(float), 2, axis=1)


def kept_unknowns(case, positions):
    n = positions.shape[1]
    return {
        "bottom": np.flatnonzero(positions[1] == 0.0),
        "one": np.array([n - 2]),
        "scattered": np.random.default_rng(3).permutation(n)[:17],
        "all": np.arange(n)[::-1],
    }[case]


def check_schur_complement(elimination, case, size):
    """Against dense linear algebra: S^-1 is the block of A^-1, and A u = f on the way back."""
    A, positions = grid(*size)
    kept = kept_unknowns(case, positions)
    found = elimination.eliminate(A, kept, positions)
    inverse = np.linalg.inv(A.toarray())
    np.testing.assert_allclose(
        found.schur, np.linalg.inv(inverse[np.ix_(kept, kept)]), rtol=1e-10, atol=1e-11
    )
    assert (found.schur == found.schur.T).all()
    f = np.random.default_rng(1).standard_normal(A.shape[0])
    u = np.linalg.solve(found.schur, found.reduce(f))
    np.testing.assert_allclose(u, (inverse @ f)[kept], rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(found.recover(f, u), inverse @ f, rtol=1e-9, atol=1e-12)


def check_refusal(elimination):
    """What is not positive definite is refused."""
    A, positions = grid(12, 9)
    A = (A - 30.0 * sp.identity(A.shape[0])).tocsr()
    if isinstance(elimination, SuperLU):
        A = sp.csr_matrix(np.zeros(A.shape))
    with pytest.raises(InvalidInputError, match="not positive definite"):
        elimination.eliminate(A, np.arange(4), positions)
