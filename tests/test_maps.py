"""Exact maps over two parameters, against closed forms and enumeration at points."""

import math
import sys

import numpy as np
import pytest
from paper_systems import TWO_NODES
from pwscont_coulomb import AffineLoad, ContactBody, CoulombLoad
from pwscont_coulomb.plane_scenes import critical_friction, example1_load_plane, fig5
from random_bodies import contact_body, random_body, random_vector
from reference_enumeration import enumerate_solutions as reference
from reference_enumeration import modes_of
from sweeps import swept

from pwscont import LCP, PiecewiseLinearSystem, Switched, enumerate_solutions, plane
from pwscont.basics.errors import InvalidInputError, InvalidSystemError, MissingPackageError
from pwscont.two_parameters.loci_plane import LociPlane
from pwscont.two_parameters.plane import area_and_centre

pytest.importorskip("shapely", reason="exact maps need the extra 'maps'")

CLOSE = {"rtol": 0.0, "atol": 1e-9}
A = np.array([[2.0, -1.0], [-1.0, 2.0]])
ONE = ContactBody(A, [[1.0, 0.0]], [[0.0, 1.0]])
UNIT = (-1.0, 1.0)


def loads(body, friction, f0, by_alpha, by_mu):
    """Return the family of a body under the load f0 + alpha f1 + mu f2."""
    f0, by_mu = np.array(f0, dtype=float), np.array(by_mu, dtype=float)
    return lambda mu: CoulombLoad(body, AffineLoad(f0 + mu * by_mu, by_alpha), friction)


def points(found, number, seed=0):
    """Return random points (alpha, mu) of a window."""
    (a, b), (c, d) = found.alphas, found.mus
    inside = np.random.default_rng(seed).random((number, 2))
    return (np.array([a, c]) + inside * [b - a, d - c]).tolist()


def wrong(found, family, number):
    """Return at how many of some random points enumeration finds other solutions."""
    return sum(differs(found, family, *point) for point in points(found, number))


def differs(found, family, alpha, mu):
    expected = {s.label: s for s in enumerate_solutions(family(mu), alpha)}
    solutions = found.solutions(alpha, mu)
    if found.count(alpha, mu) != len(expected) or {s.label for s in solutions} != set(expected):
        return True
    scale = family(mu).scale(*found.alphas)[: len(solutions[0].z)] if solutions else 1.0
    return any(
        (np.abs(s.z - expected[s.label].z) > 1e-9 * scale).any()
        or s.det_sign != expected[s.label].det_sign
        for s in solutions
    )


def filled(found):
    """Return the area of all regions."""
    return sum(area_and_centre(r.polygon)[0] for s in found.sectors for r in s.regions)


# -- by hand -------------------------------------------------------------------------------------


class Hinge(PiecewiseLinearSystem):
    """z - mu = alpha for z <= mu, and slope * (z - mu) = alpha for z >= mu."""

    size = 1

    def __init__(self, slope, mu):
        self.slope, self.mu = slope, mu

    def test_functions(self, z, alpha):
        return z - self.mu

    def residual(self, z, alpha, character):
        return (self.slope if character.signs[0] else 1.0) * (z - self.mu) - alpha


def test_two_cells_on_opposite_sides_are_a_transition():
    found = plane(lambda mu: Hinge(3.0, mu), UNIT, UNIT)
    assert found.guarantee == "complete"
    (edge,) = found.transitions
    np.testing.assert_allclose(edge.plane, [[0.0, -1.0], [0.0, 1.0]], **CLOSE)
    assert (found.folds, found.vertical) == ((), ())
    (solution,) = found.solutions(0.6, 0.5)
    np.testing.assert_allclose(solution.z, [0.7], **CLOSE)
    assert found.count(0.0, 0.5) == 1


def test_two_cells_on_one_side_are_a_fold():
    """Both have a solution for alpha <= 0, none beyond."""
    found = plane(lambda mu: Hinge(-1.0, mu), UNIT, UNIT)
    assert found.guarantee == "complete"
    (edge,) = found.folds
    np.testing.assert_allclose(edge.points, [[-1.0, 0.0, -1.0], [1.0, 0.0, 1.0]], **CLOSE)
    assert found.count(-0.5, 0.3) == 2
    assert sorted(s.det_sign for s in found.solutions(-0.5, 0.3)) == [-1, 1]
    assert found.count(0.5, 0.3) == 0
    assert found.count(0.0, 0.3) == 1
    assert found.most_solutions() == [(-1.0, 1.0, 2)]


