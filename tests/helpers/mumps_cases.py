"""What :class:`~pwscont_coulomb.elastic.Mumps` must do on any number of ranks.

``test_mumps`` runs this script in one process, and on two ranks by ``pwscont_coulomb.mpi``; with
the argument ``quick`` only a few small bodies.
"""

import gc
import pickle
import sys

import numpy as np
import pytest
import scipy.sparse as sp
from condensations import check_refusal, check_schur_complement, grid
from elastic_bodies import pressed, strip
from pwscont_coulomb.elastic import Multifrontal, Mumps, recover
from pwscont_coulomb.elastic.mumps import factorised
from pwscont_coulomb.elastic.ranks import ranks
from pwscont_coulomb.elastic.scenes import block_body, wedge_body
from skfem import Basis, ElementQuad1, ElementVector, MeshQuad
from skfem.models.elasticity import linear_elasticity

from pwscont import explore
from pwscont.basics.errors import InvalidInputError


def schur_complements_are_those_of_dense_linear_algebra():
    for case in ("bottom", "one", "scattered", "all"):
        for size in [(4, 3), (21, 13)]:
            check_schur_complement(Mumps(), case, size)


def matrices_are_those_of_multifrontal(bodies):
    for body in bodies:
        found, expected = body.condensed(Mumps()), body.condensed(Multifrontal())
        for one, other in (
            (found.body.A, expected.body.A),
            (found.load.f0, expected.load.f0),
            (found.load.f1, expected.load.f1),
        ):
            np.testing.assert_allclose(one, other, rtol=0.0, atol=1e-10 * np.abs(other).max())


def fields_are_those_of_multifrontal():
    body = wedge_body(5)
    states = []
    for elimination in (Mumps(), Multifrontal()):
        problem = body.condensed(elimination)
        found = explore(problem.along_load(), (0.0, 0.1)).solutions(0.07)
        states.append([recover(problem, solution).displacements for solution in found])
    assert len(states[0]) == len(states[1]) == 3
    for one, other in zip(*states, strict=True):
        np.testing.assert_allclose(one, other, rtol=0.0, atol=1e-9 * np.abs(other).max())


def bodies_from_matrices_are_those_of_superlu():
    full = wedge_body(5).full()
    small, other = full.body.condensed(), full.body.condensed(Mumps())
    np.testing.assert_allclose(other.A, small.A, rtol=0.0, atol=1e-10 * np.abs(small.A).max())
    load = other.reduced(full.load.f1)
    np.testing.assert_allclose(load, small.reduced(full.load.f1), rtol=0.0, atol=1e-9)


def floating(n):
    """Return the stiffness of a square that nothing holds."""
    mesh = MeshQuad.init_tensor(np.linspace(0, 1, n), np.linspace(0, 1, n))
    return linear_elasticity(1.2, 0.8).assemble(Basis(mesh, ElementVector(ElementQuad1())))


def loose_parts_are_refused(sizes):
    held, places = grid(12, 9)
    for n in sizes:
        loose = floating(n)
        A = sp.block_diag([held, loose]).tocsr()
        positions = np.hstack([places, np.zeros((2, loose.shape[0]))])
        with pytest.raises(InvalidInputError, match="is the body clamped well enough"):
            Mumps().eliminate(A, np.arange(4), positions)


def the_factor_is_spread_and_freed():
    body = block_body(60)
    interior = np.setdiff1d(np.arange(len(body.free)), body.contact_unknowns)
    places = body.positions[:, body.free // 2]
    factor = factorised(body.A, body.contact_unknowns, interior, places)
    most, together = factor.megabytes
    assert 0 < most <= 0.7 * together if ranks().size > 1 else most == together
    with pytest.raises(InvalidInputError, match="cannot be copied"):
        pickle.dumps(factor)
    gc.collect()
    assert len(ranks()._solvers) == 1
    del factor
    gc.collect()
    assert not ranks()._solvers


def everything():
    schur_complements_are_those_of_dense_linear_algebra()
    check_refusal(Mumps())
    quadratic = pressed(strip("tri", 6, 3), order=2)
    matrices_are_those_of_multifrontal([block_body(2), block_body(100), wedge_body(17), quadratic])
    fields_are_those_of_multifrontal()
    bodies_from_matrices_are_those_of_superlu()
    loose_parts_are_refused([3, 20])
    the_factor_is_spread_and_freed()


def quick():
    matrices_are_those_of_multifrontal([block_body(12), wedge_body(5)])
    loose_parts_are_refused([3])


if __name__ == "__main__":
    if sys.argv[1:] == ["quick"]:
        quick()
    else:
        everything()
    sys.stdout.write(f"all holds on {ranks().size} rank(s)\n")
