"""The manual's examples and the README say what is true, and run."""

import contextlib
import inspect
import io
import pkgutil
import re
import runpy
import tomllib
from functools import cache
from itertools import product
from math import inf
from pathlib import Path

import numpy as np
import pytest
from sweeps import swept

import pwscont
import pwscont.extending
from pwscont import BranchGraph, enumerate_solutions
from pwscont.commands.cli import main
from pwscont.scenes.registry import scene_names
from pwscont.two_parameters.exact_plane import ExactPlane

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")
EXAMPLES = sorted((ROOT / "docs" / "examples").glob("*.py"))
PNG = b"\x89PNG\r\n"


@pytest.fixture(autouse=True)
def headless(monkeypatch, tmp_path):
    """Draw without a display, write into a fresh folder, and leave no figures open."""
    monkeypatch.setenv("MPLBACKEND", "Agg")
    monkeypatch.chdir(tmp_path)
    import matplotlib.pyplot as plt  # noqa: PLC0415  after the backend is chosen

    plt.switch_backend("Agg")
    yield
    plt.close("all")


def fenced(language):
    """Return the README's code blocks of one language."""
    return re.findall(rf"^```{language}\n(.*?)^```$", README, re.MULTILINE | re.DOTALL)


def indented_between(begin, end):
    """Return the indented lines between two marker lines, as ``.ci/run`` does."""
    inside = re.search(rf"^{begin}$(.*?)^{end}$", README, re.MULTILINE | re.DOTALL)[1]
    return [line.removeprefix("    ") for line in inside.splitlines() if line.startswith("    ")]


@cache
def run_example(name):
    """Run an example in a fresh namespace, once.

    Returns
    -------
    namespace, what is printed, number of figures
    """
    import matplotlib.pyplot as plt  # noqa: PLC0415

    printed = io.StringIO()
    with contextlib.redirect_stdout(printed):
        namespace = runpy.run_path(str(ROOT / "docs" / "examples" / name))
    return namespace, printed.getvalue(), len(plt.get_fignums())


@pytest.fixture(scope="module")
def readme(tmp_path_factory):
    """Return the namespace that the README's Python blocks leave behind, and what they write."""
    namespace = {}
    with contextlib.chdir(tmp_path_factory.mktemp("readme")):
        for block in fenced("python"):
            exec(compile(block, "README.md", "exec"), namespace)
        namespace["written"] = {path.name: path.read_bytes() for path in Path().iterdir()}
    return namespace


# -- the manual --------------------------------------------------------------------------


def stretches(graph):
    """Return the table of numbers of solutions with rounded ends, and whether they are closed."""
    return [
        (pytest.approx(lo, abs=1e-12), pytest.approx(hi, abs=1e-12), count)
        for lo, hi, count in graph.multiplicity()
    ]


def kinds_at(graph, alpha):
    """Return the kinds of all special points at one alpha, sorted."""
    near = [p for p in graph.special_points() if p.alpha == pytest.approx(alpha, abs=1e-9)]
    return sorted(str(point.kind) for point in near)


def inner_kinds(graph):
    """Return the kinds of all special points but starts and ends, sorted."""
    kinds = (str(point.kind) for point in graph.special_points())
    return sorted(kind for kind in kinds if kind not in ("start", "end"))


@pytest.mark.parametrize(
    "path",
    [
        pytest.param(path, marks=() if path.stem == "paper_curve" else pytest.mark.slow)
        for path in EXAMPLES
    ],
    ids=lambda path: path.stem,
)
def test_every_example_prints_and_draws(path):
    namespace, printed, figures = run_example(path.name)
    answers = [value for value in namespace.values() if isinstance(value, BranchGraph | ExactPlane)]
    assert answers
    graphs = [answer for answer in answers if isinstance(answer, BranchGraph)]
    assert not any(graph.special_points("stopped") for graph in graphs)
    assert figures
    assert printed


@pytest.mark.parametrize(
    "name",
    swept(
        ["paper_curve.py", "corners_and_branching.py"], ["own_system.py", "how_many_solutions.py"]
    ),
)
def test_every_graph_of_an_example_has_balance_one(name):
    namespace, *_ = run_example(name)
    graphs = [value for value in namespace.values() if isinstance(value, BranchGraph)]
    for graph in graphs:
        assert graph.is_balanced()
        assert set(graph.balances()) == {1}


