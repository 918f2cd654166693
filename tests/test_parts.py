"""Systems that fall into parts: slices and corners against brute force and closed forms."""

from fractions import Fraction
from itertools import product

import numpy as np
import pytest

from pwscont import Block, Character, PiecewiseLinearSystem, enumerate_solutions, explore, trace
from pwscont.basics.rounding import CONFIDENCE
from pwscont.curve.metric import Metric
from pwscont.enumeration import by_parts, slices
from pwscont.enumeration.by_parts import most_cells, parts_of_table
from pwscont.enumeration.options import Table


class Chained(PiecewiseLinearSystem):
    """A z + B |z| = a + alpha b, with parts of a given size, each coupled to those before.

    The test functions are the unknowns, in another order than the parts.
    """

    def __init__(self, rng, sizes, spread=1.0):
        self.size = n = sum(sizes)
        self.A, self.B = np.zeros((n, n)), np.zeros((n, n))
        at = 0
        for size in sizes:
            own = slice(at, at + size)
            self.A[own, : at + size] = spread * rng.normal(size=(size, at + size))
            self.A[own, own] += np.eye(size)
            self.B[own, own] = rng.normal(size=(size, size)) * rng.choice([0.3, 2.0])
            at += size
        self.a, self.b = rng.normal(size=(2, n))
        self.order = rng.permutation(n)
        parts = np.split(np.arange(n), np.cumsum(sizes)[:-1])
        self.parts = [tuple(part.tolist()) for part in parts]

    def test_functions(self, z, alpha):
        return z[self.order]

    def signs(self, character):
        signs = np.empty(self.size)
        signs[self.order] = np.where(character.signs, 1.0, -1.0)
        return signs

    def residual(self, z, alpha, character):
        return self.A @ z + self.B @ (self.signs(character) * z) - self.a - alpha * self.b

    def blocks(self):
        place = np.argsort(self.order)
        return tuple(
            Block(
                tuple(int(place[i]) for i in part),
                part,
                tuple(product((True, False), repeat=len(part))),
            )
            for part in self.parts
        )

    def by_brute_force(self, alpha):
        """Return all z with a sign pattern that is their own."""
        found = []
        for signs in product((1.0, -1.0), repeat=self.size):
            z = np.linalg.solve(self.A + self.B * np.array(signs), self.a + alpha * self.b)
            if (z * signs >= 0.0).all():
                found.append(z)
        return found


@pytest.mark.sweep(42)
@pytest.mark.parametrize("seed", range(40))
@pytest.mark.parametrize("sizes", [(1,) * 8, (2, 1, 3, 1, 1), (3, 3, 2)])
def test_slices_in_parts_against_brute_force(seed, sizes):
    system = Chained(np.random.default_rng([seed, len(sizes)]), sizes)
    for alpha in (-1.3, 0.7):
        expected = system.by_brute_force(alpha)
        found = enumerate_solutions(system, alpha)
        assert len(found) == len(expected)
        for z in expected:
            assert min(np.abs(solution.z - z).max() for solution in found) < 1e-9 * (
                1.0 + np.abs(z).max()
            )
        for solution in found:
            signs = np.sign(solution.z)
            assert solution.det_sign == np.sign(np.linalg.det(system.A + system.B * signs))


def test_there_are_slices_with_several_solutions():
    """Else the comparison above would say little."""
    counts = [
        len(Chained(np.random.default_rng([seed, 5]), (2, 1, 3, 1, 1)).by_brute_force(0.7))
        for seed in range(40)
    ]
    assert max(counts) > 4
    assert counts.count(0) > 0


class Diodes(PiecewiseLinearSystem):
    """A chain of n diodes with equal thresholds: one solution at every alpha."""

    def __init__(self, n):
        self.size = n

    def test_functions(self, z, alpha):
        return z

    def residual(self, z, alpha, character):
        return (1.0 + character.array) * z - np.append(alpha, 0.05 * z[:-1])

    def blocks(self):
        return tuple(Block((k,), (k,), ((True,), (False,))) for k in range(self.size))

    def solution(self, alpha):
        slope = 2.0 if alpha >= 0.0 else 1.0
        return alpha / slope * (0.05 / slope) ** np.arange(self.size)


