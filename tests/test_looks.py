"""How public objects look: a few words, however large they are, and no addresses in memory."""

import re

import numpy as np
import pytest
from pwscont_coulomb import AffineLoad
from pwscont_coulomb.elastic.scenes import block, block_body
from pwscont_coulomb.plane_scenes import fig5
from pwscont_coulomb.scenes import fig7
from sweeps import swept

from pwscont import (
    BandedJacobian,
    BorderedNewton,
    Character,
    EndPoints,
    ExactLinear,
    Journal,
    PiecewiseLinearSystem,
    PiecewiseSystem,
    PseudoArclength,
    Slices,
    Stepper,
    StepSize,
    TransitionDetector,
    check_system,
    trace,
)
from pwscont.extending import Failure, FailureReason, Guarantee, Ray, Reading, SearchScope
from pwscont.two_parameters.loci_plane import LociPlane

#: Both ends in full where eight digits do not tell them apart.
INTERVALS = [
    ((1e9 - 1.0, 1e9 + 1.0), "999999999, 1000000001"),
    ((1.0, 1.0 + 1e-12), "1, 1.000000000001"),
    ((-2.0, 1e9), "-2, 1e+09"),
]
START = ((-0.5, -1.25, 0.0, 0.0), -2.0)


class Straight(PiecewiseLinearSystem):
    """z = alpha."""

    size = 1

    def test_functions(self, z, alpha):
        return np.ones(1)

    def residual(self, z, alpha, character):
        return z - alpha


class Watcher(TransitionDetector):
    """Keeps the curve and the state where the branch begins."""

    def __init__(self):
        self.seen = []

    def read(self, curve, state):
        self.seen.append((curve, state))
        return Reading(np.ones(1), np.zeros(1))

    def locate(self, segment, index, bracket):
        raise AssertionError("nothing falls")

    def arrive(self, curve, state, index):
        raise AssertionError("nothing falls")


class Many(PiecewiseSystem):
    """A system with a wrong Jacobian and many unknowns."""

    size = 300

    def test_functions(self, z, alpha):
        return np.ones(1)

    def residual(self, z, alpha, character):
        return z - alpha

    def jacobian(self, z, alpha, character):
        return np.zeros((self.size, self.size + 1))


@pytest.fixture(scope="module")
def on_the_way():
    """What detectors and steppers meet along a branch."""
    watcher = Watcher()
    trace(fig7().system, START, (-2.0, 2.0), detectors=[watcher])
    curve, state = watcher.seen[0]
    found = BorderedNewton().correct(curve, state.x, state.tangent)
    steps = [s.step(curve, (-2.0, 2.0), state, None, np.inf) for s in (ExactLinear(), Arc)]
    return [curve, state, found, *steps, curve.selection, curve.metric, Ray(curve, state)]


Arc: Stepper = PseudoArclength()


def of_the_plug_in():
    body = block_body(200)
    yield from (AffineLoad(np.zeros(900), np.ones(900)), body.contact, body.condensed())
    yield from (body.full(), body, body.condensed().along_load())


def of_scenes():
    scene = fig7()
    yield from (scene, scene.panels[0], scene.solve((), lambda *_: None), block(), fig5())
    answer = fig5().solve((), lambda *_: None)
    plane = answer.plane
    by_loci = LociPlane.between(fig5().family, (-1.0, 1.0), (0.5, 1.0), (0.7,))
    yield from (answer, plane, by_loci, by_loci.loci[0], plane.parts[0][0], *plane.groups())
    yield from (plane.sectors[0], plane.sectors[0].regions[0], plane.sectors[0].solutions[0])


def of_the_framework():
    yield from (Character([True, False] * 200), EndPoints() + Slices((0.3,)), StepSize())
    yield BandedJacobian(np.ones((3, 400)), 1, 1, np.ones(400))
    yield Failure(FailureReason.NO_TURN)
    yield SearchScope("words", Guarantee.NOTHING)
    report = check_system(Many(), [(np.zeros(300), 0.0)])
    assert report.defects
    yield from (report, *report.defects)


def assert_short(thing):
    text = repr(thing)
    assert type(thing).__name__ in text
    assert "\n" not in text.partition("BranchGraph")[0]
    assert len(text) < 320, text
    assert not re.search(r"object at 0x|array\(", text), text


@pytest.mark.parametrize("things", swept([of_the_framework], [of_the_plug_in, of_scenes]))
def test_public_objects_are_short(things):
    for thing in things():
        assert_short(thing)


def test_what_extensions_meet_is_short(on_the_way):
    for thing in on_the_way:
        assert_short(thing)


def test_in_words(on_the_way):
    curve, state, *_ = on_the_way
    assert repr(Character([True, False, True])) == "Character(+-+)"
    assert repr(Character([True] * 100)).endswith("+ ..., 100 signs)")
    assert repr(state) == "State(alpha=-2, z=[-0.5, -1.25, 0, 0], orientation +1)"
    assert repr(curve.selection) == "Selection(no contact, of AffineCoulombLoad)"
    assert repr(fig7()) == "Scene(fig7: one node, f = (0.25, alpha), F = 4)"


def test_scenes_are_small_tables_in_notebooks():
    for scene in (fig7(), fig5(), block()):
        html = scene._repr_html_()
        assert html.startswith("<table>")
        assert scene.name in html


def test_journals(tmp_path):
    journal = Journal(tmp_path / "run.journal")
    try:
        assert repr(journal).endswith("run.journal, 0 finished pieces)")
    finally:
        journal.close()


@pytest.mark.parametrize(("interval", "ends"), INTERVALS)
def test_narrow_intervals_show_both_ends(interval, ends):
    graph = trace(Straight(), ([interval[0]], interval[0]), interval)
    assert f"alpha in [{ends}]," in str(graph)
    assert graph.multiplicity()[0].ends == f"[{ends}]"
