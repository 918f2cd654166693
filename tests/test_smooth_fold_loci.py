"""Loci of smooth folds, wrong input, and regions of the plane of two parameters."""

import numpy as np
import pytest
from plane_parts import CLOSE, plane_family

from pwscont import FoldLocus, PiecewiseSystem, TransitionLocus, check_system, trace
from pwscont.basics.errors import InvalidInputError, InvalidSystemError
from pwscont.two_parameters.loci import follow_transitions
from pwscont.two_parameters.plane import area_and_centre, regions

# -- smooth folds ------------------------------------------------------------------------------


class Cusp(PiecewiseSystem):
    """z^3 - mu z - alpha, with a stop below z = -0.8: folds at z^2 = mu / 3, a cusp at mu = 0."""

    size = 1

    def __init__(self, mu):
        self.mu = mu

    def test_functions(self, z, alpha):
        return z + 0.8

    def residual(self, z, alpha, character):
        stop = 0.0 if character.signs[0] else 2.0 * (z + 0.8)
        return z**3 - self.mu * z - alpha + stop


@pytest.fixture(scope="module")
def cusp():
    _, fold = trace(Cusp(1.0), ([2.0], 3.0), (-3.0, 3.0)).special_points("fold")
    locus = FoldLocus(Cusp, 1.0, (-3.0, 3.0))
    return locus, trace(locus, locus.start(fold.z, fold.alpha, 1.0), (-1.0, 3.0), parameter="mu")


def test_smooth_folds_follow_the_cusp(cusp):
    _, graph = cusp
    points = np.vstack([piece.points for piece in graph.pieces])
    z, _, alpha, mu = points.T
    np.testing.assert_allclose(3.0 * z**2, mu, **CLOSE)
    np.testing.assert_allclose(alpha, -2.0 * z**3, **CLOSE)
    (tip,) = graph.special_points("fold")
    np.testing.assert_allclose([*tip.z[[0, 2]], tip.alpha], 0.0, rtol=0.0, atol=1e-8)


def test_a_smooth_fold_ends_at_an_interface_and_says_so(cusp):
    _, graph = cusp
    (end,) = [p for p in graph.special_points("end") if "interface" in p.message]
    assert end.message == "the smooth fold reaches the interface of test function 0"
    np.testing.assert_allclose([end.z[0], end.alpha], [-0.8, 1.92], **CLOSE)


@pytest.mark.slow
def test_jacobian_of_the_fold_locus(cusp):
    locus, graph = cusp
    points = [(x[:-1], x[-1]) for piece in graph.pieces for x in piece.points[1:-1:3]]
    report = check_system(locus, [*points, (np.array([0.3, 0.4, 0.2]), 0.7)])
    assert report, str(report)


def test_loci_of_transitions_refuse_smooth_folds():
    with pytest.raises(InvalidInputError, match=r"smooth fold at alpha = .* trace a FoldLocus"):
        follow_transitions(Cusp, (-3.0, 3.0), (0.5, 2.0), (1.0,))


# -- wrong input ---------------------------------------------------------------------------------


@pytest.mark.parametrize("test", [-1, 3, 99])
def test_no_such_test(test):
    with pytest.raises(InvalidInputError, match="test must be one of 0 to 2"):
        TransitionLocus(plane_family(2.0, 1.0, 1.0), test)


@pytest.mark.parametrize("alphas", [(1.0, 1.0), (2.0, -2.0), (0.0,), None])
@pytest.mark.parametrize("kind", [FoldLocus, lambda f, **more: TransitionLocus(f, 0, **more)])
def test_no_such_range(kind, alphas):
    with pytest.raises(InvalidInputError, match="alphas"):
        kind(plane_family(2.0, 1.0, 1.0), alphas=alphas)


def test_a_family_must_return_systems():
    with pytest.raises(InvalidSystemError, match=r"the family returned float at mu = 1\.0"):
        TransitionLocus(lambda mu: mu, 0)
    with pytest.raises(InvalidInputError, match="family must be a function of mu, got 3"):
        TransitionLocus(3, 0)


def test_a_level_through_the_apex_is_refused():
    family = plane_family(2.0, 1.0, 4.0)
    with pytest.raises(InvalidInputError, match="choose another level"):
        follow_transitions(family, (-1.0, 1.0), (-1.0, 1.0), (0.0,))


# -- regions -------------------------------------------------------------------------------------


def test_regions_fill_the_window():
    """A cross of two lines and a curve that ends within: areas add up, and none overlap."""
    curves = [
        np.array([[-1.0, -1.0], [1.0, 1.0]]),
        np.array([[1.0, -1.0], [-1.0, 1.0]]),
        np.array([[0.5, -0.25], [0.6, 0.1], [0.5, 0.25]]),
    ]
    found = regions(curves, (-1.0, 1.0), (-1.0, 1.0))
    assert sum(area_and_centre(r.polygon)[0] for r in found) == pytest.approx(4.0, rel=1e-12)
    assert all(np.abs(r.inside).max() < 1.0 for r in found)


def test_coincident_curves_enclose_nothing():
    line = np.array([[0.0, -1.0], [0.5, 1.0]])
    found = regions([line, line.copy()], (-1.0, 1.0), (-1.0, 1.0))
    assert len(found) == 2


def test_area_and_centre_of_a_triangle():
    area, centre = area_and_centre(np.array([[10.0, 5.0], [13.0, 5.0], [10.0, 11.0]]))
    assert area == pytest.approx(9.0)
    np.testing.assert_allclose(centre, [11.0, 7.0])


class CuspInUnits(PiecewiseSystem):
    """z^3 - mu z = t with z in another unit, and no word on the unit."""

    size = 1

    def __init__(self, mu, unit):
        self.mu, self.unit = mu, unit

    def test_functions(self, z, alpha):
        return np.zeros(0)

    def residual(self, z, alpha, character):
        return (z / self.unit) ** 3 - self.mu * z / self.unit - alpha

    def jacobian(self, z, alpha, character):
        slope = 3.0 * (z[0] / self.unit) ** 2 - self.mu
        return np.array([[slope / self.unit, -1.0]])


@pytest.mark.parametrize("unit", [1e-6, 1.0, 1e6])
def test_folds_in_units_that_the_family_does_not_give(unit):
    """Folds stand at z^2 = mu / 3, t = -+2 (mu / 3)^(3/2)."""
    locus = FoldLocus(lambda mu: CuspInUnits(mu, unit), mu=1.0, alphas=(-2.0, 2.0))
    z = unit * 3.0**-0.5
    graph = trace(locus, locus.start([z], -2.0 * 3.0**-1.5, 1.0), (-0.5, 2.0))
    assert graph.count(-0.2) == 0
    for mu in (0.2, 0.9, 1.7):
        alphas = sorted(float(solution.z[-1]) for solution in graph.solutions(mu))
        highest = 2.0 * (mu / 3.0) ** 1.5
        assert alphas == pytest.approx([-highest, highest], rel=1e-7)
    assert sum(len(piece.points) for piece in graph.pieces) < 100
