"""The power flow equations as a piecewise-smooth system, the loading being the parameter.

At bus i the power that the network takes equals the injected power,

    V_i exp(i theta_i) conj(sum_k Y_ik V_k exp(i theta_k)) = S_i + j Q_i,

with S = fixed + loading growing, and Q_i at generators only. A generator holds the voltage V_set
until the reactive power meets a limit; then the voltage falls below V_set (at Q_max) or rises above
V_set (at Q_min): Q is the median of Q_min, Q_max and Q - r (V - V_set), for any r > 0. The last
rows are, per generator,

===========  ==================  ==========================================
mode         row                 where
===========  ==================  ==========================================
at Q min     Q - Q_min           Q - r (V - V_set) <= Q_min
voltage held r (V - V_set)       between
at Q max     Q - Q_max           Q - r (V - V_set) >= Q_max
===========  ==================  ==========================================

which agree on the interfaces. r, which only scales, is the generator's short-circuit admittance.
"""

from __future__ import annotations

from collections.abc import Iterator
from copy import copy
from itertools import product
from typing import Any, TypeAlias, final

import numpy as np
import scipy.sparse as sp

from pwscont import Character, InvalidInputError, MultiStart, PiecewiseSystem
from pwscont.extending import (
    Array,
    BringsSearches,
    Matrix,
    checked_kind,
    checked_magnitudes,
    finite_array,
)
from pwscont_power.network import Generator, Network, one_each
from pwscont_power.pattern import Pattern
from pwscont_power.slopes import Slopes

#: Smallest voltage of the model, per unit: at V = 0, the end of every model of a load of constant
#: power, the angle means nothing, and any angle is a solution.
LOWEST = 1e-3
#: True or false for each generator.
Flags: TypeAlias = np.ndarray[Any, np.dtype[np.bool_]]
HELD = "voltage held"
#: (mode before, mode after) of a generator -> the transition in words.
CHANGES = {
    (HELD, "at Q max"): "reaches Q max",
    (HELD, "at Q min"): "reaches Q min",
    ("at Q max", HELD): "leaves Q max",
    ("at Q min", HELD): "leaves Q min",
}


