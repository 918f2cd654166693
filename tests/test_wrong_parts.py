"""Parts of a run that do not fit are refused in words, before any work; or done right."""

import numpy as np
import pytest
from wrong_parts import Bent, Lines, Straight, through

from pwscont import (
    BorderedNewton,
    EndPoints,
    InvalidInputError,
    MultiStart,
    NaturalParameter,
    PseudoArclength,
    Search,
    Slices,
    Stepper,
    StepSize,
    Stop,
    Switched,
    Tangent,
    TransitionDetector,
    check_stepper,
    explore,
    trace,
)
from pwscont.extending import (
    Corrector,
    Failure,
    FailureReason,
    Guarantee,
    Predictor,
    Ray,
    Reading,
    Reducible,
    SearchScope,
    SpecialPointFound,
    locate_sign_change,
)

pytestmark = pytest.mark.sweep(3)  # the others take too long for the README's command


# -- events --------------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("start", [0.0, 1.0, 2.0])
@pytest.mark.parametrize("stepper", [None, PseudoArclength(), NaturalParameter()], ids=repr)
@pytest.mark.parametrize("system", [Bent(), Straight()], ids=repr)
@pytest.mark.sweep(30)
def test_edges_of_stretches_without_sign_are_events(system, stepper, start):
    """A stretch of zeros between z = 0.3 and z = 0.5 is entered and left at either edge."""
    events = {
        "from": lambda z, a: max(0.0, z[0] - 0.5),
        "down": lambda z, a: min(0.0, 0.5 - z[0]),
        "both": lambda z, a: max(0.0, z[0] - 0.5) + min(0.0, z[0] - 0.3),
    }
    for name, function in events.items():
        graph = through(system, {name: function}, start, stepper=stepper)
        expected = [system.third, system.half] if name == "both" else [system.half]
        found = [point.alpha for point in graph.special_points("event")]
        assert found == pytest.approx(expected, abs=1e-13)
        assert graph.guarantee == through(system, {}, start, stepper=stepper).guarantee


@pytest.mark.slow
def test_a_stop_ends_at_the_edge_of_a_stretch():
    graph = through(Bent(), {"end": Stop(lambda z, a: max(0.0, 0.5 - z[0]))}, 2.0)
    (end,) = graph.special_points("event")
    assert end.alpha == pytest.approx(Bent.half)
    assert len(graph.pieces) == 1


def test_events_at_one_point_are_all_named():
    events = {"a": lambda z, a: z[0] - 0.5, "b": lambda z, a: 1.0 - 2.0 * z[0]}
    for system in (Bent(), Straight()):
        (point,) = through(system, events).special_points("event")
        assert point.name == "a, b"
    ends = {**events, "b": Stop(events["b"])}
    assert len(through(Straight(), ends).pieces) == 1


@pytest.mark.parametrize(
    ("what", "words"),
    [
        (lambda z, a: z[0] > 0.5, "'a' must return a finite float.*False.*a condition"),
        (lambda z, a: z[0] < a * 0.0 + 0.5, "a condition such as"),
        (lambda z, a: bool(z[0] > 0.5), "a condition such as"),
        (lambda z, a: "text", "the event 'a' must return a finite float, at alpha = 1 .*z = "),
        (lambda z: 1.0, "the event 'a' failed at alpha = 1: TypeError.*z = "),
        (lambda z, a, b: 1.0, "the event 'a' failed at alpha = 1: TypeError.*z = "),
        (lambda z, a: 1 / 0, "the event 'a' failed at alpha = 1: ZeroDivisionError.*z = "),
        (Stop, r"'a' is the class Stop: give Stop\(g\)"),
        (lambda z, a: 0.0, "the event 'a' is zero at the start, alpha = 1, and wherever"),
        (Stop(lambda z, a: 0.0 * z), "the event 'a' is zero at the start, alpha = 1, and wherever"),
    ],
)
def test_events_that_do_not_fit(what, words):
    with pytest.raises(InvalidInputError, match=words):
        through(Bent(), {"a": what})


def test_records_and_events_are_checked_alike():
    graph = through(Bent(), {}, record={"bad": lambda z: 1.0, "cond": lambda z, a: z[0] > 0.5})
    with pytest.raises(
        InvalidInputError, match=r"record 'bad' failed at alpha = .*TypeError.*z = "
    ):
        graph.special_points()[0]["bad"]
    with pytest.raises(InvalidInputError, match=r"record 'cond' must return a finite float.*cond"):
        graph.special_points()[0]["cond"]


def test_plain_data_name_events_and_parameter():
    data = through(Bent(), {"half": lambda z, a: z[0] - 0.5}, parameter="load").to_dict()
    assert data["parameter"] == {"name": "load", "lo": 0.0, "hi": 2.0}
    assert [node["name"] for node in data["nodes"] if node["kind"] == "event"] == ["half"]


def test_kinds_that_are_nearly_known():
    graph = through(Bent(), {})
    assert graph.special_points("half") == []
    with pytest.raises(InvalidInputError, match=r"unknown kind 'transitoin'; did you mean trans"):
        graph.special_points("transitoin")


