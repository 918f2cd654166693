"""The bench: its true answers against other sources, its measures, and that it sees what is wrong.

No test compares seconds: only ratios within one run mean anything, and they depend on the machine.
"""

import json
from dataclasses import replace

import numpy as np
import pytest
from paper_systems import CASES
from pwscont_coulomb.scenes import fig12
from pwscont_dynamics.scenes import border_collision
from reference_enumeration import exact_pieces
from scipy.optimize import brentq
from sweeps import swept

from pwscont import BranchGraph, ExactLinear, PseudoArclength, explore
from pwscont.bench.calls import KINDS
from pwscont.bench.cases import OWN, case_of, load_case
from pwscont.bench.contestants import BY_ANGLE, EXACT, NAMES, Contestant, by_longest, contestants
from pwscont.bench.errors import errors, verdict
from pwscont.bench.measure import follow, measure
from pwscont.bench.picture import FLOOR, branch, draw
from pwscont.bench.report import as_dict
from pwscont.bench.truth.known_answer import UnknownAnswerError
from pwscont.bench.truth.problems import Bratu, bratu_fold
from pwscont.commands.cli import main
from pwscont.curve.stepper import StepSize
from pwscont.transitions import BoundingTests

pytestmark = pytest.mark.sweep(2)  # the others take too long for the README's command

ROUNDING = 1e-13
KNOWN = [name for name in CASES if name not in ("fig12", "fig16_as_captioned")]


SHORT = ("fig7", "fig10", "fig13", "example1")  # one of each kind, built soon
LONG = [name for name in KNOWN if name not in SHORT]


class Cases(dict):
    """Every problem, built once, when it is asked for."""

    def __missing__(self, name):
        self[name] = load_case(name)
        return self[name]


@pytest.fixture(scope="module")
def cases():
    return Cases()


def by_steps(name, largest):
    return Contestant(name, size := by_longest(largest), PseudoArclength(step_size=size))


# -- the true answers -----------------------------------------------------------------------------


@pytest.mark.parametrize("name", swept(SHORT, LONG))
def test_true_pieces_are_those_of_the_reference(cases, name):
    """The reference was made by an enumeration that shares nothing with the package."""
    found = sorted((p.det_sign, *p.extent()) for p in cases[name].truth.pieces)
    reference = CASES[name].reference
    expected = sorted((p["det_sign"], *p["alpha"]) for p in reference["pieces"])
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-9)
    counts = [cases[name].truth.count(0.5 * (lo + hi)) for lo, hi, _ in reference["solution_count"]]
    assert counts == [count for _, _, count in reference["solution_count"]]


@pytest.mark.parametrize("name", ["fig7", "example1"])
def test_straight_truths_are_rational(cases, name):
    case = CASES[name]
    expected = exact_pieces(case.body, case.load.f0, case.load.f1, 4.0, case.interval)
    found = sorted((p.det_sign, *p.extent()) for p in cases[name].truth.pieces)
    exact = sorted((p.det_sign, float(p.lo), float(p.hi)) for p in expected)
    np.testing.assert_allclose(found, exact, rtol=0, atol=1e-15)


@pytest.mark.parametrize("name", swept([*OWN, *SHORT], LONG))
def test_true_points_solve_the_system(cases, name):
    """The residual is rounding, in the cell of the piece and with the sign it claims."""
    case = cases[name]
    for piece in case.truth.pieces:
        x = piece.middle()
        z, alpha = x[:-1], float(x[-1])
        character = case.system.character(z, alpha)
        assert case.system.cell(character) == piece.cell
        residual = case.system.residual(z, alpha, character)
        terms = np.abs(np.asarray(case.system.jacobian(z, alpha, character))) @ np.abs(x)
        assert (np.abs(residual) <= 1e-14 * (1.0 + terms)).all()
        matrix = np.asarray(case.system.jacobian(z, alpha, character))[:, :-1]
        assert np.linalg.slogdet(matrix)[0] == piece.det_sign
        np.testing.assert_allclose(piece.next_to(x), x, atol=ROUNDING)


def test_fold_of_bratu_by_shooting():
    """Another way to the same fold: shoot from the middle; alpha(c) is largest there."""
    system = Bratu(31)
    h2, steps = system.squared, 16

    def boundary(alpha, c):
        u, step = c, -0.5 * alpha * h2 * np.exp(c)
        for _ in range(steps):
            u += step
            step -= alpha * h2 * np.exp(u)
        return u

    def alpha(c):
        return brentq(boundary, 0.1, 4.0, args=(c,), xtol=1e-15)

    fold = bratu_fold(system)
    c = fold[15]
    assert alpha(c) == pytest.approx(fold[-1], abs=1e-12)
    assert alpha(c - 1e-3) < alpha(c) > alpha(c + 1e-3)
    assert alpha(c - 1e-3) == pytest.approx(alpha(c + 1e-3), abs=1e-8)  # stationary


