"""Pictures of evolutions: which line is which evolution, marks, zones, bodies, moving pictures."""

import numpy as np
import pytest
from matplotlib.colors import to_hex
from pwscont_coulomb import ContactBody, QuasiStaticCoulomb, draw_contact, draw_zones
from pwscont_coulomb.modes import WORDS, listed, modes_in
from pwscont_coulomb.quasi_static.pictures import COLORS as ZONES
from pwscont_coulomb.quasi_static.scenes import cattaneo, hysteresis

from pwscont import InvalidInputError, LoadHistory, UnknownNameError, evolve


@pytest.fixture(scope="module")
def four():
    """Return the four evolutions of one node at F = 4."""
    return hysteresis().run()


def drawn_lines(figure):
    """Return the lines with points of the first panel, by colour."""
    found = {}
    for line in figure.axes[0].get_lines():
        if len(line.get_xdata()):
            found.setdefault(to_hex(line.get_color()), []).append(line)
    return found


def words(figure):
    return [text.get_text() for text in figure.legends[0].get_texts()]


def test_each_evolution_has_a_line_of_its_own(four):
    figure = four.plot("u_t")
    assert words(figure)[:4] == [f"evolution {i}" for i in (1, 2, 3, 4)]
    lines = drawn_lines(figure)
    assert len(lines) == 4
    for path, some in zip(four.paths(), lines.values(), strict=True):
        points = np.hstack([line.get_xydata().T for line in some]).T
        for state in path.events:
            assert np.abs(points - [state.t, state["u_t"]]).sum(axis=1).min() < 1e-12
    styles = {str(some[0]._unscaled_dash_pattern) for some in lines.values()}
    assert len(styles) == 4


def test_stripes_of_shared_pieces_take_turns(four):
    """On the last stretch all four evolutions share a line: each point belongs to one of them."""
    stripes = []
    for some in drawn_lines(four.plot("u_t")).values():
        (last,) = [line for line in some if line.get_xdata()[-1] == 2.0]
        offset, (on, off) = last._unscaled_dash_pattern
        width = last.get_linewidth()
        stripes.append((offset * width, on * width, off * width))
    period = {round(on + off, 9) for _, on, off in stripes}
    assert len(period) == 1
    for place in np.linspace(0.0, period.pop(), 40, endpoint=False) + 0.01:
        painted = [(place + offset) % (on + off) < on for offset, on, off in stripes]
        assert sum(painted) == 1


def test_branchings_losses_and_jumps_are_marked(four):
    branchings = {(state.t, state["u_t"]) for state in four.branchings()}
    marks = {c.get_label(): c.get_offsets() for c in four.plot("u_t").axes[0].collections}
    assert {tuple(point) for point in marks["branching"].tolist()} == branchings
    body = ContactBody([[2.0, -1.0], [-1.0, 2.0]], N=[[1.0, 0.0]], T=[[0.0, 1.0]])
    system = QuasiStaticCoulomb(body, LoadHistory([[1.0, -4.0], [0.5, -4.0]]), 4.0)
    jumped = evolve(system, (0.0, 1.0), start=[0.0, 0.0, -1.0, 4.0], jumps="nearest")
    figure = jumped.plot("u_t")
    assert words(figure) == ["evolution 1", "loss", "jump"]


def test_a_start_is_seen_within_a_branching(four):
    axes = four.plot("u_t").axes[0]
    start, branching = (
        next(c for c in axes.collections if c.get_label() == kind)
        for kind in ("start", "branching")
    )
    assert start.get_offsets()[0].tolist() in branching.get_offsets().tolist()
    assert start.get_zorder() > branching.get_zorder()
    assert 2.0 * start.get_sizes()[0] < branching.get_sizes()[0]


@pytest.mark.slow
def test_arrows_of_a_loop_point_in_the_direction_of_time():
    """One node at low friction has one evolution; every arrow lies on it and points ahead."""
    evolution = hysteresis(0.5).run()
    assert not evolution.plot("u_t").axes[0].texts
    arrows = evolution.plot("lambda_t", "u_t").axes[0].texts
    assert len(arrows) >= 2
    (path,) = evolution.paths()
    times = np.linspace(0.0, 2.0, 4001)
    states = [path.state(t) for t in times]
    points = np.array([[state["u_t"], state["λ_t"]] for state in states])
    for arrow in arrows:
        tail, tip = np.array(arrow.xyann), np.array(arrow.xy)
        near = np.flatnonzero(np.abs(points - tip).max(axis=1) < 2e-3)
        assert any((points[k + 5] - points[k - 5]) @ (tip - tail) > 0.0 for k in near)


