"""A piece that begins outside of its cell ends in words: it would never meet what it has passed."""

import numpy as np
import pytest
from circle import Circle

from pwscont import PseudoArclength
from pwscont.basics.character import Character
from pwscont.continuation.follow import PieceFollower, default_detectors
from pwscont.curve.curve import Curve, State
from pwscont.curve.metric import Metric
from pwscont.system.box import Box
from pwscont.system.selection import Selection
from pwscont.transitions.ends import Bounds
from pwscont.transitions.rays import Ray
from pwscont.transitions.watch import Watch

INTERVAL = (-2.0, 2.0)


def followed(angle, way, sign):
    """Follow the circle from an angle on, as a piece of the cell with this sign."""
    system = Circle().within(*INTERVAL)
    metric, stepper = Metric.of(system, INTERVAL), PseudoArclength()
    curve = Curve(Selection(system, Character([sign])), metric)
    x = np.array([np.sin(angle), np.cos(angle)])
    tangent = metric.normalised(way * np.array([np.cos(angle), -np.sin(angle)]))
    orientation = int(np.sign(x[0] * tangent[1] - x[1] * tangent[0]))
    ray = Ray(curve, State(x, tangent, np.full((1, 2), 1e-16), orientation))
    bounds = Bounds(Box.of(system), ())
    watch = Watch(default_detectors(stepper, INTERVAL))
    return PieceFollower(stepper, watch, INTERVAL, bounds).follow(ray)[1]


@pytest.mark.parametrize("angle", [0.5, 0.3, 0.1, -0.4])
def test_a_piece_that_begins_and_stays_outside_is_stopped_in_words(angle):
    arrival = followed(angle, -1.0, True)
    assert arrival.kind == "stopped"
    assert "outside of its cell" in arrival.message


@pytest.mark.parametrize("angle", [0.5236, 0.6, 1.0])
def test_a_piece_that_begins_inside_reaches_its_end(angle):
    assert followed(angle, -1.0, True).kind in ("transition", "fold")


@pytest.mark.parametrize("shift", [0.0, -1e-15, 1e-15])
def test_a_test_that_is_zero_but_for_rounding_where_a_piece_begins_is_no_reason(shift):
    arrival = followed(np.pi / 6.0 + shift, 1.0, True)
    assert arrival.kind == "transition"
    assert arrival.x[1] == pytest.approx(-np.sqrt(0.75))
