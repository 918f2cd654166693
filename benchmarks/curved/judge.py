"""Runs a case and says what came of it: right, said so, unfound, missed, or wrong and how.

What a graph that stops, or says that it is not balanced, leaves out is said. What it invents, an
exception, a hang, equal solutions and evaluations outside the interval are never excused.
"""

from __future__ import annotations

import signal
import time
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

import numpy as np

from curved.case import Case
from curved.truth import MARGIN, TOLERANCE, Component
from pwscont import BranchGraph, PiecewiseSystem, explore, trace
from pwscont.basics.errors import PwscontError

KINDS = ("fold", "transition", "nonsmooth fold")
#: Alphas at random, and at most as many between special points.
QUERIES = 24
#: Folds of a pair that are closer in alpha than this part of the interval may be passed over.
SHALLOW = 1e-7
METHODS = ("residual", "test_functions", "jacobian", "test_jacobian")


class TooLongError(BaseException):
    """A case took longer than allowed; no handler of the code under test may catch it."""


@dataclass
class Verdict:
    """What came of a case.

    Attributes
    ----------
    word : str
        "right", "said so", "unfound" (whole components that the guarantee does not promise),
        "missed" (in a thin cell only), or "wrong".
    reasons : dict
        What is not right, and an example of it.
    guarantee : str
    seconds : float
        Of CPU.
    """

    word: str
    reasons: dict[str, str]
    guarantee: str
    seconds: float

    @property
    def is_outside(self) -> bool:
        """Whether the system was asked for an alpha outside the interval."""
        return any(reason.startswith("outside") for reason in self.reasons)

    @property
    def is_fault(self) -> bool:
        """Whether this must not be."""
        return self.word == "wrong" or self.is_outside


def judge(case: Case, rng: np.random.Generator, limit: float) -> Verdict:
    """Return the verdict; ``limit`` in seconds of CPU."""
    look = Look(case)
    began = time.process_time()
    try:
        with at_most(limit):
            look.at(recorded(case.system, look.alphas), rng)
    except TooLongError:
        look.note("hang", f"longer than {limit:g} s of CPU")
    return look.verdict(time.process_time() - began)


@contextmanager
def at_most(seconds: float) -> Iterator[None]:
    """Raise TooLongError in this block after so many seconds of CPU."""

    def stop(*_: Any) -> None:
        raise TooLongError

    before = signal.signal(signal.SIGPROF, stop)
    signal.setitimer(signal.ITIMER_PROF, seconds, 1.0)  # again should it be swallowed
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        signal.signal(signal.SIGPROF, before)


def recorded(system: PiecewiseSystem, alphas: list[float]) -> PiecewiseSystem:
    """Return the system; the smallest and the largest alpha that it is asked for are kept.

    By a class of its own, which the handles that a run makes of the system share.
    """

    def watched(method: Callable[..., Any]) -> Callable[..., Any]:
        def call(self: PiecewiseSystem, z: Any, alpha: float, *rest: Any) -> Any:
            alphas[0], alphas[1] = min(alphas[0], alpha), max(alphas[1], alpha)
            return method(self, z, alpha, *rest)

        return call

    kind = type(system)
    methods = {name: watched(getattr(kind, name)) for name in METHODS}
    system.__class__ = type(kind.__name__, (kind,), methods)
    return system


