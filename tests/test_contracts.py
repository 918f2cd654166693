"""The kit for implementers: our own parts keep the contracts, and broken ones do not."""

import re

import numpy as np
import pytest
from readings import At

from pwscont import (
    LCP,
    EndPoints,
    InvalidInputError,
    MoorePenrose,
    MultiStart,
    NaturalParameter,
    PiecewiseLinearSystem,
    PiecewiseSystem,
    PseudoArclength,
    Search,
    Secant,
    Slices,
    Stepper,
    StepSize,
    Tangent,
    TransitionDetector,
    UnknownNameError,
    check_detector,
    check_search,
    check_stepper,
    explore,
    trace,
)
from pwscont.extending import (
    CurvedSegment,
    Failure,
    FailureReason,
    Ray,
    Reading,
    SpecialPointFound,
    State,
    locate_sign_change,
)
from pwscont.transitions import BoundingTests, IntervalEnds, SmoothFolds

STEPPERS = [
    PseudoArclength(),
    PseudoArclength(predictor=Tangent()),
    PseudoArclength(predictor=Secant()),
    PseudoArclength(corrector=MoorePenrose()),
    PseudoArclength(step_size=StepSize(largest=0.03)),
    NaturalParameter(),
]
DETECTORS = [
    BoundingTests(),
    IntervalEnds(-5.0, 5.0),
    SmoothFolds(),
]
SEARCHES = [EndPoints(), Slices((0.1, 0.3)), MultiStart(), EndPoints() + MultiStart()]


@pytest.mark.parametrize("stepper", STEPPERS, ids=repr)
@pytest.mark.sweep(2)
def test_our_steppers(stepper):
    assert check_stepper(stepper), check_stepper(stepper)


@pytest.mark.parametrize("detector", DETECTORS, ids=lambda part: type(part).__name__)
def test_our_detectors(detector):
    assert check_detector(detector), check_detector(detector)


@pytest.mark.parametrize("search", SEARCHES, ids=repr)
def test_our_searches(search):
    assert check_search(search), check_search(search)


class Wrong(Stepper):
    """Returns what a function makes of the true step."""

    def __init__(self, change):
        self.change = change

    def step(self, curve, interval, state, before, longest):
        true = PseudoArclength().step(curve, interval, state, before, longest)
        return true if isinstance(true, Failure) else self.change(true)


def moved(segment):
    end = segment.end
    off = State(end.x + 1e-4, end.tangent, end.error, end.orientation)
    return CurvedSegment.between(segment.curve, segment.start, off, segment.suggestion)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda segment: None, "must return a Segment or a Failure"),
        (lambda segment: Failure(FailureReason.NO_TURN), "before the end of the interval"),
        (moved, "off the curve|leaves the interval"),
    ],
)
def test_broken_steppers(change, words):
    report = check_stepper(Wrong(change))
    assert not report
    assert re.search(words, str(report))


class WrongAim(Stepper):
    """Returns what a function makes of the true step to a zero."""

    def __init__(self, change):
        self.change = change

    def step(self, *given):
        return PseudoArclength().step(*given)

    def aim(self, *given):
        true = PseudoArclength().aim(*given)
        return true and self.change(true)


def further(segment):
    """Return a true step that is longer."""
    state, interval = segment.start, (-np.inf, np.inf)
    return PseudoArclength().step(segment.curve, interval, state, None, np.inf)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda segment: 3, "must return a CurvedSegment or None"),
        (moved, "off the curve"),
        (further, "does not vanish at the end"),
    ],
)
def test_broken_aims(change, words):
    report = check_stepper(WrongAim(change))
    assert not report
    assert re.search(words, str(report))


def test_a_stepper_that_aims_at_something_else_is_named():
    words = "WrongAim.aim must return a CurvedSegment or None, got 3"
    with pytest.raises(InvalidInputError, match=words):
        trace(Sphere(), ([1.0], 0.0), (-2.0, 2.0), stepper=WrongAim(lambda segment: 3))


class Broken(TransitionDetector):
    def __init__(self, reading, arrival=None):
        self.reading, self.arrival = reading, arrival

    def read(self, curve, state):
        return self.reading(state)

    def locate(self, segment, index, bracket):
        return segment.start

    def arrive(self, curve, state, index):
        forth = Ray(curve, state)
        return self.arrival or SpecialPointFound("own", state.x, "", (forth, forth.reversed()))


