"""The tape of a formula: what is written down, and what is refused in words."""

import copy

import numpy as np
import pytest

from pwscont import (
    Complementarity,
    Everywhere,
    InvalidInputError,
    PiecewiseSystem,
    Switched,
    explore,
)
from pwscont.proof.interval import Interval
from pwscont.proof.tape import tape_of, traced, with_slopes


class Stop(PiecewiseSystem):
    """A spring with a stop; the residual is computed in place."""

    size = 1

    def test_functions(self, z, alpha):
        return z - 1.0

    def residual(self, z, alpha, character):
        r = z * (z - 1.0) * (z - 2.0)
        r += 5.0 * (z - 1.0) if character.signs[0] else 0.0
        r[0] -= 0.5 * alpha
        r -= 0.5 * alpha
        return r


def test_arithmetic_in_place_is_written_down():
    graph = explore(Stop(), (-0.5, 1.0), search=Everywhere(box=(-5.0, 5.0)))
    assert graph.guarantee == "complete in the box, proved; balanced"
    assert [graph.proof.count(t) for t in (-0.2, 0.2, 0.7)] == [1, 3, 1]


def through_a_view(z, t, sw):
    r = z**3
    part = r[:1]
    part -= t
    return r


def test_what_is_written_through_a_view_is_written_down():
    graph = explore(Switched(1, through_a_view), (1.0, 2.0), search=Everywhere(box=(-3.0, 3.0)))
    assert graph.proof.holds
    assert graph.solutions(1.5)[0].z == pytest.approx([1.5 ** (1 / 3)])


def test_roots_of_a_negative_alpha_are_no_complex_numbers():
    """H has no value there, and z^2 = 4 - alpha elsewhere."""
    circle = Switched(1, lambda z, t, sw: np.hypot(z, t**0.5) - 2.0)
    assert np.isnan(circle.residual(np.ones(1), -0.5, circle.character(np.ones(1), -0.5)))
    found = explore(circle, (-0.5, 1.0)).solutions(0.5)
    assert [s.z[0] for s in found] == pytest.approx([-(3.5**0.5), 3.5**0.5])


def put_into_zeros(z, t, sw):
    r = np.zeros(1)
    r[0] = z[0] - t
    return r


def added_to_zeros(z, t, sw):
    r = np.zeros(1)
    r += z
    return r - t


