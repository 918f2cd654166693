"""Evolutions that are proved to be the only ones."""

import numpy as np
import pytest
from pwscont_coulomb import ContactBody, LoadHistory, QuasiStaticCoulomb

from pwscont import evolve, prove
from pwscont.proof.prove import is_unique


def evolution(F, A=((2.0, -1.0), (-1.0, 2.0))):
    body = ContactBody(A, [[1.0, 0.0]], [[0.0, 1.0]])
    loads = [[0.0, 0.0], [1.0, 3.0], [1.0, -3.0], [0.5, 2.0]]
    return evolve(QuasiStaticCoulomb(body, LoadHistory(loads), F), (0.0, 3.0))


def least_eigenvalue(F):
    """Return the least eigenvalue of the forms of one node: F couples N A w and T w."""
    A, row = np.array([[2.0, -1.0], [-1.0, 2.0]]), np.array([2.0, -1.0])
    forms = [A - 0.5 * s * F * (np.outer([0, 1], row) + np.outer(row, [0, 1])) for s in (-1, 1)]
    return min(np.linalg.eigvalsh(form).min() for form in forms)


@pytest.mark.parametrize("F", [0.0, 0.3, 0.9, 1.4, 4.0])
def test_one_evolution_is_proved_where_forms_are_positive_definite(F):
    found = evolution(F)
    proof = prove(found)
    assert proof.holds == (least_eigenvalue(F) > 0.0 and len(found.paths()) == 1)
    assert proof.statements[0].startswith("exactly one evolution" if proof.holds else "not proved")


@pytest.mark.parametrize(("F", "is_proved"), [(1.7, True), (1.743, False)])
def test_rounding_of_the_smallest_numbers_is_counted(F, is_proved):
    """F = sqrt(3) is the limit; in multiples of 5e-324, products of F with the data are off."""
    A, rows = np.array([[2.0, -1.0], [-1.0, 2.0]]), np.eye(2)
    for unit in (1.0, *(k * 5e-324 for k in range(1, 8))):
        signs = (np.array([F]), np.array([-F]))
        holds = all(is_unique(unit * A, rows[:1], rows[1:], friction) for friction in signs)
        assert holds <= is_proved
        assert holds == is_proved or unit < 1.0