def test_a_singular_cell_is_an_edge_with_infinitely_many_solutions():
    """Every z >= mu solves alpha = 0: solutions without bound, and none for alpha > 0."""
    found = plane(lambda mu: Hinge(0.0, mu), UNIT, UNIT)
    assert found.guarantee == "complete"
    assert (found.folds, found.transitions) == ((), ())
    np.testing.assert_allclose(found.vertical[0].plane, [[0.0, -1.0], [0.0, 1.0]], **CLOSE)
    counts = [found.count(alpha, -0.3) for alpha in (-0.1, 0.0, 0.1)]
    assert counts == [1, math.inf, 0]


def test_infinitely_many_solutions_all_over_a_region():
    def family(mu):
        return Switched(1, lambda z, t, sw: sw.max(z, 0.0) - sw.max(t + mu, 0.0), linear=True)

    found = plane(family, UNIT, UNIT)
    assert found.guarantee == "complete"
    assert found.count(0.2, 0.3) == 1
    assert found.count(-0.2, 0.1) == math.inf
    assert sorted(sector.count for sector in found.sectors) == [1, math.inf]
    np.testing.assert_allclose(sorted(map(tuple, found.vertical[0].plane)), [(-1, 1), (1, -1)])


def test_a_region_with_a_hole():
    """abs(z) = 1 - abs(alpha) - abs(mu) has two solutions in a diamond, and none around it."""

    def family(mu):
        def f(z, t, sw):
            return sw.abs(z) - 1.0 + sw.abs(t) + sw.abs(mu + 0.0 * t)

        return Switched(1, f, linear=True)

    found = plane(family, (-2.0, 2.0), (-2.0, 2.0))
    assert found.guarantee == "complete"
    assert filled(found) == pytest.approx(16.0, abs=1e-8)
    inner, outer = sorted(found.sectors, key=lambda s: -s.count)[:1], found.sectors[0]
    assert outer.count == 0
    assert len(outer.regions) == 2
    assert inner[0].count == 2
    for alpha, mu in points(found, 200):
        assert found.count(alpha, mu) == (2 if abs(alpha) + abs(mu) < 1.0 else 0)


# -- one node ------------------------------------------------------------------------------------


def sigma(friction):
    """Return the corners of the sectors of Figs. 4 and 5 in the square, from their formulas."""
    rays = {
        "slip+ | no contact": (-0.5, 1.0),
        "slip- | no contact": (0.5, -1.0),
        "slip+ | stick": (1.0 / friction, 1.0) if friction > 1.0 else (1.0, friction),
        "stick | slip-": (1.0 / friction, -1.0) if friction > 1.0 else (1.0, -friction),
    }
    return {label: sorted([(0.0, 0.0), end]) for label, end in rays.items()}


@pytest.mark.parametrize("friction", [0.7, 1.9, 2.1, 4.0])
@pytest.mark.parametrize("unit", [1e-9, 1.0, 1e9])
@pytest.mark.sweep(5)
def test_the_load_plane_of_one_node_in_any_units(friction, unit):
    """The load is (f_nu, f_t) = (alpha / unit, unit mu): the same sectors in other numbers."""
    family = loads(ONE, friction, [0, 0], [1.0 / unit, 0], [0, unit])
    found = plane(family, (-unit, unit), (-1.0 / unit, 1.0 / unit))
    assert found.guarantee == "complete"
    size = np.array([unit, 1.0 / unit])
    rays = sigma(friction)
    parts = [part for some in found.parts for part in some]
    assert {part.label for part in parts} == set(rays)
    for part in parts:
        ends = sorted(map(tuple, part.plane / size))
        np.testing.assert_allclose(ends, rays[part.label], **CLOSE)
    folds = {"slip- | no contact", "stick | slip-"} if friction > 2.0 else set()
    assert {part.label for part in found.folds} == folds
    assert filled(found) == pytest.approx(4.0, rel=1e-9)


@pytest.mark.parametrize("units", [1e-9, 1e9])
def test_units_of_length_and_force_do_not_matter(units):
    body = ContactBody(A * units, [[1.0, 0.0]], [[0.0, 1.0]])
    found = plane(loads(body, 4.0, [0, 0], [1, 0], [0, 1]), (-units, units), (-units, units))
    assert found.guarantee == "complete"
    assert [found.count(a * units, m * units) for a, m in ((0.3, -0.9), (0.9, 0.1))] == [3, 1]


def test_vertical_edges_of_fig6():
    found = plane(loads(ONE, 2.0, [0, 0], [1, 0], [0, 1]), UNIT, UNIT)
    assert found.guarantee == "complete"
    assert {part.label for part in found.vertical} == {"slip- | no contact", "stick | slip-"}
    assert found.count(0.25, -0.5) == math.inf
    assert found.count(0.25, -0.4) == 1


