"""Branch points that the signs at the ends of a step do not tell, against counts in closed form."""

import numpy as np
import pytest

from pwscont import PiecewiseSystem, Switched, trace

END = 0.95

#: Rows that cross the path z = 0 at alpha = b, and the number of solutions of a row beyond b.
ROWS = {
    "pitchfork": (lambda z, t, sw: z * (z**2 - t), 3),
    "kinked pitchfork": (lambda z, t, sw: z * (sw.abs(z) - t), 3),
    "transcritical": (lambda z, t, sw: z * (z - t), 2),
}


def counted(row, places, mixed=False):
    """Return what ``trace`` counts beyond all places, from z = 0 on, and the guarantee."""
    places, n = np.array(places), len(places)
    mix = np.eye(n) + 0.3 * np.cos(np.arange(n * n).reshape(n, n)) if mixed else np.eye(n)

    def residual(z, alpha, sw):
        rows = row(z, alpha - places, sw)
        return [sum(mix[i, j] * rows[j] for j in range(n)) for i in range(n)]

    graph = trace(Switched(n, residual), (np.zeros(n), -1.0), (-1.0, 1.0))
    return graph.count(END), str(graph.guarantee)


@pytest.mark.sweep(8)
@pytest.mark.parametrize("name", ROWS)
@pytest.mark.parametrize("apart", [0.08, 0.04, 0.01, 0.001])
def test_two_branch_points_within_a_step(name, apart):
    row, beyond = ROWS[name]
    for first in (-0.45, 0.13):
        assert counted(row, [first, first + apart]) == (beyond**2, "balanced")


@pytest.mark.slow
@pytest.mark.parametrize("name", ROWS)
@pytest.mark.parametrize("apart", [0.03, 0.01, 0.003])
def test_three_branch_points_within_a_step(name, apart):
    row, beyond = ROWS[name]
    places = [0.13, 0.13 + apart, 0.13 + 2.2 * apart]
    assert counted(row, places) == (beyond**3, "balanced")


def test_two_branch_points_of_coupled_equations():
    row, beyond = ROWS["pitchfork"]
    assert counted(row, [0.2, 0.21], mixed=True) == (beyond**2, "balanced")


@pytest.mark.sweep(60)
@pytest.mark.parametrize("seed", range(60))
def test_pairs_anywhere_in_a_step_are_found_or_announced(seed):
    rng = np.random.default_rng(seed)
    first, second = (ROWS[name] for name in rng.permutation(list(ROWS))[:2])
    lo, hi = rng.uniform(-2.0, -0.5), rng.uniform(0.5, 2.0)
    places = rng.uniform(0.6 * lo, 0.3 * hi) + np.array([0.0, 10.0 ** rng.uniform(-3.0, -1.0)])
    bend = rng.uniform(-0.15, 0.15)

    def beyond(alpha, place):
        return alpha - place + bend * (alpha**2 - place**2)

    def residual(z, alpha, sw):
        pairs = zip((first, second), z, places, strict=True)
        return [row(x, beyond(alpha, place), sw) for (row, _), x, place in pairs]

    graph = trace(Switched(2, residual), (np.zeros(2), lo), (lo, hi))
    # beyond both places; 1 + 2 bend alpha > 0 makes each row cross the path once
    assert graph.count(hi - 0.05) == first[1] * second[1] or str(graph.guarantee) != "balanced"


def test_two_branch_points_beside_many_stiff_unknowns():
    n = 12

    def residual(z, alpha, sw):
        pitchforks = z[:2] * (z[:2] ** 2 - (alpha - np.array([0.2, 0.21])))
        # the determinant falls by orders of magnitude along the way, for the springs unload
        springs = z[2:] + 50.0 * z[2:] ** 3 - 30.0 * (1.0 - alpha)
        return np.concatenate([pitchforks, springs])

    loaded = max(np.roots([50.0, 0.0, 1.0, -60.0]), key=lambda root: -abs(root.imag)).real
    start = np.concatenate([np.zeros(2), np.full(n - 2, loaded)])
    graph = trace(Switched(n, residual), (start, -1.0), (-1.0, 1.0))
    assert (graph.count(END), str(graph.guarantee)) == (9, "balanced")


@pytest.mark.slow
def test_branch_point_exactly_at_the_end_of_the_first_step_behind_another():
    row, beyond = ROWS["kinked pitchfork"]
    first_step = 0.02 * 2.0  # of an interval of length 2
    assert counted(row, [-0.45, -0.45 + first_step]) == (beyond**2, "balanced")


class Cluster(PiecewiseSystem):
    """M g(N z) = 0 with g_i = y_i (y_i^2 - p_i(alpha)): y_i = 0, and two roots more beyond b_i."""

    def __init__(self, seed, count, apart):
        rng = np.random.default_rng(seed)
        self.size = count
        self.places = rng.uniform(-0.6, 0.6) + 2.0 * apart * np.sort(rng.uniform(size=count))
        self.bend = rng.uniform(-0.3, 0.3, count)
        spread = 0.4 / np.sqrt(count)
        self.rows, self.columns = np.eye(count) + spread * rng.normal(size=(2, count, count))

    def beyond(self, alpha):
        return (alpha - self.places) * (1.0 + self.bend * (alpha - self.places))

    def test_functions(self, z, alpha):
        return np.zeros(0)

    def residual(self, z, alpha, character):
        y = self.columns @ z
        return self.rows @ (y * (y * y - self.beyond(alpha)))

    def jacobian(self, z, alpha, character):
        y = self.columns @ z
        by_y = 3.0 * y * y - self.beyond(alpha)
        by_alpha = -y * (1.0 + 2.0 * self.bend * (alpha - self.places))
        return np.column_stack(
            [self.rows @ (by_y[:, np.newaxis] * self.columns), self.rows @ by_alpha]
        )


