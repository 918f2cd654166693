"""Pages of views, looked at in headless Chromium as a user does; skipped where there is none."""

from importlib.util import find_spec

import numpy as np
import pytest
from pwscont_coulomb.scenes import fig7, fig12
from pwscont_structures.scenes import truss_stop
from view_pages import browser, complaints, drawn, in_browser, opened

from pwscont import View
from pwscont.scenes.registry import load_scene

pytestmark = in_browser

#: What a press of the mouse at (x, y) of the diagram does, in pixels of the page.
PLACE = """
const plot = pwscont.find("diagram");
const view = Bokeh.index.get_by_id(plot.id);
const box = view.el.getBoundingClientRect();
const frame = view.frame.bbox;
return [box.left + frame.left + view.frame.x_scale.compute(arguments[0]) - frame.left,
        box.top + frame.top + view.frame.y_scale.compute(arguments[1]) - frame.top];
"""


#: The ratio of the scales of both axes of the body.
SCALES = """
const { x_range: x, y_range: y, inner_width: wide, inner_height: high } = pwscont.find("body");
return [(wide / (x.end - x.start)) / (high / (y.end - y.start))];
"""


@pytest.fixture(scope="module")
def driver():
    with browser() as some:
        yield some


@pytest.fixture(scope="module")
def pages(tmp_path_factory):
    """Return a function that writes the page of a scene once and returns its graph and file."""
    directory, made = tmp_path_factory.mktemp("pages"), {}

    def page(scene):
        if scene.name not in made:
            graph = scene.run()
            made[scene.name] = graph, View.of(scene, graph).save(directory / f"{scene.name}.html")
        return made[scene.name]

    return page


def click(driver, x, y):
    """Click at the point (x, y) of the diagram."""
    from selenium.webdriver.common.action_chains import ActionChains  # noqa: PLC0415

    driver.execute_script("window.scrollTo(0, 0)")
    at = [round(value) for value in driver.execute_script(PLACE, x, y)]
    actions = ActionChains(driver)
    actions.w3c_actions.pointer_action.move_to_location(*at)
    actions.w3c_actions.pointer_action.click()
    actions.perform()
    wait = "setTimeout(arguments[0], 400)"  # Bokeh waits whether a second click follows
    driver.execute_async_script(wait)


def text(driver, name):
    return driver.execute_script("return document.getElementById(arguments[0]).textContent", name)


def listed(driver):
    return driver.execute_script("return document.querySelectorAll('#list li').length")


def slide(driver, part):
    """Move the slider to a part of its length."""
    code = """
    const slide = document.getElementById("slide");
    slide.value = String(Math.round(arguments[0] * Number(slide.max)));
    slide.dispatchEvent(new Event("input"));
    """
    driver.execute_script(code, part)


def hide(driver, legend, number):
    code = "document.querySelectorAll('#' + arguments[0] + ' input')[arguments[1]].click()"
    driver.execute_script(code, legend, number)


def solutions_on_page(driver, alphas):
    code = """
    return arguments[0].map((alpha) => [
      pwscont.count(alpha),
      pwscont.solutions(alpha).map((solution) => ({
        piece: pwscont.data.pieces.id[solution.piece],
        det: solution.det,
        label: solution.label,
        z: pwscont.data.names.map((_, column) => pwscont.at(solution, column)),
      })),
    ]);
    """
    return driver.execute_script(code, alphas)


@pytest.mark.parametrize(
    ("make", "near"),
    [
        pytest.param(fig7, 1e-12, id="fig7"),
        pytest.param(fig12, 1e-3, id="fig12", marks=pytest.mark.slow),
        pytest.param(truss_stop, 1e-3, id="truss-stop", marks=pytest.mark.slow),
    ],
)
def test_the_page_lists_what_the_graph_lists(driver, pages, make, near):
    graph, path = pages(make())
    opened(driver, path)
    random = np.random.default_rng(3).uniform(*graph.interval, 25).tolist()
    alphas = [*random, *graph.interval, *(point.alpha for point in graph.special_points())]
    for alpha, (count, found) in zip(alphas, solutions_on_page(driver, alphas), strict=True):
        wanted = graph.solutions(alpha)
        exact = graph.count(alpha)
        assert (exact if np.isfinite(exact) else None) == count
        assert [row["piece"] for row in found] == [solution.piece for solution in wanted]
        assert [row["det"] for row in found] == [solution.det_sign for solution in wanted]
        assert [row["label"] for row in found] == [solution.label for solution in wanted]
        for row, solution in zip(found, wanted, strict=True):
            assert row["z"][0] == pytest.approx(alpha, abs=1e-12)
            assert row["z"][1:] == pytest.approx(solution.z, abs=near * (1 + abs(solution.z).max()))
    assert not complaints(driver)