@pytest.mark.parametrize("excess", [1e-3, 1e-6, 1e-9, -1e-9])
def test_next_to_the_critical_friction_thin_sectors_are_kept(excess):
    found = plane(loads(ONE, 2.0 + excess, [0, 0], [1, 0], [0, 1]), UNIT, UNIT)
    assert found.guarantee == "complete"
    assert max(sector.count for sector in found.sectors) == (3 if excess > 0 else 1)


def test_what_is_narrower_than_rounding_is_said():
    found = plane(loads(ONE, 2.0 + 1e-11, [0, 0], [1, 0], [0, 1]), UNIT, UNIT)
    assert found.guarantee != "complete"


# -- several nodes -------------------------------------------------------------------------------

NOTHING = np.zeros((2, 2))
APART = ContactBody(np.block([[A, NOTHING], [NOTHING, A]]), np.eye(4)[[0, 2]], np.eye(4)[[1, 3]])
COUPLED = ContactBody(
    np.block([[A, -0.3 * np.eye(2)], [-0.3 * np.eye(2), A]]), np.eye(4)[[0, 2]], np.eye(4)[[1, 3]]
)


def test_tied_nodes_change_together():
    """Two equal nodes under equal loads: one solution, or each node has three."""
    found = plane(loads(APART, 4.0, [0] * 4, [1, 0, 1, 0], [0, 1, 0, 1]), UNIT, UNIT)
    assert found.guarantee == "complete"
    assert sorted(sector.count for sector in found.sectors) == [1, 1, 1, 9]
    assert wrong(found, loads(APART, 4.0, [0] * 4, [1, 0, 1, 0], [0, 1, 0, 1]), 10) == 0


@pytest.mark.parametrize("friction", [0.0, 1.0, 3.0, 4.0])
@pytest.mark.parametrize("side", [0.0, 0.2])
@pytest.mark.sweep(4)
def test_symmetric_bodies(friction, side):
    family = loads(COUPLED, friction, [side, 0, 0, 0], [1, 0, 1, 0], [0, 1, 0, 1])
    found = plane(family, UNIT, UNIT)
    assert found.guarantee == "complete"
    assert wrong(found, family, 15) == 0


def test_the_body_without_a_load():
    found = plane(loads(ONE, 4.0, [0, 0], [0, 0], [0, 0]), UNIT, UNIT)
    assert [sector.count for sector in found.sectors] == [1]
    assert found.parts == ()


def test_parallel_edges():
    """mu moves the load along alpha: all edges are parallel."""
    family = loads(ONE, 4.0, [0.25, 0], [0, 1], [0, 1])
    found = plane(family, (-2.0, 2.0), UNIT)
    assert found.guarantee == "complete"
    for part in (part for some in found.parts for part in some):
        np.testing.assert_allclose(part.plane.sum(axis=1), part.plane.sum() / 2.0, **CLOSE)
    assert wrong(found, family, 10) == 0


def test_a_tangential_load_that_is_always_zero():
    """Without friction and coupling stick and slip in both directions are one solution."""
    family = loads(
        ContactBody(np.eye(2), [[1.0, 0.0]], [[0.0, 1.0]]), 0.0, [0, 0], [1, 0], [0.1, 0]
    )
    found = plane(family, UNIT, UNIT)
    assert found.guarantee == "complete"
    assert [sector.count for sector in found.sectors] == [1, 1]


def test_example1_in_the_plane_of_two_loads():
    """The paper's two nodes: the count along its load path, and enumeration in the plane."""
    found = example1_load_plane().run()
    assert found.guarantee == "complete"
    assert [found.count(a, 0.4) for a in (-7.0, -1.4, -1.0, 0.0)] == [1, 5, 3, 1]
    regions = [region.inside.tolist() for sector in found.sectors for region in sector.regions]
    for alpha, f_nu in [*points(found, 20), *regions]:
        load = np.array([f_nu, alpha, 1.8 + 0.2 * alpha, alpha])
        expected = {one.modes for one in reference(TWO_NODES, load, 4.0)}
        assert {modes_of(s.label) for s in found.solutions(alpha, f_nu)} == expected


CASES = [(p, seed, friction) for p in range(1, 7) for seed, friction in enumerate((0.5, 1.5, 4.0))]


