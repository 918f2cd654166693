"""The sweep of curved systems: its truth against other truths, its judge, and a part of it."""

import sys
from itertools import product
from pathlib import Path

import numpy as np
import pytest
from reference_enumeration import Body, enumerate_solutions

sys.path.insert(0, str(Path(__file__).parents[1] / "benchmarks"))

from curved.case import Case, Truth, traced
from curved.contact import Problem, body_of, path_of, true_of
from curved.families import FAMILIES, case_of
from curved.judge import judge
from curved.planar import graph_of, system_of
from curved.truth import Curve

from pwscont import PiecewiseSystem

pytestmark = pytest.mark.sweep(4)  # the others take too long for the README's command

NUMBERS = range(12)
#: Families with branches that run to infinity.
NO_END = {"flat", "steppers"}


# -- the truth ---------------------------------------------------------------------------------


def truth_at(case, alpha):
    sets = [case.truth.solutions(component, alpha) for component in case.truth.components]
    return None if any(s is None for s in sets) else [z for s in sets for z in s]


@pytest.mark.parametrize("number", range(20))
def test_truth_of_polynomials_is_the_roots(number):
    rng = np.random.default_rng(number)
    roots = rng.uniform(-1, 1, int(rng.integers(2, 8)))
    p = lambda z: np.prod([z - r for r in roots], axis=0)  # noqa: E731
    curve = Curve(p, lambda s: np.array([s]), np.linspace(-4, 4, 6001))
    components = curve.components((-1.0, 1.0))
    for alpha in rng.uniform(-0.01, 0.01, 20):
        shifted = np.poly(roots)
        shifted[-1] -= alpha
        true = sorted(r.real for r in np.roots(shifted) if abs(r.imag) < 1e-9)
        sets = [curve.solutions(component, alpha, 2.0) for component in components]
        found = sorted(float(z[0]) for known in sets for z in known)
        np.testing.assert_allclose(found, true, rtol=0, atol=1e-6)


@pytest.mark.parametrize("p", [1, 2, 3])
@pytest.mark.parametrize("number", range(3))
@pytest.mark.sweep(4)
def test_truth_of_contact_is_the_enumeration(p, number):
    rng = np.random.default_rng([p, number])
    body, compliance, gap = body_of(rng, p)
    load, _ = path_of(rng, 2 * p)
    F = float(rng.uniform(0, 3))
    truth = true_of(Problem(compliance, gap, load, lambda x: np.full(len(x), F)), (0.0, 6.0))
    pick = np.eye(2 * p)
    plain = Body(np.asarray(body.A), pick[:p], pick[p:], gap)
    for alpha in rng.uniform(0, 6, 15):
        expected = enumerate_solutions(plain, load(np.array([alpha]))[0], F)
        sets = [truth.solutions(component, alpha) for component in truth.components]
        if min((f.margin for f in expected), default=1.0) < 1e-6:
            continue
        found = [z for known in sets for z in known]
        assert len(found) == len(expected)
        for solution in expected:
            assert min(np.abs(solution.z - z).max() for z in found) < 1e-7


@pytest.mark.parametrize(("family", "number"), list(product(FAMILIES, NUMBERS)))
@pytest.mark.sweep(12)
def test_the_truth_solves_the_system(family, number):
    case, rng = case_of(family, 1, number)
    lo, hi = case.interval
    answered = 0
    for alpha in rng.uniform(lo, hi, 10):
        for z in truth_at(case, alpha) or []:
            answered += 1
            character = case.system.character(z, alpha)
            x = np.append(z, alpha)
            J = case.system.jacobian(z, alpha, character)
            J = np.asarray(J.toarray() if hasattr(J, "toarray") else J)
            slack = 1e-6 * (1.0 + np.abs(J) @ np.abs(x))
            assert (np.abs(case.system.residual(z, alpha, character)) <= slack).all()
    assert answered or len(case.truth.components) == 0 or family in ("ellipses", "steppers", "flat")


@pytest.mark.parametrize(
    ("family", "number"), list(product(sorted(set(FAMILIES) - NO_END), range(30)))
)
@pytest.mark.sweep(36)
def test_components_of_the_truth_end_at_the_interval(family, number):
    """F5: a curve that is cut off before would make right solutions look invented."""
    case, _ = case_of(family, 2, number)
    for component in case.truth.components:
        if component.closed:
            continue
        first, last = component.stretches[0], component.stretches[-1]
        if family in ("contact", "friction"):
            assert any({s.alpha_a, s.alpha_b} & set(case.interval) for s in component.stretches)
        else:
            assert {first.alpha_a, last.alpha_b} <= set(case.interval)


# -- the judge ---------------------------------------------------------------------------------


def line_case(slope, system=None, **more):
    """z = alpha, but the truth is said to be z = slope alpha."""
    rng = np.random.default_rng(0)
    plain = system or system_of(rng, lambda z, alpha, signs: z - alpha, lambda z, alpha: [z - 9.0])
    curve = graph_of(lambda x: slope * x, (0.0, 1.0), 1.0)
    case = traced({}, plain, curve, (0.0, 1.0), rng, at=0.5)
    return Case(case.parameters, plain, case.interval, case.truth, (np.array([0.5]), 0.5), **more)


def word(case, limit=20.0):
    verdict = judge(case, np.random.default_rng(0), limit)
    return verdict.word, set(verdict.reasons)


def test_a_wrong_value_is_wrong():
    assert word(line_case(1.01))[0] == "wrong"
    assert "foreign" in word(line_case(1.01))[1]


def test_a_right_value_is_not_wrong():
    assert word(line_case(1.0))[0] == "right"


def test_a_solution_too_few_is_wrong():
    case = line_case(1.0)
    twice = lambda c, alpha: [np.array([alpha]), np.array([alpha + 1.0])]  # noqa: E731
    case.truth = Truth(case.truth.components, twice)
    assert "missing" in word(case)[1]


class Slow(PiecewiseSystem):
    """Never comes back."""

    size = 1

    def test_functions(self, z, alpha):
        return z.copy()

    def residual(self, z, alpha, character):
        while True:
            pass


class Broken(Slow):
    def residual(self, z, alpha, character):
        raise RuntimeError


def test_a_hang_and_an_exception_are_wrong():
    assert word(line_case(1.0, Slow()), limit=0.2) == ("wrong", {"hang"})
    assert word(line_case(1.0, Broken())) == ("wrong", {"exception"})


# -- a part of the sweep -----------------------------------------------------------------------


def is_silent(verdict):
    """Tell whether an answer is wrong and does not say so; one that takes too long is none."""
    said_twice = "stands twice" in verdict.guarantee
    return verdict.is_fault and set(verdict.reasons) != {"hang"} and not said_twice


@pytest.mark.slow
@pytest.mark.parametrize("family", FAMILIES)
def test_no_silent_wrong_answer(family):
    for number in range(16):
        case, rng = case_of(family, 0, number)
        verdict = judge(case, rng, 20.0)
        assert not is_silent(verdict), (number, case.parameters, verdict)
