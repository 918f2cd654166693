"""Loci of transitions and folds in the plane of two parameters, against closed forms.

One node with stiffness A = [[a, -b], [-b, a]] under the load (f_nu, f_t): solving the equations by
hand in each mode gives the sectors of the load plane (the paper's Figs. 4 to 6)

- no contact: a f_nu + b f_t <= 0,
- stick: abs(f_t) <= F f_nu,
- slip+: f_t >= F f_nu and a f_nu + b f_t >= 0,
- slip-: (a - F b) (f_t + F f_nu) <= 0 and (a - F b) (a f_nu + b f_t) >= 0, unless F = a/b.

Two nodes: with the other node free or stuck, node i alone sees the Schur complement S of A on its
two displacements and a condensed load, and the same formulas hold with its entries. Slip- is
singular at F = S_tt / -S_nu,t: below that alpha does not turn.
"""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
import scipy.sparse as sp
from matplotlib.path import Path
from paper_systems import TWO_NODES
from plane_parts import ALPHAS, BODY, CLOSE, PATH, family, plane_family
from pwscont_coulomb import AffineLoad, ContactBody, CoulombLoad
from pwscont_coulomb.plane_scenes import critical_friction, fig4, fig5, fig6, load_plane
from reference_enumeration import enumerate_solutions, modes_of

from pwscont import (
    LCP,
    InvalidInputError,
    Switched,
    TransitionLocus,
    check_system,
    explore,
    trace,
)
from pwscont.two_parameters.loci import Passing, follow_transitions, parts_of, turning
from pwscont.two_parameters.loci_plane import LociPlane
from pwscont.two_parameters.plane import area_and_centre

pytestmark = pytest.mark.sweep(4)  # the others take too long for the README's command


# -- one node: the sectors of the load plane ---------------------------------------------------


def sectors_at(a, b, friction, f_nu, f_t):
    """Return the modes of all solutions by the closed forms above."""
    lifted, bound = a * f_nu + b * f_t, friction * f_nu
    slip_det = a - friction * b
    holds = {
        "no contact": lifted <= 0.0,
        "stick": abs(f_t) <= bound,
        "slip+": f_t >= bound and lifted >= 0.0,
        "slip-": slip_det and slip_det * (f_t + bound) <= 0.0 and slip_det * lifted >= 0.0,
    }
    return {mode for mode, inside in holds.items() if inside}


BODIES = [(2.0, 1.0, 0.7), (2.0, 1.0, 4.0), (2.0, 1.0, 2.0), (3.0, 0.4, 1.5), (5.0, 4.0, 1.3)]


@cache
def loci_of_one_node(a, b, friction):
    family = plane_family(a, b, friction)
    return follow_transitions(family, (-9.0, 9.0), (-1.0, 1.0), (-0.5, 0.5))


@pytest.mark.parametrize(("a", "b", "friction"), BODIES)
@pytest.mark.sweep(6)
def test_sector_boundaries_are_rays_from_the_apex(a, b, friction):
    loci = loci_of_one_node(a, b, friction)
    ratio = {  # f_nu / f_t on each ray, and the sign of f_t
        "slip+ | no contact": (-b / a, 1),
        "slip- | no contact": (-b / a, -1),
        "slip+ | stick": (1.0 / friction, 1),
        "stick | slip-": (-1.0 / friction, -1),
    }
    found = {s.label: s for locus in loci for s in parts_of(locus)}
    assert set(found) == set(ratio)
    for label, (slope, side) in ratio.items():
        f_nu, f_t = found[label].plane.T
        np.testing.assert_allclose(f_nu, slope * f_t, rtol=0.0, atol=1e-13)
        np.testing.assert_allclose(sorted(f_t * side)[:: len(f_t) - 1], [0.0, 1.0], atol=1e-13)


