"""Events divide pieces, are where their functions vanish, and change nothing else."""

import numpy as np
import pytest
from circle import Circle
from paper_systems import CASES
from pwscont_coulomb.scenes import example1, example3, fig10, fig13

from pwscont import (
    BranchGraph,
    ExactLinear,
    InvalidInputError,
    Journal,
    NaturalParameter,
    PiecewiseSystem,
    PseudoArclength,
    Scene,
    Stop,
    Switched,
    TransitionDetector,
    explore,
    trace,
)
from pwscont.basics.outcome import Failure, FailureReason
from pwscont.curve.stepper import CurvedSegment
from pwscont.events import along as events_module
from pwscont.extending import Ray, Reading, SpecialPointFound, locate_sign_change
from pwscont.scenes.marks import markers_of

pytestmark = pytest.mark.sweep(2)  # the others take too long for the README's command


def along(system, interval, function):
    """Return all zeros of a function on the branches, by sign changes on a fine grid."""
    zeros = []
    for piece in explore(system, interval, stepper=fine(system)).pieces:
        x = piece.points
        if len(x) == 2:
            x = x[0] + np.linspace(0.0, 1.0, 2001)[:, np.newaxis] * (x[1] - x[0])
        g = np.array([function(point[:-1], point[-1]) for point in x])
        changes = np.flatnonzero(g[:-1] * g[1:] < 0.0)
        zeros += [x[i] + g[i] / (g[i] - g[i + 1]) * (x[i + 1] - x[i]) for i in changes]
    return zeros


def fine(system):
    from pwscont import PiecewiseLinearSystem, StepSize  # noqa: PLC0415

    straight = isinstance(system, PiecewiseLinearSystem)
    return ExactLinear() if straight else PseudoArclength(step_size=StepSize(largest=0.01))


@pytest.mark.slow
@pytest.mark.parametrize("system", [Switched(1, lambda z, t, sw: z - t), Circle()])
@pytest.mark.parametrize("place", [0.2, -0.31])
def test_a_pole_is_no_event(system, place):
    events = {
        "pole": lambda z, alpha: 1.0 / (z[0] - place - 1e-17),
        "zero beside": lambda z, alpha: (z[0] - place) / (z[0] - place - 0.02),
        "jump": lambda z, alpha: 1.0 if z[0] > place + 0.1 else -1.0,
    }
    found = explore(system, (-1.0, 1.0), events=events).special_points("event")
    assert {point.message for point in found} == {"zero beside", "jump"}
    away = {"zero beside": place, "jump": place + 0.1}
    assert all(abs(point.z[0] - away[point.message]) < 1e-9 for point in found)


SCENES = [CASES["fig7"], CASES["fig11"], example1(), fig10(), fig13(), example3()]


@pytest.mark.parametrize("scene", SCENES, ids=lambda scene: getattr(scene, "name", "scene"))
@pytest.mark.parametrize("seed", range(4))
@pytest.mark.sweep(20)
def test_every_zero_is_an_event_and_nothing_else_changes(scene, seed):
    system, rng = scene.system, np.random.default_rng(seed)
    plain = explore(system, scene.interval)
    scale, solutions = system.scale(*scene.interval), [p.z for p in plain.special_points()]
    row, through = rng.normal(size=system.size) / scale, np.mean(solutions, axis=0)
    bend = 0.3 * rng.normal()

    def g(z, alpha):
        level = float(row @ (z - through))
        return level + bend * level**2 - 0.05

    graph = explore(system, scene.interval, events={"level": g})
    events, zeros = graph.special_points("event"), along(system, scene.interval, g)
    assert len(events) == len(zeros)
    for point in events:
        assert abs(g(point.z, point.alpha)) < 1e-10
        assert min(np.abs((x[:-1] - point.z) / scale).max() for x in zeros) < 1e-3
        assert point.name == "level"
    for alpha in np.linspace(*scene.interval, 41)[1:-1]:
        assert graph.count(alpha) == plain.count(alpha)
        assert graph.balance(alpha) == plain.balance(alpha)
    assert graph.guarantee == plain.guarantee
    rows, same = graph.multiplicity(), plain.multiplicity()
    assert [row[2] for row in rows] == [row[2] for row in same]
    np.testing.assert_allclose([row[:2] for row in rows], [row[:2] for row in same], atol=1e-14)