def test_many_evolutions_share_the_last_colour():
    """Five nodes apart from each other branch at once: the picture names the first evolutions."""
    body = ContactBody(
        np.kron(np.eye(2), [[2.0, -1.0], [-1.0, 2.0]]),
        N=np.eye(4)[0::2],
        T=np.eye(4)[1::2],
    )
    load = LoadHistory(np.tile([[0.0, 0.0], [0.5, -1.5], [0.0, 2.0]], 2))
    evolution = evolve(QuasiStaticCoulomb(body, load, 4.0), (0.0, 2.0))
    assert evolution.paths().number > 8
    rest = evolution.paths().number - 8
    assert words(evolution.plot("u_t,1"))[:9][-1] == "evolution 8"
    assert f"{rest} evolutions more" in words(evolution.plot("u_t,1"))


def test_recorded_quantities_are_drawn_as_the_curves_that_they_are():
    scene = hysteresis(0.5)
    evolution = evolve(scene.system, scene.interval, record={"square": lambda z, t: z[1] ** 2})
    for line in evolution.plot("square", "u_t").axes[0].get_lines():
        x, y = line.get_data()
        assert np.allclose(y, np.square(x), atol=1e-12)


def test_quantities_that_are_not_there_are_refused(four, tmp_path):
    with pytest.raises(UnknownNameError, match="u_t"):
        four.plot("u_tt")
    with pytest.raises(UnknownNameError, match="17"):
        four.plot(17)
    for wrong, match in (
        ({"path": tmp_path / "a.mp4"}, "gif"),
        ({"path": tmp_path / "nowhere" / "a.gif"}, "no directory"),
        ({"path": tmp_path / "a.gif", "frames": 1}, "2 frames"),
        ({"path": tmp_path / "a.gif", "frames": "a"}, "whole numbers"),
    ):
        with pytest.raises(InvalidInputError, match=match):
            four.animate(**wrong)


@pytest.mark.slow
def test_animations_have_a_frame_for_each_time(four, tmp_path):
    image = pytest.importorskip("PIL.Image")
    path = four.animate(tmp_path / "loop.gif", "lambda_t", "u_t", frames=5)
    with image.open(path) as moving:
        assert moving.n_frames == 5


# -- contact ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("p", [1, 2, 3, 17])
def test_modes_are_read_from_words(p):
    rng = np.random.default_rng(p)
    for modes in (rng.integers(0, 4, p), np.sort(rng.integers(0, 4, p))):
        assert modes_in(listed([WORDS[mode] for mode in modes]), p).tolist() == modes.tolist()


@pytest.fixture(scope="module")
def round_body():
    scene = cattaneo(30)
    return scene.system, scene.run()


def test_zones_are_the_modes_over_time(round_body):
    system, evolution = round_body
    path = evolution.paths()[0]
    figure = draw_zones(system, path)
    stripes = figure.axes[0].collections
    assert len(stripes) == len(path.pieces)
    for stripe, piece, (begin, end) in zip(
        stripes, path.pieces, path.stretches(0.0, 6.0), strict=True
    ):
        colors = [to_hex(color) for color in stripe.get_facecolors()]
        modes = modes_in(piece.label, system.body.p)
        assert colors == [to_hex(ZONES[mode]) for mode in modes.tolist()]
        corners = stripe.get_paths()[0].vertices
        assert (corners[:, 0].min(), corners[:, 0].max()) == (begin.t, end.t)


@pytest.mark.slow
def test_the_round_body_is_drawn_with_its_contact(tmp_path):
    files = cattaneo(20).solve((1.6,), lambda pieces, t: None).write(tmp_path)
    names = [file.name for file in files]
    expected = [f"cattaneo{end}" for end in (".png", ".npz", "-contact.png", "-zones.png")]
    assert names == expected
    assert all(file.stat().st_size > 1000 for file in files)


@pytest.mark.slow
def test_pressure_and_shear_are_those_of_the_states(round_body):
    system, evolution = round_body
    states = [evolution.paths()[0].state(t) for t in (1.0, 1.6)]
    figure = draw_contact(system, states, areas=np.full(30, 0.5))
    for axes, state in zip(figure.axes, states, strict=True):
        lines = {line.get_label(): line.get_ydata() for line in axes.get_lines()}
        assert lines["pressure"] == pytest.approx(-2.0 * state.z[-60:-30])
        assert lines["shear"] == pytest.approx(2.0 * state.z[-30:])
        slips = np.array(["slip" in WORDS[mode] for mode in modes_in(state.label, 30)])
        at_bound = np.abs(lines["shear"])[slips] - lines["friction bound"][slips]
        assert np.abs(at_bound).max(initial=0.0) < 1e-12
    with pytest.raises(InvalidInputError, match="no state"):
        draw_contact(system, [])
    with pytest.raises(InvalidInputError, match="each of states must be an EvolutionState, got 3"):
        draw_contact(system, 3)
    with pytest.raises(InvalidInputError, match="system must be a QuasiStaticCoulomb, got 3"):
        draw_contact(3, states)
    with pytest.raises(InvalidInputError, match="path must be an EvolutionPath, got EvolutionG"):
        draw_zones(system, evolution)
    with pytest.raises(InvalidInputError, match="must grow"):
        draw_zones(system, evolution.paths()[0], at=np.zeros(30))


