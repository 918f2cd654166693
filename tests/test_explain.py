"""The parts of a run are said, and nothing else is done."""

import json

import numpy as np
import pytest
from pwscont_coulomb import AffineLoad, ContactBody, CoulombLoad
from pwscont_coulomb.scenes import two_nodes

from pwscont import EndPoints, PiecewiseSystem, PseudoArclength, Scene, Switched, explore
from pwscont.commands.cli import main


def plan(system, interval=(0.0, 1.0), **parts):
    return Scene("it", "it", system, interval, **parts).plan()


def straight(gap=0.0):
    body = two_nodes()
    contact = ContactBody(body.A, body.N, body.T, gap=[0.0, gap])
    return CoulombLoad(contact, AffineLoad(np.ones(4), np.ones(4)), 0.5)


def test_straight_pieces_need_no_steps_and_no_smooth_detectors():
    told = plan(straight())
    assert told["steps"] == "ExactLinear()"
    assert told["watched"] == "IntervalEnds, StraightTests"
    assert told["unknowns"] == "8 of 8"
    told = plan(straight(), stepper=PseudoArclength())
    assert told["steps"].startswith("PseudoArclength")
    assert told["watched"].endswith("SmoothBranchPoints, SmoothFolds")


def test_a_node_out_of_reach_is_named_with_its_bound_and_is_not_followed():
    system = straight(gap=1e3)
    assert plan(system)["unknowns"].startswith("6 of 8; node 2 cannot touch")
    graph = explore(system, (0.0, 1.0))
    assert all(not piece.z[:, [5, 7]].any() for piece in graph.pieces)


def test_the_search_is_said():
    class Parabola(PiecewiseSystem):
        size = 1

        def test_functions(self, z, alpha):
            return z

        def residual(self, z, alpha, character):
            return z**2 - alpha

    system = Parabola()
    assert plan(system, (-1.0, 1.0))["starts"] == explore(system, (-1.0, 1.0)).searched.what
    arch = Switched(1, lambda z, t, sw: z * (z - 1.0) * (z - 2.0) + 5.0 * sw.relu(z - 1.0) - t)
    assert plan(arch, (-0.5, 1.0))["starts"] == explore(arch, (-0.5, 1.0)).searched.what
    told = plan(straight(), search=EndPoints())["starts"]
    assert told == explore(straight(), (0.0, 1.0), search=EndPoints()).searched.what


@pytest.mark.parametrize("name", ["fig7", pytest.param("fig5", marks=pytest.mark.slow)])
def test_explain_on_the_command_line(name, capsys):
    assert main(["run", name, "--explain"]) == 0
    assert "What was done" in capsys.readouterr().out
    assert main(["run", name, "--explain", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["plan"]
    assert main(["run", name, "--json"]) == 0
    assert "plan" not in json.loads(capsys.readouterr().out)