def test_vertical_pieces_are_refused():
    with pytest.raises(UnknownAnswerError, match="vertical"):
        case_of(fig12())


# -- the measures ---------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["fig7", "example1"])
def test_exact_linear_is_right_to_rounding(cases, name):
    case = cases[name]
    graph = follow(case, Contestant(EXACT, None, ExactLinear()))
    found = errors(graph, case.truth, case.system)
    assert not verdict(graph, case.truth, case.system)
    assert max(vars_of(found)) < ROUNDING


@pytest.mark.parametrize("name", swept([*OWN, *SHORT], LONG))
@pytest.mark.parametrize("largest", [0.3, 0.03])
@pytest.mark.sweep(5)
def test_special_points_are_exact_whatever_the_step(cases, name, largest):
    case = cases[name]
    graph = follow(case, by_steps("arc", largest))
    found = errors(graph, case.truth, case.system)
    assert not verdict(graph, case.truth, case.system)
    assert np.fmax(found.transitions, found.folds) < 1e-12
    assert found.points_max < 1e-12


@pytest.mark.slow
def test_alpha_turns_at_a_corner_too():
    """Where all orbits of the border collision meet no kind is a fold, yet alpha turns there."""
    case = case_of(border_collision())
    graph = follow(case, Contestant(EXACT, None, ExactLinear()))
    assert not graph.special_points("fold")
    assert not graph.special_points("nonsmooth fold")
    assert errors(graph, case.truth, case.system).folds < ROUNDING


@pytest.mark.parametrize("name", swept(["fig10", "two-curves"], ["fig13", "example3"]))
def test_chords_are_of_second_order(cases, name):
    """A third of the step is a ninth of the error between stored points."""
    found = [
        errors(follow(cases[name], by_steps("arc", h)), cases[name].truth, cases[name].system)
        for h in (0.03, 0.01)
    ]
    assert 4.0 < found[0].branch_rms / found[1].branch_rms < 20.0


def test_distance_of_a_known_polygon(cases):
    """A square in the unit circle is off by 1 - cos 45 degrees, in units of the scale."""
    case = cases["circle"]
    graph = follow(case, by_steps("arc", 0.1))
    corners = np.array([[0.0, 1.0], [1.0, 0.0], [0.0, -1.0]])  # (z, alpha)
    pieces = [replace(p, points=corners * [[p.det_sign, 1.0]]) for p in graph.pieces]
    square = BranchGraph(graph.special_points(), pieces, graph.interval, system=case.system)
    z_scale, alpha_scale = case.truth.scale
    found = errors(square, case.truth, case.system).branch_max
    angle = np.linspace(0.0, 0.5 * np.pi, 20001)
    circle = np.column_stack([np.sin(angle) / z_scale, np.cos(angle) / alpha_scale])
    normal = np.array([z_scale, alpha_scale]) / np.hypot(z_scale, alpha_scale)
    exact = np.abs((circle - [1.0 / z_scale, 0.0]) @ normal).max()
    assert found == pytest.approx(exact, rel=1e-3)
    assert errors(square, case.truth, case.system).points_max < ROUNDING


def vars_of(found):
    return [value for name in found.__slots__ if not np.isnan(value := getattr(found, name))]


# -- what is wrong is seen ------------------------------------------------------------------------


def test_a_truncated_graph_is_wrong(cases):
    case = cases["fig7"]
    graph = follow(case, Contestant(EXACT, None, ExactLinear()))
    nodes = graph.special_points()
    short = BranchGraph(nodes, graph.pieces[:-1], graph.interval, system=case.system)
    assert verdict(short, case.truth, case.system) == "1 of 4 pieces missing, 0 that are none"


def test_a_shifted_piece_is_wrong(cases):
    case = cases["fig7"]
    graph = follow(case, Contestant(EXACT, None, ExactLinear()))
    points = graph.pieces[0].points.copy()
    points[-1] += 1e-2
    pieces = [replace(graph.pieces[0], points=points), *graph.pieces[1:]]
    bent = BranchGraph(graph.special_points(), pieces, graph.interval, system=case.system)
    assert verdict(bent, case.truth, case.system) == "pieces end elsewhere"
    assert errors(bent, case.truth, case.system).points_max > 1e-3


