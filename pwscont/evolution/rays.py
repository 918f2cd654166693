"""The ways on of any system with memory: rays of the cone problem of the restated law.

Failure modes and answers
-------------------------
- A ray is vertical: infinitely many states at one time. Where the ray ends, other ways may begin,
  and the answer is called incomplete; where the ray has no end, as at plastic collapse, no way on
  begins there.
- Solutions fill a cone of dimension two: the extreme rays are ways on, and the answer is called
  incomplete.
- Parts of a law, such as two stops, are alike at first and not later: such parts are told apart
  from the beginning. Parts that are alike whatever the memory is stay one part.
- The law restated with the memory of a state does not hold in the state: the system is refused.
- Errors of many events add: every state is solved for in the cell of the piece that leads there.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, final

import numpy as np

from pwscont.basics.arguments import checked_kind
from pwscont.basics.arrays import Array, finite_array, generic
from pwscont.basics.character import Character
from pwscont.basics.errors import InvalidInputError, InvalidSystemError
from pwscont.basics.outcome import Failure, Kind
from pwscont.basics.rounding import EPS, GUARD
from pwscont.curve.curve import Curve
from pwscont.curve.error_samples import Found, is_same
from pwscont.curve.magnitudes import rough_magnitudes
from pwscont.curve.metric import Metric
from pwscont.curve.newton import newton, uncertainty
from pwscont.curve.semismooth import semismooth_newton
from pwscont.evolution.memory import Evolver, Moment, Moments, Way, WaysOn, closeness
from pwscont.linear.factorise import last_unit
from pwscont.search.enumeration import solve_surely
from pwscont.system.abilities import HidesUnknowns, completed, shown_size
from pwscont.system.selection import Selection
from pwscont.system.system import PiecewiseLinearSystem
from pwscont.transitions.cone import TangentCone, tangent_cone
from pwscont.transitions.corner import Corner
from pwscont.transitions.ends import departures
from pwscont.transitions.rays import Ray
from pwscont.transitions.zeros import ratio_test

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pwscont.evolution.memory import SystemWithMemory
    from pwscont.evolution.states import EvolutionState

#: A restated law holds in a state where its residual is below this part of its terms.
HOLDS = EPS**0.5
#: Most tests that vanish along a piece, whose signs are all tried.
MOST_ZERO = 12
#: Most Newton iterations on an affine selection: one solves, the rest mends rounding.
REFINEMENTS = 3


@final
class ByRays(Evolver):
    """The ways on as rays of the cone problem.

    Parameters
    ----------
    system : SystemWithMemory
    interval : tuple of float
    """

    def __init__(self, system: SystemWithMemory, interval: tuple[float, float]) -> None:
        self.system, self.interval = system, interval
        self._first = finite_array("initial_memory()", system.initial_memory())
        self._apart = False
        self._apart = self._differs_elsewhere()
        law = self._stated(self._first)
        self._size, self._shown_size = law.size, shown_size(law)
        self._magnitudes = None if law.gives_scale else typical(law, interval)
        self._metric = Metric.of(self.law(self._first), interval)

    def _stated(self, memory: Array) -> PiecewiseLinearSystem:
        law = self.system.remembering(memory)
        what = f"what {type(self.system).__name__}.remembering returns"
        checked_kind(what, law, PiecewiseLinearSystem, is_needed=True)
        if self._apart and isinstance(law, HidesUnknowns):
            law = law.told_apart()
        return law

    def _differs_elsewhere(self) -> bool:
        """Tell whether parts of the law that are alike at first are so by chance."""
        first = self._stated(self._first)
        if not isinstance(first, HidesUnknowns):
            return False
        if first.told_apart() is first:
            return True
        try:
            other = self._stated(self._first + generic(len(self._first)))
        except Exception:  # this memory may mean nothing to the law
            return True
        return other.size != first.size

    def law(self, memory: Array) -> PiecewiseLinearSystem:
        """Return the law restated with a memory, for work on the interval."""
        law = self._stated(memory)
        if law.size != self._size:
            raise InvalidSystemError(
                f"{type(self.system).__name__}.remembering has {law.size} unknowns now, "
                f"{self._size} at first; the number of unknowns must not change with the memory"
            )
        return law.within(*self.interval, self._magnitudes)

    def sizes(self) -> Array:
        """Return typical magnitudes of all unknowns."""
        return self._metric.scale[:-1]

    def memory(self, z: Array, t: float) -> Array:
        """Return the memory of the state that users see."""
        what = f"{type(self.system).__name__}.memory"
        return finite_array(what, self.system.memory(self.shown(z, t), t), self._first.shape)

    def shown(self, z: Array, t: float) -> Array:
        """Return the unknowns that are not hidden."""
        return z[: self._shown_size].copy()

    def names(self) -> tuple[str, ...]:
        """Return the names that the law gives."""
        own = self.system.names()
        return tuple(self._stated(self._first).names()) if own is None else tuple(own)

    def starts(self, t: float, start: Any) -> Moments:
        """Return all solutions at the beginning under the initial memory, or the given state."""
        if start is not None:
            return Moments((self._given(t, start),))
        return self._solutions(self._first, t)

    def _given(self, t: float, start: Any) -> Moment:
        shown = finite_array("start", start, (self._shown_size,))
        memory = np.asarray(self.system.memory(shown, t), dtype=float)
        law = self.law(memory)
        z = completed(law, shown, t)
        if not holds(law, z, t, self.sizes()):
            kind = type(self.system).__name__
            raise InvalidInputError(f"start is no state of {kind} at t = {t:.10g}: {shown}")
        return Moment(t, z, memory)

    def _solutions(self, memory: Array, t: float) -> Moments:
        law = self.law(memory)
        if law.unique:
            one = semismooth_newton(law, self._metric, np.zeros(law.size), t)
            if not isinstance(one, Failure):
                return Moments((self._moment(one[0][:-1], t, np.atleast_2d(one[1])),))
        found = solve_surely(law, self._metric, t)
        moments = tuple(self._moment(p.x[:-1], t, p.error) for p in found.points)
        certain = not (found.undecided or found.faces)
        why = "" if certain else f"not all states at t = {t:.10g} are certain"
        return Moments(moments, certain, why)

    def _moment(self, z: Array, t: float, error: Array | None) -> Moment:
        """Return a state with the memory of the state, and with the hidden unknowns restated."""
        memory = self.memory(z, t)
        law = self.law(memory)
        return Moment(t, completed(law, self.shown(z, t), t), memory, error=error)

    def elsewhere(self, moment: Moment) -> Moments:
        """Return the other solutions of the law restated with the memory of the moment."""
        found = self._solutions(moment.memory, moment.t)
        here = _found(moment, self._metric)
        others = (m for m in found.moments if not is_same(self._metric, here, _found(m)))
        return Moments(tuple(others), found.complete, found.remark)

    def ways_on(self, moment: Moment) -> WaysOn:
        """Return the rays in the direction of growing t."""
        law = self.law(moment.memory)
        x, error = _found(moment, self._metric)
        if not holds(law, moment.z, moment.t, self.sizes()):
            raise InvalidSystemError(
                f"{type(self.system).__name__}.remembering(memory(z, t)) does not hold in the "
                f"state z it was made from, at t = {moment.t:.10g}"
            )
        zero, found = _rays(law, self._metric, x, error)
        slopes = [ray.curve.slope(ray.state) for ray in found.rays]
        pairs = zip(found.rays, slopes, strict=True)
        ways = tuple(self._way(ray, zero) for ray, slope in pairs if slope > 0.0)
        level = [ray for ray, slope in zip(found.rays, slopes, strict=True) if slope == 0.0]
        if found.dimension > 1 or any(np.isfinite(_length(ray, zero)) for ray in level):
            return WaysOn(ways, False, "infinitely many ways on")
        searched = "the corner has too many cells to try all"
        return WaysOn(ways) if found.exact else WaysOn(ways, False, searched)

    def _way(self, ray: Ray, zero: frozenset[int]) -> Way:
        """Return the piece along a ray, up to where a test that bounds the cell vanishes."""
        selection, state = ray.curve.selection, ray.state
        t, tangent = float(state.x[-1]), state.tangent
        rate = tangent[:-1] / tangent[-1]
        until = t + _length(ray, zero) * float(tangent[-1])
        label, mode = selection.system.label(selection.character), str(selection.character)
        return Way(label, state.x[:-1], rate, until, mode.encode())

    def reached(self, moment: Moment, way: Way, t: float) -> Moment:
        """Return the state on a way, solved for in the cell of the way."""
        rough = way.z + (t - moment.t) * way.rate
        selection = Selection(self.law(moment.memory), Character.read(way.mode.decode()))
        row = last_unit(len(rough) + 1)
        root = newton(
            Curve(selection, self._metric),
            lambda x: (float(x[-1]) - t, row),
            np.append(rough, t),
            REFINEMENTS,
        )
        if isinstance(root, Failure):
            return self._moment(rough, t, None)
        return self._moment(root.x[:-1], t, uncertainty(root))


def _length(ray: Ray, zero: frozenset[int]) -> float:
    """Return the length of a ray, up to where a test that bounds the cell vanishes."""
    selection, state = ray.curve.selection, ray.state
    tests = selection.tests(state.x)
    slopes = selection.test_gradients(state.x) @ state.tangent
    ahead = np.array([int(test) not in zero for test in selection.bounding], dtype=bool)
    return float(ratio_test(tests[ahead], slopes[ahead]).min(initial=np.inf))


def _found(moment: Moment, metric: Metric | None = None) -> Found:
    """Return a moment as a solution with samples of the error of the solution."""
    x = np.append(moment.z, moment.t)
    if moment.error is not None and moment.error.shape[-1] == len(x):
        return x, moment.error
    scale = 0.0 if metric is None else metric.scale
    return x, GUARD * EPS * (np.abs(x) + scale)[np.newaxis]


def typical(law: PiecewiseLinearSystem, interval: tuple[float, float]) -> Array:
    """Return typical magnitudes of the unknowns of a law, as the law gives or from its terms."""
    law = law.within(*interval)
    given = law.gives_scale
    return law.scale(*interval) if given else rough_magnitudes(law, interval, np.zeros(law.size))


def holds(
    law: PiecewiseLinearSystem, z: Array, t: float, sizes: Array, cell: Character | None = None
) -> bool:
    """Tell whether a law holds in a state, in a cell; default one to which the state belongs."""
    x = np.append(z, t)
    selection = Selection(law, cell or law.character(z, t))
    terms = abs(selection.jacobian(x)) @ (np.abs(x) + np.append(sizes, 0.0))
    return bool((np.abs(selection.residual_and(x, 0.0)[:-1]) <= HOLDS * terms).all())


def is_piece(
    system: SystemWithMemory,
    states: Sequence[EvolutionState],
    interval: tuple[float, float],
    label: str | None,
) -> bool:
    """Tell whether states, nodes at both ends, lie in one cell, to which the middle belongs.

    The cell is one of the law with the memory of the first node, and has a label, or any.
    """
    law, middle = system.remembering(states[0].memory), states[len(states) // 2]
    points = [(completed(law, state.z, state.t), state.t) for state in states]
    sizes, at = typical(law, interval), (completed(law, middle.z, middle.t), middle.t)
    large = np.abs(system.memory(sizes[: len(middle.z)], middle.t))
    for node in (states[0], states[-1]):
        if closeness(system.memory(node.z, node.t), node.memory, large) > HOLDS:
            return False
    terms = abs(law.test_jacobian(*at)) @ (np.abs(np.append(*at)) + np.append(sizes, 0.0))
    zero = np.flatnonzero(np.abs(law.test_functions(*at)) <= HOLDS * terms)
    cells = [law.character(*at)]
    for test in zero[:MOST_ZERO].tolist():
        cells += [cell.flip(test) for cell in cells]
    named = (cell for cell in cells if label in (None, law.label(cell)))
    return any(all(holds(law, *point, sizes, cell) for point in points) for cell in named)


def _rays(
    law: PiecewiseLinearSystem, metric: Metric, x: Array, error: Array
) -> tuple[frozenset[int], TangentCone]:
    """Return the tests that vanish at a solution, and the rays that leave the solution."""
    corner = Corner.of_start(law, metric, x, error)
    if corner.zero:
        return corner.zero, tangent_cone(corner)
    inside = departures(corner)
    return corner.zero, TangentCone(inside.rays, 1, exact=inside.kind != Kind.STOPPED)
