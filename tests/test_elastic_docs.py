"""The manual's page on elastic bodies runs and says what is true."""

import re
from pathlib import Path

import numpy as np
import pytest
from pwscont_coulomb.elastic import recover
from pwscont_coulomb.elastic.scenes import block, wedge_body
from pwscont_coulomb.modes import Mode

from pwscont import explore
from pwscont.continuation.plan import silent

PAGE = (Path(__file__).parents[1] / "docs" / "elastic.rst").read_text(encoding="utf-8")


CONDENSED = re.findall(r'^   ("[\d,]+", "[\d,]+", "[\d.]+ ×".*)$', PAGE, re.MULTILINE)
WEDGE = re.findall(r'^   "(\d+)", "(\d+)", "(\d+)", "([\d.]+)", "([\d.]+)"$', PAGE, re.MULTILINE)


def python_blocks():
    """Return the code of all Python blocks, without their indentation."""
    found = re.findall(r"^\.\. code-block:: python\n\n((?:   .*\n|\n)+)", PAGE, re.MULTILINE)
    return [re.sub(r"^   ", "", code, flags=re.MULTILINE) for code in found]


@pytest.mark.slow
def test_the_code_runs(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    namespace = {}
    blocks = python_blocks()
    assert len(blocks) == 3
    for code in blocks:
        exec(compile(code, "elastic.rst", "exec"), namespace)
    problem, body = namespace["problem"], namespace["body"]
    assert (problem.body.n, len(body.free)) == (42, 420)
    assert "42 unknowns instead of 420" in PAGE
    files = {file.name for file in tmp_path.iterdir()}
    assert files == {"states.png", "state.vtu", "branch.gif"}


def test_the_block_is_in_the_state_that_its_picture_shows():
    answer = block().solve((0.7,), silent)
    (solution,) = answer.graph.graph.solutions(0.7)
    state = recover(answer.problem, solution)
    assert np.count_nonzero(state.modes == Mode.STICK) == 10
    assert np.count_nonzero(state.modes == Mode.SLIP_PLUS) == 9
    assert state.modes[0] == Mode.SLIP_MINUS
    text = " ".join(PAGE.split())
    assert "ten nodes stick, nine slip to the right, the first one slips to the left" in text


@pytest.mark.parametrize("row", CONDENSED)
def test_the_table_agrees_with_itself(row):
    """Unknowns are those of the block with that many contact nodes."""
    unknowns, nodes = (int(cell.replace(",", "")) for cell in re.findall(r'"([\d,]+)"', row)[:2])
    assert unknowns == 2 * nodes * max(1, nodes // 2)


@pytest.mark.parametrize(
    "row", [pytest.param(WEDGE[0], marks=pytest.mark.slow), WEDGE[1]], ids=lambda row: row[0]
)
def test_the_table_of_the_wedge(row):
    body = wedge_body(int(row[0]))
    graph = explore(body.condensed().along_load(), (0.0, 0.2))
    assert (len(body.free), len(graph.pieces)) == (int(row[1]), int(row[2]))
    ((lo, hi, count),) = [s for s in graph.multiplicity() if s[2] > 1]
    assert (f"{lo:.6f}", f"{hi:.6f}", count) == (row[3], row[4], 3)


def test_both_tables_are_found():
    assert (len(CONDENSED), len(WEDGE)) == (5, 4)


# -- memory of ranks -----------------------------------------------------------------------------

RANKS = re.findall(
    r'^   "([\d,]+)", "(\d) ranks?", (?:"[\d.]+", ){3}"[\d,]+", '
    r'"([\d,]+)", "([\d,]+)", "([\d,]*)"$',
    PAGE,
    re.MULTILINE,
)
EXPECTED = re.findall(r'^   "10\\ :sup:`(\d)`", "(\d+)", "([\d.]+)", "(\d+)"$', PAGE, re.MULTILINE)


def number(text):
    return float(text.replace(",", ""))


def growth(n):
    """Return the page's bytes for MUMPS on all ranks."""
    return 67.0 * n * np.log2(n)


def test_memory_of_ranks_grows_as_is_said():
    assert len(RANKS) == 8
    for n, ranks, mumps, first, other in RANKS:
        used, whole = 1e6 * number(mumps), growth(number(n))
        low, high = {"1": (65 / 67, 68 / 67), "2": (0.55, 0.59)}[ranks]
        assert low - 0.01 < used / whole < high + 0.01
        if ranks == "2":
            assert number(other) == pytest.approx(number(mumps) + 110, rel=0.05)
        later = 1.6e-3 * number(n) + number(mumps)
        assert number(first) == pytest.approx(max(later, 2.2e-3 * number(n)) + 100, rel=0.15)


def test_memory_of_many_ranks_follows_from_the_growth():
    assert len(EXPECTED) == 6
    for power, ranks, other, first in EXPECTED:
        n = 10.0 ** int(power)
        part = 1.15 * growth(n) / int(ranks)
        assert float(other) == pytest.approx(1e-9 * part + 0.1, rel=0.02)
        assert float(first) == pytest.approx(1e-9 * max(2200 * n, 1600 * n + part), rel=0.01)
