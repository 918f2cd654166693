"""All ways on of a body with friction, event by event, in the unknowns of the contact nodes.

A state is y = (lam_nu, lam_t, u_nu, u_t), four numbers per node; the displacements of the body
follow from y. The forces and rates at an event are those of :mod:`.rates`.

Failure modes and answers
-------------------------
- Rounding errors of many events add: on every piece the state is solved for anew, from the places
  where nodes stick; these places are carried over without any change.
- Two events at one time: every condition that is met up to rounding when the piece ends is met.
- A node at the bound neither slips nor leaves the bound: the status of the node stays.
- F is so close to a critical value that slip hardly determines the state: the state that is solved
  for anew is another one, and the answer is called incomplete.
- The load does not act on a node, or stands still: rates that rounding alone makes are zero, for
  rounding would choose among several rates.
"""

from __future__ import annotations

import math
from itertools import product
from typing import Any, final

import numpy as np

from pwscont import InvalidInputError, enumerate_solutions
from pwscont.extending import (
    EPS,
    GUARD,
    Array,
    Evolver,
    Indices,
    Moment,
    Moments,
    Way,
    WaysOn,
    finite_array,
)
from pwscont_coulomb.condensed import Condensation
from pwscont_coulomb.modes import Mode
from pwscont_coulomb.quasi_static import nodes as node
from pwscont_coulomb.quasi_static.active import ActiveInverse, Flags
from pwscont_coulomb.quasi_static.problem import FrictionProblem
from pwscont_coulomb.quasi_static.rates import RateProblem, Rates
from pwscont_coulomb.quasi_static.uniqueness import ZERO

#: Most contact nodes of a body whose states at one time are all enumerated.
MOST_ENUMERATED = 6
#: Most contact nodes for which all modes are tried if rounding leaves the enumeration in doubt.
MOST_TRIED = 4
#: A given start is in equilibrium up to this part of typical forces.
GIVEN = 1e-8
#: A state that moves by a larger part when solved for anew is hardly determined.
MOVED = 1e-6
HARDLY = "the equations of slip hardly determine the state"
NO_CONTACT, STICK = int(Mode.NO_CONTACT), int(Mode.STICK)


