"""Counts that a theorem stands behind: right or not said, whatever the system."""

import numpy as np
import pytest
from proof_families import Mixed, PiecewisePolynomial, proved, uneven_arches
from sweeps import swept

import pwscont.proof.boxes
import pwscont.proof.interval
from pwscont import Everywhere, Switched, explore
from pwscont.proof.boxes import MOST_BOXES
from pwscont.proof.interval import Interval

pytestmark = pytest.mark.sweep(4)  # the others take too long for the README's command

ARCH = Switched(1, lambda z, t, sw: z * (z - 1) * (z - 2) + 5 * sw.relu(z - 1) - t)


def slices(seed, count=8):
    return np.random.default_rng(10**6 + seed).uniform(-1.0, 1.0, count)


def wrong_polynomials(seeds):
    """Return how many slices are wrong, not said, and how many there are."""
    wrong = unsaid = total = 0
    for seed in seeds:
        f = PiecewisePolynomial(np.random.default_rng(seed))
        proof = proved(f, 1, (-3.0, 3.0), (-1.0, 1.0))
        for alpha in slices(seed):
            known, truth = proof.count(alpha), f.count(alpha, -3.0, 3.0)
            unsaid, total = unsaid + (known is None), total + 1
            wrong += None not in (known, truth) and known != truth
    return wrong, unsaid, total


@pytest.mark.parametrize("seeds", swept([range(4)], [range(4, 400)]))
def test_counts_of_piecewise_polynomials(seeds):
    wrong, unsaid, total = wrong_polynomials(seeds)
    assert wrong == 0
    assert unsaid <= 0.05 * total


@pytest.mark.parametrize(
    ("n", "seeds"), swept([(2, range(2)), (3, (2,))], [(2, range(2, 30)), (3, (4, *range(5, 18)))])
)
def test_counts_of_mixed_rows(n, seeds):
    unsaid = total = 0
    for seed in seeds:
        f = Mixed(np.random.default_rng(1000 * n + seed), n)
        if not f.is_covered(2.0):
            continue
        proof = proved(f, n, (-2.0, 2.0), (-1.0, 1.0))
        for alpha in slices(seed, 4):
            known, truth = proof.count(alpha), f.count(alpha, 2.0)
            unsaid, total = unsaid + (known is None), total + 1
            assert None in (known, truth) or known == truth
    assert unsaid <= 0.2 * total


@pytest.mark.slow
def test_no_coordinate_is_left_wide():
    proof = proved(uneven_arches, 3, (-5.0, 5.0), (-1.0, 1.0))
    assert proof.boxes < 40_000
    assert [proof.count(t) for t in (-0.9, 0.0, 0.9)] == [3, 27, 3]


def test_close_branches_that_hardly_move_need_few_boxes():
    proof = proved(lambda z, t, sw: z * (z - 1e-5) + 1e-12 * t, 1, (-2.0, 2.0), (-1.0, 1.0))
    assert (proof.boxes < 200, proof.count(0.0)) == (True, 2)


# -- faults of the rules: the tests above must see them (certificates: test_certificates.py) -------


@pytest.mark.slow
def test_a_single_selection_at_kinks_is_caught(monkeypatch):
    switches = pwscont.proof.interval.SWITCHES
    monkeypatch.setitem(switches, "abs", (switches["abs"][0], lambda dx: (dx, dx)))
    assert wrong_polynomials(range(12))[0] > 0


@pytest.mark.slow
def test_enclosures_that_are_not_told_apart_are_caught(monkeypatch):
    """Each enclosure counted for itself: the same solution counts several times."""
    each = lambda _, found: list(zip(found.lo[:, :-1], found.hi[:, :-1], strict=True))  # noqa: E731
    monkeypatch.setattr(pwscont.proof.boxes, "_told_apart", each)
    with pytest.raises(AssertionError):
        test_counts_of_piecewise_polynomials(range(12))


def leaving(z, t, sw):
    """A curve that leaves the box [-1, 1] at t = 0.3 and comes back at t = 0.7."""
    return z - 1.0 + (t - 0.3) * (t - 0.7)


def test_a_curve_that_leaves_the_box_makes_windows():
    proof = proved(leaving, 1, (-1.0, 1.0), (0.0, 1.0))
    assert [proof.count(t) for t in (0.1, 0.5, 0.9)] == [1, 0, 1]
    assert len(proof.folds) == 2
    assert proof.words == "complete in the box, proved"


