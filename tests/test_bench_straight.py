"""Yardsticks of straight paths: loops by hand end where `trace` does, and so does the benchmark."""

import json
import sys
from pathlib import Path

import numpy as np
import pytest
from pages import DOCS, page

from pwscont import Character, check_system, trace

sys.path.insert(0, str(Path(__file__).parents[1] / "benchmarks"))
import limits
import straight
from lasso import Lasso, is_installed
from obstacle import String

SIZES = {"strip": 20, "string, banded": 30, "string, sparse": 30, "LASSO": 20}


@pytest.mark.parametrize("path", SIZES)
def test_every_way_ends_at_the_same_state(path):
    ways = straight.CASES[path](SIZES[path])
    row = straight.measured(ways, 1)
    assert row["transitions"] > 10
    assert ("bare" in ways) == (path != "LASSO" or is_installed())
    assert all(row[way] > 0.0 for way in ways)


@pytest.mark.parametrize("change", [{"transitions": 4}, {"end": np.array([1.0, 2.0 + 1e-8])}])
def test_ways_that_differ_are_refused(change):
    true = straight.Run(1.0, 3, np.array([1.0, 2.0]))
    straight.check(true, true._replace(each=2.0))
    with pytest.raises(SystemExit):
        straight.check(true, true._replace(**change))


@pytest.mark.parametrize("system", [String(4, True), String(4, False), Lasso(3)])
def test_the_systems_are_right(system):
    rng = np.random.default_rng(0)
    points = [(rng.normal(size=system.size), alpha) for alpha in (0.2, 0.9)]
    assert check_system(system, points)


def test_break_points_are_optimal():
    """Subgradients lie between -1 and 1, and are signs where coefficients are not zero."""
    lasso = Lasso(20)
    graph = trace(lasso, (lasso.start, lasso.interval[1]), lasso.interval)
    assert len(graph.special_points("transition")) > 10
    for point in graph.special_points():
        b = np.sign(point.z) * np.maximum(np.abs(point.z) - point.alpha, 0.0)
        subgradient = (lasso.start - lasso.gram @ b) / point.alpha
        assert np.abs(subgradient).max() <= 1.0 + 1e-9
        np.testing.assert_allclose(subgradient[b != 0.0], np.sign(b[b != 0.0]), rtol=1e-9)


def test_both_jacobians_of_a_string_are_one():
    banded, sparse = String(6, True), String(6, False)
    z, character = np.zeros(6), Character([True, False, False, True, True, False])
    both = [s.jacobian(z, 0.0, character).toarray() for s in (banded, sparse)]
    np.testing.assert_array_equal(*both)


def test_the_page_shows_the_stored_figures():
    data = json.loads((DOCS / "data" / "scale.json").read_text(encoding="utf-8"))
    for row in data["straight"]:
        assert straight.told(row) in page("scale.rst")
    for row in data["limits"]:
        assert limits.Row(**row).told() in page("scale.rst")


def test_the_table_of_limits_compares_ways_that_are_measured():
    for path, _, yardstick, limit in limits.RATIOS:
        ways = straight.CASES[path](SIZES[path])
        assert yardstick in ways or (path == "LASSO" and not is_installed())
        assert limit >= 1
    over = limits.Row("a path", 2.345, 2.0, " ×")
    assert over.told() == '   "a path", "2.35 ×", "2 ×"'


def test_diodes_that_turn_at_once_have_one_solution_everywhere():
    graph = trace(limits.Chain(6), (np.full(6, -0.01), -1.0), (-1.0, 1.0))
    assert [graph.count(alpha) for alpha in (-0.7, -0.1, 0.2, 0.9)] == [1, 1, 1, 1]