STEPPERS = [PseudoArclength(), NaturalParameter()]


@pytest.mark.parametrize("stepper", STEPPERS, ids=lambda stepper: type(stepper).__name__)
def test_events_on_a_curve_are_found_to_rounding(stepper):
    interval = (-0.99, 0.99)
    graph = trace(
        Circle(), ([1.0], 0.0), interval, stepper=stepper, events={"up": lambda z, a: z - 0.8}
    )
    assert [point.alpha for point in graph.special_points("event")] == pytest.approx(
        [-0.6, 0.6], abs=1e-14
    )


def test_a_start_that_is_an_event():
    graph = trace(Circle(), ([1.0], 0.0), (-2.0, 2.0), events={"axis": lambda z, a: a})
    events = graph.special_points("event")
    assert sorted(point.z[0] for point in events) == pytest.approx([-1.0, 1.0])
    assert graph.guarantee == "balanced"
    assert graph.count(0.0) == 2


def test_a_stop_ends_the_branch_on_purpose():
    scene = CASES["fig7"]
    plain = explore(scene.system, scene.interval)
    fold = plain.special_points("nonsmooth fold")[0]
    graph = trace(
        scene.system,
        (plain.solutions(scene.interval[0])[0].z, scene.interval[0]),
        scene.interval,
        events={"enough": Stop(lambda z, a: a - (fold.alpha - 0.25))},
    )
    ends = [point for point in graph.special_points("event") if len(graph.pieces_at(point.id)) == 1]
    assert ends
    assert all(point.alpha == pytest.approx(fold.alpha - 0.25) for point in ends)
    assert "a branch ends on purpose" in graph.guarantee


def test_an_event_at_a_transition_is_the_transition():
    scene = CASES["fig7"]
    plain = explore(scene.system, scene.interval)
    place = plain.special_points("transition")[0].alpha
    graph = explore(scene.system, scene.interval, events={"there": lambda z, a: a - place})
    assert len(graph.pieces) - len(plain.pieces) == len(graph.special_points("event"))
    assert all(piece.interval[1] - piece.interval[0] > 1e-9 for piece in graph.pieces)


class Every(TransitionDetector):
    """Marks where z falls or rises through a level, with a kind of its own."""

    def __init__(self, level, kind="level"):
        self.level, self.kind = level, kind

    def read(self, curve, state):
        off, slope = state.x[0] - self.level, state.tangent[0]
        off = 0.0 if abs(off) < 1e-11 else off
        return Reading(np.array([off, -off]), np.array([slope, -slope]))

    def locate(self, segment, index, bracket):
        return locate_sign_change(segment, lambda state: state.x[0] - self.level, bracket)

    def arrive(self, curve, state, index):
        forth = Ray(curve, state)
        return SpecialPointFound(
            self.kind, state.x, f"level {self.level}", (forth.reversed(), forth)
        )


def test_a_detector_with_a_kind_of_its_own(tmp_path):
    graph = trace(Circle(), ([1.0], 0.0), (-2.0, 2.0), detectors=[Every(0.8), Every(-0.2)])
    points = graph.special_points("level")
    assert sorted(round(float(p.z[0]), 9) for p in points) == [-0.2, -0.2, 0.8, 0.8]
    assert graph.guarantee == "balanced"
    graph.save(tmp_path / "graph.npz")
    kept = BranchGraph.load(tmp_path / "graph.npz").special_points("level")
    assert [p.message for p in kept] == [p.message for p in points]