@pytest.mark.parametrize(("a", "b", "friction"), BODIES)
@pytest.mark.sweep(6)
def test_only_slip_minus_folds_and_only_above_the_ratio(a, b, friction):
    loci = loci_of_one_node(a, b, friction)
    expected = Passing.TRANSITION
    if friction >= a / b:
        expected = Passing.FOLD if friction > a / b else Passing.VERTICAL
    for part in (s for locus in loci for s in parts_of(locus)):
        passes = "slip-" not in part.label
        assert part.crossing == (Passing.TRANSITION if passes else expected)


@pytest.mark.slow
@pytest.mark.parametrize(("friction", "test", "f_t"), [(0.7, 1, 0.5), (4.0, 2, -0.5)])
def test_a_locus_ends_at_the_apex_and_says_why(friction, test, f_t):
    """Beyond the apex the friction bound means nothing: contact is lost."""
    f_nu = abs(f_t) / friction
    locus = TransitionLocus(plane_family(2.0, 1.0, friction), test, f_t)
    start = np.array([0.0, 0.0, -f_nu, -f_t, f_nu])
    graph = trace(locus, (start, f_t), (-1.0, 1.0))
    (apex,) = [end for end in graph.special_points("end") if "meet" in end.message]
    assert apex.message == "the loci of several transitions meet: test functions 0, 1, 2 vanish"
    np.testing.assert_allclose([*apex.z, apex.alpha], 0.0, **CLOSE)
    assert len(graph.pieces) == 1


@pytest.mark.slow
def test_the_locus_of_lift_off_goes_straight_through_the_apex():
    locus = TransitionLocus(plane_family(2.0, 1.0, 4.0), 0, 1.0)
    graph = trace(locus, ([0.0, 0.5, 0.0, 0.0, -0.5], 1.0), (-1.0, 1.0))
    (apex,) = graph.special_points("corner")
    np.testing.assert_allclose([*apex.z, apex.alpha], 0.0, **CLOSE)
    assert [piece.label for piece in graph.pieces] == ["slip+ | no contact", "slip- | no contact"]
    for piece in graph.pieces:
        np.testing.assert_allclose(2.0 * piece.z[:, -1], -piece.alpha, **CLOSE)


@pytest.mark.slow
def test_a_locus_ends_where_alpha_leaves_its_range():
    locus = TransitionLocus(plane_family(2.0, 1.0, 0.7), 2, -0.5, (-1.0, 1.0))
    graph = trace(locus, ([0.0, 0.0, -1 / 1.4, 0.5, 1 / 1.4], -0.5), (-1.0, 1.0))
    (end,) = [
        p for p in graph.special_points("end") if p.message == "the first parameter leaves [-1, 1]"
    ]
    assert end.z[-1] == pytest.approx(1.0, abs=1e-12)
    assert end.alpha == pytest.approx(-0.7, abs=1e-12)


@pytest.mark.parametrize("how", [pytest.param("loci", marks=pytest.mark.slow), "exact"])
@pytest.mark.parametrize("scene", [fig4(), fig5(), fig6()], ids=lambda scene: scene.name)
def test_sectors_hold_what_the_closed_forms_say(scene, how):
    friction = float(scene.family(0.5).friction[0])
    plane = plane_of(scene.name, how)
    assert plane.guarantee.startswith({"exact": "complete", "loci": "balanced; "}[how])
    area = 0.0
    for sector in plane.sectors:
        for region in sector.regions:
            area += area_and_centre(region.polygon)[0]
            for f_nu, f_t in points_of_any(region.polygon):
                assert set(sector.labels) == sectors_at(2.0, 1.0, friction, f_nu, f_t)
        assert sector.count == len(sector.labels)
    assert area == pytest.approx(4.0, rel=1e-12)
    assert set(plane.balances()) == {1}
    assert {scene.sector_name(s): sector_count(s) for s in plane.sectors} == SECTORS[scene.name]


@cache
def plane_of(name, how):
    scene = {"fig4": fig4, "fig5": fig5, "fig6": fig6}[name]()
    if how == "exact":
        pytest.importorskip("shapely", reason="exact maps need the extra 'maps'")
        return scene.run()
    return LociPlane.between(scene.family, scene.alphas, scene.mus, scene.levels)


