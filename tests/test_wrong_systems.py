"""Systems, scenes and files that break their contract."""

import numpy as np
import pytest
import scipy.sparse as sp
from wrong_parts import Bent, Lines, Straight, through

from pwscont import (
    BranchGraph,
    InvalidInputError,
    InvalidSystemError,
    Panel,
    PiecewiseLinearSystem,
    PiecewiseSystem,
    PwscontError,
    Scene,
    SceneNotFoundError,
    Search,
    TransitionDetector,
    UnknownNameError,
    check_system,
    explore,
    trace,
)
from pwscont.commands.cli import main
from pwscont.extending import Ending
from pwscont.scenes import registry
from pwscont.scenes.registry import settings_of

# -- systems -------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("points", "words"),
    [
        (([0.1], 0.2), r"points\[0\] must be a pair .* got \[0.1\]; give one point as \[\(z, a"),
        ([0.1, 0.2], r"points\[0\] must be a pair .* got 0.1"),
        (0.3, "points must be pairs"),
        ([([0.1], 0.2), ([0.1], "x")], r"alpha of points\[1\] must be"),
        ([([0.1], np.nan)], r"alpha of points\[0\] must be finite"),
        ([([0.1, 0.2], 0.2)], r"z of points\[0\] has shape \(2,\)"),
    ],
)
def test_points_that_are_none(points, words):
    with pytest.raises(InvalidInputError, match=words):
        check_system(Bent(), points)


@pytest.mark.parametrize(
    ("name", "method", "words"),
    [
        ("scale", lambda self: np.ones(1), r"def scale\(self, lo, hi\), but takes \(self\)"),
        ("residual", lambda self, z, alpha: z, r"def residual\(self, z, alpha, character\)"),
        ("label", lambda self: "", r"def label\(self, character\)"),
        ("cells", lambda self, alpha: (), r"def cells\(self\), but takes \(self, alpha\)"),
    ],
)
def test_methods_with_other_arguments(name, method, words):
    with pytest.raises(InvalidSystemError, match=words):
        explore(type("Wrong", (Bent,), {name: method})(), (0.0, 1.0))


def test_static_methods_and_private_names_are_free():
    class Own(Bent):
        scale = staticmethod(lambda lo, hi: np.ones(1))

        def __init__(self):
            self._residual = self._some = self._differences = None

    assert explore(Own(), (0.0, 1.0)).count(0.5) == explore(Bent(), (0.0, 1.0)).count(0.5)


@pytest.mark.parametrize(
    ("method", "value", "words"),
    [
        ("scale", np.zeros(1), r"scale\(\) must return 1 positive"),
        ("test_functions", [0.5], r"returned list where .* \(1,\) is expected: numpy.array makes"),
        ("scale", -np.ones(1), r"scale\(\) must return 1 positive"),
        ("scale", 2.0, r"scale\(\) must return 1 positive"),
        ("bounds", (1.0, -1.0), r"bounds\(\) needs lower < upper"),
        ("names", ("a", "b"), r"names\(\) must return 1 names, one for each unknown, got 2"),
        ("names", "a", r"names\(\) must return 1 texts, got 'a'"),
        ("names", (1,), r"names\(\) must return texts"),
        ("end", "beyond", r"Wrong\.end would never be called, .* derive from .*\.Ending: let it"),
        ("reduction", None, r"Wrong\.reduction would never .*\.Reducible"),
        ("searches", (), r"Wrong\.searches would never .*\.BringsSearches"),
    ],
)
def test_what_a_run_refuses_check_system_refuses(method, value, words):
    system = type("Wrong", (Bent,), {method: lambda self, *interval: value})()
    for run in (
        lambda: check_system(system, [([0.1], 0.2)]),
        lambda: explore(system, (0.0, 2.0), search=Unasked()),
        lambda: trace(system, ([0.1], 0.2), (0.0, 2.0)),
    ):
        with pytest.raises(InvalidSystemError, match=words):
            run()


def test_what_is_no_method_may_have_any_name():
    system = Bent()
    system.end = 3.0
    assert check_system(system, [([0.1], 0.2)])


class Unasked(Search):
    """Is not to be asked: what is wrong is known before."""

    def starts(self, system, metric, interval):
        raise AssertionError


class Two(PiecewiseLinearSystem):
    size = 2

    def test_functions(self, z, alpha):
        return z.copy()

    def residual(self, z, alpha, character):
        return z - alpha

    def names(self):
        return "u", "u"


def test_a_name_that_is_given_twice():
    for run in (
        lambda: check_system(Two(), [([0.1, 0.1], 0.2)]),
        lambda: explore(Two(), (0.0, 2.0)),
    ):
        with pytest.raises(InvalidSystemError, match=r"Two.names\(\) gives several .* name 'u'"):
            run()