# -- searches ------------------------------------------------------------------------------------


class Own(Search):
    """Yields what it is given."""

    def __init__(self, *found, says=None, nothing=False):
        self.found, self.says, self.nothing = found, says, nothing

    def starts(self, system, metric, interval):
        return None if self.nothing else iter(self.found)

    def searched(self, system):
        return self.says or SearchScope("nothing", Guarantee.NOTHING)


SOME = np.zeros((1, 2))


@pytest.mark.parametrize(
    ("search", "words"),
    [
        (Own(says="everything"), r"Own.searched must return a SearchScope.*'everything'"),
        (Own(nothing=True), r"Own.starts must yield pairs \(x, error\), got None"),
        (Own(Failure(FailureReason.JUMP)), r"Own.starts must yield pairs.*got Failure"),
        (Own((np.zeros(1), 0.5)), r"Own.starts yields a pair \(z, alpha\), \(array.*, 0.5\): want"),
        (Own([0.25, 0.5]), r"yields a pair \(z, alpha\), \[0.25, 0.5\]: .*np.append\(z, alpha\)"),
        (Own((np.zeros(1), np.ones(1))), r"got shapes \(1,\) and \(1,\)"),
        (Own(np.zeros(2)), r"Own.starts yields x, array.*: .* pairs \(x, error\)"),
        (Own((np.zeros(3), SOME)), r"Own.starts .*got shapes \(3,\)"),
        (Own((np.zeros(2), SOME[:0])), r"of shape \(k, 2\), k > 0, got shapes \(2,\) and \(0, 2\)"),
        (Own((np.zeros(2), [[0.0, 0.0], [0.0]])), r"Own.starts yields an error that is no array"),
        (Own((np.zeros(2), ["a", "b"])), r"Own.starts yields an error that is no array of numbers"),
        (Own((np.zeros(2), [SOME])), r"Own.starts .*got shapes \(2,\) and \(1, 1, 2\)"),
        (Own((np.array([np.nan, 0.5]), SOME)), r"x of Own.starts must be finite"),
        (Own((np.array([0.1, 2.5]), SOME)), r"Own.starts .* alpha = 2.5, outside the interval"),
        (Own((np.array([0.1, 0.5]), SOME * np.nan)), r"Own.starts yields an error that is nan, at"),
    ],
)
def test_searches_that_do_not_fit(search, words):
    for each in (search, search + EndPoints()):
        with pytest.raises(InvalidInputError, match=words):
            explore(Bent(), (0.0, 2.0), search=each)


def test_starts_beside_a_curve_are_not_followed_and_counted():
    """z^2 = alpha: two curves; one start is a solution."""
    curve = Switched(1, lambda z, t, sw: z**2 - t)
    found = [(np.array([z, 0.25]), SOME) for z in (0.5, -0.501)]
    graph = explore(
        curve, (0.1, 1.0), search=Own(*found, says=SearchScope("own", Guarantee.EVERYTHING))
    )
    assert (graph.count(0.5), len(graph.pieces)) == (1, 1)
    assert graph.searched.what.endswith(
        "1 of the points found not followed, for H does not vanish there"
    )
    assert not graph.guarantee.startswith("complete")


@pytest.mark.parametrize("system", [Straight(), Lines()], ids=repr)
def test_starts_beside_a_straight_curve_are_refused(system):
    """The curve is a line, and from a start off it one would run beside it."""
    solution = trace(system, ([0.5], 0.5), (0.0, 2.0)).solutions(0.5)[0].z
    x = np.append(solution, 0.5)
    assert explore(system, (0.0, 2.0), search=Own((x, SOME))).count(1.0) == 1
    for off, error in [(1e-3, 1e-5), (5.0, 0.1)]:
        given = Own((x + np.array([off, 0.0]), np.full((1, 2), error)))
        with pytest.raises(InvalidInputError, match=r"Own.starts yields a point off the curve, at"):
            explore(system, (0.0, 2.0), search=given)


def test_searches_that_cannot_be_made():
    with pytest.raises(InvalidInputError, match=r"EndPoints \+ 3: searches add up with searches"):
        EndPoints() + 3
    with pytest.raises(InvalidInputError, match=r"searches add up.*call it to make one"):
        EndPoints() + MultiStart
    with pytest.raises(InvalidInputError, match=r"as in Slices\(\(0.7,\)\), got 0.7"):
        Slices(0.7)
    with pytest.raises(InvalidInputError, match=r"one value of alpha or several, .* got \[\]"):
        Slices([])


# -- steps ---------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "lengths",
    [
        {"largest": -0.1},
        {"largest": 0.0},
        {"largest": np.nan},
        {"first": 0.5, "largest": 0.2},
        {"first": 0.0},
        {"smallest": 0.05},
        {"least_cosine": 2.0},
        {"largest": "long"},
    ],
)
def test_steps_of_no_length(lengths):
    with pytest.raises(InvalidInputError, match="StepSize"):
        StepSize(**lengths)