def test_tutorial_shows_the_numbers_of_the_paper():
    namespace, printed, _ = run_example("paper_curve.py")
    for tangent in ("0.     -0.2132  0.2132 -0.8528  0.4264", "-0.2673 -0.5345"):
        assert tangent in printed
    (branch,) = namespace["graph"].components()
    passed = [point.passed(-1) for point in namespace["graph"].itinerary(branch, -1)]
    assert passed[1:-1] == [
        "contact-slip → contact-stick",
        "contact-stick → contact-slip",
        "contact-slip → no contact",
    ]
    assert namespace["det"] == pytest.approx(namespace["det_new"], rel=1e-12)
    assert "rank of J' - J: 1\n" in printed


@pytest.mark.slow
def test_how_to_finds_both_folds_and_the_mistake():
    namespace, printed, _ = run_example("own_system.py")
    snap, back = namespace["snap"], namespace["back"]
    # the limit load of w (w - 1) (w - 2) is 2 / (3 sqrt 3), at w = 1 - 1 / sqrt 3
    assert snap.alpha == pytest.approx(2.0 / 27.0**0.5, rel=1e-12)
    assert snap.z[0] == pytest.approx(1.0 - 3.0**-0.5, rel=1e-7)
    # at the stop the pad carries 0.1 d + d^3, and so does the contact spring
    d = 0.35
    push = 0.1 * d + d**3
    w = 0.7 + d + push / 20.0
    assert back.z == pytest.approx(np.array([w, d]), rel=1e-12)
    assert back.alpha == pytest.approx(w * (w - 1.0) * (w - 2.0) + push, rel=1e-10)
    assert namespace["loaded"].count(0.2) == 3
    assert "no defects" in printed
    assert "H jumps across test function 0" in printed


def test_two_nodes_have_up_to_five_solutions():
    namespace, printed, _ = run_example("how_many_solutions.py")
    graph, system = namespace["graph"], namespace["system"]
    # stick at the second node ends where |2 alpha| = F; the other folds are found by hand, too
    folds = (-2.8, -2.0, -1.2, -1.0)
    assert stretches(graph) == [
        (-4.0, -2.8, 1),
        (-2.8, -2.0, 3),
        (-2.0, -1.2, 5),
        (-1.2, -1.0, 3),
        (-1.0, 3.0, 1),
    ]
    assert [s.ends for s in graph.with_count(5)] == ["(-2, -1.2)"]
    assert graph.guarantee == "complete"
    for fold, numbers in zip(folds, ((1, 2, 3), (3, 4, 5), (5, 4, 3), (3, 2, 1)), strict=True):
        assert kinds_at(graph, fold) == ["nonsmooth fold"]
        for alpha, number in zip((fold - 1e-12, fold, fold + 1e-12), numbers, strict=True):
            found = enumerate_solutions(system, alpha)
            assert len(found) == number
            assert sum(solution.det_sign for solution in found) == 1
    assert "alpha = -2 -1e-12: 3 solutions\n" in printed
    assert "alpha = -2 +0: 4 solutions nonsmooth fold\n" in printed
    assert "alpha = -2 +1e-12: 5 solutions\n" in printed


def test_states_of_the_two_nodes_in_closed_form():
    namespace, *_ = run_example("how_many_solutions.py")
    graph, alpha = namespace["graph"], -1.5
    found = {solution.label: solution for solution in graph.solutions(alpha)}
    free = np.linalg.solve(namespace["body"].A, [1.0, alpha, 1.0, 2.0 * alpha])
    assert found["node 1 no contact, node 2 no contact"].z == pytest.approx([*free, 0, 0, 0, 0])
    stuck = [0, 0, 0, 0, -1, -1, -alpha, -2 * alpha]
    assert found["node 1 stick, node 2 stick"].z == pytest.approx(stuck, abs=1e-14)
    way = graph.path(namespace["free"], namespace["stuck"])
    assert [piece.det_sign for piece in way] == [1, -1, 1, -1, 1]
    assert {piece.label for piece in way} == set(found)


def test_searches_promise_what_the_tutorial_says():
    _, printed, _ = run_example("how_many_solutions.py")
    rows = dict(re.findall(r"^(\w+\(.*\)) +(\d .*)$", printed, re.MULTILINE))
    missing = "not balanced: at least one branch missing in (-1.9, -1.3)"
    assert rows["AllTransitions()"] == "3 at 0, balance 1: complete"
    assert rows["EndPoints()"] == "1 at 0, balance 1: complete but for closed loops"
    assert rows["EndPoints() + Slices((0.3,))"].startswith("3 at 0, balance 1")
    # out at -1.3, around the fold at -1.2, and back: the second solution is on the same curve
    assert rows["FromFrictionless()"] == f"2 found, balance +0: {missing}"
    assert rows["Slices((-1.5,))"] == "5 found, balance +1: balanced"
    assert rows["MultiStart()"] == "5 found, balance +1: balanced"
    assert "AllTransitions()    5 found, balance +1: complete\n" in printed
    assert "EndPoints()         5 found, balance +1: complete but for closed loops\n" in printed


