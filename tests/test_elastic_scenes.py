"""The scenes wedge and press: what they are meant to show is there."""

import json

import numpy as np
import pytest
from pwscont_coulomb.elastic import recover
from pwscont_coulomb.elastic.scenes import (
    PRESS_MESH,
    block_body,
    press,
    press_body,
    triangle,
    wedge,
    wedge_body,
)

from pwscont import explore
from pwscont.basics.errors import InvalidInputError
from pwscont.bench.cases import case_of
from pwscont.commands.cli import main
from pwscont.continuation.plan import silent


def jam(nodes):
    """Return the interval with three solutions of a wedge with so many nodes on each wall."""
    graph = explore(wedge_body(nodes).condensed().along_load(), wedge().interval)
    assert graph.is_balanced()
    several = [(lo, hi) for lo, hi, count in graph.multiplicity() if count == 3]
    assert len(graph.special_points("nonsmooth fold")) == 2
    assert len(several) == 1
    return np.array(several[0])


@pytest.mark.slow
def test_the_wedge_jams_on_every_mesh():
    """The interval with three solutions does not depend on the mesh: it converges."""
    coarse, middle, fine = jam(5), jam(9), jam(13)
    np.testing.assert_allclose(middle, [0.031658, 0.116364], atol=2e-6)
    assert (np.abs(fine - middle) < 0.012 * middle).all()
    assert np.abs(fine - middle).max() < np.abs(middle - coarse).max()


def test_each_state_of_the_wedge_is_an_equilibrium():
    """Stuck, slipping and out: forces on the whole body balance, walls obey contact and friction.

    The vertical force of walls and hanger balances the pull: 0.01 alpha times the wedge's area.
    """
    problem = wedge_body().condensed()
    graph = explore(problem.along_load(), wedge().interval)
    found = graph.solutions(0.07)
    assert sorted(solution.det_sign for solution in found) == [-1, 1, 1]
    body, contact = problem.elastic, problem.elastic.contact
    stiffness = body.space.stiffness(*body._lame)
    for solution in found:
        state = recover(problem, solution)
        forces = (stiffness @ state.displacements.ravel())[body.free] - body.load(0.07)
        wall = state.normal_force * contact.normals + state.tangential_force * contact.tangents
        forces[body.contact_unknowns] -= wall.T.ravel()
        assert np.abs(forces).max() < 1e-9 * np.abs(wall).max()
        bound = 0.5 * np.abs(state.normal_force)
        tiny = 1e-9 * np.abs(state.displacements).max()
        assert (state.normal_force <= 1e-20).all()
        assert (state.distance >= -tiny).all()
        assert (np.abs(state.tangential_force) <= bound * (1.0 + 1e-9) + 1e-20).all()
        resisting = -state.tangential_force * np.sign(state.slip)
        moving = np.abs(state.slip) > tiny
        np.testing.assert_allclose(resisting[moving], bound[moving], rtol=1e-8, atol=1e-18)
    pulls = [recover(problem, s).displacements[:, 1].max() for s in found]
    assert max(pulls) > 5.0 * min(pulls)  # out of the slot, and in it


def test_the_press_mesh_is_curved():
    """Gmsh's second order: normals of rounded edges are radial, the sole's length is the arc's."""
    contact = press_body().contact
    assert PRESS_MESH.with_suffix(".geo").is_file()
    x, y = contact.positions
    rounded = np.abs(x) > 0.6 + 1e-9
    radial = np.stack([x - np.sign(x) * 0.6, y - 0.4])[:, rounded] / 0.4
    np.testing.assert_allclose(np.hypot(*radial), 1.0, atol=1e-9)
    np.testing.assert_allclose(contact.normals[:, rounded], radial, atol=5e-4)
    np.testing.assert_allclose(contact.normals[:, ~rounded][1], -1.0, atol=1e-6)
    assert contact.areas.sum() == pytest.approx(1.2 + 0.4 * np.pi / 2.0, rel=1e-5)
    # from a node along its normal down to the table
    foot = contact.positions + contact.gap * contact.normals
    np.testing.assert_allclose(foot[1], 0.0, atol=2e-4)