@pytest.mark.parametrize(
    ("reading", "words"),
    [
        (lambda state: 1.0, "must return a Reading"),
        (lambda state: Reading(np.ones(2), np.zeros(1)), "vectors alike"),
        (lambda state: Reading(np.array([np.nan]), np.zeros(1)), "finite"),
        (lambda state: Reading(state.x[:1] + 3.0, np.array([5.0])), "slopes do not match"),
        (lambda state: Reading(np.ones(1), np.zeros(1)), "does not point back"),
    ],
)
def test_broken_detectors(reading, words):
    report = check_detector(Broken(reading))
    assert not report
    assert words in str(report)


class Yields(Search):
    def __init__(self, *starts):
        self.given = starts

    def starts(self, system, metric, interval):
        yield from self.given


@pytest.mark.parametrize(
    ("start", "words"),
    [
        ((np.zeros(7), np.zeros(7)), "shapes"),
        ((np.array([0.0, 9.0]), np.zeros(2)), "outside the interval"),
        ((np.array([0.3, 0.1]), np.zeros(2)), "off the curve"),
    ],
)
def test_broken_searches(start, words):
    report = check_search(Yields(start))
    assert not report
    assert words in str(report)


class Passing(TransitionDetector):
    """Marks where z passes a place, and leaves the rounding in what it reads."""

    def __init__(self, place):
        self.place = place

    def read(self, curve, state):
        return Reading(np.array([state.x[0] - self.place, self.place - state.x[0]]), np.zeros(2))

    def locate(self, segment, index, bracket):
        return locate_sign_change(segment, lambda state: state.x[0] - self.place, bracket)

    def arrive(self, curve, state, index):
        forth = Ray(curve, state)
        return SpecialPointFound("passed", state.x, "", (forth.reversed(), forth))


class Bent(PiecewiseSystem):
    """z + z^3 / 7 = alpha: one solution at every alpha."""

    size = 1

    def test_functions(self, z, alpha):
        return z - 9.0

    def residual(self, z, alpha, character):
        return z + z**3 / 7.0 - alpha


@pytest.mark.slow
def test_rounding_at_its_own_special_point_ends_no_branch():
    for place in np.linspace(-0.9, 0.9, 25):
        graph = trace(Bent(), ([0.01], 0.01), (-2.0, 2.0), detectors=[Passing(place)])
        (point,) = graph.special_points("passed")
        assert point.alpha == pytest.approx(place + place**3 / 7.0, abs=1e-11)
        assert [row[2] for row in graph.multiplicity()] == [1]


def test_a_start_that_is_no_solution_says_so_once():
    class Beside(Search):
        def starts(self, system, metric, interval):
            yield np.array([1.5, 0.0]), np.zeros(2)

    graph = explore(Bent(), (-2.0, 2.0), search=Beside())
    assert not graph.special_points()
    assert str(graph).count("H does not vanish there") == 1
    with pytest.raises(KeyError, match=r"there is no special point 99"):
        explore(Bent(), (-2.0, 2.0)).point(99)


WRONG = ([0.2], np.array([0.2, 0.3]), {}, None, "zero")


@pytest.mark.parametrize("wrong", WRONG, ids=repr)
@pytest.mark.sweep(2)
def test_arguments_of_another_kind_are_refused_in_words(wrong):
    graph = explore(Bent(), (-2.0, 2.0))
    for ask in (graph.point, graph.solution_at, graph.pieces_at):
        with pytest.raises(UnknownNameError, match="there is no special point"):
            ask(wrong)
    with pytest.raises(InvalidInputError, match="count must be a number, got"):
        graph.with_count(wrong)
    if not isinstance(wrong, str | None):
        with pytest.raises(InvalidInputError, match=r"unknown kind .*; kinds are start, end"):
            graph.special_points(wrong)


