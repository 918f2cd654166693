"""Pages of views, looked at in headless Chromium as a user does; skipped where there is none."""

from importlib.util import find_spec

import numpy as np
import pytest
from pwscont_coulomb.quasi_static.scenes import hysteresis
from pwscont_coulomb.scenes import fig7, fig12
from pwscont_structures.scenes import truss_stop
from view_pages import browser, complaints, drawn, in_browser, opened

from pwscont import LCP, BranchGraph, PiecewiseSystem, Switched, View, explore
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


@pytest.mark.slow
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


@pytest.mark.slow
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


class Parabola(PiecewiseSystem):
    """z^2 = alpha in units of their own: two solutions where alpha > 0, a fold at zero."""

    size = 1

    def __init__(self, z_unit=1.0, alpha_unit=1.0, name="z"):
        self._units, self._name = (z_unit, alpha_unit), name

    def names(self):
        return [self._name]

    def scale(self, lo, hi):
        return np.array(self._units[:1])

    def test_functions(self, z, alpha):
        return z + 9.0 * self._units[0]

    def residual(self, z, alpha, character):
        return (z / self._units[0]) ** 2 - alpha / self._units[1]


class Kink(Parabola):
    """abs(z) = alpha - shift, in units of its own."""

    shift = 0.0

    def residual(self, z, alpha, character):
        return np.abs(z) / self._units[0] - (alpha - self.shift) / self._units[1]


def written(driver, alphas):
    """Return the heading, the box and the values of all solutions as the page writes them."""
    code = """
    return arguments[0].map((alpha) => {
      pwscont.move(alpha);
      const buttons = [...document.querySelectorAll("#list li button")];
      const cells = () => [...document.querySelectorAll("#table tr td:last-child")];
      const values = buttons.map((button) => {
        button.click();
        return cells().map((cell) => cell.textContent);
      });
      const [box, head] = ["alpha", "count"].map((id) => document.getElementById(id));
      return { box: box.value, head: head.textContent, values };
    });
    """
    return driver.execute_script(code, [float(alpha) for alpha in alphas])


def read(word):
    """Return a number of the page, and the unit of its last digit."""
    plain = word.replace("\N{MINUS SIGN}", "-").replace("\N{ALMOST EQUAL TO}", "").strip()
    digits, _, power = plain.partition("e")
    decimals = len(digits.partition(".")[2])
    return float(plain), 10.0 ** (int(power or 0) - decimals)


def shown(driver, tmp_path, graph, alphas):
    """Open the page of a graph and return what it writes at some alphas."""
    opened(driver, View(graph).save(tmp_path / "page.html"))
    return written(driver, alphas)


@pytest.mark.slow
@pytest.mark.parametrize("units", [(1.0, 1.0), (1e-4, 1e9), (1.0, 1e-9), (1e-4, 1e15)])
@pytest.mark.sweep(4)
def test_every_digit_on_a_parabola_is_right_in_any_units(driver, tmp_path, units):
    z_unit, alpha_unit = units
    graph = explore(Parabola(*units), (-alpha_unit, alpha_unit))
    parts = np.array([1e-7, 0.002, 0.04, 0.1, 0.35, 0.5, 0.77, 1.0])
    rows = shown(driver, tmp_path, graph, parts * alpha_unit)
    for part, row in zip(parts, rows, strict=True):
        found = sorted(read(values[1]) for values in row["values"])
        for (value, unit), sign in zip(found, (-1, 1), strict=True):
            assert abs(value - sign * z_unit * part**0.5) <= max(unit, 5e-4 * z_unit * (not value))
        if part > 1e-6:
            assert all(value for value, _ in found)
    assert not complaints(driver)


@pytest.mark.slow
def test_small_unknowns_beside_a_large_parameter_are_not_zero(driver, tmp_path):
    graph = explore(Kink(1e-4, 1e9), (-1e9, 1e9))
    (row,) = shown(driver, tmp_path, graph, [0.25e9])
    assert sorted(read(values[1])[0] for values in row["values"]) == [-2.5e-5, 2.5e-5]


@pytest.mark.slow
def test_the_parameter_is_told_apart_in_a_short_interval_far_from_zero(driver, tmp_path):
    system = Kink()
    system.shift = 1e9
    row, none = shown(driver, tmp_path, explore(system, (1e9 - 1, 1e9 + 1)), [1e9 + 0.25, 1e9 - 1])
    assert row["box"] == "1000000000.25"
    assert row["head"] == "At least 2 solutions at α = 1000000000.25"
    assert {values[0] for values in row["values"]} == {"1000000000.25"}
    assert none["head"] == "No solution found at α = 999999999"