def test_the_slider_changes_the_list(driver, pages):
    _, path = pages(fig7())
    opened(driver, path)
    assert text(driver, "count") == "3 solutions at α = −0.75"
    assert listed(driver) == 3
    slide(driver, 0.75)
    assert text(driver, "count") == "1 solution at α = 1"  # also a transition: one solution
    assert listed(driver) == 1
    slide(driver, 0.0)
    assert text(driver, "count") == "1 solution at α = −2"
    assert drawn(driver, "now")["x"] == [-2.0]
    assert not complaints(driver)


@pytest.mark.slow
def test_a_click_shows_the_solution_there(driver, pages):
    _, path = pages(fig7())
    opened(driver, path)
    click(driver, 1.5, -0.333)  # on slip+: lam_nu falls from -1/4 by 1/6 for each alpha
    assert "piece 3" in text(driver, "heading")
    assert text(driver, "mode") == "slip+"
    alpha = driver.execute_script("return pwscont.state.alpha")
    assert alpha == pytest.approx(1.5, abs=0.02)
    click(driver, -0.5, 0.0)  # on the fold, exactly
    assert text(driver, "count") == "2 solutions at α = −0.5"
    assert "non-smooth fold, det 0" in text(driver, "heading")
    click(driver, 1.0, -0.05)  # far from any branch
    assert text(driver, "count") == "2 solutions at α = −0.5"
    assert not complaints(driver)


@pytest.mark.slow
def test_on_a_vertical_piece_a_click_shows_the_solution_there(driver, pages):
    graph, path = pages(fig12())
    opened(driver, path)
    vertical = next(piece for piece in graph.pieces if piece.is_vertical)
    at, forces = vertical.interval[0], vertical.z[:, 2]
    click(driver, at, float(forces.mean()))
    assert text(driver, "count").startswith("Infinitely many solutions at α = ")
    assert text(driver, "heading").startswith("A solution on a vertical piece")
    shown = drawn(driver, "chosen")["y"][0]
    assert abs(shown - forces.mean()) < 0.1 * np.ptp(forces)
    assert "vertical piece: α = 0.478176, α = 0.812647" in text(driver, "verticals")
    assert not complaints(driver)


@pytest.mark.slow
def test_branches_and_modes_can_be_hidden(driver, pages):
    _, path = pages(fig7())
    opened(driver, path)
    assert len(drawn(driver, "lines")["xs"]) == 4
    hide(driver, "modes", 0)
    assert len(drawn(driver, "lines")["xs"]) == 3
    hide(driver, "branches", 0)
    assert not drawn(driver, "lines")["xs"]
    assert not drawn(driver, "marks")["x"]
    assert not drawn(driver, "now")["x"]
    hide(driver, "branches", 0)
    assert len(drawn(driver, "lines")["xs"]) == 3
    assert not complaints(driver)


@pytest.mark.slow
def test_any_quantity_on_either_axis(driver, pages):
    graph, path = pages(fig7())
    opened(driver, path)
    code = """
    for (const [id, name] of Object.entries(arguments[0])) {
      const select = document.getElementById(id);
      select.value = [...select.options].find((some) => some.text === name).value;
      select.dispatchEvent(new Event("change"));
    }
    """
    driver.execute_script(code, {"horizontal": "u_t", "vertical": "α"})
    lines = drawn(driver, "lines")
    pairs = zip(lines["xs"], lines["ys"], strict=True)
    ends = {place for xs, ys in pairs for place in zip(xs, ys, strict=True)}
    names = list(graph.names)
    for piece in graph.pieces:
        for x in piece.points:
            assert (x[names.index("u_t")], x[-1]) in ends
    assert driver.execute_script("return pwscont.find('rule').dimension") == "width"
    click(driver, float(graph.pieces[0].z[:, names.index("u_t")].mean()), -1.25)
    assert "piece 0" in text(driver, "heading")
    assert not complaints(driver)


