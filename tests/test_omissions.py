"""What a run leaves out is said, and left out indeed."""

import json

import numpy as np
import pytest
from pwscont_coulomb import AffineLoad, ContactBody, CoulombLoad
from pwscont_coulomb.scenes import two_nodes

from pwscont import EndPoints, PiecewiseSystem, PseudoArclength, explore
from pwscont.commands.cli import main
from pwscont.continuation.omissions import omissions


def words(*arguments, **named):
    return dict(omissions(*arguments, **named))


def with_gap(gap):
    body = two_nodes()
    return ContactBody(body.A, body.N, body.T, gap=[0.0, gap])


def test_straight_pieces_need_no_steps_and_no_smooth_detectors():
    system = CoulombLoad(two_nodes(), AffineLoad(np.ones(4), np.ones(4)), 0.5)
    said = words(system, (0.0, 1.0))
    assert "step sizes and corrections" in said
    assert "detectors of smooth folds and branch points" in said
    assert not any("search" in what for what in said)  # the default one promises everything
    said = words(system, (0.0, 1.0), stepper=PseudoArclength())
    assert "step sizes and corrections" not in said
    assert "detectors of smooth folds and branch points" not in said


def test_a_node_out_of_reach_is_named_with_its_bound_and_is_not_followed():
    system = CoulombLoad(with_gap(1e3), AffineLoad(np.ones(4), np.ones(4)), 0.5)
    said = words(system, (0.0, 1.0))
    assert said["a part of the system"].startswith("node 2 cannot touch")
    assert said["2 of 8 unknowns"] == "zero in the parts left out"
    graph = explore(system, (0.0, 1.0))
    assert all(not piece.z[:, [5, 7]].any() for piece in graph.pieces)


def test_a_chosen_search_and_a_nonlinear_system_say_why_no_better_one_is_made():
    class Parabola(PiecewiseSystem):
        size = 1

        def test_functions(self, z, alpha):
            return z

        def residual(self, z, alpha, character):
            return z**2 - alpha

    said = words(Parabola(), (-1.0, 1.0))
    assert said["a search that promises to miss no branch"].startswith("there is none")
    assert "differences" not in said  # both derivatives are differences
    system = CoulombLoad(two_nodes(), AffineLoad(np.ones(4), np.ones(4)), 0.5)
    said = words(system, (0.0, 1.0), search=EndPoints())
    assert said["a search that also finds every closed loop"] == "the scene chooses its search"


@pytest.mark.parametrize("name", ["fig7", pytest.param("fig5", marks=pytest.mark.slow)])
def test_explain_on_the_command_line(name, capsys, tmp_path):
    assert main(["run", name, "--explain"]) == 0
    assert "Left out, and why" in capsys.readouterr().out
    assert main(["run", name, "--explain", "--json"]) == 0
    left_out = json.loads(capsys.readouterr().out)["left_out"]
    assert {"what": "pictures and files", "why": "no -o: matplotlib is not loaded"} in left_out
    assert main(["run", name, "--explain", "--json", "-o", str(tmp_path)]) == 0
    left_out = json.loads(capsys.readouterr().out)["left_out"]
    assert "pictures and files" not in [omission["what"] for omission in left_out]
    assert main(["run", name, "--json"]) == 0
    assert "left_out" not in json.loads(capsys.readouterr().out)