@final
class CoulombEvolver(Evolver):
    """The evolver of :class:`pwscont_coulomb.QuasiStaticCoulomb`.

    Parameters
    ----------
    problem : FrictionProblem
    interval : tuple of float
    """

    def __init__(self, problem: FrictionProblem, interval: tuple[float, float]) -> None:
        self.problem, self.interval = problem, interval
        body, history = problem.body, problem.history
        self.p, self._gap, self._friction = body.p, body.gap, problem.friction
        self._condensation = Condensation(body.A, body.N, body.T)
        self._C: Array = self._condensation.flexibility
        self._free = self._condensation.solve(history.loads.T)
        self._at_loads = self._condensation.contact_displacements(self._free)
        #: Rates without contact forces on each line of the load; exactly zero where the load rests.
        self._free_slopes = self._rates_without_contact()
        self._absolute: Array = np.abs(self._C)
        self._inverse = ActiveInverse(self._C)
        scale = problem.restated(problem.slip).scale(*interval)
        self._length, self._force = float(scale[0]), float(scale[-1])

    def _rates_without_contact(self) -> Array:
        """Return the rates of the contact displacements on each line of the load, shape (2 p, k).

        By Cauchy and Schwarz the terms of a displacement are of the size (C_ii f.A^-1 f)^(1/2).
        """
        history = self.problem.history
        loads = np.diff(history.loads, axis=0).T
        moved = self._condensation.solve(loads)
        energies = np.maximum((loads * moved).sum(axis=0), 0.0)
        sizes = np.multiply.outer(np.sqrt(np.diag(self._C)), np.sqrt(energies))
        changes = self._condensation.contact_displacements(moved)
        slopes: Array = _without_rounding(changes, sizes) / np.diff(history.times)
        return slopes

    # -- what users see ---------------------------------------------------------------------

    def sizes(self) -> Array:
        """Return typical forces and displacements."""
        return np.repeat([self._force, self._length], 2 * self.p)

    def memory(self, z: Array, t: float) -> Array:
        """Return u_t."""
        return z[3 * self.p :].copy()

    def shown(self, z: Array, t: float) -> Array:
        """Return (u, lam_nu, lam_t)."""
        forces = z[: 2 * self.p]
        u = self._free @ self.problem.history.weights(t)
        u += self._condensation.by_forces(forces[np.newaxis])[0]
        return np.concatenate([u, forces])

    def names(self) -> tuple[str, ...]:
        """Return the names of the static law."""
        return self.problem.names

    # -- starts -----------------------------------------------------------------------------

    def starts(self, t: float, start: Any) -> Moments:
        """Return all states that the initial slip admits, or the given state."""
        if start is not None:
            return Moments((self._given(t, start),))
        return self._states(self.problem.slip, t)

    def elsewhere(self, moment: Moment) -> Moments:
        """Return the other states that the slip of a moment admits."""
        found = self._states(moment.memory, moment.t)
        near = ZERO * self.sizes()
        others = (m for m in found.moments if (np.abs(m.z - moment.z) > near).any())
        return Moments(tuple(others), found.complete, found.remark)

    def _given(self, t: float, start: Any) -> Moment:
        n, p = self.problem.body.n, self.p
        z = finite_array("start", start, (n + 2 * p,))
        forces = z[n:]
        rest = z[:n] - self.shown(np.append(forces, np.zeros(2 * p)), t)[:n]
        if (np.abs(rest) > GIVEN * self._length).any():
            raise InvalidInputError(f"start is no equilibrium under the load at t = {t:.10g}")
        y = self._contact(z)
        self._check_contact(y)
        return self._moment(y, t, (GIVEN * self._force, GIVEN * self._length))

    def _check_contact(self, y: Array) -> None:
        """Refuse a state that breaks the laws of contact or friction."""
        normal, tangential, u_nu, _ = y.reshape(4, -1)
        force, length = GIVEN * self._force, GIVEN * self._length
        apart = self._gap - u_nu
        wrong = [
            ("lies beyond the obstacle", apart < -length),
            ("pulls on the obstacle", normal > force),
            ("presses from afar", (apart > length) & (normal < -force)),
            (
                "exceeds the bound of friction",
                np.abs(tangential) > self._friction * np.abs(normal) + force,
            ),
        ]
        for what, where in wrong:
            if where.any():
                raise InvalidInputError(f"start: node {int(np.argmax(where)) + 1} {what}")

    def _moment(self, y: Array, t: float, slack: tuple[float, float]) -> Moment:
        status = node.statuses(y, self._friction, self._gap, slack)
        exact = self._exact(y, status)
        return Moment(t, exact, exact[3 * self.p :], _bytes(status))

    def _states(self, slip: Array, t: float) -> Moments:
        """Return all states in which nodes have slipped from some places, or say what is missing.

        States by rates are certain for most bodies; of few nodes all states can be enumerated, and
        of many nodes one state is found by other means.
        """
        states, remark = self._by_rates(slip, t)
        if not remark:
            return self._moments(states, t)
        few = self.p <= MOST_ENUMERATED
        return self._enumerated(slip, t, states) if few else self._from_one(slip, t)

    def _enumerated(self, slip: Array, t: float, states: list[Array]) -> Moments:
        """Return the states of few nodes, those that are known included."""
        found = enumerate_solutions(self.problem.restated(slip), t)
        every = [*(self._contact(s.z) for s in found), *states]
        if found.guarantee.startswith("complete") and "infinitely" not in found.guarantee:
            return self._moments(every, t)
        words = f"states at t = {t:.10g}: {found.guarantee}"
        return self._moments([*every, *self._tried(slip, t)], t, words)

    def _from_one(self, slip: Array, t: float) -> Moments:
        """Return the states of many nodes, beginning the search at a state without contact."""
        one = self._one_state(slip, t)
        if one is None:
            return self._moments([], t, f"no state at t = {t:.10g} was found")
        states, remark = self._by_rates(slip, t, one)
        if not remark:
            return self._moments(states, t)
        if not one[: 2 * self.p].any():
            found = self._moments([one], t).moments
            return Moments(found, origin="from the state without contact forces")
        return self._moments([one], t, f"other states at t = {t:.10g} are not excluded")

    def _moments(self, states: list[Array], t: float, remark: str = "") -> Moments:
        slack = ZERO * self._force, ZERO * self._length
        different = self._different(states)
        return Moments(tuple(self._moment(y, t, slack) for y in different), not remark, remark)

    def _by_rates(
        self, slip: Array, t: float, guess: Array | None = None
    ) -> tuple[list[Array], str]:
        """Return states, and in words what may be missing.

        The states are the rates of nodes that all touch without force, with displacements that
        count from gap and slip.

        Parameters
        ----------
        slip : ndarray, shape (p,)
        t : float
        guess : ndarray, shape (4 p,), optional
            A state at which the search begins.
        """
        self.forget()  # a resumed run repeats every bit
        held = np.concatenate([self._gap, slip])
        g = self._at_loads @ self.problem.history.weights(t)
        problem, which = self._problem(np.full(self.p, node.TOUCHES), g - held)
        modes = np.where((g - held)[: self.p] > 0.0, STICK, NO_CONTACT)
        if guess is not None:
            slack = ZERO * self._force, ZERO * self._length
            modes = node.KEPT[node.statuses(guess, self._friction, self._gap, slack)]
        found = problem.all_rates(dict(enumerate(modes[which].tolist())))
        states = []
        for rates in found.found:
            modes[which] = rates.modes
            states.append(self._clean(self._solved(modes, held, g), modes))
        return states, found.remark

    def _contact(self, z: Array) -> Array:
        """Return y of a state that users see."""
        body = self.problem.body
        u, forces = z[: body.n], z[body.n :]
        return np.concatenate([forces, body.N @ u, body.T @ u])

    def _tried(self, slip: Array, t: float) -> list[Array]:
        """Return the states of all modes of few nodes that hold to rounding, each once."""
        states: list[Array] = []
        held, g = (
            np.concatenate([self._gap, slip]),
            self._at_loads @ self.problem.history.weights(t),
        )
        for modes in product(range(4), repeat=self.p) if self.p <= MOST_TRIED else ():
            try:
                y = self._clean(self._solved(np.array(modes), held, g), np.array(modes))
            except np.linalg.LinAlgError:
                continue
            states += [y] if self._holds(y, np.array(modes), slip) else []
        return states

    def _different(self, states: list[Array]) -> list[Array]:
        """Return each state once."""
        near, found = ZERO * self.sizes(), list[Array]()
        for y in states:
            if not any((np.abs(y - other) <= near).all() for other in found):
                found.append(y)
        return found

    def _holds(self, y: Array, modes: Indices, slip: Array) -> bool:
        """Tell whether the inequalities of some modes hold up to rounding."""
        normal, tangential, u_nu, u_t = y.reshape(4, -1)
        force, length = ZERO * self._force, ZERO * self._length
        sign = np.select([modes == int(Mode.SLIP_PLUS), modes == int(Mode.SLIP_MINUS)], [1.0, -1.0])
        rests = np.abs(tangential) <= -self._friction * normal + force * (1.0 + self._friction)
        slips = sign * (u_t - slip) >= -length
        fits = (normal <= force) & (u_nu <= self._gap + length) & rests & slips
        return bool(fits.all())

    def _one_state(self, slip: Array, t: float) -> Array | None:
        """Return the state without force where this is a state, else one state by pivoting."""
        u = self._at_loads @ self.problem.history.weights(t)
        rest = np.concatenate([np.zeros(2 * self.p), u])
        if (u[: self.p] <= self._gap).all():
            return rest
        return self.problem.one_state(slip, t)

    def forget(self) -> None:
        """Forget the inverse, whose rounding depends on all events before."""
        self._inverse = ActiveInverse(self._C)

    # -- ways on ----------------------------------------------------------------------------

    def ways_on(self, moment: Moment) -> WaysOn:
        """Return all solutions of the rate problem, each up to the next event."""
        status = self._status(moment)
        slope = self._free_slopes[:, self.problem.history.leg(moment.t)]
        problem, which = self._problem(status, slope)
        guess = {k: int(node.KEPT[status[i]]) for k, i in enumerate(which.tolist())}
        found = problem.all_rates(guess)
        ways = tuple(self._way(moment, status, which, rates, slope) for rates in found.found)
        remark = found.remark or (HARDLY if any(self._moved(moment, way) for way in ways) else "")
        return WaysOn(ways, not remark, remark)

    def _moved(self, moment: Moment, way: Way) -> bool:
        """Tell whether a state that was solved for anew is another state."""
        apart = np.abs(way.z - moment.z) / (np.abs(moment.z) + self.sizes())
        return bool(apart.max(initial=0.0) > MOVED)

    def _status(self, moment: Moment) -> Indices:
        if moment.mode:
            return np.frombuffer(moment.mode, dtype=np.int8).astype(np.intp)
        slack = ZERO * self._force, ZERO * self._length
        return node.statuses(moment.z, self._friction, self._gap, slack)

    def _active(self, status: Indices) -> Flags:
        """Return which contact unknowns are held or may be held, shape (2 p,)."""
        normal = status != node.FREE
        tangential = normal & (status != node.GLIDES) & (self._friction > 0.0)
        return np.concatenate([normal, tangential])

    def _problem(self, status: Indices, slope: Array) -> tuple[RateProblem, Indices]:
        """Return the rate problem, and the nodes that have a choice."""
        active = self._active(status)
        K = self._inverse.at(active)
        open_, bound = np.flatnonzero(status == node.TOUCHES), np.flatnonzero(node.AT_BOUND[status])
        rubs = open_[self._friction[open_] > 0.0]
        columns = np.concatenate([open_, self.p + rubs, self.p + bound])
        rows = np.concatenate([columns, bound])
        which = np.concatenate([open_, bound])
        row = {int(r): k for k, r in enumerate(rows)}
        problem = RateProblem(
            K[np.ix_(rows, columns)],
            _without_rounding(K[rows] @ slope, np.abs(K[rows]) @ np.abs(slope)),
            self._friction[which],
            node.DIRECTION[status[which]],
            np.array([row[int(i)] for i in which], dtype=np.intp),
            np.array([row.get(self.p + int(i), -1) for i in which], dtype=np.intp),
        )
        return problem, which

    def _way(
        self, moment: Moment, status: Indices, which: Indices, rates: Rates, slope: Array
    ) -> Way:
        """Return the piece with some rates."""
        modes = np.where(status == node.FREE, NO_CONTACT, STICK)
        modes[which] = rates.modes
        rate = self._rate(status, modes, slope)
        z = self._anchor(moment, status, modes)
        after = self._after(status, modes, rate)
        until = self._until(moment.t, z, rate, after)
        return Way(node.label(self._said(modes, status)), z, rate, until, _bytes(after))

    def _said(self, modes: Indices, status: Indices) -> Indices:
        """Return the modes for the label; a node without friction in contact slips."""
        glides = (self._friction == 0.0) & (modes == STICK)
        return np.where(glides & ~self.problem.body.guided, int(Mode.SLIP_PLUS), modes)

    def _held(self, modes: Indices) -> Flags:
        """Return which contact unknowns have a force in some modes, shape (2 p,)."""
        touches = modes != NO_CONTACT
        return np.concatenate([touches, touches & (self._friction > 0.0)])

    def _solved(self, modes: Indices, held: Array, g: Array) -> Array:
        """Return y in some modes: forces and displacements that fulfil all equations.

        Parameters
        ----------
        modes : ndarray of int, shape (p,)
        held : ndarray, shape (2 p,)
            u_nu of nodes in contact, u_t of nodes that stick.
        g : ndarray, shape (2 p,)
            Displacements without contact forces.
        """
        p, F = self.p, self._friction
        slips = (modes != NO_CONTACT) & (modes != STICK) & (F > 0.0)
        sign = np.where(modes == int(Mode.SLIP_PLUS), 1.0, -1.0)
        active = self._held(modes)
        K, u = self._inverse.at(active), np.where(active, held, 0.0)
        at = np.flatnonzero(slips)
        u[p + at] = 0.0
        if len(at):
            mixed = sign[at, np.newaxis] * K[p + at] - F[at, np.newaxis] * K[at]
            right = -mixed @ np.where(active, u - g, 0.0)
            u[p + at] = np.linalg.solve(mixed[:, p + at], right)
        return self._completed(K @ np.where(active, u - g, 0.0), u, active, g)

    def _completed(self, forces: Array, u: Array, active: Flags, g: Array) -> Array:
        displaced = g + self._C @ forces
        return np.concatenate([forces, np.where(active, u, displaced)])

    def _rate(self, status: Indices, modes: Indices, slope: Array) -> Array:
        rate = self._solved(modes, np.zeros(2 * self.p), slope)
        forces, speeds = rate[: 2 * self.p], np.abs(slope)
        stiffness = np.abs(self._inverse.at(self._held(modes)))
        sizes = [stiffness @ (np.abs(rate[2 * self.p :]) + speeds)]
        sizes.append(speeds + self._absolute @ np.abs(forces))
        return self._clean(_without_rounding(rate, np.concatenate(sizes)), modes)

    def _anchor(self, moment: Moment, status: Indices, modes: Indices) -> Array:
        """Return the state of a moment, solved for anew with nodes held where they stick."""
        held = np.concatenate([self._gap, moment.z[3 * self.p :]])
        g = self._at_loads @ self.problem.history.weights(moment.t)
        return self._exact(self._clean(self._solved(modes, held, g), modes), status)

    def _clean(self, y: Array, modes: Indices) -> Array:
        """Return a state or rate with the equations of the modes fulfilled to the last bit."""
        normal, tangential, *_ = y.reshape(4, -1)
        away = modes == NO_CONTACT
        normal[away] = tangential[away] = 0.0
        for mode, s in ((Mode.SLIP_PLUS, 1.0), (Mode.SLIP_MINUS, -1.0)):
            slips = modes == int(mode)
            tangential[slips] = s * self._friction[slips] * normal[slips]
        tangential[self._friction == 0.0] = 0.0
        return y

    def _exact(self, y: Array, status: Indices) -> Array:
        """Return a state with the equations of the statuses fulfilled to the last bit."""
        exact = y.copy()
        normal, tangential, u_nu, _ = exact.reshape(4, -1)
        without = (status == node.FREE) | (status == node.TOUCHES)
        normal[without] = tangential[without] = 0.0
        touches = status != node.FREE
        u_nu[touches] = self._gap[touches]
        for bound, s in ((node.BOUND_PLUS, 1.0), (node.BOUND_MINUS, -1.0)):
            at = status == bound
            tangential[at] = s * self._friction[at] * normal[at]
        return exact

    def _after(self, status: Indices, modes: Indices, rate: Array) -> Indices:
        """Return the statuses just after the beginning of a piece."""
        after = status.copy()
        normal, tangential, u_nu, _ = rate.reshape(4, -1)
        F, force = self._friction, ZERO * float(np.abs(rate[: 2 * self.p]).max(initial=0.0))
        speed = ZERO * float(np.abs(rate[2 * self.p :]).max(initial=0.0))
        opened = status == node.TOUCHES
        after[opened & (modes == NO_CONTACT) & (u_nu < -speed)] = node.FREE
        pressed = opened & (modes != NO_CONTACT) & (normal < -force)
        after[pressed] = node.STICKS
        loose = -F * normal - np.abs(tangential) <= force
        after[pressed & loose & (tangential <= 0.0)] = node.BOUND_PLUS
        after[pressed & loose & (tangential > 0.0)] = node.BOUND_MINUS
        after[pressed & (F == 0.0)] = node.GLIDES
        for mode, bound in ((Mode.SLIP_PLUS, node.BOUND_PLUS), (Mode.SLIP_MINUS, node.BOUND_MINUS)):
            after[pressed & (modes == int(mode)) & (F > 0.0)] = bound
        held = node.AT_BOUND[status] & (modes == STICK)
        leaves = node.DIRECTION[status] * tangential - F * normal > force
        after[held & leaves] = node.STICKS
        return after

    # -- the next event ---------------------------------------------------------------------

    def _slacks(self, y: Array) -> Array:
        """Return what falls to zero at events: gap, -lam_nu, and both bounds, shape (4, p)."""
        normal, tangential, u_nu, _ = y.reshape(4, -1)
        bound = -self._friction * normal
        return np.stack([self._gap - u_nu, -normal, bound + tangential, bound - tangential])

    def _slopes(self, rate: Array) -> Array:
        normal, tangential, u_nu, _ = rate.reshape(4, -1)
        bound = -self._friction * normal
        return np.stack([-u_nu, -normal, bound + tangential, bound - tangential])

    def _watched(self, after: Indices) -> Flags:
        """Return which of the slacks belong to the statuses, shape (4, p)."""
        sticks = after == node.STICKS
        return np.stack([after == node.FREE, node.PRESSED[after], sticks, sticks])

    def _until(self, t: float, y: Array, rate: Array, after: Indices) -> float:
        """Return the time of the next event, or of the next corner of the load."""
        history = self.problem.history
        values, slopes = np.maximum(self._slacks(y), 0.0), self._slopes(rate)
        falling = self._watched(after) & (
            slopes < -ZERO * np.abs(slopes).max(axis=1, initial=0.0)[:, np.newaxis]
        )
        steps = np.full(values.shape, math.inf)
        np.divide(values, -slopes, out=steps, where=falling)
        return min(t + float(steps.min(initial=math.inf)), float(history.times[history.leg(t) + 1]))

    def reached(self, moment: Moment, way: Way, t: float) -> Moment:
        """Return the state on a way, with the status of nodes at which an event is."""
        status = np.frombuffer(way.mode, dtype=np.int8).astype(np.intp)
        y = way.z + (t - moment.t) * way.rate
        values, slopes = self._slacks(y), self._slopes(way.rate)
        sizes = np.array([self._length, self._force, self._force, self._force])
        rounding = ZERO * (t - moment.t) + GUARD * EPS * abs(t)  # of the time of the event
        slack = ZERO * sizes[:, np.newaxis] + rounding * np.abs(slopes)
        met = self._watched(status) & (values <= slack) & (slopes < 0.0)
        after = status.copy()
        after[met[2]], after[met[3]] = node.BOUND_PLUS, node.BOUND_MINUS
        after[met[0] | met[1]] = node.TOUCHES
        exact = self._exact(y, after)
        return Moment(t, exact, exact[3 * self.p :], _bytes(after))


def _without_rounding(rates: Array, sizes: Array) -> Array:
    """Return rates with zeros where the rest of the terms, of some sizes, is rounding."""
    return np.where(np.abs(rates) <= ZERO * sizes, 0.0, rates)


def _bytes(status: Indices) -> bytes:
    return status.astype(np.int8).tobytes()