@pytest.mark.slow
@pytest.mark.parametrize(("count", "apart"), [(3, 0.1), (3, 0.02), (3, 1e-3), (4, 0.1), (4, 0.02)])
@pytest.mark.parametrize("seed", range(6))
def test_three_and_four_branch_points_close_together(count, apart, seed):
    cluster = Cluster(seed, count, apart)
    graph = trace(cluster, (np.zeros(count), -1.0), (-1.0, 1.0))
    is_right = (graph.count(-0.95), graph.count(0.97)) == (1, 3**count)
    assert is_right or str(graph.guarantee) != "balanced"
    if apart > 1e-2 and count == 3:
        assert is_right


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize(
    ("count", "apart"), [(2, 1e-2), (2, 1e-3), (2, 1e-4), (3, 1e-2), (4, 1e-2)]
)
def test_branch_points_close_together_with_many_unknowns(count, apart, seed):
    """Beside the branch points springs y + y^3 = 0, all mixed by matrices."""
    n, cluster, rng = 40, Cluster(seed, count, apart), np.random.default_rng(seed)
    rows, columns = np.eye(n) + 0.05 * rng.normal(size=(2, n, n))

    def residual(z, alpha, sw):
        y, springs = np.split(columns @ z, [count])
        pitchforks = y * (y**2 - cluster.beyond(alpha))
        return rows @ np.concatenate([pitchforks, springs * (1.0 + springs**2)])

    graph = trace(Switched(n, residual), (np.zeros(n), -1.0), (-1.0, 1.0))
    is_right = (graph.count(-0.95), graph.count(0.97)) == (1, 3**count)
    assert is_right or str(graph.guarantee).startswith("not balanced")
    assert is_right or count > 2


def test_two_branch_points_where_a_piece_begins_at_another_one():
    assert counted(ROWS["pitchfork"][0], [0.2, 0.203, 0.2041])[0] == 27


@pytest.mark.parametrize("name", ROWS)
def test_two_curves_that_cross_a_path_at_one_point_are_announced(name):
    count, words = counted(ROWS[name][0], [0.13, 0.13])
    assert count == 1
    assert "curves touch, or more than two cross, at alpha = 0.13" in words


@pytest.mark.slow
@pytest.mark.parametrize("beyond", [0.03, 0.2, 0.5])
def test_curves_that_cross_at_one_point_before_another_branch_point_are_announced(beyond):
    places = np.array([0.13, 0.13, 0.13 + beyond])

    def residual(z, alpha, sw):
        t = alpha - places
        return [z[0] * (z[0] - t[0]), z[1] * (sw.abs(z[1]) - t[1]), z[2] * (z[2] ** 2 - t[2])]

    graph = trace(Switched(3, residual), (np.zeros(3), -1.0), (-1.0, 1.0))
    assert graph.count(END) == 18 or "touch, or more than two cross" in str(graph.guarantee)


@pytest.mark.parametrize("size", [5, 6, 8, 9])
@pytest.mark.parametrize("coupling", [0.15, 0.27, 0.4])
@pytest.mark.sweep(3)
def test_a_ring_loses_rank_twice_on_its_uniform_path(size, coupling):
    """z_i (alpha - z_i^2) + k (z_{i-1} - 2 z_i + z_{i+1}) = b at z = (u, ..., u): cosine and sine.

    Both eigenvalues are alpha - 3 u^2 - 2 k (1 - cos(2 pi / n)).
    """
    unequal = 2.0 * coupling * (1.0 - np.cos(2.0 * np.pi / size))
    u = min(x.real for x in np.roots([2.0, 0.0, unequal, -0.02]) if abs(x.imag) < 1e-12)
    place = unequal + 3.0 * u**2

    def residual(z, alpha, sw):
        beside = [z[i - 1] - 2.0 * z[i] + z[(i + 1) % size] for i in range(size)]
        return [z[i] * (alpha - z[i] ** 2) + coupling * beside[i] - 0.02 for i in range(size)]

    end = place + 0.1
    start = min((x.real for x in np.roots([-1.0, 0.0, end, -0.02])), key=lambda x: abs(x - u))
    graph = trace(Switched(size, residual), (np.full(size, start), end), (-0.3, end))
    (point,) = graph.special_points("degenerate")
    assert abs(point.alpha - place) < 1e-4
    assert "curves touch, or more than two cross" in graph.guarantee


def test_nothing_is_seen_where_the_determinant_is_small_but_does_not_vanish():
    def residual(z, alpha, sw):
        return [z[0] * (z[0] ** 2 + (alpha - 0.1) ** 2 + 1e-3)]

    graph = trace(Switched(1, residual), ([0.0], -1.0), (-1.0, 1.0))
    assert [str(point.kind) for point in graph.special_points()] == ["start", "end"]
    assert str(graph.guarantee) == "balanced"


def test_a_jacobian_that_is_undefined_in_the_middle_of_steps_hides_no_branches():
    class Partly(Cluster):
        def jacobian(self, z, alpha, character):
            # undefined in the middle of steps, whose ends are at round numbers
            undefined = 0.05 < alpha < 0.25 and round(1e6 * alpha) % 10000
            return super().jacobian(z, alpha, character) + (np.nan if undefined else 0.0)

    graph = trace(Partly(0, 2, 0.01), (np.zeros(2), -1.0), (-1.0, 1.0))
    assert graph.count(-0.95) == 1
    assert graph.count(0.97) == 9 or str(graph.guarantee).startswith("not balanced")