def test_no_check_at_the_boundary_is_caught(monkeypatch):
    def inside(boxes, slopes):
        return Interval.is_within(boxes, slopes) | True

    kept = pwscont.proof.boxes.Interval.is_within
    monkeypatch.setattr(
        Interval, "is_within", lambda a, b: kept(a, b) | np.ones_like(a.lo, dtype=bool)
    )
    proof = proved(leaving, 1, (-1.0, 1.0), (0.0, 1.0))
    assert not (proof.holds and [proof.count(t) for t in (0.1, 0.5, 0.9)] == [1, 0, 1])


# -- what must stay not proved ---------------------------------------------------------------------


ANIMALS = {
    "a double root": lambda z, t, sw: (z - t) ** 2,
    "a double root beside another": lambda z, t, sw: (z * z - 1) ** 2 * (z - 2) + 0.0 * t,
    "a pitchfork": lambda z, t, sw: z**3 - t * z,
    "two curves that cross": lambda z, t, sw: z * (z - t),
    "an isolated solution": lambda z, t, sw: z**2 + t**2,
    "an area": lambda z, t, sw: sw.relu(z) + 0.0 * t,
    "a jump across zero": lambda z, t, sw: sw.where(z - 0.3, z + 1, z - 1) - t,
    "a jump of a clip": lambda z, t, sw: z - sw.clip(2 * z, t, -t),
    "no number": lambda z, t, sw: z * np.log(z - 5) - t,
    "an infinite slope": lambda z, t, sw: sw.abs(z) ** 1.5 - t,
}


@pytest.mark.parametrize("name", ANIMALS)
@pytest.mark.sweep(12)
def test_what_cannot_be_proved_ends_in_words(name):
    proof = proved(ANIMALS[name], 1, (-3.0, 3.0), (-1.0, 1.0))
    assert not proof.holds
    assert proof.open
    assert proof.words.startswith("not proved in ")
    assert proof.boxes <= 2 * MOST_BOXES


def test_between_windows_counts_are_proved_even_beside_a_pitchfork():
    proof = proved(ANIMALS["a pitchfork"], 1, (-3.0, 3.0), (-1.0, 1.0))
    assert [proof.count(t) for t in (-0.5, 0.0, 0.5)] == [1, None, 3]


@pytest.mark.parametrize("shift", [-1e-12, -1e-15, 0.0, 1e-15, 1e-12])
@pytest.mark.sweep(8)
def test_data_moved_a_little_across_a_kink(shift):
    """|z| = shift, for all alpha: two solutions, one or none; closer than any box."""
    proof = proved(lambda z, t, sw: sw.abs(z - 0.1) - shift + 0.0 * t, 1, (-1.0, 1.0), (-1.0, 1.0))
    right = 0 if shift < 0.0 else 1 if shift == 0.0 else 2
    assert proof.count(0.2) in (None, right)
    assert proof.holds == (shift < 0.0)


HALF_UNDEFINED = {
    "max": lambda z, t, sw: sw.max(np.sqrt(z) + 10.0, z + 3.0 - t),
    "min": lambda z, t, sw: sw.min(z + 3.0 - t, np.sqrt(z) + 10.0),
    "relu": lambda z, t, sw: sw.relu(np.sqrt(z)) + z + 3.0 - t,
    "clip": lambda z, t, sw: sw.clip(np.sqrt(z), 0.0, 5.0) + z + 3.0 - t,
    "where": lambda z, t, sw: sw.where(z, np.sqrt(z), 0.0) + z + 3.0 - t,
}


@pytest.mark.slow
@pytest.mark.parametrize("name", HALF_UNDEFINED)
@pytest.mark.sweep(12)
def test_a_switch_may_take_the_argument_that_has_a_value(name):
    """The only solution is z = t - 3, where sqrt(z) has no value."""
    with np.errstate(invalid="ignore"):
        assert Switched(1, HALF_UNDEFINED[name]).formula_at(np.array([-3.0]), 0.0) == 0.0
    proof = proved(HALF_UNDEFINED[name], 1, (-4.0, 4.0), (-1.0, 1.0), seconds=1.0)
    assert proof.count(0.2) in (1, None)