# -- scenes --------------------------------------------------------------------------------------


def scene(**parts):
    return Scene("bent", "a bent line", Bent(), (0.0, 2.0), **{"search": Unasked(), **parts})


@pytest.mark.parametrize(
    ("parts", "words"),
    [
        ({"panels": (Panel("pwoer"),), "record": {"power": abs}}, "there is no 'pwoer'.*power"),
        ({"panels": (Panel(1),)}, "there is no unknown 1"),
        ({"panels": (Panel(None),)}, "must be an index, a name or a function"),
        ({"panels": ("z",)}, "each of the panels of scene bent must be a Panel, got 'z'"),
        ({"panels": Panel(0)}, "panels of scene bent must be a tuple of Panel"),
        ({"at": (0.5, 3.0)}, r"at of scene bent: 3.0 lies outside the interval \[0.0, 2.0\]"),
        ({"at": 0.5}, r"at of scene bent must be several numbers, as in \(0.5,\), got 0.5"),
    ],
)
def test_scenes_that_do_not_fit(parts, words):
    wrong = scene(**parts)
    for ask in (wrong.run, lambda: wrong.values(None)):
        with pytest.raises(PwscontError, match=words):
            ask()


def test_the_command_line_tells_numerical_failures_in_one_line(monkeypatch, capsys):
    def failing(R: float = 1.0):
        return scene(search=None, detectors=(Singular(R),))

    monkeypatch.setattr(registry, "_entry_point", lambda name: name)
    monkeypatch.setattr(registry, "_loaded", lambda point: failing)
    assert main(["run", "bent", "-s", "R=nan"]) == 2
    message = capsys.readouterr().err.splitlines()[-1]
    assert message == (
        "pwscont: scene bent cannot be computed: LinAlgError: Singular matrix; check the settings "
        "R=nan"
    )


class Singular(TransitionDetector):
    def __init__(self, value):
        self.value = value

    def read(self, curve, state):
        np.linalg.solve(np.zeros((1, 1)), np.ones(1))

    def locate(self, segment, index, bracket):
        raise AssertionError

    def arrive(self, curve, state, index):
        raise AssertionError


def test_settings_are_of_the_type_of_their_defaults():
    def make(length=2.0, count=3, on=False, name="a", other=None):
        raise AssertionError

    given = {"length": "1", "count": "2.5", "on": "true", "name": "7", "other": "8"}
    expected = {"length": 1, "count": 2.5, "on": True, "name": "7", "other": "8"}
    assert settings_of("s", make, given) == expected
    with pytest.raises(InvalidInputError, match="length of scene s must be a number, got 'x'"):
        settings_of("s", make, {"length": "x"})


def test_far_names_of_scenes_are_not_offered():
    with pytest.raises(SceneNotFoundError) as caught:
        registry.load_scene("nothing")
    assert str(caught.value) == "there is no scene 'nothing'; see 'pwscont scenes'"


# -- files ---------------------------------------------------------------------------------------


def test_a_graph_without_its_functions_says_how_to_give_them(tmp_path):
    record = {"power": lambda z, a: float(z[0] ** 2)}
    through(Bent(), {}, record=record).save(tmp_path / "graph")
    loaded = BranchGraph.load(tmp_path / "graph", Bent())
    assert loaded.special_points()[0]["power"] >= 0.0
    with pytest.raises(UnknownNameError, match=r"load\(\.\.\., record=\{'power': \.\.\.\}\)"):
        loaded.solutions(0.5)[0]["power"]
    again = BranchGraph.load(tmp_path / "graph", Bent(), record=record)
    (solution,) = again.solutions(0.5)
    assert solution["power"] == pytest.approx(solution.z[0] ** 2)


