"""The table that ``pwscont run`` prints: short lines, plain words, each branch once."""

import re

import numpy as np
import pytest

from pwscont import Panel, Scene, Switched, check_system, explore, plot
from pwscont.commands.cli import main
from pwscont.kit.inspection import Defect
from pwscont.kit.system import Report
from pwscont.scenes.registry import load_scene
from pwscont.scenes.table import report


def slow(*names):
    """Return cases that the quick tests leave out."""
    return [pytest.param(name, marks=pytest.mark.slow) for name in names]


WIDE = ["obstacle", *slow("ieee14", "relu-fixed-points")]


@pytest.mark.parametrize("name", WIDE)
def test_wide_states_are_shortened_unless_asked_for(capsys, name):
    assert main(["run", name]) == 0
    short = capsys.readouterr().out
    assert max(map(len, short.splitlines())) < 260
    assert "--full" in short.splitlines()[-1]
    assert main(["run", name, "--full"]) == 0
    full = capsys.readouterr().out
    assert "..." not in full
    shortened = [line for line in short.splitlines() if "..." in line]
    for line in shortened:  # nothing is lost but the middle
        head, tail = line.split("...")
        tail = re.sub(r" \(\d+ unknowns\)$", "", tail)
        assert any(whole.startswith(head) and whole.endswith(tail) for whole in full.splitlines())


@pytest.mark.parametrize("name", ["fig7", "example1", "lasso"])
def test_short_states_are_printed_in_full(capsys, name):
    assert main(["run", name]) == 0
    assert "..." not in capsys.readouterr().out


def test_each_branch_is_printed_once(capsys):
    for name in ("fig7", "example3", "lasso"):
        assert main(["run", name]) == 0
        printed = capsys.readouterr().out
        pieces = re.findall(r"^    piece (\d+):", printed, re.M)
        assert sorted(pieces, key=int) == [str(i) for i in range(len(pieces))]


@pytest.mark.parametrize("name", ["fig13", "border-collision", *slow("ieee14", "game", "block")])
def test_exact_values_and_names_in_the_table(capsys, name):
    """No error of zero, no zero with a sign, and no alpha where the parameter has a name."""
    assert main(["run", name]) == 0
    printed = capsys.readouterr().out
    assert "0e+00" not in printed
    assert "+0 " not in printed
    parameter = load_scene(name).parameter
    assert parameter == "alpha" or not re.search(r"\balpha\b", printed.split("\n", 1)[1])


@pytest.mark.slow
@pytest.mark.parametrize("spelt", ["lambda_t", "λ_t"])
@pytest.mark.sweep(2)
def test_panels_with_greek_letters_in_words(capsys, tmp_path, spelt):
    out = str(tmp_path)
    assert main(["run", "fig7", "-o", out, "--panels", spelt, "u_nu", "--format", "svg"]) == 0
    assert (tmp_path / "fig7.svg").stat().st_size > 1000


def test_a_fold_is_told_within_its_mode():
    """Labels may begin with a preposition of their own, such as those of switches."""
    arch = Switched(1, lambda z, t, sw: z * (z - 1) * (z - 2) + 5 * sw.relu(z - 1) - t)
    graph = explore(arch, (-0.5, 1.0))
    (fold,) = graph.special_points("fold")
    assert fold.message == f'fold within "{graph.pieces[0].label}"'


def test_one_defect_is_no_plural():
    report = check_system(Switched(1, lambda z, t, sw: z - sw.relu(t)), [([0.0], 0.5)])
    assert str(report) == "no defects found at 1 point"
    assert str(Report((Defect("H jumps", np.zeros(1), 0.5, 1.0),), 1)).startswith("1 defect:\n")


def test_numbers_far_from_zero_have_the_digits_that_tell_them_apart():
    """abs(z) = alpha - 1e9 - 1/8 has a fold an eighth beyond the beginning of the interval."""
    system, interval = Switched(1, lambda z, t, sw: sw.abs(z) + 1e9 + 0.125 - t), (1e9, 1e9 + 1)
    scene = Scene("far", "far from zero", system, interval, panels=(Panel(0),))
    table = report(scene, graph := scene.run(), ())
    assert "piece 0: " in table
    assert table.count("1000000000.125") == 6  # fold, two pieces, three numbers of solutions
    assert [text.get_text() for text in plot(graph).axes.texts] == ["1000000000.125"]
    assert "1000000000.125" in graph._repr_html_()


def test_a_guarantee_names_places_far_from_zero():
    """The root of 1e9 + 1/4 - alpha ends within the interval."""
    system = Switched(1, lambda z, t, sw: z - np.sqrt(1e9 + 0.25 - t))
    found = re.search(r"stopped at alpha = (\S+)", explore(system, (1e9, 1e9 + 1)).guarantee)
    assert abs(float(found[1]) - 1e9 - 0.25) < 1e-3
