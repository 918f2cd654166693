"""Certificates, not counts: each is rechecked in balls of 128 bits; mutants are caught."""

import numpy as np
import pytest
from certificates import holds_a_zero, is_injective, verdicts
from proof_families import Mixed, PiecewisePolynomial, accepted_in, domain_of, uneven_arches
from sweeps import swept

import pwscont.proof.boxes
import pwscont.proof.interval
from pwscont.proof.boxes import Domain
from pwscont.proof.interval import Interval
from pwscont.proof.tape import with_slopes

PLACES = (-0.83, -0.21, 0.35, 0.77)


def rechecked(domain, f, every=1):
    """Return the verdicts of accepted boxes, and of the solutions that are enclosed in them."""
    boxes = accepted_in(domain)
    pairs = zip(boxes.lo[::every], boxes.hi[::every], strict=True)
    enclosed = pwscont.proof.boxes.enclosures(domain, boxes, PLACES)
    zeros = [(z, alpha) for alpha, some in zip(PLACES, enclosed, strict=True) for z in some or ()]
    found = verdicts(is_injective(f, pair) for pair in pairs)
    return found, verdicts(holds_a_zero(f, *zero) for zero in zeros)


def polynomial_verdicts(seeds):
    """Return how many certificates of boxes, and of solutions, are true, false and not known."""
    families = [PiecewisePolynomial(np.random.default_rng(seed)) for seed in seeds]
    found = [rechecked(domain_of(f, 1, (-3.0, 3.0), (-1.0, 1.0)), f, 4) for f in families]
    return np.sum(found, axis=0).tolist()


@pytest.mark.slow
@pytest.mark.parametrize("seeds", swept([range(4)], [range(100, 120)]))
def test_certificates_of_one_unknown_hold(seeds):
    for true, *others in polynomial_verdicts(seeds):
        assert (true > 20, others) == (True, [0, 0])


def test_certificates_of_two_unknowns_hold():
    domain = domain_of(uneven_arches, 2, (-5.0, 5.0), (-1.0, 1.0))
    for true, *others in rechecked(domain, uneven_arches, 8):
        assert (true > 5, others) == (True, [0, 0])


@pytest.mark.slow
@pytest.mark.parametrize(("n", "seed"), [(2, 0), (2, 2), (2, 9), (2, 11), (3, 2)])
def test_certificates_of_mixed_rows_hold(n, seed):
    f = Mixed(np.random.default_rng(1000 * n + seed), n)
    f.rows = ([row for row in f.rows if row.kind < 2] * n)[:n]  # those without tanh
    if f.rows:
        for verdict in rechecked(domain_of(f, n, (-2.0, 2.0), (-1.0, 1.0)), f, 20):
            assert verdict[1:] == (0, 0)


def kink(z, t, sw):
    return z - sw.abs(t)


def test_an_enclosure_is_narrow():
    """z = |t|: to a few roundings."""
    domain = domain_of(kink, 1, (-3.0, 3.0), (-1.0, 1.0))
    (((lo, hi),),) = pwscont.proof.boxes.enclosures(domain, accepted_in(domain), [0.4])
    assert lo <= 0.4 <= hi
    assert hi - lo < 1e-14


def stairs(z, t, sw):
    """Slopes -1, 0.2, 1.8, 0.2, kinks at x = -1.2, -0.1, 0.4; solutions at x = -1.6 and 0."""
    x = z - 0.103 * sw.abs(t)
    return 0.2 * x + 1.6 * sw.clip(x, -0.1, 0.4) - 1.2 * sw.min(x + 1.2, 0.0)