def test_the_first_step_is_no_longer_than_the_longest():
    assert StepSize(largest=0.01).first == 0.01
    assert StepSize(largest=0.5).first == StepSize().first


def test_parts_of_steppers():
    with pytest.raises(InvalidInputError, match=r"predictor of Pseudo.*call it to make one"):
        PseudoArclength(Tangent)
    with pytest.raises(InvalidInputError, match="must be a Predictor, got BorderedNewton"):
        PseudoArclength(BorderedNewton(), Tangent())
    with pytest.raises(InvalidInputError, match="corrector of PseudoArclength must be a Corrector"):
        PseudoArclength(Tangent(), StepSize())
    with pytest.raises(InvalidInputError, match="step_size of NaturalParameter must be a StepSize"):
        NaturalParameter(0.1)


class Wordless(Predictor, Corrector):
    """Returns something else than a predictor and a corrector must."""

    def __init__(self, result):
        self.result = result

    def predict(self, curve, previous, state, length):
        return self.result

    def correct(self, curve, predicted, tangent):
        return self.result


@pytest.mark.parametrize("result", [None, 1.0, "x", (), (np.zeros(2), np.zeros(3))])
def test_what_predictors_and_correctors_must_return(result):
    part = Wordless(result)
    with pytest.raises(InvalidInputError, match=r"Wordless.predict\(\) must return a point and a"):
        explore(Bent(), (0.0, 1.0), stepper=PseudoArclength(part))
    with pytest.raises(InvalidInputError, match=r"Wordless.correct\(\) must return a Corrected or"):
        explore(Bent(), (0.0, 1.0), stepper=PseudoArclength(Tangent(), part))


class Judged:
    """A proof that says something."""

    def __init__(self, words):
        self.words = words

    def judged(self, graph, words):
        return self.words


class Claims(Search):
    """A search that proves something anew in every run."""

    def __init__(self, thing):
        self.answers = iter([None, thing])

    def starts(self, system, metric, interval):
        return iter(())

    def proved(self, system, interval):
        return next(self.answers)


@pytest.mark.parametrize("thing", [1, "proved", False, [], np.zeros(2), Judged])
def test_what_a_search_proves_must_be_a_proof(thing):
    with pytest.raises(InvalidInputError, match=r"proved must return None, or an object with judg"):
        explore(Bent(), (0.0, 1.0), search=EndPoints() + Claims(thing))


def test_a_proof_must_say_words():
    graph = explore(Bent(), (0.0, 1.0), search=EndPoints())
    graph.proof = Judged("complete in the box, proved")
    assert "complete in the box, proved" in str(graph)
    for said in (None, 3, True):
        graph = explore(Bent(), (0.0, 1.0), search=EndPoints())
        graph.proof = Judged(said)
        with pytest.raises(InvalidInputError, match=r"Judged.judged must return words, got"):
            str(graph)


class Repeating(Stepper):
    """A stepper that returns its first step again and again."""

    def __init__(self):
        self.first = None

    def step(self, *arguments):
        self.first = self.first or PseudoArclength().step(*arguments)
        return self.first


def test_a_stepper_that_repeats_a_step_is_refused():
    with pytest.raises(InvalidInputError, match="a segment that begins at the state given"):
        trace(Bent(), ([0.0], 0.0), (-1.0, 1.0), stepper=Repeating())
    assert "does not begin at the state" in str(check_stepper(Repeating()))


@pytest.mark.parametrize("away", [np.nan, np.inf])
def test_a_detector_whose_special_point_is_no_number_is_refused(away):
    class Level(TransitionDetector):
        def read(self, curve, state):
            return Reading(np.array([0.5 - state.alpha]), -state.tangent[-1:])

        def locate(self, segment, index, bracket):
            return locate_sign_change(segment, lambda state: 0.5 - state.alpha, bracket)

        def arrive(self, curve, state, index):
            rays = Ray(curve, state).reversed(), Ray(curve, state)
            return SpecialPointFound("level", away * np.ones(2), "here", rays)

    with pytest.raises(InvalidInputError, match=r"at 2 finite numbers \(z, alpha\)"):
        trace(Bent(), ([0.0], 0.0), (-1.0, 1.0), detectors=[Level()])


def test_what_a_detector_says_of_a_step_must_be_a_failure():
    class Doubtful(TransitionDetector):
        def read(self, curve, state):
            return Reading(np.ones(1), np.zeros(1))

        def locate(self, segment, index, bracket):
            raise NotImplementedError

        def arrive(self, curve, state, index):
            raise NotImplementedError

        def needs_shorter_step(self, segment, start, end):
            return "too long"

    with pytest.raises(InvalidInputError, match="needs_shorter_step must return a Failure or None"):
        trace(Bent(), ([0.0], 0.0), (-1.0, 1.0), detectors=[Doubtful()])


def test_what_a_reduction_must_be():
    class Reduced(Straight, Reducible):
        def reduction(self, lo, hi):
            return lo, hi

    with pytest.raises(
        InvalidInputError, match=r"Reduced.reduction\(\) returns must be a Reduction"
    ):
        explore(Reduced(), (0.0, 1.0))
