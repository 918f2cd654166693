"""What tests of corners share."""

from itertools import pairwise

import numpy as np
import pytest
from pwscont_coulomb import AffineLoad, CoulombLoad
from random_bodies import contact_body
from reference_enumeration import enumerate_solutions, modes_of

from pwscont import (
    PseudoArclength,
)

STEPPERS = pytest.mark.parametrize("stepper", [None, PseudoArclength()], ids=["exact", "arc"])


def affine(body, f0, f1, friction):
    return CoulombLoad(contact_body(body), AffineLoad(f0, f1), friction)


def assert_agrees(graph, alpha, body, load, friction):
    """Solutions at a regular alpha are those of brute force: number, modes, signs and z."""
    expected = {one.modes: one for one in enumerate_solutions(body, load, friction, 1e-15)}
    found = {modes_of(solution.label): solution for solution in graph.solutions(alpha)}
    assert graph.count(alpha) == len(found) == len(expected)
    assert found.keys() == expected.keys()
    for modes, one in expected.items():
        size = 1e-9 * np.abs(one.z).max() + 1e-14
        np.testing.assert_allclose(found[modes].z, one.z, rtol=1e-9, atol=size)
        assert found[modes].det_sign == one.det_sign
    assert graph.balance(alpha) == 1


def gaps(graph, narrowest=0.0):
    """Return the middle of each interval between neighbouring special points."""
    alphas = sorted({*graph.interval, *(point.alpha for point in graph.special_points())})
    return [0.5 * (a + b) for a, b in pairwise(alphas) if b - a > narrowest]


def assert_agrees_everywhere(graph, body, load, friction, narrowest=1e-12):
    """One alpha in every gap between special points, however narrow."""
    for alpha in gaps(graph, narrowest):
        assert_agrees(graph, alpha, body, load(alpha), friction)
    assert graph.is_balanced()


def assert_states(graph, alpha, expected):
    assert graph.count(alpha) == len(expected)
    found = sorted(np.round(solution.z, 9).tolist() for solution in graph.solutions(alpha))
    expected = sorted(np.round(z, 9).tolist() for z in expected)
    np.testing.assert_allclose(found, expected, rtol=0, atol=2e-9)