def test_kinds_of_one_s_own_are_told_apart_in_pictures():
    detectors = [Every(0.8, "high"), Every(-0.2, "low")]
    graph = trace(Circle(), ([1.0], 0.0), (-2.0, 2.0), detectors=detectors)
    looks = markers_of(graph)
    assert looks["high"]["marker"] != looks["low"]["marker"]
    assert (
        looks["transition"] == markers_of(trace(Circle(), ([1.0], 0.0), (-2.0, 2.0)))["transition"]
    )


def test_events_survive_a_journal(tmp_path):
    scene, events = CASES["fig7"], {"half": lambda z, a: a - 0.3}
    journal = Journal(tmp_path / "run.journal")
    first = explore(scene.system, scene.interval, events=events, journal=journal)
    journal.close()
    again = Journal(tmp_path / "run.journal")
    second = explore(scene.system, scene.interval, events=events, journal=again)
    assert [p.name for p in second.special_points()] == [p.name for p in first.special_points()]
    again.close()
    other = Journal(tmp_path / "run.journal")
    with pytest.raises(InvalidInputError, match="events: half when it was begun, none now"):
        explore(scene.system, scene.interval, journal=other)
    other.close()


@pytest.mark.parametrize(
    ("events", "match"),
    [
        ({"bad": 3.0}, "'bad': 3.0"),
        ({"": lambda z, a: 1.0}, "name: function"),
        ([lambda z, a: 1.0], "mapping"),
        ({"nan": lambda z, a: np.nan}, "the event 'nan' must return a finite float"),
        ({"two": lambda z, a: np.ones(2)}, "the event 'two' must return a finite float"),
    ],
)
def test_events_that_are_none_are_refused(events, match):
    with pytest.raises(InvalidInputError, match=match):
        trace(Circle(), ([1.0], 0.0), (-2.0, 2.0), events=events)


def test_a_detector_that_is_none_is_refused():
    with pytest.raises(InvalidInputError, match="call it to make one"):
        trace(Circle(), ([1.0], 0.0), (-2.0, 2.0), detectors=[Every])


def test_a_stop_at_a_fold_ends_the_branch_as_well():
    graph = trace(Circle(), ([1.0], 0.0), (-2.0, 2.0), events={"end": Stop(lambda z, a: z)})
    ends = graph.special_points("event")
    assert sorted(point.alpha for point in ends) == pytest.approx([-1.0, 1.0])
    assert graph.count(0.0) == 1
    assert "a branch ends on purpose" in graph.guarantee


def test_recorded_quantities_are_at_hand_by_name():
    graph = explore(
        Circle(),
        (-0.9, 0.9),
        starts=[([1.0], 0.0)],
        record={"angle": lambda z, a: np.arctan2(z[0], a)},
    )
    for solution in graph.solutions(0.3):
        assert solution["angle"] == pytest.approx(np.arctan2(solution.z[0], 0.3))
    for point in graph.special_points():
        assert point["angle"] == pytest.approx(np.arctan2(point.z[0], point.alpha))


def test_a_scene_carries_events_and_records():
    scene = Scene(
        name="circle",
        title="a circle",
        system=Circle(),
        interval=(-0.9, 0.9),
        events={"up": lambda z, a: z - 0.8},
        record={"square": lambda z, a: float(z[0] ** 2)},
    )
    graph = scene.run()
    assert {point.name for point in graph.special_points("event")} == {"up"}
    assert graph.solutions(0.5)[0]["square"] == pytest.approx(0.75)


class Arch(PiecewiseSystem):
    """z (z - 1) (z - 2) = alpha, with a stop at z = 1: a fold, and a non-smooth fold."""

    size = 1

    def test_functions(self, z, alpha):
        return z - 1.0

    def residual(self, z, alpha, character):
        return z * (z - 1.0) * (z - 2.0) + 5.0 * (z - 1.0) * character.signs[0] - alpha


