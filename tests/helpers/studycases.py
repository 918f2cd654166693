"""Problems of studies, at the top of a module so that other processes can import them."""

import os
import time
from pathlib import Path

from pwscont_coulomb import AffineLoad, ContactBody, CoulombLoad

from pwscont import InvalidInputError, MultiStart, PiecewiseSystem, Scene, Study, explore


def one_node(friction=4.0, f_nu=0.25):
    """Return the paper's one-node body; with a = 2 and b = 1 its closed forms are known."""
    body = ContactBody([[2.0, -1.0], [-1.0, 2.0]], N=[[1.0, 0.0]], T=[[0.0, 1.0]])
    return CoulombLoad(body, AffineLoad([f_nu, 0.0], [0.0, 1.0]), friction), (-4.0, 4.0)


def unproven_above_three(friction=1.0, f_nu=0.25):
    """Return the same, searched in a way that promises nothing where friction exceeds 3."""
    system, interval = one_node(friction, f_nu)
    search = MultiStart(count=5, seed=1) if friction > 3.0 else None
    return Scene("one", "one node", system, interval, search=search)


def recorded(friction=4.0):
    """Return a scene that records the slip times two."""
    system, interval = one_node(friction)
    return Scene("own", "own", system, interval, record={"twice": lambda z, alpha: 2.0 * z[1]})


GRAPH = explore(*one_node())


def known_graph(number=0):
    """Return a graph that is there already: nothing is computed."""
    return GRAPH


def refused(friction=4.0):
    """Refuse negative friction in words, and fail at zero."""
    if friction < 0.0:
        raise InvalidInputError("friction is negative")
    return one_node(1.0 / (1.0 / friction))


def ends_once(number, folder):
    """End the process that runs case 3 for the first time."""
    mark = Path(folder, "ended")
    if number == 3 and not mark.exists():
        mark.touch()
        os._exit(7)
    return GRAPH


def ends_always(number):
    """End every process that runs case 2."""
    if number == 2:
        os._exit(9)
    return GRAPH


def slow(number):
    """Take a moment."""
    time.sleep(0.01)
    return GRAPH


def exits(number):
    """Want to end the program."""
    raise SystemExit("enough")


def scene_of_one_node(friction, f_nu=0.25):
    """Return the one-node body as a scene, with settings as texts."""
    system, interval = one_node(float(friction), float(f_nu))
    return Scene("one", "one node", system, interval)


def slow_study(cases=100):
    """Return a study of which a hundred cases take a second."""
    return Study(slow, {"number": range(cases)}, {"pieces": number_of_pieces})


def number_of_pieces(graph):
    """Return the number of pieces."""
    return len(graph.pieces)


class Parabola(PiecewiseSystem):
    """z^2 = alpha / unit."""

    size = 1

    def __init__(self, unit):
        self._unit = unit

    def test_functions(self, z, alpha):
        return z + 9.0

    def residual(self, z, alpha, character):
        return z**2 - alpha / self._unit


def parabola(unit):
    """Return a smooth fold at zero between none and two solutions."""
    return Parabola(unit), (-unit, unit)