@pytest.mark.parametrize(
    ("p", "seed", "friction", "number"),
    swept(
        [(2, 2, 4.0, 20), (3, 2, 4.0, 10)],
        [(*case, 300 if case[0] < 5 else 100) for case in CASES],
    ),
)
def test_random_bodies_against_enumeration(p, seed, friction, number):
    body = random_body(p, seed, gap=seed == 1)
    f0, f1, f2 = (random_vector(body.n, [p, i, seed]) for i in range(3))
    family = loads(contact_body(body), friction, f0, f1, f2)
    found = plane(family, (-2.0, 2.0), (-2.0, 2.0))
    # where edges nearly agree, another order of summation may leave their order open
    assert found.guarantee.startswith(("complete", "not certain: rounding moves edges"))
    assert set(found.balances()) == {1}
    assert filled(found) == pytest.approx(16.0, rel=1e-8)
    assert wrong(found, family, number) == 0


@pytest.mark.parametrize(
    ("p", "seed"), swept([(3, 1)], [(p, s) for p in (2, 3, 4) for s in range(3)])
)
def test_random_bodies_against_the_reference(p, seed):
    body = random_body(p, seed)
    f0, f1, f2 = (random_vector(body.n, [p, i, seed]) for i in range(3))
    found = plane(loads(contact_body(body), 2.0, f0, f1, f2), (-2.0, 2.0), (-2.0, 2.0))
    for alpha, mu in points(found, 40):
        expected = reference(body, f0 + alpha * f1 + mu * f2, 2.0)
        assert {modes_of(s.label) for s in found.solutions(alpha, mu)} == {
            e.modes for e in expected
        }


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
def test_many_nodes_by_linear_programs(seed):
    """Nine nodes have 262,144 cells, of which few are looked at."""
    body = random_body(9, seed)
    f0, f1, f2 = (random_vector(body.n, [9, i, seed]) for i in range(3))
    family = loads(contact_body(body), 1.0, f0, f1, f2)
    found = plane(family, (-2.0, 2.0), (-2.0, 2.0))
    assert found.guarantee == "complete"
    assert wrong(found, family, 30) == 0


@pytest.mark.parametrize(
    ("n", "seed", "number"),
    swept([(2, 1, 10)], [(n, s, 60) for n in (1, 2, 3, 4) for s in range(8)]),
)
def test_complementarity_problems(n, seed, number):
    rng = np.random.default_rng([n, seed])
    M, (q, d, e) = rng.normal(size=(n, n)), rng.normal(size=(3, n))

    def family(mu):
        return LCP(M, q + mu * e, d)

    found = plane(family, (-2.0, 2.0), (-2.0, 2.0))
    assert found.guarantee == "complete"
    assert wrong(found, family, number) == 0


# -- what is refused, and what is said -------------------------------------------------------------


def test_points_outside_the_window_are_refused():
    found = plane(lambda mu: Hinge(3.0, mu), UNIT, UNIT)
    with pytest.raises(InvalidInputError, match=r"\(1.5, 0\) lies outside the window"):
        found.count(1.5, 0.0)


def test_friction_as_a_parameter_is_refused():
    scene = critical_friction()
    with pytest.raises(InvalidInputError, match="not affine in z, alpha and the second parameter"):
        plane(scene.family, scene.alphas, scene.mus)


def test_a_parameter_that_enters_as_a_square_is_refused():
    with pytest.raises(InvalidInputError, match="not affine"):
        plane(lambda mu: Hinge(3.0, mu**2), UNIT, UNIT)


def test_curved_loads_are_refused():
    with pytest.raises(InvalidInputError, match="needs a family of PiecewiseLinearSystems"):
        plane(lambda mu: CoulombLoad(ONE, lambda t: np.array([t**2, mu]), 1.0), UNIT, UNIT)


def test_systems_with_bounds_are_refused():
    class Bounded(Hinge):
        def bounds(self):
            return -1.0, 1.0

    with pytest.raises(InvalidInputError, match="has bounds or periods"):
        plane(lambda mu: Bounded(3.0, mu), UNIT, UNIT)


@pytest.mark.parametrize("ends", [(1.0, 1.0), (2.0, -2.0), (0.0, np.inf), (0.0,), None])
def test_no_such_window(ends):
    with pytest.raises(InvalidInputError, match="alphas"):
        plane(lambda mu: Hinge(3.0, mu), ends, UNIT)
    with pytest.raises(InvalidInputError, match="mus"):
        plane(lambda mu: Hinge(3.0, mu), UNIT, ends)


def test_a_family_returns_systems():
    with pytest.raises(InvalidSystemError, match="the family returned float"):
        plane(lambda mu: mu, UNIT, UNIT)


