"""check_system finds broken promises of every kind, and none in our own systems."""

import numpy as np
import pytest
from paper_systems import CASES

from pwscont import (
    Block,
    Character,
    InvalidInputError,
    PiecewiseLinearSystem,
    PiecewiseSystem,
    SlicewiseLinearSystem,
    check_system,
    explore,
)


class Plain(PiecewiseSystem):
    """z + kink = alpha in both unknowns; the tests below break one promise each."""

    size = 2

    def test_functions(self, z, alpha):
        return z - 0.3

    def residual(self, z, alpha, character):
        return z - alpha + 0.5 * np.array(character.signs) * (z - 0.3)


POINTS = [([0.1, 0.2], 0.15), ([0.5, -0.2], 0.3), ([0.9, 0.7], -0.2)]
SOLUTIONS = [([0.1, 0.1], 0.1), ([0.9, 0.9], 1.2)]


def broken(base=Plain, **methods):
    return type("Broken", (base,), methods)()


def straight(**methods):
    return type("Broken", (Plain, PiecewiseLinearSystem), {**LINEAR, **methods})()


LINEAR = {
    "jacobian": PiecewiseLinearSystem.jacobian,
    "test_jacobian": PiecewiseLinearSystem.test_jacobian,
}
MODES = ((True,), (False,))
BLOCKS = (Block((0,), (0,), MODES), Block((1,), (1,), MODES))


@pytest.mark.parametrize("system", [broken(), straight(), straight(blocks=lambda self: BLOCKS)])
def test_nothing_is_broken(system):
    assert check_system(system, [*POINTS, *SOLUTIONS]), str(check_system(system, POINTS))


@pytest.mark.parametrize("name", sorted(CASES))
@pytest.mark.sweep(10)
def test_no_false_alarm_on_the_papers_systems(name):
    system, (lo, hi) = CASES[name].system, CASES[name].interval
    random = np.random.default_rng(0)
    scale = system.scale(lo, hi)
    points = [(scale * random.normal(size=system.size), random.uniform(lo, hi)) for _ in range(8)]
    graph = explore(system, (lo, hi))
    solutions = [(s.z, s.alpha) for a in np.linspace(lo, hi, 7) for s in graph.solutions(a)]
    report = check_system(system, [*points, *solutions])
    assert report, str(report)


def words(system, points=POINTS, **options):
    report = check_system(system, points, **options)
    assert not report
    return str(report)


KINKS = {
    "maximum": lambda z: np.maximum(z - 0.15, 0.0),
    "absolute": lambda z: 1e-3 * np.abs(z - 0.15),
    "jump": lambda z: 1e-3 * np.sign(z - 0.15),
}


@pytest.mark.parametrize("name", KINKS)
def test_a_kink_hidden_in_a_cell(name):
    def residual(self, z, alpha, character):
        return Plain.residual(self, z, alpha, character) + KINKS[name](z)

    found = words(broken(residual=residual), [([0.1, 0.2], 0.15)])
    assert "residual in cell -- has a kink or jump that no test function announces" in found
    near = check_system(broken(residual=residual), [([0.9, 0.9], 0.5)])
    assert near  # nothing within the radius
    assert not check_system(broken(residual=residual), [([0.9, 0.9], 0.5)], radius=2.0)


def test_a_kink_hidden_in_a_test():
    system = broken(test_functions=lambda self, z, alpha: z - 0.3 + 0.1 * np.abs(z - 0.15))
    assert "test_functions have a kink" in words(system, [([0.1, 0.2], 0.15)])


@pytest.mark.parametrize("width", [1.0, 0.1, 0.01])
def test_a_narrow_bump_is_no_kink(width):
    def residual(self, z, alpha, character):
        bump = width**2 / (width**2 + (z - 0.15) ** 2)
        return Plain.residual(self, z, alpha, character) + 0.1 * bump

    assert check_system(broken(residual=residual), POINTS)


def test_a_test_that_bounds_a_cell_is_left_out():
    system = broken(bounding_tests=lambda self, character: [0])
    assert "bounding_tests leaves out test function 1, whose sign changes H" in words(system)


def test_wrong_linear_promises():
    def residual(self, z, alpha, character):
        return Plain.residual(self, z, alpha, character) + 0.1 * z**2

    assert "is a PiecewiseLinearSystem, but residual" in words(straight(residual=residual))
    slicewise = type("Broken", (Plain, SlicewiseLinearSystem), {"residual": residual})()
    assert "is a SlicewiseLinearSystem, but residual" in words(slicewise)


