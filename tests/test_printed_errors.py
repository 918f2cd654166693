"""The table and the JSON print the estimated errors, and say where few digits are known."""

import re

import numpy as np
import pytest
from paper_systems import CASES
from pwscont_coulomb import AffineLoad, ContactBody, CoulombLoad

from pwscont import Scene, explore


def answer(system, interval, at):
    scene = Scene("told", "told", system, interval, at=at)
    return scene.solve(at, lambda *_: None)


def fig7():
    case = CASES["fig7"]
    return answer(case.system, case.interval, at=(-0.75, 0.5))


def soft(lost=12):
    """Return the answer for a body with a direction 10^12 times as soft as the other."""
    turn = np.array([[0.6, -0.8], [0.8, 0.6]])
    A = (turn * [1.0, 10.0**-lost]) @ turn.T
    body = ContactBody((A + A.T) / 2.0, np.eye(2)[:1], np.eye(2)[1:])
    return answer(CoulombLoad(body, AffineLoad(-A[:, 0], A[:, 1]), 0.5), (-1.0, 1.0), at=(0.5,))


def points_of(text):
    return [line for line in text.splitlines() if re.match(r"  [a-z]", line) and "=" in line]


def solutions_of(text):
    return [line for line in text.splitlines() if re.match(r"  \d+\. ", line)]


def test_each_special_point_and_each_solution_has_its_error():
    shown = fig7()
    text, data = shown.as_text(), shown.as_dict()
    assert all(re.search(r"alpha = \S+ ± \de-\d\d\b", line) for line in points_of(text))
    assert all(re.search(r", error \de-\d\d$", line) for line in solutions_of(text))
    assert len(points_of(text)) == len(data["nodes"]) == 5
    assert len(solutions_of(text)) == len(data["solutions"]) == 4
    assert "only" not in text


@pytest.mark.parametrize("make", [fig7, soft])
def test_the_json_has_errors_and_digits(make):
    data = make().as_dict()
    for item in data["nodes"] + data["solutions"]:
        assert len(item["error"]) == len(item["z"]) + 1
        assert 0.0 <= item["digits"] <= 16.0


def test_few_digits_are_said():
    shown = soft()
    text, data = shown.as_text(), shown.as_dict()
    (solution,), (line,) = data["solutions"], solutions_of(text)
    assert solution["digits"] < 6.0
    few = f"only {int(solution['digits'])} digits known"
    assert line.endswith(few)
    alarmed = [node for node in data["nodes"] if node["digits"] < 6.0]
    assert len([line for line in points_of(text) if "digits known" in line]) == len(alarmed) > 0


def test_no_graph_with_few_digits_is_called_complete():
    """Friction of one node 1e15 times its neighbour's leaves no digit, and a piece is missing."""
    body = ContactBody(
        [
            [2.0, -1.0, -0.3, 0.0],
            [-1.0, 2.0, 0.0, -0.3],
            [-0.3, 0.0, 2.0, -1.0],
            [0.0, -0.3, -1.0, 2.0],
        ],
        N=[[1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]],
        T=[[0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]],
    )
    load = AffineLoad([0.25, 0.05, 0.25, 0.15], [0.1, 1.0, 0.1, 1.0])
    for contrast, promises in ((1.0, True), (1e12, True), (1e15, False)):
        graph = explore(CoulombLoad(body, load, [4.0 * contrast, 4.0]), (-2.0, 2.0))
        few = any(point.digits < 2.0 for point in graph.special_points())
        assert few != promises
        assert (graph.guarantee == "complete") == promises
