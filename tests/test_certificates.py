"""Certificates of tubes, not counts: each is rechecked in balls of 128 bits; mutants are caught."""

import numpy as np
import pytest
from certificates import verdicts
from proof_families import Mixed, PiecewisePolynomial, tubes_of, uneven_arches
from sweeps import swept

import pwscont.proof.counts
import pwscont.proof.interval
import pwscont.proof.search
from pwscont.proof.interval import Interval
from pwscont.proof.search import Tubes, around
from pwscont.proof.tape import traced


def polynomial_verdicts(seeds, every=25):
    """Return how many certificates are true, false and not known."""
    families = [PiecewisePolynomial(np.random.default_rng(seed)) for seed in seeds]
    found = [verdicts(f, tubes_of(f, 1, (-3.0, 3.0), (-1.0, 1.0)), every) for f in families]
    return tuple(np.sum(found, axis=0).tolist())


@pytest.mark.slow
@pytest.mark.parametrize("seeds", swept([range(4)], [range(100, 120)]))
def test_certificates_of_one_unknown_hold(seeds):
    true, *others = polynomial_verdicts(seeds)
    assert (true > 100, others) == (True, [0, 0])


def test_certificates_of_two_unknowns_hold():
    tubes = tubes_of(uneven_arches, 2, (-5.0, 5.0), (-1.0, 1.0))
    assert verdicts(uneven_arches, tubes, len(tubes.first) // 8)[1:] == (0, 0)


@pytest.mark.slow
@pytest.mark.parametrize(("n", "seed"), [(2, 0), (2, 2), (2, 9), (2, 11), (3, 2)])
def test_certificates_of_mixed_rows_hold(n, seed):
    f = Mixed(np.random.default_rng(1000 * n + seed), n)
    f.rows = ([row for row in f.rows if row.kind < 2] * n)[:n]  # those without tanh
    if f.rows:
        tubes = tubes_of(f, n, (-2.0, 2.0), (-1.0, 1.0))
        assert verdicts(f, tubes, 1 + len(tubes.first) // 40)[1:] == (0, 0)


def test_an_image_ends_at_a_solution():
    """z = |t|: the tube around z = 0 has the image |z| <= 1, and at t = 1 the solution is 1."""
    tubes = tubes_of(kink, 1, (-3.0, 3.0), (-1.0, 1.0))
    assert tubes.image.min() == pytest.approx(1.0, rel=1e-12)
    assert verdicts(kink, tubes) == (3 * len(tubes.first), 0, 0)


def kink(z, t, sw):
    return z - sw.abs(t)


# -- tubes that do not hold what is found ---------------------------------------------------------


def stairs(z, t, sw):
    """Slopes -1, 0.2, 1.8, 0.2, kinks at x = -1.2, -0.1, 0.4; solutions at x = -1.6 and 0."""
    x = z - 0.103 * sw.abs(t)
    return 0.2 * x + 1.6 * sw.clip(x, -0.1, 0.4) - 1.2 * sw.min(x + 1.2, 0.0)


def solutions_of_stairs():
    """Return what is found in tubes around both solutions, at t = 1."""
    tape = traced(stairs, 1)
    boxes = Interval(np.array([[-0.8, -1.7], [-1.0, -1.0]]), np.array([[0.8, -1.4], [1.0, 1.0]]))
    tubes, is_proved = around(tape, boxes, np.array([[[1.0, -1.0], [0.0, 0.0]]]), np.ones((1, 1)))
    assert is_proved.all()
    whole = Interval(np.array([-3.0, -1.0]), np.array([3.0, 1.0]))
    return pwscont.proof.counts._solutions(tape, whole, tubes, 1.0)


def test_newton_may_leave_a_tube_for_another_solution():
    """From x = -0.103 the steps of Newton are 0.9 and -4, then on to the other solution."""
    found = solutions_of_stairs()
    assert len(found) == 2
    for (lo, hi), x in zip(sorted(found), (-1.6, 0.0), strict=True):
        assert lo[0] <= x + 0.103 + 1e-15
        assert hi[0] >= x + 0.103 - 1e-15


def touching_enclosures():
    """Return two tubes around 0 and 0.15, and wide enclosures that touch; no tube holds both."""
    one, centre = np.ones(2), np.array([[0.0, 0.15]])
    tubes = Tubes(-one, 0.0 * one, one, centre, 0.0 * centre, 0.1 + 0.0 * centre, 0.0 * centre)
    return tubes, Interval(np.array([[-0.05, 0.08]]), np.array([[0.08, 0.2]]))


def test_enclosures_that_touch_are_told_apart_only_if_a_tube_holds_both():
    tubes, found = touching_enclosures()
    assert pwscont.proof.counts._distinct(tubes, found, 0.0) is None
    wider = tubes._replace(radius=3.0 * tubes.radius)
    assert pwscont.proof.counts._distinct(wider, found, 0.0) == [0]


# -- faults: the tests above must see them --------------------------------------------------------

original = pwscont.proof.search.proved


def accepted_outside(*args):
    tubes, _ = original(*args)
    tubes = tubes._replace(image=0.05 * tubes.radius)
    return tubes, (tubes.image < tubes.radius).all(axis=0)


def half_the_image(*args):
    tubes, is_proved = original(*args)
    return tubes._replace(image=0.5 * tubes.image), is_proved


def accepted_always(*args):
    tubes, is_proved = original(*args)
    return tubes, np.ones_like(is_proved)


@pytest.mark.parametrize("fault", [accepted_outside, half_the_image, accepted_always])
def test_wrong_certificates_are_caught(monkeypatch, fault):
    """Counts do not show these faults."""
    monkeypatch.setattr(pwscont.proof.search, "proved", fault)
    found = verdicts(kink, tubes_of(kink, 1, (-3.0, 3.0), (-1.0, 1.0)))
    assert sum(found[1:]) or sum(polynomial_verdicts(range(4))[1:])


def test_a_single_selection_at_kinks_is_caught(monkeypatch):
    switches = pwscont.proof.interval.SWITCHES
    monkeypatch.setitem(switches, "abs", (switches["abs"][0], lambda dx: (dx, dx)))
    assert sum(verdicts(kink, tubes_of(kink, 1, (-3.0, 3.0), (-1.0, 1.0)))[1:])


def test_tubes_said_to_hold_everything_are_caught(monkeypatch):
    monkeypatch.setattr(Tubes, "hold", lambda self, z, alpha: np.ones(z.lo.shape[1], dtype=bool))
    assert len(solutions_of_stairs()) == 1
    assert pwscont.proof.counts._distinct(*touching_enclosures(), 0.0) == [0]
