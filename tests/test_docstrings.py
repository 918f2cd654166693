"""Every public class and function shows an example in its docstring, and the example runs."""

import doctest
import inspect
from importlib import import_module, util

import pytest
from sweeps import swept

PACKAGES = (
    "pwscont",
    "pwscont_circuits",
    "pwscont_coulomb",
    "pwscont_coulomb.elastic",
    "pwscont_dynamics",
    "pwscont_optimisation",
    "pwscont_power",
    "pwscont_structures",
)
#: What examples need beside the package itself; without it they are skipped.
NEEDS = {"plane": "shapely", "PlaneScene": "shapely", "View": "bokeh", "ElasticPicture": "bokeh"}
NEEDS |= {"membrane": "skfem", "Study": "skfem"}


def public(package):
    """Return the public classes and functions of a package by name."""
    module = import_module(package)
    named = {name: getattr(module, name) for name in module.__all__}
    return {name: it for name, it in named.items() if inspect.isclass(it) or inspect.isfunction(it)}


NAMES = [(package, name) for package in PACKAGES for name in public(package)]
#: Examples that take half a second or more.
LONG = ("Complementarity", "FilippovEquilibria", "Strut", "TransitionLocus", "explore")


@pytest.fixture(autouse=True)
def headless(monkeypatch, tmp_path):
    """Draw without a display, and write into a fresh folder."""
    monkeypatch.setenv("MPLBACKEND", "Agg")
    monkeypatch.chdir(tmp_path)
    yield
    import matplotlib.pyplot as plt  # noqa: PLC0415  after the backend is chosen

    plt.close("all")


@pytest.mark.parametrize(
    ("package", "name"),
    swept(
        [named for named in NAMES if named[1] not in LONG],
        [named for named in NAMES if named[1] in LONG],
    ),
)
def test_a_public_name_has_an_example_that_runs(package, name):
    needed = "skfem" if package.endswith("elastic") else NEEDS.get(name)
    if needed and not util.find_spec(needed):
        pytest.skip(f"the example needs {needed}")
    it = public(package)[name]
    tests = doctest.DocTestFinder(recurse=False).find(it, name, globs={})
    assert any(test.examples for test in tests)
    assert failures(tests) == 0


def failures(tests):
    """Return how many examples fail."""
    runner = doctest.DocTestRunner(optionflags=doctest.NORMALIZE_WHITESPACE)
    for test in tests:
        runner.run(test)
    return runner.failures


def test_examples_for_those_who_extend_run():
    finder, found = doctest.DocTestFinder(), public("pwscont.extending")
    tests = [test for name, it in found.items() for test in finder.find(it, name, globs={})]
    assert len([test for test in tests if test.examples]) >= 10
    assert failures(tests) == 0