@pytest.mark.parametrize("exponent", range(1, 9))
@pytest.mark.parametrize("is_smooth", [True, False])
def test_loops_of_all_sizes_are_never_denied(exponent, is_smooth):
    r = 10.0**-exponent

    def loop(z, t, sw):
        x, y = z - 0.3, t - 0.2
        return x * x + y * y - r * r if is_smooth else sw.abs(x) + sw.abs(y) - r

    proof = proved(loop, 1, (-3.0, 3.0), (-1.0, 1.0))
    assert proof.count(0.2) in (2, None)
    assert proof.count(0.2) == 2 or proof.open
    assert proof.count(0.2) == 2 or exponent > 6


# -- folds ----------------------------------------------------------------------------------------


def turns(f, lo, hi):
    """Return the signs of the local extrema of alpha(z) with alpha in a range: 1 for a minimum."""
    z = np.linspace(-3.0, 3.0, 200_001)
    alpha = -f([z], 0.0, np)[0] / f.b
    inner, rise = alpha[1:-1], np.sign(np.diff(alpha))
    near = (inner > lo - 1e-5) & (inner < hi + 1e-5)
    return (rise[1:] - rise[:-1])[near & (rise[1:] != rise[:-1])] / 2.0


def wrong_folds(seeds):
    """Return in how many ranges that are called folds alpha turns both ways, and the ranges."""
    wrong = total = 0
    for seed in seeds:
        f = PiecewisePolynomial(np.random.default_rng(seed))
        f.e = 0.0
        proof = proved(f, 1, (-3.0, 3.0), (-1.0, 1.0))
        for lo, hi in proof.folds:
            before, after = proof.count(lo - 1e-7), proof.count(hi + 1e-7)
            if None not in (before, after) and abs(after - before) > 1:  # else an end of the box
                wrong += (turns(f, lo, hi) != np.sign(after - before)).any()
                total += 1
    return wrong, total


@pytest.mark.parametrize("seeds", swept([range(15)], [range(15, 300)]))
@pytest.mark.slow
def test_alpha_turns_one_way_in_what_is_called_folds(seeds):
    wrong, total = wrong_folds(seeds)
    assert wrong == 0
    assert total > len(seeds) // 3


TWO_TURNS = {
    "smooth": lambda z, t, sw: z**3 - 1e-9 * z - t,
    "kinks": lambda z, t, sw: z - 2.0 * sw.relu(z) + 2.0 * sw.relu(z - 1e-9) - t,
    "a kink and a smooth fold": lambda z, t, sw: sw.max(-z, 1e-5 * z - z**2) - t,
}


@pytest.mark.parametrize("name", TWO_TURNS)
def test_two_folds_that_are_too_close_are_no_fold(name):
    """There are one, three and one solutions, within 1e-9 of alpha or less."""
    proof = proved(TWO_TURNS[name], 1, (-0.4, 0.4), (-0.1, 0.1))
    assert [fold for fold in proof.folds if fold[0] < 1e-8 and fold[1] > -1e-8] == []
    assert proof.count(0.0) is None
    assert proof.words != "complete in the box, proved"


def test_second_derivatives_are_needed_to_call_a_fold_a_fold(monkeypatch):
    always = lambda self, way: np.ones(len(way.lo))  # noqa: E731
    monkeypatch.setattr(pwscont.proof.boxes._Passage, "_of_folds", always)
    with pytest.raises(AssertionError):
        test_two_folds_that_are_too_close_are_no_fold("smooth")


def test_a_kink_where_alpha_turns_is_a_fold_of_a_sign():
    for sign in (1.0, -1.0):
        proof = proved(lambda z, t, sw, s=sign: sw.abs(z) - s * t, 1, (-2.0, 2.0), (-1.0, 1.0))
        assert [turn for *_, turn in proof.turns] == [sign]
        assert proof.words == "complete in the box, proved"


@pytest.mark.parametrize(
    "grows", [lambda u: np.exp(u * u) - 1.0, lambda u: 3.0 * np.expm1(u * u), np.cosh]
)
def test_far_out_where_the_exponential_overflows_nothing_is_left_open(grows):
    loop = Switched(1, lambda z, t, sw: grows((z + 1.6) / 0.1) + (t / 0.01) ** 2 - 3.0)
    proof = explore(loop, (-0.5, 1.0), search=Everywhere(box=(-500.0, 500.0))).proof
    assert proof.holds
    assert [proof.count(t) for t in (-0.4, 0.001, 0.9)] == [0, 2, 0]