@pytest.mark.parametrize("alpha", [-0.5, 0.0, 0.5])
@pytest.mark.parametrize("n", [8, 16, 30])
def test_a_chain_of_diodes_has_one_solution(n, alpha):
    (found,) = enumerate_solutions(Diodes(n), alpha)
    np.testing.assert_allclose(found.z, Diodes(n).solution(alpha), rtol=1e-12, atol=1e-300)


@pytest.mark.parametrize("n", [12, 24, 60, 100])  # magnitudes fall to 1e-158
@pytest.mark.sweep(4)
def test_all_ways_on_from_a_corner_of_many_diodes(n):
    system = Diodes(n)
    graph = trace(system, (system.solution(-1.0), -1.0), (-1.0, 1.0))
    assert graph.guarantee == "balanced"
    assert [graph.count(alpha) for alpha in (-0.5, 0.5)] == [1, 1]
    np.testing.assert_allclose(graph.solutions(0.5)[0].z, system.solution(0.5), rtol=1e-9)


@pytest.mark.parametrize("n", [12, 24])
def test_explore_is_sure_of_a_long_chain(n):
    """Each diode has a slope of one sign, so that no branch turns: there are no loops."""
    graph = explore(Diodes(n), (-1.0, 1.0))
    assert graph.count(0.5) == 1
    assert graph.guarantee == "complete"
    assert "no branch turns" in graph.searched.what


class Detached(PiecewiseLinearSystem):
    """z_k + s_k |z_k| = alpha for each k by itself: with s_k = -2 there is a fold at alpha = 0."""

    def __init__(self, folds):
        self.slopes = np.where(folds, -2.0, 0.5)
        self.size = len(folds)

    def test_functions(self, z, alpha):
        return z

    def residual(self, z, alpha, character):
        return z + self.slopes * np.where(character.array, z, -z) - alpha

    def blocks(self):
        return tuple(Block((k,), (k,), ((True,), (False,))) for k in range(self.size))


@pytest.mark.parametrize("folds", [1, 2, 3])
@pytest.mark.sweep(2)
def test_branches_of_detached_parts_multiply(folds):
    """Each fold has two solutions for alpha < 0 and none beyond."""
    system = Detached(np.arange(9) < folds)
    graph = explore(system, (-1.0, 1.0))
    assert graph.count(-0.5) == 2**folds
    assert graph.count(0.5) == 0
    (corner,) = (p for p in graph.special_points() if p.alpha == 0.0)
    assert len(graph.pieces_at(corner.id)) == 2**folds
    assert "no branch turns" not in graph.searched.what


class Loops(Detached):
    """The first two unknowns make a loop: |z_0| + |z_1| = 1/2 and z_1 = alpha."""

    def residual(self, z, alpha, character):
        rows = super().residual(z, alpha, character)
        signs = np.where(character.array, 1.0, -1.0)
        rows[0] = signs[0] * z[0] + signs[1] * z[1] - 0.5
        rows[1] = z[1] - alpha
        return rows

    def blocks(self):
        first = Block((0, 1), (0, 1), tuple(product((True, False), repeat=2)))
        return (first, *super().blocks()[2:])


def test_a_loop_in_a_chain_without_other_turns_is_found():
    """|z_0| + |alpha| = 1/2 is a diamond that meets no end of the interval."""
    graph = explore(Loops(np.zeros(10, bool)), (-1.0, 1.0))
    assert [graph.count(alpha) for alpha in (-0.8, -0.3, 0.3, 0.8)] == [0, 2, 2, 0]
    assert graph.guarantee == "complete"