@pytest.mark.slow
def test_a_step_that_sees_nothing_on_its_way_is_a_cross(cases, monkeypatch):
    """An absurd step, with the care taken against it switched off, leaves pieces out."""
    huge = StepSize(first=3.0, largest=3.0, least_cosine=-1.0)
    blind = Contestant(BY_ANGLE, huge, PseudoArclength(step_size=huge))
    assert not measure(cases["example2"], blind, quick=True).wrong  # with that care it is right
    read = BoundingTests.read

    def unwatched(self, curve, state):
        found = read(self, curve, state)
        return replace(found, values=np.ones_like(found.values), slopes=0.0 * found.slopes)

    monkeypatch.setattr(BoundingTests, "read", unwatched)
    row = measure(cases["example2"], blind, quick=True)
    assert row.wrong
    (ax,) = draw(["example2"], [row]).axes
    crosses = [line for line in ax.lines if line.get_marker() == "x" and len(line.get_xdata())]
    assert len(crosses) == 1
    assert crosses[0].get_ydata()[0] <= 1.0


def test_natural_parameter_is_wrong_at_a_smooth_fold(cases):
    rows = [c for c in contestants(False, quick=True) if c.name == "natural parameter"]
    row = measure(cases["two-curves"], rows[0], quick=True)
    assert row.wrong == "stopped at alpha = -1"


def test_what_is_drawn_is_clipped_and_said(cases):
    row = measure(cases["fig7"], Contestant(EXACT, None, ExactLinear()), quick=True)
    tiny = replace(row, errors=replace(row.errors, branch_max=0.0))
    figure = draw(["fig7"], [tiny])
    heights = [y for line in figure.axes[0].lines for y in line.get_ydata()]
    assert min(heights) == FLOOR
    assert branch(tiny.errors) == 0.0  # the figure itself is not changed
    assert any(f"{FLOOR:.0e}" in text.get_text() for text in figure.legends[0].get_texts())


def test_other_programs_do_not_look_like_steppers(cases):
    row = measure(cases["fig7"], Contestant(EXACT, None, ExactLinear()), quick=True)
    figure = draw(["fig7"], [row, *(replace(row, stepper=f"program {k}") for k in range(12))])
    lines = [(h.get_color(), h.get_marker()) for h in figure.legends[0].legend_handles[:13]]
    assert len(set(lines)) == 13


# -- the command ----------------------------------------------------------------------------------


@pytest.mark.slow
def test_quick_form(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("pwscont.bench.measure.FEW_RUNS", 1)
    assert main(["bench", "fig7", "two-curves", "--quick", "-o", str(tmp_path / "new")]) == 0
    printed = capsys.readouterr().out
    assert "exact linear" in printed
    assert "WRONG: stopped at alpha = -1" in printed
    assert (tmp_path / "new" / "bench.png").read_bytes().startswith(b"\x89PNG")
    check_schema(json.loads((tmp_path / "new" / "bench.json").read_text(encoding="utf-8")))


def check_schema(data):
    assert set(data) == {"schema", "quick", "machine", "problems", "left_out", "rows"}
    assert (data["schema"], data["quick"]) == (1, True)
    expected = {"system", "processor", "cores", "python", "versions", "blas", "blas_threads"}
    assert set(data["machine"]) == expected
    assert {"pwscont", "numpy", "scipy"} <= set(data["machine"]["versions"])
    assert [problem["name"] for problem in data["problems"]] == ["fig7", "two-curves"]
    assert {row["stepper"] for row in data["rows"]} == set(NAMES)
    for row in data["rows"]:
        seconds = row["seconds"]
        assert 0.0 < seconds["least"] <= seconds["median"] <= seconds["most"]
        assert set(row["calls"]) == set(KINDS)
        assert row["right"] == (row["wrong"] == "")
        assert all(e is None or e >= 0.0 for e in row["errors"].values())
        assert row["right"] or row["stepper"] == "natural parameter"


@pytest.mark.slow
def test_exact_linear_does_less_work_than_steps(cases):
    """Within one run: less than a fifth of the factorisations of pseudo-arclength."""
    case = cases["fig7"]
    exact, *others = (measure(case, one, quick=True) for one in contestants(True, quick=True))
    assert all(
        5 * exact.calls["factorisations"] < row.calls["factorisations"]
        for row in others
        if row.stepper != "natural parameter"
    )


def test_what_is_left_out_says_why(cases):
    data = as_dict([cases["circle"]], [], {"fig12": "vertical pieces"}, quick=False)
    assert data["left_out"] == {"fig12": "vertical pieces"}
    assert json.loads(json.dumps(data)) == data


@pytest.mark.parametrize(
    ("name", "message"), [("fig12", "vertical"), ("fig4", "two parameters"), ("fgi7", "fig7")]
)
def test_wrong_names(name, message, capsys):
    assert main(["bench", name]) == 2
    assert message in capsys.readouterr().err


@pytest.mark.slow
def test_searching_is_not_part_of_a_measurement(cases):
    """Every component is followed from one true start; the default search finds the same."""
    case = cases["example3"]
    graph = follow(case, by_steps("arc", 0.1))
    assert len(graph.components()) == len(explore(case.system, case.interval).components()) == 3