def points_of_any(polygon, count=40):
    """Return random points of a polygon."""
    lo, hi = polygon.min(axis=0), polygon.max(axis=0)
    points = lo + np.random.default_rng(5).random((50 * count, 2)) * (hi - lo)
    inside = Path(polygon).contains_points(points)
    assert inside.any()
    return points[inside][:count]


SECTORS = {
    "fig4": {"σ₁": 1, "σ₂": 1, "σ₃": 1, "σ₄": 1},
    "fig5": {"σ₁": 1, "σ₂": 1, "σ₃": 1, "σ₅ = σ₁ ∩ σ₂": 3},
    "fig6": {"σ₁": 1, "σ₂": 1, "σ₃": 1},
}


def sector_count(sector):
    return sector.count


def points_inside(polygon, count=40):
    """Return random points of a polygon that is convex in alpha at every mu."""
    rng = np.random.default_rng(5)
    half = len(polygon) // 2
    left, right = polygon[:half], polygon[half:][::-1]
    for part, height in rng.uniform(0.02, 0.98, (count, 2)):
        mu = (1.0 - height) * left[0, 1] + height * left[-1, 1]
        lo, hi = (np.interp(mu, side[:, 1], side[:, 0]) for side in (left, right))
        if hi - lo > 1e-6:
            yield (1.0 - part) * lo + part * hi, mu


@pytest.mark.parametrize("how", [pytest.param("loci", marks=pytest.mark.slow), "exact"])
def test_infinitely_many_solutions_on_the_ray_of_fig6(how):
    """At F = a/b every u_t between both ends of the segment solves the equations."""
    vertical = [s for some in plane_of("fig6", how).parts for s in some if s.crossing == "vertical"]
    assert {s.label for s in vertical} == {"slip- | no contact", "stick | slip-"}
    for part in vertical:
        np.testing.assert_allclose(part.plane[:, 0], -0.5 * part.plane[:, 1], **CLOSE)
    f_nu, f_t = 0.25, -0.5
    for u_t in (-0.2, -0.1, -0.05):
        lam_nu = -u_t - f_nu
        assert lam_nu < 0.0
        assert 2.0 * u_t - f_t == pytest.approx(-2.0 * lam_nu)  # slip-, F = 2
    graph = explore(load_plane(2.0, f_t), (-1.0, 1.0))
    assert graph.count(f_nu) == np.inf


NODE = ([0, 1], [2, 3])


def critical_ratio(node, other):
    """Return S_tt / -S_nu,t of a node while the other is "free" or "stuck"."""
    here, there = NODE[node], NODE[1 - node]
    S = TWO_NODES.A[np.ix_(here, here)]
    if other == "free":
        coupling = TWO_NODES.A[np.ix_(here, there)]
        S = S - coupling @ np.linalg.solve(TWO_NODES.A[np.ix_(there, there)], coupling.T)
    return S[1, 1] / -S[0, 1]


@pytest.fixture(scope="module")
def plane():
    return critical_friction().run()


def curve(plane, label):
    """Return (alpha, F, crossing) of every part between two modes, the lower ones first."""
    found = [s for some in plane.parts for s in some if s.label == label]
    return sorted(found, key=lambda s: s.plane[0, 1])


LIFTED_1, STUCK_2 = "node 1 no contact, node 2 {}", "node 1 {}, node 2 stick"


#: Each locus, alpha as a function of F, and where it is a fold. Node 1 beside the stuck node 2 has
#: S = [[1, -1], [-1, 2]] and the load (0.4, alpha); node 2 beside the free node 1 has the same S
#: and the load (2.2 + 1.2 alpha, alpha).
CURVES = [
    (LIFTED_1, "slip-", "no contact", lambda F: -22.0 / 17.0 + 0.0 * F),
    (LIFTED_1, "stick", "slip-", lambda F: -2.2 * F / (1.0 + 1.2 * F)),
    (STUCK_2, "slip-", "no contact", lambda F: -0.8 + 0.0 * F),
    (STUCK_2, "stick", "slip-", lambda F: -0.4 * F),
]