def test_wrong_blocks():
    swapped = (Block((0,), (1,), MODES), Block((1,), (0,), MODES))
    found = words(straight(blocks=lambda self: swapped))
    assert "a mode of block 0 changes rows that it does not own" in found
    both = (Block((0,), (0, 1), MODES), Block((1,), (1,), MODES))
    assert "row 1 is claimed 2 times" in words(straight(blocks=lambda self: both))


def test_blocks_that_leave_something_out():
    half = (Block((0,), (0,), MODES[:1]), BLOCKS[1])
    assert "block 0 does not have the mode of cell --" in words(straight(blocks=lambda self: half))
    for left in (BLOCKS[:1], ()):
        found = words(straight(blocks=lambda self, left=left: left))
        assert "test function 1 changes H, and is in no block" in found
    idle = straight(
        test_functions=lambda self, z, alpha: np.append(z - 0.3, z[0] - 1.0),
        residual=lambda self, z, a, c: Plain.residual(self, z, a, Character(c.signs[:2])),
        blocks=lambda self: BLOCKS,
    )
    assert check_system(idle, [*POINTS, *SOLUTIONS]), str(check_system(idle, POINTS))


def test_wrong_necessary():
    system = straight(necessary=lambda self, alpha: (np.eye(2), np.array([-0.5, 1.0])))
    assert check_system(system, POINTS)
    assert "a solution breaks inequality 0" in words(system, SOLUTIONS)


def test_wrong_scale():
    system = broken(scale=lambda self, lo, hi: np.array([1.0, 1e-5]))
    assert "scale() says 1e-05 for z[1], which is 0.9" in words(system, SOLUTIONS)


def test_wrong_unique():
    class Two(PiecewiseSystem):
        size = 1
        unique = True

        def test_functions(self, z, alpha):
            return z - 9.0

        def residual(self, z, alpha, character):
            return z**2 - alpha

    assert check_system(Two(), [([1.0], 1.0), ([2.0], 4.0)])
    assert "unique is True, but there is another" in words(Two(), [([1.0], 1.0), ([-1.0], 1.0)])


@pytest.mark.parametrize("radius", [0.0, -1.0, np.nan, "far"])
def test_radius(radius):
    with pytest.raises(InvalidInputError, match="radius"):
        check_system(broken(), POINTS, radius=radius)


class Hinge(PiecewiseLinearSystem):
    """z + c max(z, 0) = alpha: the signs sum to 1 for c > -1, to 0 below."""

    size = 1

    def __init__(self, c, degree=None, unique=False):
        self.c, self.degree, self.unique = c, degree, unique

    def test_functions(self, z, alpha):
        return z.copy()

    def residual(self, z, alpha, character):
        return z + self.c * z * character.signs[0] - alpha


@pytest.mark.parametrize(
    ("c", "degree", "unique", "word"),
    [
        (1.0, 1, True, None),
        (-2.0, 0, False, None),
        (-2.0, 1, False, "degree"),
        (1.0, -1, False, "degree"),
        (-2.0, None, True, "unique"),
    ],
)
def test_degree_and_unique_are_held_to_all_solutions(c, degree, unique, word):
    report = check_system(Hinge(c, degree, unique), [([0.3], -0.7), ([-0.1], 0.4)])
    assert bool(report) == (word is None)
    assert word is None or word in str(report)


class HiddenKink(PiecewiseSystem):
    """Decides by z where the character is given, and has a misspelt and a plural method."""

    size = 1

    def test_functions(self, z, alpha):
        return z - 0.3

    def residual(self, z, alpha, character):
        return z - alpha + 10.0 * np.maximum(z - 0.3, 0.0)

    def jacobain(self, z, alpha, character):
        return [[1.0, -1.0]]

    def residuals(self):
        return None


def test_a_kink_on_the_boundary_and_a_misspelt_method_are_named():
    defects = [each.what for each in check_system(HiddenKink(), [([-0.5], 0.5)]).defects]
    assert len(defects) == 2
    assert any("decide by character.signs" in words for words in defects)
    assert "jacobain is never asked for; is jacobian meant?" in defects


@pytest.mark.parametrize("signs", [[1, -1], "+-", [0.5], [None], 3, None])
def test_a_character_has_signs_only(signs):
    with pytest.raises(InvalidInputError, match="True or False"):
        Character(signs)


@pytest.mark.parametrize("text", ["+x", "+ -", 3, [True]])
def test_a_character_is_read_from_plus_and_minus(text):
    with pytest.raises(InvalidInputError, match="written as"):
        Character.read(text)