@pytest.mark.slow
def test_both_horizontal_axes_move_together(driver, pages):
    _, path = pages(fig7())
    opened(driver, path)
    code = """
    pwscont.find("diagram").x_range.setv({start: -1, end: 0.5});
    const range = pwscont.find("strip").x_range;
    return [range.start, range.end];
    """
    assert driver.execute_script(code) == [-1, 0.5]


@pytest.mark.slow
def test_the_number_of_solutions_is_the_graphs(driver, pages):
    graph, path = pages(fig7())
    opened(driver, path)
    steps = drawn(driver, "count")
    rows = [(lo, hi, n) for lo, hi, n in graph.multiplicity()]
    assert steps["x"] == [end for lo, hi, _ in rows for end in (lo, hi)]
    assert steps["y"] == [n for *_, n in rows for _ in range(2)]
    single = drawn(driver, "single")
    assert (single["x"], single["y"]) == ([-1.0, -0.5], [2, 2])


@pytest.mark.skipif(not find_spec("skfem"), reason="bodies need scikit-fem: pip install '.[fem]'")
def test_a_click_changes_the_body(driver, pages):
    scene = load_scene("wedge", {"nodes": "3"}).curve()
    graph, path = pages(scene)
    opened(driver, path)
    out = max(graph.pieces, key=lambda piece: -piece.z[:, scene.panels[0].component].min())
    before = drawn(driver, "elements"), drawn(driver, "pressure at nodes")
    middle = out.points.mean(axis=0)
    click(driver, float(middle[-1]), float(middle[scene.panels[0].component]))
    assert f"piece {out.id}," in text(driver, "heading")
    alpha = driver.execute_script("return pwscont.state.alpha")
    after = drawn(driver, "elements"), drawn(driver, "pressure at nodes")
    assert after[0]["xs"] != before[0]["xs"]
    assert after[1]["y"] != before[1]["y"]
    solution = next(some for some in graph.solutions(alpha) if some.piece == out.id)
    shapes = scene.body.shapes(np.array([np.append(solution.z, alpha)]))
    assert after[1]["y"] == pytest.approx(shapes.pressure[0], abs=1e-6)
    assert np.array(after[0]["shade"]) == pytest.approx(
        np.hypot(*shapes.shade[0]), abs=1e-6 + 1e-6 * shapes.shade.max()
    )
    assert driver.execute_script(SCALES) == pytest.approx([1.0], rel=0.02)
    words = scene.body.contact_states(solution.character)
    for name in ("stick", "no contact"):
        assert len(drawn(driver, name)["x"]) == words.count(name)
    assert len(drawn(driver, "slip")["x"]) == sum(word.startswith("slip") for word in words)
    assert not complaints(driver)


@pytest.mark.slow
def test_in_a_narrow_window_nothing_is_cut_off(driver, pages):
    _, path = pages(fig7())
    driver.set_window_size(520, 900)
    opened(driver, path)
    width, shown = driver.execute_script(
        "return [document.documentElement.scrollWidth, document.documentElement.clientWidth]"
    )
    driver.set_window_size(1300, 1000)
    assert width <= shown


@pytest.mark.slow
def test_a_frame_in_a_notebook_shows_the_view(driver, tmp_path):
    (tmp_path / "notebook.html").write_text(
        f"<!DOCTYPE html><meta charset='utf-8'>{View(fig7().run())._repr_html_()}", "utf-8"
    )
    driver.get((tmp_path / "notebook.html").resolve().as_uri())
    driver.switch_to.frame(0)
    code = """
    const done = arguments[0];
    (function look() { window.pwscont && pwscont.isReady ? done(true) : setTimeout(look, 20); })();
    """
    assert driver.execute_async_script(code)
    assert listed(driver) == 3
    driver.switch_to.default_content()
    assert not complaints(driver)