@pytest.mark.slow
@pytest.mark.parametrize(("words", "below", "above", "alpha"), CURVES)
def test_fold_curves_in_closed_form(plane, words, below, above, alpha):
    lower, upper = curve(plane, f"{words.format(below)} | {words.format(above)}")
    for part in (lower, upper):
        np.testing.assert_allclose(part.plane[:, 0], alpha(part.plane[:, 1]), **CLOSE)
    assert (lower.crossing, upper.crossing) == ("transition", "fold")
    assert upper.plane[-1, 1] == 4.0
    assert upper.plane[0, 1] == pytest.approx(2.0, abs=1e-9)


@pytest.mark.slow
def test_slip_plus_never_folds(plane):
    (part,) = curve(plane, "node 1 slip+, node 2 stick | node 1 stick, node 2 stick")
    assert part.crossing == "transition"
    np.testing.assert_allclose(part.plane[:, 0], 0.4 * part.plane[:, 1], **CLOSE)


def begins_to_fold_at_two(plane):
    """Node 2 while node 1 is free and node 1 while node 2 is stuck both begin to fold at a/b."""
    tips = sorted(plane.lowest_folds, key=lambda x: x[-2])
    np.testing.assert_allclose([tip[-1] for tip in tips], [2.0, 2.0], **CLOSE)
    np.testing.assert_allclose([tip[-2] for tip in tips], [-22.0 / 17.0, -0.8], **CLOSE)
    assert critical_ratio(1, "free") == pytest.approx(2.0, abs=1e-15)
    assert critical_ratio(0, "stuck") == pytest.approx(2.0, abs=1e-15)


@pytest.mark.slow
def test_most_solutions_by_friction(plane):
    table = plane.most_solutions()
    assert [count for _, _, count in table] == [1, 3, 5]
    expected = [0.5, 2.0, 55.0 / 17.0, 4.0]  # -0.4 F = -22/17 where the third wedge begins
    np.testing.assert_allclose([table[0][0], *(hi for _, hi, _ in table)], expected, **CLOSE)


def largest_count(body, load, friction, alphas):
    return max(len(enumerate_solutions(body, load(alpha), friction)) for alpha in alphas)


@pytest.mark.parametrize("friction", [0.3, 0.9, 1.5, 1.9, 1.99])
@pytest.mark.sweep(6)
def test_enumeration_finds_one_solution_below(friction):
    alphas = [*np.linspace(*ALPHAS, 333), -22.0 / 17.0 + 1e-4, -0.8 - 1e-4]
    assert largest_count(TWO_NODES, PATH, friction, alphas) == 1


@pytest.mark.parametrize("friction", [2.01, 2.1, 3.0])
def test_enumeration_finds_three_solutions_above(friction):
    middles = [
        0.5 * (-22.0 / 17.0 - 2.2 * friction / (1.0 + 1.2 * friction)),
        -0.4 - 0.2 * friction,
    ]
    for alpha in middles:
        assert largest_count(TWO_NODES, PATH, friction, [alpha]) == 3


def sectors_hold_what_enumeration_finds(plane):
    for sector in plane.sectors:
        for region in sector.regions:
            for alpha, friction in list(points_inside(region.polygon, 12)):
                found = enumerate_solutions(TWO_NODES, PATH(alpha), friction)
                if min((abs(f.margin) for f in found), default=1.0) < 1e-2:
                    continue  # the regions' sides are polylines
                assert {f.modes for f in found} == {modes_of(label) for label in sector.labels}


@pytest.mark.slow
@pytest.mark.parametrize("level", [-0.4, 0.0, 0.6])
def test_a_solution_that_runs_to_infinity_is_seen(level):
    """Of w = (mu - 0.3) z + 1, w z = 0, two solutions exist below mu = 0.3, and one above."""

    def family(mu):
        return LCP([[mu - 0.3]], q=[1.0], d=[0.0])

    plane = LociPlane.between(family, (-1.0, 1.0), (-1.0, 1.0), (level,))
    assert "solutions run to infinity" in plane.guarantee
    assert not any(plane.proven)