@dataclass
class Look:
    """What is seen of one case."""

    case: Case
    reasons: dict[str, str] = field(default_factory=dict)
    guarantee: str = ""
    said: bool = False
    found: set[int] = field(default_factory=set)
    absent: dict[int, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Begin with no alpha."""
        self.alphas = [np.inf, -np.inf]

    def note(self, reason: str, example: str) -> None:
        """Keep the first example of each reason."""
        self.reasons.setdefault(reason, example)

    def at(self, system: PiecewiseSystem, rng: np.random.Generator) -> None:
        """Follow, and compare everything."""
        graph = self._guarded(lambda: self._graph(system), "explore or trace")
        if graph is None:
            return
        self.guarantee = graph.guarantee
        stopped = graph.special_points("stopped")
        self.said = bool(stopped) or "not balanced" in graph.guarantee or not graph.pieces
        if stopped:
            self.guarantee += f"; stopped: {stopped[0].message}"
        for alpha in self._queries(rng):
            self._compare(graph, alpha)
        self._compare_specials(graph)

    def _guarded(self, call: Callable[[], Any], what: str) -> Any:
        """Return what a call of the code under test returns; None, and a note, if it raises."""
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("error")
                return call()
        except Exception as error:
            refused = isinstance(error, PwscontError) and not self.guarantee
            self.said |= refused
            self.note(
                "refused" if refused else "exception", f"{what}: {type(error).__name__}: {error}"
            )
            return None

    def _graph(self, system: PiecewiseSystem) -> BranchGraph:
        case = self.case
        if case.start is None:
            return explore(system, case.interval, stepper=case.stepper)
        self.found.add(0)
        return trace(system, case.start, case.interval, stepper=case.stepper)

    # -- solutions -----------------------------------------------------------------------

    def _queries(self, rng: np.random.Generator) -> list[float]:
        lo, hi = self.case.interval
        everywhere = rng.uniform(lo, hi, QUERIES).tolist()
        ends = {a for c in self.case.truth.components for s in c.stretches for a in s[2:]}
        cuts = sorted({lo, hi, *ends})
        wide = 10 * MARGIN * (hi - lo)
        between = [0.5 * (a + b) for a, b in pairwise(cuts) if b - a > wide]
        if len(between) > QUERIES:
            between = rng.choice(between, QUERIES, replace=False).tolist()
        return [*everywhere, *between]

    def _compare(self, graph: BranchGraph, alpha: float) -> None:
        components = self.case.truth.components
        sets = [self.case.truth.solutions(component, alpha) for component in components]
        answer = self._guarded(
            lambda: ([(s.z, s.error) for s in graph.solutions(alpha)], graph.count(alpha)),
            f"at {alpha!r}",
        )
        if answer is None:
            return
        have, count = answer
        if any(known is None for known in sets):
            return
        true = [(k, z) for k, known in enumerate(sets) for z in known or ()]
        if count != len(have):
            self.note("count", f"count({alpha!r}) = {count}, {len(have)} solutions")
        self._pair(true, have, alpha)

    def _pair(
        self,
        true: list[tuple[int, np.ndarray]],
        have: list[tuple[np.ndarray, np.ndarray]],
        alpha: float,
    ) -> None:
        """Match every solution with the nearest true one; it may be off by what its error says."""
        near = _near([z for _, z in true])
        hits = [0] * len(true)
        for z, error in have:
            gaps = [float(np.abs(z - w).max() / (1 + np.abs(w).max())) for _, w in true]
            nearest = int(np.argmin(gaps)) if gaps else -1
            allowed = max(min(TOLERANCE, 0.25 * near), float(error.max(initial=0.0)))
            if nearest < 0 or gaps[nearest] > allowed:
                self._fault("foreign", alpha, f"solutions({alpha!r}) has {z}, true: {_z(true)}")
            else:
                hits[nearest] += 1
        for (k, z), hit in zip(true, hits, strict=True):
            if hit:
                self.found.add(k)
            else:
                self._absent(k, alpha, f"solutions({alpha!r}) lacks {z}")
            if hit > 1:
                self.note("twice", f"solutions({alpha!r}) has {z} {hit} times")

    def _fault(self, reason: str, alpha: float, example: str) -> None:
        thin = any(lo <= alpha <= hi for lo, hi in self.case.thin)
        self.note(f"thin {reason}" if thin else reason, example)

    def _absent(self, k: int, alpha: float, example: str) -> None:
        if any(lo <= alpha <= hi for lo, hi in self.case.thin):
            self.note("thin missing", example)
        else:
            self.absent.setdefault(k, example)

    # -- special points ------------------------------------------------------------------

    def _compare_specials(self, graph: BranchGraph) -> None:
        """Match folds and transitions by alpha with those of the components that were found."""
        if not self.case.truth.has_specials:
            return
        lo, hi = self.case.interval
        slack = MARGIN * (hi - lo)
        true = [p for k in self.found for p in self.case.truth.components[k].specials]
        for kind in KINDS:
            have = [(p.alpha, 10 * float(p.error[-1])) for p in graph.special_points(kind)]
            expected = sorted(
                p.alpha for p in true if p.kind == kind and lo + slack < p.alpha < hi - slack
            )
            have = [h for h in have if lo + slack < h[0] < hi - slack]
            for alpha, error in sorted(have):
                gaps = [abs(alpha - x) for x in expected]
                if gaps and min(gaps) <= slack + error:
                    expected.pop(int(np.argmin(gaps)))
                else:
                    self.note("invented", f"{kind} at {alpha!r}")
            for alpha in expected:
                thin = any(abs(alpha - x) <= slack for pair in self.case.thin for x in pair)
                pair = sum(abs(alpha - x) <= SHALLOW * (hi - lo) for x in expected) > 1
                thin |= kind == "fold" and pair
                self.note(f"{'thin ' if thin else ''}unseen", f"{kind} at {alpha!r}")

    # -- the word ------------------------------------------------------------------------

    def verdict(self, seconds: float) -> Verdict:
        """Return what came of it."""
        lo, hi = self.case.interval
        for k, example in self.absent.items():
            self.note("missing" if k in self.found else self._unfound(k), example)
        if self.alphas[0] < lo or self.alphas[1] > hi:
            self.note(self._outside(), f"alpha from {self.alphas[0]!r} to {self.alphas[1]!r}")
        return Verdict(self._word(), self.reasons, self.guarantee, seconds)

    def _unfound(self, k: int) -> str:
        """Return whether the guarantee leaves room for a whole component that was not found."""
        component: Component = self.case.truth.components[k]
        if self.case.start is not None:
            return "missing"
        loops = "but for closed loops" in self.guarantee and component.closed
        return (
            "unfound" if loops or self.guarantee.startswith(("balanced", "nothing")) else "missing"
        )

    def _outside(self) -> str:
        """Return whether it was a difference at an end of the interval, or a step."""
        lo, hi = self.case.interval
        step = 1e-5 * max(1.0, abs(lo), abs(hi))
        short = self.alphas[0] >= lo - step and self.alphas[1] <= hi + step
        return "outside by a difference" if short else "outside"

    def _word(self) -> str:
        hard = {"exception", "hang", "invented", "count"}
        soft = {"missing", "foreign", "unseen", "refused", "twice"}
        reasons = set(self.reasons)
        if reasons & hard or (reasons & soft and not self.said):
            return "wrong"
        if reasons & soft:
            return "said so"
        if "unfound" in reasons:
            return "said so" if self.said else "unfound"
        return "missed" if any(r.startswith("thin") for r in reasons) else "right"


def _near(z: list[np.ndarray]) -> float:
    """Return the smallest relative distance between two of them."""
    pairs = (
        float(np.abs(a - b).max() / (1 + np.abs(a).max())) for i, a in enumerate(z) for b in z[:i]
    )
    return min(pairs, default=np.inf)


def _z(true: list[tuple[int, np.ndarray]]) -> list[list[float]]:
    return [z.tolist() for _, z in true]