@pytest.mark.parametrize("wrong", [0, -1, 1.0, None, True, slice(0, 1), (0,), ["z[0]"]], ids=repr)
@pytest.mark.sweep(4)
def test_a_state_is_asked_by_name(wrong):
    graph = explore(Bent(), (-2.0, 2.0))
    for state in (graph.solutions(0.5)[0], graph.special_points()[0]):
        with pytest.raises(UnknownNameError, match=r"there is no .*; names are z\[0\]"):
            state[wrong]


@pytest.mark.parametrize("error", [[0.0, 0.0], [[0.0, 0.0]], np.zeros(2), np.zeros((3, 2))])
def test_a_search_may_give_errors_as_lists(error):
    class Known(Search):
        def starts(self, system, metric, interval):
            yield np.array([0.0, 0.0]), error

    graph = explore(Bent(), (-2.0, 2.0), search=Known())
    (solution,) = graph.solutions(1.0)
    assert solution.z[0] + solution.z[0] ** 3 / 7.0 == pytest.approx(1.0, abs=1e-14)


def test_a_search_that_yields_nothing_to_look_at():
    class Nothing(Search):
        def starts(self, system, metric, interval):
            return None

    assert "must yield pairs (x, error), got None" in str(check_search(Nothing()))


def test_classes_instead_of_objects_are_refused():
    for check, part in [(check_stepper, PseudoArclength), (check_search, MultiStart)]:
        with pytest.raises(InvalidInputError, match="call it to make one"):
            check(part)


class Kink(PiecewiseLinearSystem):
    """z + max(z, 0) = alpha."""

    size = 1

    def test_functions(self, z, alpha):
        return z

    def residual(self, z, alpha, character):
        return z + (z if character.signs[0] else 0.0) - alpha


class AimedAt(At):
    """The same with a gradient, so that steps may end there."""

    gradient = 1.0

    def border(self, curve, index):
        sign, row = 1.0 - 2.0 * index, np.zeros(curve.selection.system.size + 1)
        row[0] = sign * self.gradient
        return lambda x: (sign * (x[0] + 0.5), row)


class Sphere(PiecewiseSystem):
    """z^2 + alpha^2 = 1, with a seam at z = 0.3 at which nothing changes."""

    size = 1

    def test_functions(self, z, alpha):
        return z - 0.3

    def residual(self, z, alpha, character):
        return z**2 + alpha**2 - 1.0


@pytest.mark.parametrize("kind", [At, AimedAt])
def test_a_detector_on_a_circle(kind):
    """With a gradient its points are the ends of steps; they are the same."""
    assert check_detector(kind()), check_detector(kind())
    graph = trace(Sphere(), ([1.0], 0.0), (-2.0, 2.0), detectors=[kind()])
    found = sorted(point.alpha for point in graph.special_points("at"))
    np.testing.assert_allclose(found, [-(0.75**0.5), 0.75**0.5], rtol=1e-11)
    kinks = sorted(point.alpha for point in graph.special_points("transition"))
    np.testing.assert_allclose(kinks, [-(0.91**0.5), 0.91**0.5], rtol=1e-14)


def test_a_border_that_is_not_the_function_that_is_read():
    class Steeper(AimedAt):
        gradient = 2.0

    assert "border(..., 0): the gradient gives the slope" in str(check_detector(Steeper()))


@pytest.mark.parametrize("slopes", [1.0, 0.0])
def test_a_detector_on_straight_pieces(slopes):
    """With slopes by the ratio test, without them by reading; beyond its point it stays silent."""
    assert check_detector(At(slopes=slopes))
    graph = explore(Kink(), (-2.0, 2.0), detectors=[At(slopes=slopes)])
    found = {str(point.kind): point.alpha for point in graph.special_points()}
    assert found == pytest.approx({"start": -2.0, "at": -0.5, "transition": 0.0, "end": 2.0})
    assert graph.guarantee == "complete"
    assert graph.count(1.0) == 1


@pytest.mark.parametrize(
    ("locate", "words"),
    [
        (lambda *_: None, "must return a State or a Failure"),
        (lambda segment, *_: segment.start, "not zero"),
    ],
)
def test_points_that_are_located_wrongly(locate, words):
    assert words in str(check_detector(At(locate)))