def test_the_press_presses_and_shears():
    answer = press().solve((0.0, 1.0), silent)
    graph = answer.graph.graph
    (down,), (sheared,) = graph.solutions(0.0), graph.solutions(1.0)
    before, after = recover(answer.problem, down), recover(answer.problem, sheared)
    assert 15 <= np.count_nonzero(before.pressure > 0.0) < 29
    # without shear the tool is nearly symmetric (its mesh is not)
    np.testing.assert_allclose(before.pressure, before.pressure[::-1], atol=0.12)
    contact = answer.problem.elastic.contact
    pull = after.normal_force * contact.normals + after.tangential_force * contact.tangents
    assert pull[0].sum() < 0.0  # the table holds the tool back
    assert pull[1].sum() > 0.0


@pytest.mark.slow
def test_text_of_a_large_body_is_short():
    """Neighbours in one mode are named together, solutions in sum: resultant, peak, size."""
    answer = wedge().solve((0.07,), silent)
    text = answer.as_text()
    assert max(map(len, text.splitlines())) < 250
    assert "3 solutions at alpha = 0.07" in text
    labels = [f"{s.label}, det {s.det_sign:+d}" for s in answer.graph.graph.solutions(0.07)]
    assert labels[2] == "nodes 1 to 8 no contact, node 9 slip-, nodes 10 to 18 no contact, det +1"
    assert all(label in text for label in labels)
    state = recover(answer.problem, answer.graph.graph.solutions(0.07)[2])
    assert f"({state.normal_force[8]:.8g}, " not in text  # the left wall pushes to the right
    assert f"({-state.normal_force[8]:.8g}, " in text
    assert f"largest pressure {state.pressure[8]:.8g} at node 9" in text


@pytest.mark.parametrize("make", [block_body, wedge_body])
def test_a_body_needs_two_nodes(make):
    with pytest.raises(InvalidInputError, match="nodes must be at least 2, got 1"):
        make(1)


def test_the_bench_knows_the_answer_of_the_triangle():
    """A body of one node is solved in rational arithmetic."""
    case = case_of(triangle())
    assert case.is_straight
    assert case.truth.known_by == "rational arithmetic"
    assert len(case.truth.pieces) == 4


def test_reading_a_mesh_prints_nothing(capsys):
    press_body()
    assert capsys.readouterr().out == ""


# -- settings -------------------------------------------------------------------------------------


@pytest.mark.slow
def test_the_size_of_a_block_is_a_setting(capsys):
    assert main(["run", "block", "-s", "nodes=4", "friction=0.5", "--json"]) == 0
    data = json.loads(capsys.readouterr().out)
    assert {len(node["z"]) for node in data["nodes"]} == {4 * 4}
    assert main(["scenes"]) == 0
    assert "20 contact nodes, F = 0.3 [-s nodes=20 friction=0.3]" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("setting", "message"),
    [
        ("node=5", "has no setting 'node'; it has nodes=20, friction=0.3"),
        ("nodes=many", "nodes of scene block must be a whole number, got 'many'"),
        ("friction=high", "friction of scene block must be a number, got 'high'"),
        ("nodes=1", "at least 2"),
        ("friction=-1", "negative"),
    ],
)
def test_settings_that_do_not_fit(setting, message, capsys):
    assert main(["run", "block", "-s", setting]) == 2
    assert message in capsys.readouterr().err


def test_a_scene_without_settings_says_so(capsys):
    assert main(["run", "fig7", "-s", "F=3"]) == 2
    assert "scene fig7 has no setting 'F'; it has none" in capsys.readouterr().err


def test_a_setting_needs_a_value(capsys):
    with pytest.raises(SystemExit):
        main(["run", "block", "-s", "nodes"])
    assert "'nodes' is not of the form NAME=VALUE" in capsys.readouterr().err