@final
class PowerFlow(PiecewiseSystem, BringsSearches):
    """AC power flow of a network whose injections grow with the loading.

    Unknowns are the angles theta and the voltages V of all buses except the slack, and the reactive
    powers Q of all generators except at the slack, per unit and in radians, named by the numbers of
    the buses: ``theta3``, ``V3``, ``Q2``. Angles have the period 2 pi. A branch on which a voltage
    falls to 0.001 ends there: at V = 0 the model ends, with no meaning for the angle.

    Parameters
    ----------
    network : Network
    growing : array_like of complex, shape (buses,), optional
        Injections that are multiplied by the loading; default generation minus load of the network.
    fixed : array_like of complex, shape (buses,), optional
        Injections that do not depend on the loading; default none.
    scale : array_like, optional
        Typical magnitudes of all unknowns, in the order of ``names``. Default: 1 for angles and
        voltages, the largest injection for reactive powers.

    Raises
    ------
    InvalidInputError
        If the shapes do not fit, magnitudes are not positive, or a part of the network is not
        connected to the slack.

    Examples
    --------
    >>> from pwscont import trace
    >>> from pwscont_power import Branch, Generator, Network, PowerFlow
    >>> line = (Branch(1, 2, 0.0, 0.5),)
    >>> network = Network((1, 2), line, (Generator(1, 1.0),), slack=1, load=[0, 1.0])
    >>> graph = trace(PowerFlow(network), ([0.0, 1.0], 0.1), (0.1, 2.0), parameter="lambda")
    >>> [round(p.alpha, 6) for p in graph.special_points("fold")]  # 1 / (2 x)
    [1.0]
    """

    def __init__(
        self, network: Network, growing: Any = None, fixed: Any = 0.0, *, scale: Any = None
    ) -> None:
        checked_kind("network", network, Network, is_needed=True)
        if growing is None:
            growing = network.generation - network.load
        self.network = network
        self._growing = one_each("growing", growing, len(network.buses))
        self._fixed = one_each("fixed", fixed, len(network.buses))
        self._Y = network.admittance
        _check_connected(network, self._Y)
        slack = int(network.places([network.slack])[0])
        held = {generator.bus: generator for generator in network.generators}
        self._slack_voltage = held.pop(network.slack).V
        self._generators = tuple(held.values())
        self._at = network.places(list(held))
        self._others = np.delete(np.arange(len(network.buses)), slack)
        self._set = np.array([generator.V for generator in self._generators])
        self._r = np.abs(self._Y.diagonal()[self._at])
        self._n, self._g = len(self._others), len(self._at)
        self.size = 2 * self._n + self._g
        self._scale = checked_magnitudes(scale, self.size)
        self._voltage_columns = self._n + np.searchsorted(self._others, self._at)
        self._Q_columns = 2 * self._n + np.arange(self._g)
        self._slopes = Slopes(self._Y, self._others)
        self._pattern, self._constant = self._jacobian_pattern()
        self._limit(self._generators)

    def _limit(self, generators: tuple[Generator, ...]) -> None:
        """Take the reactive limits of generators."""
        limits = [g.Q_min for g in generators] + [g.Q_max for g in generators]
        self._finite = np.isfinite(limits)
        self._limits = np.where(self._finite, limits, 0.0)
        #: The tests of limits at infinity.
        self._beyond = np.repeat([1.0, -1.0], len(generators))
        self._gradients = self._test_gradients()

    def with_limits(self, bus: int, Q_min: float, Q_max: float) -> PowerFlow:
        """Return the power flow with other reactive limits at a bus, at little cost.

        Raises
        ------
        InvalidInputError
            As for :meth:`Network.with_limits`.
        """
        changed = copy(self)
        changed.network = self.network.with_limits(bus, Q_min, Q_max)
        held = {generator.bus: generator for generator in changed.network.generators}
        changed._generators = tuple(held[generator.bus] for generator in self._generators)
        changed._limit(changed._generators)
        return changed

    # -- states --------------------------------------------------------------------------

    def _split(self, z: Array) -> tuple[Array, Array]:
        """Return the complex voltages of all buses, and exp(i theta)."""
        unit = np.ones(len(self.network.buses), dtype=complex)
        unit[self._others] = np.exp(1j * z[: self._n])
        size = np.full(len(unit), self._slack_voltage)
        size[self._others] = z[self._n : 2 * self._n]
        return size * unit, unit

    def voltages(self, z: Any) -> Array:
        """Return the complex voltages of all buses, shape (buses,), in the order of the network."""
        return self._split(finite_array("z", z, (self.size,)))[0]

    def start(self) -> Array:
        """Return a state to start from, shape (n,), near the upper branch of most networks.

        Generators hold the given voltages, and all other buses have the voltages of the network
        without load; reactive powers are zero, or at the limit next to zero.
        """
        z = np.zeros(self.size)
        voltage = self._without_load()[self._others]
        z[: self._n], z[self._n : 2 * self._n] = np.angle(voltage), np.abs(voltage)
        z[self._Q_columns] = [min(max(0.0, g.Q_min), g.Q_max) for g in self._generators]
        return z

    def _without_load(self) -> Array:
        """Return the voltages at which no current flows into buses without a generator."""
        voltage = np.full(len(self.network.buses), self._slack_voltage, dtype=complex)
        voltage[self._at] = self._set
        free = np.setdiff1d(self._others, self._at)
        Y = self._Y[free]
        voltage[free] = 0.0
        try:
            voltage[free] = sp.linalg.splu(Y[:, free].tocsc()).solve(-Y @ voltage)
        except RuntimeError:  # the matrix is singular: a resonance
            voltage[free] = self._slack_voltage
        return voltage

    def searches(self) -> list[MultiStart]:
        """Return Newton from :meth:`start`."""
        return [MultiStart(count=1, around=(tuple(self.start().tolist()),))]

    # -- the contract --------------------------------------------------------------------

    def test_functions(self, z: Array, alpha: float) -> Array:
        """Return for each generator Q - r (V - V_set) - Q_min, then the same with Q_max."""
        Q = z[2 * self._n :] - self._r * self._too_high(z)
        tests: Array = np.where(self._finite, np.concatenate([Q, Q]) - self._limits, self._beyond)
        return tests

    def _too_high(self, z: Array) -> Array:
        excess: Array = z[self._voltage_columns] - self._set
        return excess

    def _modes(self, character: Character) -> tuple[Flags, Flags]:
        """Return which generators are at Q min, and which at Q max."""
        above = character.array
        return ~(above[: self._g] | above[self._g :]), above[self._g :]

    def residual(self, z: Array, alpha: float, character: Character) -> Array:
        """Return the mismatches of active, then of reactive power, then the rows of generators."""
        voltage, Q = self._split(z)[0], z[2 * self._n :]
        power = voltage * (self._Y @ voltage).conj() - self._fixed - alpha * self._growing
        power[self._at] -= 1j * Q
        mismatch = power[self._others]
        at_low, at_high = self._modes(character)
        rows = self._r * self._too_high(z)
        rows = np.where(at_low, Q - self._limits[: self._g], rows)
        rows = np.where(at_high, Q - self._limits[self._g :], rows)
        return np.concatenate([mismatch.real, mismatch.imag, rows])

    def jacobian(self, z: Array, alpha: float, character: Character) -> Matrix:
        """Return the exact derivatives, sparse in large networks."""
        limited = np.logical_or(*self._modes(character))
        rows = np.where(limited, 0.0, self._r), np.where(limited, 1.0, 0.0)
        return self._pattern.filled(
            np.concatenate([self._slopes(*self._split(z)), self._constant, *rows])
        )

    def _jacobian_pattern(self) -> tuple[Pattern, Array]:
        """Return the places of all derivatives, and the constant derivatives of the mismatches."""
        rows, columns = self._slopes.places
        growing = self._growing[self._others]
        loading = np.concatenate([growing.real, growing.imag])
        last = np.full(2 * self._n, self.size)
        all_rows = [rows, self._voltage_columns, np.arange(2 * self._n), *2 * [self._Q_columns]]
        all_columns = [columns, self._Q_columns, last, self._voltage_columns, self._Q_columns]
        pattern = Pattern(
            np.concatenate(all_rows), np.concatenate(all_columns), (self.size, self.size + 1)
        )
        return pattern, -np.concatenate([np.ones(self._g), loading])

    def test_jacobian(self, z: Array, alpha: float) -> Matrix:
        """Return the gradients of the tests, which are constant; zero for limits at infinity."""
        return self._gradients.copy()

    def _test_gradients(self) -> Matrix:
        finite = self._finite * 1.0
        tests = np.arange(2 * self._g)
        columns = [*2 * [self._Q_columns], *2 * [self._voltage_columns]]
        pattern = Pattern(np.tile(tests, 2), np.concatenate(columns), (2 * self._g, self.size + 1))
        return pattern.filled(np.concatenate([finite, -finite * np.tile(self._r, 2)]))

    def bounding_tests(self, character: Character) -> list[int]:
        """Return the two tests of each generator within limits, the single test of a limit met."""
        at_low, at_high = self._modes(character)
        bounds = np.concatenate([~at_high, ~at_low]) & self._finite
        found: list[int] = np.flatnonzero(bounds).tolist()
        return found

    def cells(self) -> Iterator[Character]:
        """Yield the characters of all combinations of the modes of generators."""
        for modes in product(*map(self._possible, range(self._g))):
            yield Character(tuple(np.transpose(modes).ravel().tolist()))

    def _possible(self, i: int) -> list[tuple[bool, bool]]:
        """Return the signs of a generator's tests in all modes, except at infinite limits."""
        low, high = self._finite[[i, self._g + i]].tolist()
        return [(False, False)] * low + [(True, False)] + [(True, True)] * high

    def bounds(self) -> tuple[Array, float]:
        """Return lower bounds of the voltages, below which angles would have no meaning."""
        lower = np.full(self.size, -np.inf)
        lower[self._n : 2 * self._n] = LOWEST
        return lower, np.inf

    def periods(self) -> Array:
        """Return 2 pi for angles."""
        return np.where(np.arange(self.size) < self._n, 2.0 * np.pi, np.inf)

    @property
    def gives_scale(self) -> bool:
        """Whether the typical magnitudes are known: always, per unit."""
        return True

    def scale(self, lo: float, hi: float) -> Array:
        """Return the given magnitudes, or the magnitudes of quantities per unit.

        Angles, in radians, and voltages, in units of the voltages that generators hold, are
        typically 1. Reactive powers are as large as the largest injection.
        """
        if self._scale is not None:
            return self._scale
        sizes = np.ones(self.size)
        injections = np.abs(self._growing) * max(abs(lo), abs(hi)) + np.abs(self._fixed)
        sizes[2 * self._n :] = injections.max(initial=0.0) or 1.0
        return sizes

    # -- in words ------------------------------------------------------------------------

    def names(self) -> tuple[str, ...]:
        """Return theta, V and Q with the numbers of the buses."""
        buses = [self.network.buses[i] for i in self._others]
        angles, sizes = ([f"{letter}{bus}" for bus in buses] for letter in ("theta", "V"))
        return (*angles, *sizes, *(f"Q{generator.bus}" for generator in self._generators))

    def _words(self, character: Character) -> list[str]:
        at_low, at_high = self._modes(character)
        return np.where(at_high, "at Q max", np.where(at_low, "at Q min", HELD)).tolist()

    def describe(self, character: Character) -> str:
        """Return the mode of every generator, such as ``G2 at Q max, G3 voltage held``."""
        modes = zip(self._generators, self._words(character), strict=True)
        return ", ".join(f"G{generator.bus} {mode}" for generator, mode in modes)

    def label(self, character: Character) -> str:
        """Return the generators at limits, such as ``G2, G3 at Q max``."""
        groups = (self._at_limit(character, mode) for mode in ("at Q min", "at Q max"))
        return "; ".join(filter(None, groups)) or "all voltages held"

    def _at_limit(self, character: Character, mode: str) -> str:
        words = zip(self._generators, self._words(character), strict=True)
        found = [f"G{generator.bus}" for generator, its_mode in words if its_mode == mode]
        return f"{', '.join(found)} {mode}" if found else ""

    def describe_transition(self, before: Character, after: Character) -> str:
        """Return which generators meet or leave a limit, such as ``G2 reaches Q max``."""
        changes = zip(self._generators, self._words(before), self._words(after), strict=True)
        return ", ".join(
            f"G{generator.bus} {CHANGES.get((old, new), f'goes from {old} to {new}')}"
            for generator, old, new in changes
            if old != new
        )

    def test_name(self, test: int) -> str:
        """Return such as ``Q max of G2``."""
        which, i = divmod(test, self._g)
        return f"{('Q min', 'Q max')[which]} of G{self._generators[i].bus}"


def _check_connected(network: Network, Y: sp.csr_array) -> None:
    parts, part = sp.csgraph.connected_components(abs(Y), directed=False)
    apart = np.flatnonzero(part != part[network.places([network.slack])[0]])
    if parts > 1:
        raise InvalidInputError(
            f"bus {network.buses[apart[0]]} is not connected to the slack, bus {network.slack}; "
            "leave out the buses of the other island"
        )