def test_loop_beside_the_line_is_the_diamond():
    namespace, *_ = run_example("how_many_solutions.py")
    graph = namespace["loop_graph"]
    assert stretches(graph) == [(-2.0, -1.0, 1), (-1.0, 1.0, 3), (1.0, 2.0, 1)]
    assert graph.guarantee == "complete"
    for alpha in (-0.7, 0.0, 0.25):
        found = sorted(solution.z[0] for solution in graph.solutions(alpha))
        loop = 1.0 - abs(alpha)
        assert found == pytest.approx([-loop, loop, 3.0 + abs(alpha)], abs=1e-14)
    assert inner_kinds(graph) == ["nonsmooth fold"] * 2 + ["transition"] * 3
    assert graph.path(namespace["on_loop"], namespace["on_line"]) == []


def test_unloaded_body_leads_to_all_products():
    namespace, printed, _ = run_example("corners_and_branching.py")
    # f = alpha (1, -3), F = 4: the states of one node for alpha = 1, and the one for alpha = -1
    states = {
        "no contact": (1, [-1 / 3, -5 / 3, 0, 0]),
        "slip-": (-1, [0, -1 / 2, -1 / 2, 2]),
        "stick": (1, [0, 0, -1, 3]),
    }
    one = namespace["one"]
    found = {s.label: (s.det_sign, pytest.approx(s.z, abs=1e-14)) for s in one.solutions(1.0)}
    assert found == {label: (sign, np.array(z)) for label, (sign, z) in states.items()}
    (only,) = one.solutions(-1.0)
    assert only.z == pytest.approx([0, 7 / 6, -1 / 6, -2 / 3], abs=1e-14)
    expected = {
        f"node 1 {a}, node 2 {b}": states[a][0] * states[b][0] for a, b in product(states, states)
    }
    two = namespace["two"]
    assert {s.label: s.det_sign for s in two.solutions(1.0)} == expected
    assert two.count(-1.0) == 1
    for nodes in (1, 2, 3):
        numbers = f"solutions: {3**nodes}, pieces that meet: {3**nodes + 1}"
        assert f"nodes: {nodes}, {numbers}\n" in printed


def test_identical_nodes_square_the_curve_of_one():
    namespace, *_ = run_example("corners_and_branching.py")
    graph = namespace["symmetric"]
    assert stretches(graph) == [(-2.0, -1.0, 1), (-1.0, -0.5, 9), (-0.5, 2.0, 1)]
    assert graph.guarantee == "complete"
    for fold in (-1.0, -0.5):
        assert graph.count(fold) == 4
        assert kinds_at(graph, fold) == ["nonsmooth branch point"] + ["nonsmooth fold"] * 2
    assert kinds_at(graph, 1.0) == ["corner"]


def test_unequal_pull_splits_off_a_loop():
    namespace, *_ = run_example("corners_and_branching.py")
    graph = namespace["broken"]
    # the folds of node 1 are at -1 and -1/2, those of node 2 where 1.2 alpha is
    assert stretches(graph) == [
        (-2.0, -1.0, 1),
        (-1.0, -1.0 / 1.2, 3),
        (-1.0 / 1.2, -0.5, 9),
        (-0.5, -0.5 / 1.2, 3),
        (-0.5 / 1.2, 2.0, 1),
    ]
    assert set(inner_kinds(graph)) == {"transition", "nonsmooth fold"}
    assert [len(pieces) for pieces in graph.components()] == [7, 4]
    loop = graph.nx.edge_subgraph([(p.start, p.end, p.id) for p in namespace["loop"]])
    assert {degree for _, degree in loop.degree} == {2}
    assert namespace["at_ends"].guarantee == "complete but for closed loops"
    assert namespace["at_ends"].count(-0.75) == 5


def test_path_along_the_boundary_of_stick_and_slip():
    namespace, *_ = run_example("corners_and_branching.py")
    graph = namespace["boundary"]
    assert graph.count(0.5) == 1
    assert inf not in [count for _, _, count in graph.multiplicity()]
    assert kinds_at(graph, 0.0) == ["degenerate"]
    (state,) = graph.solutions(0.5)
    assert state.z == pytest.approx([0, 0, -0.5, -2.0], abs=1e-14)


# -- the README --------------------------------------------------------------------------


def test_ci_finds_one_test_command():
    script = (ROOT / ".ci" / "run").read_text()
    begin, end = "<!-- test command -->", "<!-- end -->"
    assert begin in script
    assert end in script
    assert indented_between(begin, end) == [
        "python3 -m venv .venv && .venv/bin/pip install -q -e '.[test]'"
        " && .venv/bin/python -m pytest -n auto"
    ]