def test_what_to_install_where_shapely_is_missing(monkeypatch):
    monkeypatch.setitem(sys.modules, "shapely", None)
    with pytest.raises(MissingPackageError, match=r"pip install '\.\[maps\]' in a checkout"):
        plane(lambda mu: Hinge(3.0, mu), UNIT, UNIT)


@pytest.mark.slow
def test_without_shapely_scenes_follow_loci(monkeypatch):
    monkeypatch.setitem(sys.modules, "shapely", None)
    found = fig5().run()
    assert isinstance(found, LociPlane)
    assert found.guarantee.startswith("balanced; ")
    (remark,) = found.remarks
    assert "pip install '.[maps]'" in remark
    assert sorted(sector.count for sector in found.sectors) == [1, 1, 1, 3]


def in_units(rng, n):
    """Return M, q, d, e of an LCP, and of the same one with units of powers of two."""
    M, (q, d, e) = rng.normal(size=(n, n)), rng.normal(size=(3, n))
    of_z, of_w = 2.0 ** rng.integers(-30, 31, (2, n))
    return (M, q, d, e), (of_w[:, np.newaxis] * M / of_z, of_w * q, of_w * d, of_w * e)


@pytest.mark.parametrize("seed", swept(range(4), range(4, 200)))
@pytest.mark.sweep(2)
def test_other_units_leave_the_map_as_it_is(seed):
    """A unit of 1e-9 to 1e9 for each unknown, each row and each parameter, without scale=."""
    rng = np.random.default_rng([36, seed])
    usual, other = in_units(rng, int(rng.integers(1, 5)))
    a, m = 2.0 ** rng.integers(-30, 31, 2)
    known = plane(lambda mu: LCP(usual[0], usual[1] + mu * usual[3], usual[2]), UNIT, UNIT)
    M, q, d, e = other
    found = plane(lambda mu: LCP(M, q + mu / m * e, d / a), (-a, a), (-m, m))
    assert found.guarantee == known.guarantee == "complete"
    assert len(found.sectors) == len(known.sectors)
    for alpha, mu in points(known, 10):
        assert found.count(a * alpha, m * mu) == known.count(alpha, mu)
        assert known.count(alpha, mu) == len(enumerate_solutions(LCP(M, q + mu * e, d), alpha))


@pytest.mark.parametrize("seed", swept([95, 155, 168, *range(4)], range(4, 95)))
@pytest.mark.sweep(6)
def test_wrong_magnitudes_make_no_complete_map(seed):
    """Rounding of magnitudes that are far too large hides sides of cells, which is said."""
    rng = np.random.default_rng([37, seed])
    M, q, d, e = in_units(rng, n := int(rng.integers(1, 5)))[0]
    unit = 10.0 ** rng.integers(-9, 10)
    found = plane(lambda mu: LCP(M, unit * (q + mu * e), unit * d, scale=np.ones(n)), UNIT, UNIT)
    is_right = all(
        found.count(alpha, mu) == len(enumerate_solutions(LCP(M, q + mu * e, d), alpha))
        for alpha, mu in points(found, 10)
    )
    assert is_right or found.guarantee.startswith("not certain")


@pytest.mark.slow
@pytest.mark.parametrize("unit", swept([2.0**15], [2.0**-20]))
def test_other_units_leave_loci_as_they_are(unit):
    """A coupling that is no load; loci have the magnitudes of the solutions."""
    M, q, d = np.array([[1.0, 0.4], [0.3, 1.2]]), np.array([-0.4, 0.3]), np.array([1.0, 0.5])
    one, other = (
        LociPlane.between(
            lambda mu, u=u: LCP(M + mu * np.eye(2)[::-1], u * q, u * d), UNIT, (0.0, 0.5), [0.2]
        )
        for u in (1.0, unit)
    )
    assert [s.count for s in other.sectors] == [s.count for s in one.sectors]
    assert other.guarantee == one.guarantee
    assert len(other.loci) == len(one.loci) > 0


def test_a_family_is_a_function():
    with pytest.raises(InvalidInputError, match="family must be a function of mu, got Hinge"):
        plane(Hinge(3.0, 0.0), UNIT, UNIT)


def test_the_corners_of_a_window_far_from_zero_belong_to_the_window():
    alphas, mus = (0.009998, 0.010001999999999999), (999.8000000000001, 1000.2)
    found = plane(lambda mu: Hinge(3.0, mu - 1000.0), alphas, mus)
    assert [found.count(alpha, mu) for alpha in alphas for mu in mus] == [1, 1, 1, 1]