@pytest.mark.slow
@pytest.mark.parametrize("at", [-0.1, 0.0, 0.5])
@pytest.mark.sweep(4)
def test_two_zeros_close_to_each_other_and_a_flat_one(at):
    close = {"close": lambda z, a: (z - at) ** 2 - 1e-12, "flat": lambda z, a: (z[0] - at) ** 3}
    graph = explore(Arch(), (-0.5, 1.0), events=close)
    found = sorted(point.z[0] - at for point in graph.special_points("event"))
    assert found == pytest.approx([-1e-6, 0.0, 1e-6], abs=1e-11)


FOLD = 1.0 - 3.0**-0.5


@pytest.mark.parametrize("at", [FOLD, 1.0])
@pytest.mark.parametrize("edge", [np.maximum, np.minimum])
@pytest.mark.sweep(4)
def test_the_edge_of_a_stretch_of_zeros_at_a_special_point_changes_nothing(at, edge):
    graph = explore(Arch(), (-0.5, 1.0), events={"edge": lambda z, a: edge(z[0] - at, 0.0)})
    (named,) = (point for point in graph.special_points() if point.name == "edge")
    assert named.z[0] == pytest.approx(at, abs=1e-10)
    kinds = [str(point.kind) for point in graph.special_points()]
    assert sorted(kinds) == ["end", "fold", "nonsmooth fold", "start"]
    assert [count for _, _, count in graph.multiplicity()] == [1, 3, 1]
    assert graph.guarantee == "balanced"


class Smooth(PiecewiseSystem):
    """z + 0.3 sin z = alpha, or a cubic with two folds."""

    size = 1

    def __init__(self, cubic):
        self.cubic = cubic

    def alpha(self, z):
        return z**3 - z if self.cubic else z + 0.3 * np.sin(z)

    def test_functions(self, z, alpha):
        return z + 50.0

    def residual(self, z, alpha, character):
        return self.alpha(z) - alpha


@pytest.mark.parametrize("cubic", [False, True])
@pytest.mark.parametrize("seed", range(4))
@pytest.mark.sweep(8)
def test_pairs_and_triples_of_events_within_a_step_change_nothing(cubic, seed):
    """One function with all zeros, or one for each; near and far, beside folds and ends."""
    system, rng = Smooth(cubic), np.random.default_rng(seed)
    at = rng.choice([-(3.0**-0.5), 3.0**-0.5, *rng.uniform(-1.2, 1.2, 2)])
    zeros = at + rng.uniform(0.1, 1.0) * 10.0 ** rng.uniform(-5, -1.5) * np.array([0.3, 1.1, 2.4])
    together = {"e": lambda z, a: float(np.prod(z[0] - zeros[: 2 + seed % 2]))}
    apart = {f"e{i}": lambda z, a, c=c: float(z[0] - c) for i, c in enumerate(zeros)}
    plain = trace(system, ([0.1], system.alpha(0.1)), (-1.3, 1.3))
    for events, count in ((together, 2 + seed % 2), (apart, 3)):
        graph = trace(system, ([0.1], system.alpha(0.1)), (-1.3, 1.3), events=events)
        found = sorted(point.z[0] for point in graph.special_points("event"))
        assert found == pytest.approx(zeros[:count], abs=1e-9)
        others = [p for p in graph.special_points() if p.kind not in ("event", "start")]
        same = [p for p in plain.special_points() if p.kind != "start"]
        assert [(p.kind, p.alpha) for p in others] == [(p.kind, p.alpha) for p in same]
        assert graph.multiplicity() == plain.multiplicity()
        assert graph.guarantee == plain.guarantee


@pytest.mark.parametrize("level", [3.0**-0.5, 0.0])
def test_a_detector_that_meets_a_fold_keeps_its_word(level):
    graph = trace(Smooth(True), ([1.1], 1.1**3 - 1.1), (-1.3, 1.3), detectors=[Every(level)])
    named = {str(p.kind): p.name for p in graph.special_points() if abs(p.z[0] - level) < 1e-9}
    assert named == ({"fold": "level"} if level else {"level": ""})


