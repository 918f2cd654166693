"""The cheat sheet and the recipes, run as they stand."""

import os
import re
import runpy
import shlex
import subprocess
import sys
import tomllib
from importlib.util import find_spec
from pathlib import Path

import pwscont_coulomb
import pwscont_coulomb.elastic
import pytest
from pages import DOCS, blocks, check_answers, page

import pwscont
from pwscont.commands.cli import main


@pytest.fixture(autouse=True)
def in_a_folder(tmp_path, monkeypatch):
    """Write into a fresh folder, without a display."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("MPLBACKEND", "Agg")
    import matplotlib.pyplot as plt  # noqa: PLC0415  after the backend is chosen

    plt.switch_backend("Agg")
    yield
    plt.close("all")


def run(name, skipped=()):
    """Run a page from top to bottom; return what is there in the end, and the number of answers."""
    names, answers = {"__name__": "page"}, 0
    for code in [code for code in blocks(name) if code not in skipped]:
        exec(compile(code, name, "exec"), names)
        answers += check_answers(code, names)
    return names, answers


WRITTEN = {"curve.png", "curve.npz", "curve.html", "run.journal", "most.png", "study.db"}


@pytest.mark.slow
def test_the_cheat_sheet_runs(tmp_path):
    _, answers = run("cheatsheet.rst")
    assert answers == 48
    assert {file.name for file in tmp_path.iterdir()} >= WRITTEN


COMMANDS = re.findall(r"^   \$ (pwscont .+)$", page("cheatsheet.rst"), re.M)
QUICK = [line for line in COMMANDS if "bench" not in line]
SLOW = [pytest.param(line, marks=pytest.mark.slow) for line in COMMANDS if "bench" in line]


@pytest.mark.slow
@pytest.mark.parametrize("line", QUICK + SLOW)
def test_the_commands_of_the_cheat_sheet_run(capsys, line):
    assert main(shlex.split(line)[1:]) == 0
    assert capsys.readouterr().out


@pytest.mark.parametrize("package", [pwscont, pwscont_coulomb, pwscont_coulomb.elastic])
def test_the_cheat_sheet_has_every_public_name(package):
    words = set(re.findall(r"\w+", page("cheatsheet.rst")))
    assert set(package.__all__) <= words


def test_the_cheat_sheet_has_what_a_graph_answers():
    questions = {name for name in dir(pwscont.BranchGraph) if not name.startswith("_")}
    inner = {"balances", "breaks", "clean", "names", "pieces_at", "same", "verticals"}
    inner |= {"is_beside_infinite", "nodes", "extent", "alphas", "alpha_errors"}
    words = set(re.findall(r"\.(\w+)", page("cheatsheet.rst")))
    assert questions - inner <= words


SWEEP = next(code for code in blocks("recipes.rst") if "ProcessPoolExecutor" in code)


def test_the_recipes_run(tmp_path, capsys):
    names, answers = run("recipes.rst", [SWEEP])
    assert answers == 4
    header, *rows = (tmp_path / "special.csv").read_text(encoding="utf-8").splitlines()
    assert (header, len(rows)) == ("kind,alpha,u_t,λ_ν", 5)
    assert capsys.readouterr().out.endswith(f"\n{names['some'].guarantee}\n")


def test_the_page_for_beginners_runs(tmp_path):
    _, answers = run("getting_started.rst")
    assert answers == 11
    assert (tmp_path / "arch.png").stat().st_size > 1000


@pytest.mark.slow
@pytest.mark.parametrize(("name", "answers"), [("histories.rst", 14), ("matrices.rst", 5)])
def test_pages_of_histories_and_matrices_run(name, answers):
    assert run(name)[1] == answers


def test_the_page_for_beginners_names_every_extra():
    project = tomllib.loads((DOCS.parent / "pyproject.toml").read_text())["project"]
    extras = set(project["optional-dependencies"]) - {"test", "docs", "dev"}
    named = set(re.findall(r"^   \* - ``(\w+)``$", page("getting_started.rst"), re.M))
    assert named == extras
    every = re.findall(r"\w+", project["optional-dependencies"]["all"][0])
    assert set(every) == extras - {"all", "mumps", "proof"} | {"pwscont"}


def test_no_number_of_an_equation_reads_as_a_list():
    """A cell or a paragraph that begins with "(1)" would become an enumerated list."""
    number = re.compile(r"\s+(\* )?- \(?(\d+|[a-z])[.)]( |$)")
    for path in sorted(DOCS.glob("*.rst")):
        lines = path.read_text(encoding="utf-8").splitlines()
        assert not any(map(number.match, lines)), path


@pytest.mark.skipif(not find_spec("sphinx-mathjax-offline"), reason="needs the extra docs")
def test_formulas_need_no_network():
    conf = runpy.run_path(str(DOCS / "conf.py"))
    (script,) = [Path(path) for path in conf["html_static_path"] if path.endswith(".js")]
    assert script.stat().st_size > 1_000_000
    assert conf["mathjax_path"] == script.name


def test_the_tutorials_stand_in_the_order_of_learning():
    tutorials = re.search(r"^TUTORIALS = \((.*?)^\)", page("conf.py"), re.M | re.S)[1]
    listed = re.findall(r'"(\w+)"', tutorials)
    assert sorted(listed) == sorted(path.stem for path in (DOCS / "examples").glob("*.py"))
    linked = re.findall(r":doc:`gallery/(\w+)`", page("index.rst"))
    assert linked == listed
    toctree = page("index.rst").split(":hidden:")[1].split()
    assert toctree[:2] == ["getting_started", "gallery/index"]


@pytest.mark.slow
def test_the_page_on_notation_runs(tmp_path):
    _, answers = run("notation.rst")
    assert answers == 12
    assert (tmp_path / "spring.png").stat().st_size > 1000


def test_cells_of_notebooks_show_something():
    names, _ = run("recipes.rst", [SWEEP])
    cells = [code.strip() for code in blocks("recipes.rst") if code.count("\n") <= 2]
    shown = [eval(cell.splitlines()[-1], names) for cell in cells]
    assert len(shown) == 2
    assert all("<table" in thing._repr_html_() for thing in shown)


@pytest.mark.slow
def test_the_parallel_sweep_prints_what_the_page_shows(tmp_path):
    Path("sweep.py").write_text(SWEEP, encoding="utf-8")
    for _ in range(2):  # the second time from the files of the first
        done = subprocess.run(
            [sys.executable, "sweep.py"], env=os.environ, capture_output=True, text=True, check=True
        )
        assert done.stdout == blocks("recipes.rst", "text")[0]
    assert len(list(Path("sweep").iterdir())) == 6
