"""Pictures, files and scenes of elastic bodies show what the solutions are."""

import json

import meshio
import numpy as np
import pytest
from elastic_bodies import KINDS, pressed, square
from matplotlib.quiver import Quiver
from PIL import Image
from pwscont_coulomb.elastic import ContactBoundary, ElasticBody, Support, Units, Young, recover
from pwscont_coulomb.elastic import scene as scene_module
from pwscont_coulomb.elastic.animation import along, animate
from pwscont_coulomb.elastic.pictures import draw_states, summary
from pwscont_coulomb.elastic.placement import Placement, magnification
from pwscont_coulomb.elastic.scenes import (
    block,
    block_body,
    press_body,
    triangle,
    triangle_body,
)
from pwscont_coulomb.elastic.vtu import write_vtu
from pwscont_coulomb.modes import Mode

from pwscont import explore
from pwscont.basics.errors import InvalidInputError, UnknownNameError
from pwscont.continuation.plan import silent
from pwscont.scenes.answer import Look


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


@pytest.mark.slow
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


@pytest.mark.slow
def test_scenes_write_pictures_and_vtu(tmp_path, monkeypatch):
    monkeypatch.setattr(scene_module, "FRAMES", 3)
    scene = triangle()
    at = scene.values([-0.75])
    answer = scene.solve(at, silent)
    assert len(json.loads(json.dumps(answer.as_dict()))["solutions"]) == 3
    assert "3 solutions at alpha = -0.75" in answer.as_text()
    files = {file.name for file in answer.write(tmp_path, Look(animate=True))}
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


# -- where bodies are drawn ------------------------------------------------------------------------


@pytest.fixture(scope="module")
def press_case():
    problem = press_body().condensed()
    return problem, explore(problem.along_load(), (0.0, 0.2))


@pytest.mark.parametrize("factor", [1.0, 2.0, 5.0])
@pytest.mark.sweep(2)
def test_flat_ground_is_drawn_flat_and_closed_nodes_lie_on_it(press_case, factor):
    """The gaps of the rounded edges, magnified, would make a hump of the table."""
    problem, graph = press_case
    state = recover(problem, graph.solutions(0.1)[0])
    placement, contact = Placement.of(problem.elastic, factor), problem.elastic.contact
    size = np.ptp(contact.positions)
    assert contact.gap.max() > 0.1
    np.testing.assert_allclose(placement.obstacle[1], 0.0, atol=3e-3 * size)
    moved, closed = placement.moved(state)[:, contact.nodes], state.modes != Mode.NO_CONTACT
    assert closed.sum() > 10
    np.testing.assert_allclose(moved[1, closed], 0.0, atol=3e-3 * size)
    height = moved[1, ~closed] - placement.obstacle[1, ~closed]
    true = (contact.positions[1] + state.displacements[contact.nodes, 1])[~closed]
    np.testing.assert_allclose(height, factor * true, atol=3e-3 * factor * size)


def test_an_uneven_obstacle_below_a_flat_body_is_drawn_at_its_magnified_gap():
    body = ElasticBody(
        square("tri", 5),
        Young(1.0, 0.3),
        supports=[Support("top", constant=(0.0, -0.01))],
        contact=ContactBoundary("bottom", friction=0.3, gap=lambda x: 0.01 * (x[0] - 0.5) ** 2),
    )
    contact, placement = body.contact, Placement.of(body, 10.0)
    np.testing.assert_array_equal(placement.rest, body.positions)
    drawn = contact.positions + 10.0 * contact.gap * contact.normals
    np.testing.assert_array_equal(placement.obstacle, drawn)


def test_large_gaps_keep_magnification_down(press_case):
    problem, graph = press_case
    tiny = recover(problem, graph.solutions(0.1)[0])
    factor = magnification(problem.elastic, [tiny])
    extent = np.ptp(problem.elastic.positions, axis=1).max()
    assert factor == 1.0 or factor * problem.elastic.contact.gap.max() <= 0.25 * extent


@pytest.mark.parametrize(
    ("case", "scale", "words"),
    [
        ("block_case", 1.0, "displacements true to scale"),
        ("block_case", 3.0, "displacements magnified 3 times"),
        ("block_case", 0.1, "displacements drawn at 0.1 of their size"),
        ("press_case", 3.0, "displacements and gaps magnified 3 times"),
    ],
)
def test_the_picture_says_what_is_magnified(request, case, scale, words):
    problem, graph = request.getfixturevalue(case)
    states = [recover(problem, graph.solutions(0.1)[0])]
    figure = draw_states(problem.elastic, states, scale=scale)
    assert figure.get_suptitle() == words


def test_legends_stand_outside_and_nothing_is_clipped(block_case):
    problem, graph = block_case
    states = [recover(problem, solution) for solution in graph.solutions(1.9)]
    figure = draw_states(problem.elastic, states, units=Units("mm", "MPa"))
    assert not [ax for ax in figure.axes if ax.get_legend()]
    (legend,) = figure.legends
    words = {text.get_text() for text in legend.get_texts()}
    assert {"stick", "slip", "no contact", "pressure", "shear", "friction bound"} <= words
    figure.draw_without_rendering()
    box = legend.get_window_extent()
    assert not any(box.overlaps(ax.get_window_extent()) for ax in figure.axes)
    below = figure.axes[1]
    assert below.get_xlabel() == "length along the boundary [mm]"
    assert below.get_ylabel() == "force per area [MPa]"
    low, high = below.get_ylim()
    for line in below.lines:
        assert low < line.get_ydata().min() <= line.get_ydata().max() < high
    (arrows,) = [c for c in figure.axes[0].collections if isinstance(c, Quiver)]
    assert len(np.unique(arrows.get_facecolor(), axis=0)) == 1
    assert figure.axes[0].get_title() == summary(states[0])


@pytest.mark.slow
def test_animations_are_written_only_where_asked_for(tmp_path):
    answer = triangle().solve((), silent)
    assert {file.suffix for file in answer.write(tmp_path)} == {".png", ".npz"}


def test_a_body_scene_draws_the_unknowns_that_are_asked_for():
    with pytest.raises(UnknownNameError, match="λ_t"):
        triangle().with_panels(["λ_x"]).solve((), silent)
    answer = triangle().with_panels(["λ_t"]).solve((), silent)
    assert [panel.component for panel in answer.graph.scene.panels] == ["λ_t"]