class Eight(Smooth):
    """A figure eight, whose two curves cross at zero."""

    def residual(self, z, alpha, character):
        return z**2 - alpha**2 * (1.0 - alpha**2)


@pytest.mark.parametrize("level", [-1e-4, 0.003, 0.02, 0.1])
@pytest.mark.sweep(4)
def test_events_beside_a_branch_point(level):
    start, plain = ([0.48], 0.8), (-1.5, 1.5)
    graph = trace(Eight(False), start, plain, events={"e": lambda z, a: float(z[0] - level)})
    below = 0.5 - (0.25 - level**2) ** 0.5
    expected = sorted([-((1.0 - below) ** 0.5), -(below**0.5), below**0.5, (1.0 - below) ** 0.5])
    found = sorted(point.alpha for point in graph.special_points("event"))
    assert found == pytest.approx(expected, abs=1e-9)
    assert all(len(piece.points) > 2 for piece in graph.pieces)


def test_an_event_that_cannot_be_located_is_kept_with_its_error(monkeypatch):
    """No corrected point is to be had, but the cubic shows that g changes its sign."""
    system = Switched(1, lambda z, alpha, sw: z + 0.3 * np.sin(z) - alpha)
    fails = Failure(FailureReason.NOT_CONVERGED)
    monkeypatch.setattr(events_module, "locate_sign_change", lambda *_: fails)
    monkeypatch.setattr(CurvedSegment, "at", lambda *_: fails)
    graph = trace(system, ([0.0], 0.0), (-2.0, 2.0), events={"g": lambda z, alpha: z[0] - 1.0})
    (event,) = graph.special_points("event")
    assert event.name == "g"
    assert abs(event.alpha - (1.0 + 0.3 * np.sin(1.0))) <= event.error[-1] < 0.1


# -- clusters of zeros -----------------------------------------------------------------------------

SINE = Switched(1, lambda z, t, sw: [0.3 * np.sin(3.0 * t) + t - z[0] - 0.1 * z[0] ** 3])
LINE = Switched(1, lambda z, t, sw: [z[0] - t], linear=True)
KINK = Switched(1, lambda z, t, sw: [z[0] - t + sw.relu(t - 0.3)], linear=True)
#: Curves with seeds of clusters. The first zeros are seen by comparing g with a single zero, the
#: next ones on graded places around the least value, the last ones at the lowest places.
CLUSTERS = [
    *((LINE, seed) for seed in (40, 41, 4, 64, 10, 93, 0, 7)),
    *((SINE, seed) for seed in (7, 10, 14, 36, 5, 15, 41, 67)),
    *((KINK, seed) for seed in (4, 15, 67, 1)),
]


def clusters(rng):
    """Return up to nine zeros in (0, 1), in clusters as narrow as 1e-6."""
    zeros = []
    for _ in range(rng.integers(1, 4)):
        number, width = rng.integers(1, 4), 10.0 ** -rng.uniform(0.5, 6)
        zeros += list(rng.uniform(0.05, 0.95) + width * rng.uniform(-1, 1, number))
    return np.sort([zero for zero in zeros if 0.001 < zero < 0.999])


@pytest.mark.parametrize(("system", "seed"), CLUSTERS)
@pytest.mark.sweep(6)
def test_all_zeros_in_clusters_are_found(system, seed):
    """A polynomial, its saturation, or the polynomial times a factor that grows by 150."""
    zeros = clusters(np.random.default_rng(seed))

    def g(z, t):
        product = np.prod(t - zeros)
        shapes = product, np.tanh(50.0 * product), product * np.exp(5.0 * t)
        return float(shapes[seed % 3])

    graph = trace(system, ([0.0], 0.0), (0.0, 1.0), events={"g": g})
    found = sorted(point.alpha for point in graph.special_points() if point.name == "g")
    assert found == pytest.approx(zeros, rel=0.0, abs=1e-9)