REFUSED = {
    "an entry of zeros": (put_into_zeros, r"np.array\(\[...\]\) instead of entries put into zeros"),
    "zeros to which something is added": (added_to_zeros, "instead of entries put into zeros"),
    "a function among numbers": (lambda z, t, sw: np.cbrt(z[0]) - t, "takes cbrt"),
    "a plain number": (lambda z, t, sw: z - float(t), "plain number"),
    "complex numbers": (lambda z, t, sw: ((z + 1j) * (t + 1j)).imag, "no real number"),
    "a function it does not know": (lambda z, t, sw: np.cbrt(z) - t, "cbrt"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_cannot_be_traced_is_refused_in_words(name):
    f, words = REFUSED[name]
    with pytest.raises(InvalidInputError, match=words):
        traced(f, 1)


def with_a_fallback(z, t, sw):
    """A root at 3.95 that only plain numbers near that root show."""
    try:
        number = float(z[0])
    except TypeError:
        number = 0.0
    return (z - t) * (z - 3.95 if number > 3.9 else 1.0)


def with_a_comparison(z, t, sw):
    try:
        is_far = bool(z[0] > 3.9)
    except Exception:
        is_far = False
    return (z - t) * (z - 3.95 if is_far else 1.0)


def with_a_floor(z, t, sw):
    try:
        number = np.floor(z[0] - 0.9)
    except Exception:
        number = 0.0
    return (z - t) * (z - 3.95 if number == 3.0 else 1.0)


def with_an_attribute(z, t, sw):
    number = 0.0 if not hasattr(z[0], "is_integer") else float(z[0])
    return (z - t) * (z - 3.95 if number > 3.9 else 1.0)


def with_another_function(z, t, sw):
    try:
        return np.cbrt(z) - t
    except TypeError:
        return z - t


class Kept:
    """A formula that keeps a number of its first call."""

    last = None

    def __call__(self, z, t, sw):
        self.last = t if self.last is None else self.last
        return z - self.last


def with_noise(z, t, sw):
    return z - t + 1e-12 * np.random.default_rng().random()


SLY = [with_a_fallback, with_a_comparison, with_a_floor, with_an_attribute, with_another_function]


@pytest.mark.parametrize("f", [*SLY, with_noise, Kept()])
def test_a_formula_that_goes_on_without_numbers_or_changes_is_refused(f):
    with pytest.raises(InvalidInputError, match="cannot be traced"):
        traced(f, 1)


def test_shapes_of_numbers_are_no_decision():
    f = lambda z, t, sw: z[0] * np.ones(np.shape(z[0])) * np.size(t) - t + np.ndim(z[0])  # noqa: E731
    assert traced(f, 1).steps == traced(lambda z, t, sw: z[0] - t, 1).steps


def test_clips_without_jumps_are_told_by_their_bounds():
    def names(f):
        return {step.name for step in traced(f, 1).steps}

    assert "where" not in names(lambda z, t, sw: sw.clip(z, 0.0, 2.0) - t)
    assert "where" not in names(lambda z, t, sw: -sw.clip(-t, 0.0 - z, 2.0 - z))
    assert "where" in names(lambda z, t, sw: sw.clip(z, 2.0 - t, 0.0 - t))
    assert "where" in names(lambda z, t, sw: sw.clip(z, -t, t))


def test_copies_of_numbers_are_the_same_numbers():
    tape = traced(lambda z, t, sw: copy.deepcopy(z) * z - copy.copy(t), 1)
    assert tape.steps == traced(lambda z, t, sw: z * z - t, 1).steps


def test_a_class_that_writes_to_its_unknowns_is_refused():
    class Writing(Stop):
        def residual(self, z, alpha, character):
            z -= 0.0 if character.signs[0] else 1e-3
            return super().residual(z, alpha, character)

    with pytest.raises(InvalidInputError, match="read-only"):
        tape_of(Writing())


OTHERS = {
    "positive": lambda z, t: +z,
    "conjugate": lambda z, t: np.conj(z),
    "square": lambda z, t: np.square(z),
    "reciprocal": lambda z, t: np.reciprocal(z),
    "hypot": np.hypot,
    "log2": lambda z, t: np.log2(z),
    "log10": lambda z, t: np.log10(z),
    "exp2": lambda z, t: np.exp2(z),
    "tan": lambda z, t: np.tan(z),
    "the root of a power": lambda z, t: z**0.5,
}


@pytest.mark.parametrize("name", OTHERS)
def test_functions_that_are_written_down_as_others(name):
    f, x, h = OTHERS[name], np.array([0.7, 1.3]), 1e-6
    tape = traced(lambda z, t, sw: f(z, t), 1).slopes
    value, slopes = with_slopes(tape, Interval(x[np.newaxis]))
    assert value.lo <= f(*x) <= value.hi
    steps = [f(*(x + d)) - f(*(x - d)) for d in h * np.eye(2)]
    assert slopes.middle()[0, 0] == pytest.approx(np.array(steps) / (2 * h), abs=1e-8)


def test_bounds_may_be_infinite_for_some_unknowns():
    """z = -1 - alpha, where the constant exceeds no bound, and z = max(alpha, 0)."""
    mixed = Complementarity(
        lambda z, t: np.array([z[0] + z[1] ** 3 * 0.0 + 1.0 + t, z[1] - t]),
        lower=[-np.inf, 0.0],
        upper=[1.0, np.inf],
        n=2,
    )
    graph = explore(mixed, (-0.9, 0.9), search=Everywhere(box=(-5.0, 5.0)))
    assert graph.proof.holds
    assert [graph.count(t) for t in (-0.5, 0.5)] == [1, 1]
    assert graph.solutions(0.5)[0].z == pytest.approx([-1.5, 0.5])


def test_clips_may_be_open():
    half = Switched(1, lambda z, t, sw: sw.clip(z, -np.inf, t + 0.5) + z**3 - 0.2)
    graph = explore(half, (-1.0, 1.0), search=Everywhere(box=(-3.0, 3.0)))
    assert graph.proof.holds
    assert graph.count(0.0) == 1
