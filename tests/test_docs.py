"""The manual's examples and the README say what is true, and run."""

import contextlib
import io
import re
import runpy
import tomllib
from pathlib import Path

import numpy as np
import pytest

from pwscont import BranchGraph
from pwscont.interface.cli import main
from pwscont.interface.registry import scene_names

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


def run_example(name):
    """Run an example in a fresh namespace and return that and what it prints."""
    printed = io.StringIO()
    with contextlib.redirect_stdout(printed):
        namespace = runpy.run_path(str(ROOT / "docs" / "examples" / name))
    return namespace, printed.getvalue()


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


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_every_example_draws_a_balanced_graph(path):
    import matplotlib.pyplot as plt  # noqa: PLC0415

    namespace, printed = run_example(path.name)
    graphs = [value for value in namespace.values() if isinstance(value, BranchGraph)]
    assert graphs
    for graph in graphs:
        assert graph.is_balanced()
        assert graph.balances()[0] == 1
        assert not graph.special_points("stopped")
        assert not graph.special_points("corner")
    assert plt.get_fignums()
    assert printed


def test_tutorial_shows_the_numbers_of_the_paper():
    namespace, printed = run_example("paper_curve.py")
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


def test_how_to_finds_both_folds_and_the_mistake():
    namespace, printed = run_example("own_system.py")
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


# -- the README --------------------------------------------------------------------------


def test_ci_finds_one_test_command():
    script = (ROOT / ".ci" / "run").read_text()
    begin, end = "<!-- test command -->", "<!-- end -->"
    assert begin in script
    assert end in script
    assert indented_between(begin, end) == [
        "python3 -m venv .venv && .venv/bin/pip install -q -e '.[test]'"
        " && .venv/bin/python -m pytest"
    ]


def test_main_job_writes_what_the_readme_shows(capsys):
    (command,) = re.findall(r"^    (.*pwscont run.*)$", README, re.MULTILINE)
    set_up, job = command.rsplit(" && ", 1)
    assert set_up == "python3 -m venv .venv && .venv/bin/pip install -q ."
    assert job == ".venv/bin/pwscont run example3 -o out"
    assert main(job.split()[1:]) == 0
    printed = capsys.readouterr().out.splitlines()
    (shown,) = fenced("text")
    for line in shown.splitlines():
        assert line == "..." or line in printed
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
    assert len(answers) == 7
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
        for name in re.findall(r"`(\w+)`", row.split("|")[1])
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