def test_newton_may_leave_a_box_for_another_solution():
    """From x = -0.103 the steps of Newton are 0.9 and -4, then on to the other solution."""
    domain = domain_of(stairs, 1, (-3.0, 3.0), (-1.0, 1.0))
    boxes = Interval(np.array([[-0.8, -1.0], [-1.7, -1.0]]), np.array([[0.8, 1.0], [-1.4, 1.0]]))
    assert domain.continues(boxes, domain.slopes(boxes)).all()
    (found,) = pwscont.proof.boxes.enclosures(domain, boxes, [1.0])
    for (lo, hi), x in zip(sorted(found), (-1.6, 0.0), strict=True):
        assert lo[0] <= x + 0.103 + 1e-15
        assert hi[0] >= x + 0.103 - 1e-15


def distinct(f):
    """Return how many solutions two enclosures, of -0.05 to 0.08 and of 0.08 to 0.2, hold."""
    found = Interval(np.array([[-0.05, 0.5], [0.08, 0.5]]), np.array([[0.08, 0.5], [0.2, 0.5]]))
    domain = domain_of(f, 1, (-3.0, 3.0), (-1.0, 1.0))
    some = pwscont.proof.boxes._told_apart(domain, found)
    return some and len(some)


def test_enclosures_that_touch_are_told_apart_only_if_both_hold_one_solution():
    assert distinct(lambda z, t, sw: z * (z - 0.15) + 0.0 * t) is None
    assert distinct(lambda z, t, sw: z - 0.08 + 0.0 * t) == 1


# -- faults: the tests above must see them --------------------------------------------------------

FAULTS = {
    "each matrix regular": lambda matrices, size: np.ones(len(matrices.lo), dtype=bool),
    "the middle regular": lambda matrices, size: np.linalg.det(matrices.middle()) != 0.0,
}


@pytest.mark.parametrize("name", FAULTS)
def test_boxes_accepted_wrongly_are_caught(monkeypatch, name):
    """Counts do not always show these faults."""
    monkeypatch.setattr(pwscont.proof.boxes, "are_regular", FAULTS[name])
    assert polynomial_verdicts(range(4))[0][1] > 0


original = Domain.enclosed


def half_the_width(domain, boxes):
    found = original(domain, boxes)
    return Interval(found.middle(), found.hi)


def not_where_the_zero_is(domain, boxes):
    found = original(domain, boxes)
    aside = np.array([1e-9, 0.0])  # not of alpha
    return Interval(found.lo + aside, found.hi + aside)


@pytest.mark.parametrize("fault", [half_the_width, not_where_the_zero_is])
def test_wrong_enclosures_are_caught(monkeypatch, fault):
    monkeypatch.setattr(Domain, "enclosed", fault)
    assert sum(polynomial_verdicts(range(4))[1][1:]) > 0


def test_a_single_selection_at_kinks_is_caught(monkeypatch):
    f = PiecewisePolynomial(np.random.default_rng(1))
    switches = pwscont.proof.interval.SWITCHES
    monkeypatch.setitem(switches, "abs", (switches["abs"][0], lambda dx: (dx, dx)))
    assert rechecked(domain_of(f, 1, (-3.0, 3.0), (-1.0, 1.0)), f)[0][1] > 0


def test_boxes_without_what_lies_beside_are_caught(monkeypatch):
    """|z| = t turns at z = 0, on the faces of the first boxes."""
    domain = domain_of(lambda z, t, sw: sw.abs(z) - t, 1, (-2.0, 2.0), (-2.0, 2.0))
    assert covers_zero(accepted_in(domain)) == 0
    within = lambda self, boxes: with_slopes(self.tape.slopes, boxes)[1]  # noqa: E731
    monkeypatch.setattr(Domain, "slopes", within)
    assert covers_zero(accepted_in(domain)) > 0


def covers_zero(boxes):
    return ((boxes.lo <= 0.0) & (boxes.hi >= 0.0)).all(axis=1).sum()


def test_enclosures_said_to_hold_one_solution_are_caught(monkeypatch):
    monkeypatch.setattr(pwscont.proof.boxes, "are_regular", FAULTS["each matrix regular"])
    assert distinct(lambda z, t, sw: z * (z - 0.15) + 0.0 * t) == 1