class Below(TransitionDetector):
    """Marks where the first unknown passes 5, which no check reaches; the promise is to be kept."""

    is_affine = True

    def __init__(self, function, slope):
        self.function, self.slope = function, slope

    def read(self, curve, state):
        value, slope = self.function(state.x[0]), self.slope(state.x[0]) * state.tangent[0]
        return Reading(np.array([value]), np.array([slope]))

    def locate(self, segment, index, bracket):
        return locate_sign_change(segment, lambda state: state.x[0] - 5.0, bracket)

    def arrive(self, curve, state, index):
        forth = Ray(curve, state)
        return SpecialPointFound("at", state.x, "z is 5", (forth.reversed(), forth))


def test_a_promise_to_be_affine():
    kept = Below(lambda z: 5.0 - z, lambda z: -1.0)
    assert check_detector(kept), check_detector(kept)
    negative = Below(lambda z: z - 5.0, lambda z: 1.0)
    assert "a function is negative where a piece begins" in str(check_detector(negative))
    bent = Below(lambda z: 25.0 - z**2, lambda z: -2.0 * z)
    assert "values on a ray are not those of the slopes" in str(check_detector(bent))
    graph = explore(Kink(), (-20.0, 20.0), detectors=[kept])
    (point,) = graph.special_points("at")
    assert point.alpha == pytest.approx(10.0)


def test_a_stepper_that_goes_back():
    class Back(Stepper):
        def step(self, curve, interval, state, before, longest):
            turned = State(state.x, -state.tangent, state.error, -state.orientation)
            return PseudoArclength().step(curve, interval, turned, None, longest)

    assert "goes back" in str(check_stepper(Back()))


class Smooth(PiecewiseSystem):
    size = 1

    def test_functions(self, z, alpha):
        return z - 9.0

    def residual(self, z, alpha, character):
        return z**3 + z - alpha


def returning(value):
    class Some(Stepper):
        def step(self, *_):
            return value

    return Some()


@pytest.mark.parametrize("value", [None, (1.0, 2.0)])
def test_a_stepper_that_returns_no_segment_is_named(value):
    with pytest.raises(InvalidInputError, match="must return a Segment or a Failure"):
        explore(Smooth(), (-1.0, 1.0), stepper=returning(value))


def test_a_stepper_that_promises_rays_takes_rays():
    class Broken(Stepper):
        takes_rays = True

        def step(self, *asked):
            return PseudoArclength().step(*asked)

    problem = LCP([[2, 1], [1, 2]], q=[-1, -1], d=[1, 0])
    with pytest.raises(InvalidInputError, match="must return a StraightSegment or a Failure"):
        explore(problem, (-1.0, 2.0), stepper=Broken())
    with pytest.raises(InvalidInputError, match="Broken needs a PiecewiseLinearSystem"):
        explore(Smooth(), (-1.0, 1.0), stepper=Broken())


def test_a_failure_may_have_words_of_its_own():
    graph = explore(Smooth(), (-1.0, 1.0), stepper=returning(Failure("out of patience")))
    assert "out of patience" in graph.guarantee


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        ({"read": lambda *_: 1.0}, "read must return a Reading"),
        ({"read": lambda *_: Reading(np.ones(2), np.zeros(1))}, "vectors alike"),
        ({"read": lambda *_: Reading(np.array([np.nan]), np.zeros(1))}, "finite values"),
        ({"locate": lambda *_: 1.0}, "locate must return a State or a Failure"),
        ({"arrive": lambda *_: None}, "arrive must return a SpecialPointFound"),
    ],
)
@pytest.mark.parametrize("system", [Kink(), Smooth()])
def test_a_detector_that_breaks_its_contract_is_named(system, changed, words):
    detector = type("Odd", (At,), {name: staticmethod(f) for name, f in changed.items()})()
    with pytest.raises(InvalidInputError, match=f"Odd.*{words}"):
        explore(system, (-2.0, 2.0), detectors=[detector])


class AheadFirst(At):
    """The same, with the ray ahead before the one back."""

    def arrive(self, curve, state, index):
        found = super().arrive(curve, state, index)
        return SpecialPointFound(found.kind, found.x, found.message, found.rays[::-1])


def test_rays_in_the_wrong_order_are_refused():
    with pytest.raises(InvalidInputError, match="the ray back before all others"):
        explore(Kink(), (-2.0, 2.0), detectors=[AheadFirst()])