@pytest.mark.slow
def test_a_state_of_an_evolution_on_the_whole_body(tmp_path):
    """Equilibrium on the full mesh, and the same for the condensed and for the full body."""
    scenes = pytest.importorskip("pwscont_coulomb.elastic.scenes")
    animation = pytest.importorskip("pwscont_coulomb.elastic.animation")
    recover = pytest.importorskip("pwscont_coulomb.elastic").recover

    found = {}
    for kind in ("condensed", "full"):
        problem = getattr(scenes.block_body(6, 0.3), kind)()
        press, side = problem.load.f0, problem.load.f1
        history = LoadHistory([0.0 * press, 2.0 * press, 2.0 * press + side])
        system = QuasiStaticCoulomb(problem.body, history, problem.friction)
        path = evolve(system, history.interval).paths()[0]
        found[kind] = recover(problem, path.state(1.6))
        assert problem.load_factors(path.state(1.6).z) == pytest.approx([2.0, 0.6])
        assert (found[kind].alpha, found[kind].parameter) == (1.6, "t")
    one, other = found["condensed"], found["full"]
    assert np.abs(one.displacements - other.displacements).max() < 1e-13
    assert one.modes.tolist() == other.modes.tolist()
    elastic = problem.elastic
    free = one.displacements.ravel()[elastic.free]
    rest = elastic.A @ free - 2.0 * elastic.f0 - 0.6 * elastic.f1
    rest[elastic.contact_unknowns] = 0.0  # contact forces act there
    assert np.abs(rest).max() < 1e-13
    states = animation.over_time(problem, path, 3)
    assert [state.alpha for state in states] == [0.0, 1.0, 2.0]
    animation.animate_states(elastic, states, tmp_path / "body.gif")
    strange = LoadHistory([press, press + np.arange(len(press))])
    system = QuasiStaticCoulomb(problem.body, strange, problem.friction)
    with pytest.raises(InvalidInputError, match="other loads"):
        recover(problem, evolve(system, (0.0, 1.0)).states(0.5)[0])


@pytest.mark.slow
def test_the_scene_of_a_block_writes_its_pictures(tmp_path):
    scenes = pytest.importorskip("pwscont_coulomb.quasi_static.scenes")
    pytest.importorskip("skfem")
    answer = scenes.block_cycle(6).solve((1.0, 1.5), lambda *_: None)
    names = {file.name for file in answer.write(tmp_path)}
    pictures = ("", "-zones", "-body", "-damping")
    assert {f"block-cycle{name}.png" for name in pictures} <= names
    assert all((tmp_path / name).stat().st_size for name in names)


def test_the_area_of_the_loop_is_what_friction_takes():
    """Work at the top against dissipation at the bottom, over the last period of the load."""
    scenes = pytest.importorskip("pwscont_coulomb.quasi_static.scenes")
    pytest.importorskip("skfem")
    path = scenes.block_cycle(12).run().paths()[0]
    events = [path.state(5.0), *(state for state in path.events if 5.0 < state.t <= 7.0)]
    force = np.array([state["force"] for state in events])
    moved = np.array([0.01 * state["shift"] for state in events])  # percent of the height, 1
    work = 0.5 * (force[1:] + force[:-1]) @ np.diff(moved)
    assert work == pytest.approx(path.dissipated(5.0, 7.0), rel=1e-8)
    assert path.dissipated(5.0, 7.0) > 1e-7


def test_the_damping_of_the_block_has_a_maximum_over_the_preload():
    """Loads and slip may be multiplied: twice of both takes four times the energy."""
    scenes = pytest.importorskip("pwscont_coulomb.quasi_static.scenes")
    problem = pytest.importorskip("pwscont_coulomb.elastic.scenes").block_body(6).condensed()
    few, some, much = scenes._damping(problem, np.array([0.1, 0.5, 3.0]), 1.0)
    assert 0.0 < few < some
    assert much == 0.0  # all nodes stick
    (twice,) = scenes._damping(problem, np.array([1.0]), 2.0)
    assert twice == pytest.approx(4.0 * some, rel=1e-10)