@pytest.mark.slow
def test_what_is_recorded_is_not_straight_where_the_solution_is(driver, tmp_path):
    record = {"square": lambda z, alpha: float(z[0] ** 2), "twice": lambda z, alpha: 2.0 * z[0]}
    graph = explore(LCP(np.eye(1), [0.0], [-1.0]), (-1.0, 1.0), record=record)
    (row,) = shown(driver, tmp_path, graph, [0.37])
    assert row["values"][0][1] == "0.37"
    assert row["values"][0][2] == "≈ 0.137"  # of 0.1369; a cubic may be off by 2.5e-5
    driver.execute_script("pwscont.move(1)")
    (end,) = written(driver, [1.0])
    assert end["values"] == [["1", "1", "1", "2"]]


@pytest.mark.slow
def test_rounding_of_an_unknown_that_is_zero_reads_as_zero(driver, tmp_path):
    M = np.array([[1 / 3, 0.1], [0.7, 0.2]])  # M z = (alpha + 1 / 3) M e_1 / 7, so z[1] is zero

    def residual(z, alpha, switch):
        return M @ z - (alpha + 1 / 3) * M[:, 0] / 7 + 0.0 * switch.max(z[0], 0.0)

    graph = explore(Switched(2, residual, linear=True), (0.1, 1.0))
    assert any(piece.z[:, 1].any() for piece in graph.pieces)
    for row in shown(driver, tmp_path, graph, np.linspace(0.1, 1.0, 9)):
        assert all(values[2] == "0" for values in row["values"])


@pytest.mark.slow
@pytest.mark.parametrize("name", ["__proto__", "</script><b>", "'\"&\u2028", "constructor"])
def test_any_name_is_shown_as_it_is(driver, tmp_path, name):
    graph = explore(Parabola(name=name), (-1.0, 1.0))
    opened(driver, View(graph, title=name).save(tmp_path / "page.html"))
    cell = "return document.querySelectorAll('#table tr td:first-child')[1].textContent"
    assert driver.execute_script(cell) == name
    assert driver.execute_script("return document.querySelector('h1').textContent") == name
    assert not complaints(driver)


@pytest.mark.slow
def test_a_click_in_a_tiny_interval_shows_the_solution_there(driver, tmp_path):
    graph = explore(Kink(1.0, 1e-20), (-1e-20, 1e-20))
    opened(driver, View(graph).save(tmp_path / "page.html"))
    click(driver, 0.5e-20, 0.5)
    alpha = driver.execute_script("return pwscont.state.alpha")
    assert alpha == pytest.approx(0.5e-20, rel=0.02)


@pytest.mark.slow
def test_digits_without_a_system_are_right_as_far_as_they_are_shown(driver, tmp_path):
    graph = truss_stop().run()
    graph.save(tmp_path / "truss.npz")
    alphas = np.random.default_rng(1).uniform(*graph.interval, 40)
    rows = shown(driver, tmp_path, BranchGraph.load(tmp_path / "truss.npz"), alphas)
    largest = max(np.abs(piece.z).max() for piece in graph.pieces)
    for alpha, row in zip(alphas, rows, strict=True):
        for solution, values in zip(graph.solutions(alpha), row["values"], strict=True):
            for word, exact in zip(values[1:], solution.z, strict=True):
                value, unit = read(word)
                assert abs(value - exact) <= max(1.01 * unit, 0.01 * largest * (not value))


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


@pytest.mark.slow
def test_evolutions_have_colours_and_states_over_time(driver, tmp_path):
    graph = hysteresis().run()
    opened(driver, View(graph, "u_t").save(tmp_path / "hysteresis.html"))
    assert not complaints(driver)
    driver.execute_script("pwscont.move(1.3)")
    assert text(driver, "count") == "3 solutions at t = 1.3"
    values = driver.execute_script("return pwscont.solutions(1.3).map((s) => pwscont.at(s, 2))")
    assert sorted(values) == pytest.approx(sorted(s["u_t"] for s in graph.states(1.3)), abs=1e-12)
    lines = drawn(driver, "lines")
    assert len(set(lines["color"])) == 4
    shared = [piece for piece in graph.pieces if len(graph.into[piece.start]) > 1]
    assert len(lines["xs"]) == sum(map(len, View(graph).records["pieces"]["owners"])) > len(shared)
    assert text(driver, "branch-legend") == "Evolutions"
    assert "det" not in text(driver, "list")