def parts_of(pattern, tests, blocks):
    """Return the parts of a slice with these unknowns in rows and tests."""
    rows, values = (np.zeros(len(matrix)) for matrix in (pattern, tests))
    table = Table([(pattern.astype(float), rows)], (tests.astype(float), values), blocks, [])
    return parts_of_table(table)


class Sums(PiecewiseLinearSystem):
    """Each unknown, or each two, is about the sum of those before; the second is nearly zero.

    The rounding of the first unknowns is most of the error of all others, and grows with them.
    """

    def __init__(self, size, n=30):
        self.size = n
        weights = np.random.default_rng(size).uniform(0.9, 1.1, (n, n))
        self.A = np.eye(n) - np.tril(weights, -1)
        self.A[1:, 0], self.A[0, 0], self.A[1, 0] = 0.0, 3.0, -1.0
        if size == 2:
            first = np.arange(2, n, 2)
            self.A[first, first + 1], self.A[first + 1, first] = 0.3, -0.4
        self.rest = np.zeros(n)
        self.rest[:2] = -0.7, 0.7 / 3.0 - 1e-6

    def test_functions(self, z, alpha):
        return z

    def residual(self, z, alpha, character):
        return self.A @ z + self.rest

    def blocks(self):
        return tuple(Block((k,), (k,), ((True,), (False,))) for k in range(self.size))

    def solution(self):
        """Return the solution in rational numbers."""
        rows = [
            [Fraction(x) for x in row] for row in np.column_stack([self.A, -self.rest]).tolist()
        ]
        for i, pivot in enumerate(rows):
            for j, row in enumerate(rows):
                if j != i and row[i]:
                    part = row[i] / pivot[i]
                    rows[j] = [a - part * b for a, b in zip(row, pivot, strict=True)]
        return [row[-1] / row[i] for i, row in enumerate(rows)]


@pytest.mark.parametrize("size", [1, 2])
def test_errors_of_parts_grow_with_those_of_parts_before(size, monkeypatch):
    system, found = Sums(size), []

    def kept(*given):
        found.extend(solve_parts(*given))
        return found

    solve_parts = by_parts.solve_parts
    monkeypatch.setattr(by_parts, "solve_parts", kept)
    slices.solve_slice(system, Metric(np.ones(system.size + 1)), 0.0)
    (partial,) = found
    pairs = zip(partial.z.tolist(), system.solution(), strict=True)
    far = [float(abs(Fraction(x) - y)) for x, y in pairs]
    error = np.hypot.reduce(partial.error, axis=0)
    assert (np.array(far) <= CONFIDENCE * error).all()
    assert (error <= 1e-3 * np.abs(partial.z)).all()


def test_parts_come_after_what_they_need():
    pattern = np.eye(5, dtype=bool)
    pattern[0, 3] = pattern[3, 0] = True  # a part of two
    pattern[2, 0] = pattern[1, 2] = pattern[4, 1] = True
    blocks = [Block((k,), (k,), ((True,), (False,))) for k in range(5)]
    tests = np.eye(5, dtype=bool)
    parts = parts_of(pattern, tests, blocks)
    assert [sorted(part.rows.tolist()) for part in parts] == [[0, 3], [2], [1], [4]]
    assert most_cells(parts, blocks) == 4
    tests[3, 4] = True  # what chooses the mode of row 3 depends on everything
    assert len(parts_of(pattern, tests, blocks)) == 1


def test_without_a_pairing_there_is_one_part():
    pattern = np.eye(4, dtype=bool)
    pattern[3] = [True, False, False, False]
    blocks = [Block((k,), (k,), ((True,), (False,))) for k in range(4)]
    assert len(parts_of(pattern, np.eye(4, dtype=bool), blocks)) == 1


def test_the_signs_of_a_character_as_an_array():
    character = Character((True, False, True))
    assert character.array.tolist() == [True, False, True]
    with pytest.raises(ValueError, match="read-only"):
        character.array[0] = False
