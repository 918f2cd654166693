"""Pictures, files and scenes of elastic bodies show what the solutions are."""

import json

import meshio
import numpy as np
import pytest
from elastic_bodies import KINDS, pressed, square
from matplotlib.quiver import Quiver
from PIL import Image
from pwscont_coulomb.elastic import recover
from pwscont_coulomb.elastic import scene as scene_module
from pwscont_coulomb.elastic.animation import along, animate
from pwscont_coulomb.elastic.pictures import draw_states, magnification
from pwscont_coulomb.elastic.scenes import block, block_body, triangle, triangle_body
from pwscont_coulomb.elastic.vtu import write_vtu
from pwscont_coulomb.modes import Mode

from pwscont import explore
from pwscont.basics.errors import InvalidInputError
from pwscont.continuation.plan import silent


@pytest.fixture(scope="module")
def block_case():
    problem = block_body(12).condensed()
    return problem, explore(problem.along_load(), (0.0, 2.0))


@pytest.fixture(scope="module")
def triangle_case():
    problem = triangle_body().condensed()
    return problem, explore(problem.along_load(), (-2.0, 2.0))


def marks(ax, marker, face=None):
    """Return how many points of a marker an axis shows."""
    lines = [line for line in ax.lines if line.get_marker() == marker]
    return sum(
        len(line.get_xdata()) for line in lines if face in (None, line.get_markerfacecolor())
    )


def test_every_contact_node_is_drawn_in_its_state(block_case):
    problem, graph = block_case
    states = [recover(problem, graph.solutions(alpha)[0]) for alpha in (0.5, 1.9)]
    figure = draw_states(problem.elastic, states)
    axes = [ax for ax in figure.axes if any(isinstance(c, Quiver) for c in ax.collections)]
    assert len(axes) == 2
    for ax, state in zip(axes, states, strict=True):
        (arrows,) = [c for c in ax.collections if isinstance(c, Quiver)]
        slips = np.isin(state.modes, [Mode.SLIP_PLUS, Mode.SLIP_MINUS])
        assert marks(ax, "o", "black") == np.count_nonzero(state.modes == Mode.STICK)
        assert marks(ax, "o", "white") == np.count_nonzero(state.modes == Mode.NO_CONTACT)
        assert len(arrows.U) == np.count_nonzero(slips)
        # the bottom runs to the right: an arrow points where the body has slipped to
        assert (np.sign(arrows.U) == np.sign(state.slip[slips])).all()


def test_curves_are_pressure_shear_and_bound(block_case):
    problem, graph = block_case
    state = recover(problem, graph.solutions(0.5)[0])
    figure = draw_states(problem.elastic, [state])
    lines = {line.get_label(): line.get_ydata() for line in figure.axes[1].lines}
    np.testing.assert_array_equal(lines["pressure"], state.pressure)
    np.testing.assert_array_equal(lines["shear"], state.shear)
    np.testing.assert_allclose(lines["friction bound"], 0.3 * state.pressure)
    total = state.pressure @ problem.elastic.contact.areas
    assert total == pytest.approx(-state.normal_force.sum())


def test_solutions_side_by_side_have_one_scale(triangle_case):
    problem, graph = triangle_case
    states = [recover(problem, solution) for solution in graph.solutions(-0.75)]
    assert len(states) == 3
    figure = draw_states(problem.elastic, states, titles=["a", "b", "c"])
    assert [ax.get_title() for ax in figure.axes[:3]] == ["a", "b", "c"]
    assert len({ax.get_ylim() for ax in figure.axes[3:6]}) == 1
    largest = max(np.abs(state.displacements).max() for state in states)
    assert 0.03 < magnification(problem.elastic, states) * largest <= 0.08
    with pytest.raises(InvalidInputError, match="no solution to draw"):
        draw_states(problem.elastic, [])
    with pytest.raises(InvalidInputError, match="2 titles for 3 states"):
        draw_states(problem.elastic, states, titles=["a", "b"])


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.sweep(3)
def test_vtu_holds_the_solution(kind, tmp_path):
    family, order = KINDS[kind]
    body = pressed(square(family, 3), order=order, friction=0.4)
    problem = body.condensed()
    graph = explore(problem.along_load(), (0.0, 0.5))
    state = recover(problem, graph.solutions(0.4)[0])
    mesh = meshio.read(write_vtu(tmp_path / "x.vtu", body, state))
    np.testing.assert_allclose(mesh.points[:, :2], body.positions.T)
    np.testing.assert_allclose(mesh.point_data["displacement"][:, :2], state.displacements)
    (cells,) = mesh.cells
    assert cells.data.shape == body.space.element_nodes.T.shape
    # middle nodes follow the corners in the order of VTK
    corners = cells.data[:, : 3 if family == "tri" else 4]
    if order == 2:
        middle = 0.5 * (mesh.points[corners] + mesh.points[np.roll(corners, -1, axis=1)])
        beyond = cells.data[:, corners.shape[1] : 2 * corners.shape[1]]
        np.testing.assert_allclose(mesh.points[beyond], middle, atol=1e-15)
    force = mesh.point_data["contact_force"].sum(axis=0)
    np.testing.assert_allclose(force[1], -state.normal_force.sum())
    mode = mesh.point_data["contact_mode"]
    assert (mode[body.contact.nodes] == state.modes).all()
    assert np.count_nonzero(mode >= 0) == body.contact.count
    np.testing.assert_allclose(mesh.cell_data["stress_xy"][0], state.stresses[2])


def test_animation_runs_along_the_branch(triangle_case, tmp_path):
    problem, graph = triangle_case
    (pieces,) = graph.components()
    states = along(problem, pieces, 41)
    alphas = np.array([state.alpha for state in states])
    np.testing.assert_allclose(alphas[[0, -1]], [pieces[0].alpha[0], pieces[-1].alpha[-1]])
    assert np.count_nonzero(np.diff(np.sign(np.diff(alphas)))) == 2  # back at both folds
    assert len({int(state.modes[0]) for state in states}) == 4
    file = animate(problem, pieces, tmp_path / "x.gif", frames=3)
    with Image.open(file) as picture:
        assert picture.n_frames == 3
    with pytest.raises(InvalidInputError, match="need pieces and 2 frames"):
        along(problem, [], 5)


def test_scenes_write_pictures_and_vtu(tmp_path, monkeypatch):
    monkeypatch.setattr(scene_module, "FRAMES", 3)
    scene = triangle()
    at = scene.values([-0.75])
    answer = scene.solve(at, silent)
    assert len(json.loads(json.dumps(answer.as_dict()))["solutions"]) == 3
    assert "3 solutions at alpha = -0.75" in answer.as_text()
    files = {file.name for file in answer.write(tmp_path)}
    assert files == {
        "triangle.png",
        "triangle.npz",
        "triangle-branch1.gif",
        "triangle--0.75.png",
        *(f"triangle--0.75-{i}.vtu" for i in (1, 2, 3)),
    }
    assert all((tmp_path / name).stat().st_size > 500 for name in files)


def test_a_scene_refuses_values_outside_its_interval():
    assert block().values(None) == (1.0,)
    with pytest.raises(InvalidInputError, match=r"--at 3 lies outside the interval \[0.0, 2.0\]"):
        block().values([3])