@pytest.mark.slow
def test_a_locus_that_no_level_meets_is_seen_beside_an_edge(plane):
    """Node 2 starts to slip beside the slipping node 1 in a corner, below F = 0.71."""
    (part,) = curve(plane, "node 1 slip+, node 2 slip+ | node 1 slip+, node 2 stick")
    for alpha, friction in part.plane[1:-1]:
        found = enumerate_solutions(TWO_NODES, PATH(alpha - 1e-3), friction)
        assert {f.modes for f in found} == {("slip+", "stick")}
        found = enumerate_solutions(TWO_NODES, PATH(alpha + 1e-3), friction)
        assert {f.modes for f in found} == {("slip+", "slip+")}
    assert len(plane.levels) > 1


def every_region_is_proven_at_its_points(plane):
    regions = [region for sector in plane.sectors for region in sector.regions]
    assert len(plane.proven) == len(regions)
    assert all(points == 1 + len(r.others) for points, r in zip(plane.proven, regions, strict=True))
    assert {plane.proof(region).split()[0] for region in regions} == {"proven"}
    assert (
        f"{len(regions)} of {len(regions)} regions of {len(plane.sectors)} sectors"
        in plane.guarantee
    )


OF_A_PLANE = [
    begins_to_fold_at_two,
    sectors_hold_what_enumeration_finds,
    every_region_is_proven_at_its_points,
]


@pytest.mark.slow
@pytest.mark.parametrize("holds", OF_A_PLANE)
def test_facts_of_the_whole_plane(plane, holds):
    holds(plane)


@pytest.mark.slow
def test_around_the_critical_friction():
    narrow = replace(critical_friction(), alphas=(-3.0, 0.0), mus=(1.8, 2.2), levels=(2.2,)).run()
    for holds in OF_A_PLANE:
        holds(narrow)
    for friction in (1.9, 2.1):
        turning_agrees(narrow, friction, narrow.alphas)
    (below, above) = narrow.most_solutions()
    assert below == (1.8, pytest.approx(2.0, abs=1e-9), 1)
    assert above == (pytest.approx(2.0, abs=1e-9), 2.2, 3)


@pytest.mark.slow
def test_another_path_has_another_critical_friction():
    """With node 2 lifted node 1 is softer: it folds from F = 4/3 on."""
    path = AffineLoad([0.4, 0.0, -5.0, 0.0], [0.0, 1.0, 0.0, 0.0])
    loci = follow_transitions(
        lambda F: CoulombLoad(BODY, path, F), (-8.0, 8.0), (0.5, 4.0), (3.9,), parameter="F"
    )
    folds = [s for locus in loci for s in parts_of(locus) if s.crossing == "fold"]
    lowest = min(s.plane[0, 1] for s in folds)
    assert critical_ratio(0, "free") == pytest.approx(4.0 / 3.0, abs=1e-15)
    assert lowest == pytest.approx(4.0 / 3.0, abs=1e-9)
    alphas = np.linspace(-8.0, 8.0, 801) + 1e-3  # no transitions on the grid
    assert largest_count(TWO_NODES, path, 1.32, alphas) == 1
    assert largest_count(TWO_NODES, path, 1.4, alphas) == 3


@pytest.mark.slow
def test_loci_of_two_nodes_kink_where_they_cross(plane):
    """At F = 20/31 both loci reach alpha = -0.8 at one state: each changes its selection."""
    kinks = [p for locus in plane.loci for p in locus.graph.special_points("transition")]
    assert len(kinks) == 2
    for kink in kinks:
        assert kink.alpha == pytest.approx(20.0 / 31.0, abs=1e-9)
        assert kink.z[-1] == pytest.approx(-0.8, abs=1e-9)
    assert {kink.message for kink in kinks} == {
        "node 1: no contact → contact-slip",
        "node 2: contact-stick → contact-slip",
    }