def test_main_job_writes_what_the_readme_shows(capsys):
    (command,) = re.findall(r"^    (.*pwscont run.*)$", README, re.MULTILINE)
    set_up, job = command.rsplit(" && ", 1)
    assert set_up == "python3 -m venv .venv && .venv/bin/pip install -q ."
    assert job == ".venv/bin/pwscont run example3 -o out"
    assert main(job.split()[1:]) == 0
    # the last digit of an estimate may differ from machine to machine
    printed, shown = (
        re.sub(r"\de-1[56]\b", "rounding", text)
        for text in (capsys.readouterr().out, *fenced("text"))
    )
    for line in shown.splitlines():
        assert line == "..." or line in printed.splitlines()
    for name in ("example3.png", "example3.npz"):
        assert Path("out", name).stat().st_size > 1000


def test_own_system_draws_and_saves(readme):
    assert readme["written"]["arch.png"].startswith(PNG)
    assert readme["written"]["arch.npz"]
    graph = readme["graph"]
    (fold,) = graph.special_points("fold")
    (kink,) = graph.special_points("nonsmooth fold")
    assert fold.alpha == pytest.approx(2.0 / 27.0**0.5, rel=1e-12)
    assert kink.alpha == pytest.approx(0.0, abs=1e-12)
    assert kink.z == pytest.approx(np.array([1.0]), rel=1e-12)


def test_every_answer_in_the_readme_is_right(readme):
    answers = re.findall(r"^(.+?)  # -> (.+)$", "\n".join(fenced("python")), re.MULTILINE)
    assert len(answers) == 8
    for question, answer in answers:
        assert repr(eval(question, readme)) == answer


def test_own_system_fits_in_fifteen_lines():
    assert len([line for line in fenced("python")[0].splitlines() if line.strip()]) <= 15


def test_table_of_scenes_is_complete():
    table = README.split("## Scenes")[1].split("##")[0]
    listed = {
        name
        for row in table.splitlines()
        if row.startswith("| `")
        for name in re.findall(r"`([\w-]+)`", row.split("|")[1])
    }
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    assert listed == set(project["entry-points"]["pwscont.scenes"])
    assert listed <= set(scene_names())


def test_every_file_that_the_readme_names_exists():
    names = re.findall(r"\]\(((?!http)[^)]+)\)", README) + re.findall(
        r"`([A-Z]+(?:\.md)?)`", README
    )
    assert "docs/images/example3.png" in names
    for name in set(names) - {"ALPHA", "DIR", "SCENE"}:
        assert (ROOT / name).exists(), name


def test_picture_of_the_readme_is_small():
    picture = (ROOT / "docs/images/example3.png").read_bytes()
    assert picture.startswith(PNG)
    assert len(picture) < 80_000


def test_page_of_scenes_shows_each_once_and_leads_to_tutorials():
    page = runpy.run_path(str(ROOT / "docs" / "scenes_page.py"))["scenes_page"]("built")
    shown = re.findall(r"^ +\.\. figure:: built/scene-(.*)\.png$", page, re.MULTILINE)
    assert sorted(shown) == sorted(scene_names())
    docs = ROOT / "docs"
    for name in set(re.findall(r":doc:`(.*?)`", page)):
        source = docs / name.replace("gallery/", "examples/")
        assert source.with_suffix(".py").exists() or source.with_suffix(".rst").exists()


# -- the pages about the code ------------------------------------------------------------


def resolves(path):
    """Tell whether a dotted path names a module of pwscont, or what stands in one."""
    try:
        return pkgutil.resolve_name(path) is not None
    except (ImportError, AttributeError):
        return False


@pytest.mark.parametrize("page", ["architecture", "seams"])
def test_every_module_and_class_on_the_pages_about_the_code_exists(page):
    text = (ROOT / "docs" / f"{page}.rst").read_text(encoding="utf-8")
    paths = set(re.findall(r"[`~](pwscont[\w.]*\w)`", text))
    assert len(paths) > 20
    assert not [path for path in sorted(paths) if not resolves(path)]


def test_every_seam_is_on_its_page():
    """A class of ``pwscont`` or ``extending`` that is abstract can be derived from."""
    text = (ROOT / "docs" / "seams.rst").read_text(encoding="utf-8")
    for module in (pwscont, pwscont.extending):
        for name in module.__all__:
            if inspect.isabstract(getattr(module, name)):
                assert re.search(rf"[`~.]{getattr(module, name).__name__}`", text), name