# -- attributes of systems -------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"names": ("x",)}, r"Mine.names must be a method, def names\(self\), got \('x',\)"),
        ({"scale": np.ones(1)}, r"Mine.scale must be a method, def scale\(self, lo, hi\)"),
        ({"bounds": (0, 1)}, r"Mine.bounds must be a method, def bounds\(self\)"),
        ({"blocks": ()}, r"Mine.blocks must be a method, def blocks\(self\)"),
        ({"label": "x"}, r"Mine.label must be a method, def label\(self, character\)"),
        ({"degree": lambda self: 1}, "Mine.degree must be a value, not a method"),
        ({"unique": lambda self: True}, "Mine.unique must be a value, not a method"),
        ({"degree": "1"}, "Mine.degree must be a whole number or None, got '1'"),
        ({"size": 0}, "Mine.size must be an int, the number of unknowns, got 0"),
        (
            {"cells": lambda self: None},
            r"Mine.cells\(\) must yield a Character for each cell, got None",
        ),
        (
            {"cells": lambda self: "-+"},
            r"Mine.cells\(\) must yield a Character for each cell, got '-'",
        ),
        ({"label": lambda self, c: None}, "Mine.label must return a text, got None"),
        (
            {"residual": lambda self, z, a, c: z + np.nan},
            r"Mine.residual in cell - returned \[nan\] at alpha=0, z=\[0\]",
        ),
        (
            {"test_functions": lambda self, z, a: np.ones(1 if z[0] < 0.3 else 2)},
            r"of shape \(1,\) and of shape \(2,\) were returned .* must not change",
        ),
    ],
)
def test_attributes_that_do_not_fit_are_refused(given, words):
    system = type("Mine", (Lines,), given)()
    with pytest.raises(InvalidSystemError, match=words):
        explore(system, (0.0, 2.0), record={"twice": lambda z, a: 2.0 * a})
    if "return" not in words:
        with pytest.raises(InvalidSystemError, match=words):
            check_system(system, [([0.0], 0.0)])


@pytest.mark.parametrize("name", ["residual", "label", "bounding_tests"])
def test_methods_of_one_object_are_looked_at_though_its_class_was_before(name):
    trace(Lines(), (np.zeros(1), 0.0), (0.0, 2.0))
    system = Lines()
    setattr(system, name, 5)
    with pytest.raises(InvalidSystemError, match=rf"Lines\.{name} must be a method"):
        trace(system, (np.zeros(1), 0.0), (0.0, 2.0))


@pytest.mark.parametrize(
    ("name", "given", "words"),
    [
        ("label", 5, r"Mine\.label must be a method"),
        ("end", lambda self, *_: None, r"Mine\.end would never be called"),
    ],
)
def test_a_class_that_was_changed_is_looked_at_again(name, given, words):
    kind = type("Mine", (Lines,), {})
    trace(kind(), (np.zeros(1), 0.0), (0.0, 2.0))
    setattr(kind, name, given)
    with pytest.raises(InvalidSystemError, match=words):
        trace(kind(), (np.zeros(1), 0.0), (0.0, 2.0))
    delattr(kind, name)
    trace(kind(), (np.zeros(1), 0.0), (0.0, 2.0))


def test_a_property_may_return_a_method():
    class Chosen(Lines):
        @property
        def label(self):
            return self.words

        words = staticmethod(lambda character: "chosen")

    graph = trace(Chosen(), (np.zeros(1), 0.0), (0.0, 2.0))
    assert {piece.label for piece in graph.pieces} == {"chosen"}
    Chosen.words = "not callable"
    with pytest.raises(InvalidSystemError, match=r"Chosen\.label must be a method"):
        trace(Chosen(), (np.zeros(1), 0.0), (0.0, 2.0))


class Crossing(PiecewiseSystem):
    """z = (alpha, 3 alpha / 2) in every cell; both tests vanish at zero."""

    size = 2

    def __init__(self, stored=np.asarray, wrong=np.nan):
        self.stored, self.wrong = stored, wrong

    def test_functions(self, z, alpha):
        return z.copy()

    def residual(self, z, alpha, character):
        return np.array([z[0] - alpha, z[1] - 1.5 * alpha])

    def jacobian(self, z, alpha, character):
        slope = self.wrong if character.signs == (True, True) else 1.0
        return self.stored(np.array([[slope, 0.0, -1.0], [0.0, 1.0, -1.5]]))


@pytest.mark.parametrize("wrong", [np.nan, np.inf])
@pytest.mark.parametrize(
    "stored", [np.asarray, sp.csr_matrix, sp.csc_array, sp.coo_matrix, sp.dia_matrix, sp.lil_array]
)
@pytest.mark.sweep(3)
def test_a_jacobian_at_a_corner_is_refused_in_the_name_of_its_system(stored, wrong):
    words = r"Crossing\.jacobian in cell \+\+ .* not finite in row 0, .* at alpha=0, z=\[0, 0\]"
    with pytest.raises(InvalidSystemError, match=words):
        trace(Crossing(stored, wrong), ([-1.0, -1.5], -1.0), (-1.0, 1.0))
    graph = trace(Crossing(stored, 1.0), ([-1.0, -1.5], -1.0), (-1.0, 1.0))
    np.testing.assert_allclose(graph.solutions(0.8)[0].z, [0.8, 1.2], atol=1e-12)


def test_a_reason_to_end_is_a_text():
    class Fuse(Straight, Ending):
        def test_functions(self, z, alpha):
            return z - 0.5

        def end(self, character, tests):
            return True

    with pytest.raises(InvalidSystemError, match=r"Fuse.end must return why .*, got True"):
        through(Fuse(), {})