@pytest.mark.slow
def test_facts_hold_for_the_locus(plane):
    """F1 at the interfaces near every locus, and at the kinks themselves."""
    for locus in plane.loci:
        points = [x for piece in locus.graph.pieces for x in piece.points[::4]]
        points = [x for x in points if x[-1] > 1.0] + [
            np.append(kink.z, kink.alpha) for kink in locus.graph.special_points("transition")
        ]
        report = check_system(locus.system, [(x[:-1], x[-1]) for x in points])
        assert report, str(report)


@pytest.mark.slow
def test_rank_one_at_a_kink_of_the_locus(plane):
    """Computed here from the Jacobians, without check_system."""
    seen = 0
    for locus in plane.loci:
        for kink in locus.graph.special_points("transition"):
            touching = [p for p in locus.graph.pieces if kink.id in (p.start, p.end)]
            J, K = (locus.system.jacobian(kink.z, kink.alpha, p.character) for p in touching)
            tests = locus.system.test_functions(kink.z, kink.alpha)
            gradient = locus.system.test_jacobian(kink.z, kink.alpha)[np.argmin(abs(tests))]
            c = (K - J) @ gradient / (gradient @ gradient)
            np.testing.assert_allclose(K - J, np.outer(c, gradient), rtol=0.0, atol=1e-8)
            assert np.linalg.matrix_rank(K - J, tol=1e-8) == 1
            seen += 1
    assert seen == 2


@pytest.mark.slow
@pytest.mark.parametrize("friction", [1.0, 1.9, 2.1, 3.3])
def test_turning_agrees_with_the_kinds_of_explore(plane, friction):
    turning_agrees(plane, friction, ALPHAS)


def turning_agrees(plane, friction, alphas):
    kinds = {"fold": "nonsmooth fold", "transition": "transition"}
    found = {}
    for locus in plane.loci:
        for s in locus.graph.solutions(friction):
            value = turning(locus.system, s.z, friction, s.character)
            found[round(float(s.z[-1]), 8)] = kinds["fold" if value > 0.0 else "transition"]
    graph = explore(family(friction), alphas)
    expected = {
        round(p.alpha, 8): str(p.kind)
        for p in graph.special_points()
        if p.kind not in ("start", "end")
    }
    assert found == expected


@pytest.mark.slow
def test_sparse_bodies_have_the_same_loci():
    body = ContactBody(*map(sp.csr_matrix, (TWO_NODES.A, TWO_NODES.N, TWO_NODES.T)))
    (start,) = [
        p for p in explore(family(4.0), ALPHAS).special_points("nonsmooth fold") if p.alpha < -1.59
    ]
    graphs = [
        trace(
            TransitionLocus(lambda F, body=body: CoulombLoad(body, PATH, F), 2, 4.0, ALPHAS),
            (np.append(start.z, start.alpha), 4.0),
            (0.5, 4.0),
        )
        for body in (BODY, body)
    ]
    for dense, sparse in zip(*(graph.pieces for graph in graphs), strict=True):
        assert dense.label == sparse.label
        np.testing.assert_allclose(dense.points, sparse.points, rtol=1e-8, atol=1e-10)


@pytest.mark.slow
def test_switches_that_agree_at_one_mu_are_named():
    """At mu = -0.5 both calls of relu agree: the system has one test there, two elsewhere."""

    def family(mu):
        def law(z, t, sw):
            return z - 2.0 * sw.relu(z - mu) + 3.0 * sw.relu(z + 0.5) - t

        return Switched(1, law)

    locus = TransitionLocus(family, 1, mu=0.2, alphas=(-1.5, 1.5))  # z = -0.5, at t = -0.5
    start = (np.array([-0.5, -0.5]), 0.2)
    assert trace(locus, start, (-0.45, 0.3)).solutions(0.0)[0].z == pytest.approx([-0.5, -0.5])
    with pytest.raises(InvalidInputError, match=r"at mu = -0.5 has .* one switch there"):
        trace(locus, start, (-1.0, 0.3))
