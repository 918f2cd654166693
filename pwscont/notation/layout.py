"""Kinds of switches, and the switches of a user's function.

All tests stand in a vector, call by call of ``sw``; all branches stand in another vector in the
same order. A *switch* is an entry of a call.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise, product
from typing import Any, final

import numpy as np

from pwscont import Character
from pwscont.extending import Array, Indices, Signs


@final
@dataclass(frozen=True, slots=True, eq=False)
class Operation:
    """A kind of switch with k tests, whose value is branch j if j of the tests are not negative.

    Attributes
    ----------
    name : str
    modes : tuple of str, length k + 1
        The name of each mode.
    changes : dict of (int, int) to str
        The change of the switch from the first mode to the second, in words.
    sides : tuple of int, length k + 1
        For each branch +1 if the value of the switch is never below the branch, -1 if never above,
        in any mode; else 0.
    """

    name: str
    modes: tuple[str, ...]
    changes: dict[tuple[int, int], str]
    sides: tuple[int, ...]

    def __reduce__(self) -> str:
        """Return the name by which a pickle finds this operation, compared by identity."""
        return next(name for name, value in globals().items() if value is self)


def _there_and_back(forth: str, back: str) -> dict[tuple[int, int], str]:
    return {(0, 1): forth, (1, 0): back}


_FIRST, _SECOND = "takes its first argument", "takes its second argument"
MAX = Operation("max", ("second", "first"), _there_and_back(_FIRST, _SECOND), (1, 1))
MIN = Operation("min", ("first", "second"), _there_and_back(_SECOND, _FIRST), (-1, -1))
ABS = Operation(
    "abs", ("negative", "positive"), _there_and_back("becomes positive", "becomes negative"), (1, 1)
)
RELU = Operation("relu", ("off", "on"), _there_and_back("turns on", "turns off"), (1, 1))
WHERE = Operation("where", ABS.modes, ABS.changes, (0, 0))
LOWER = Operation(
    "clip",
    ("at its lower bound", "above its lower bound"),
    _there_and_back("leaves its lower bound", "reaches its lower bound"),
    (1, 1),
)
UPPER = Operation(
    "clip",
    ("below its upper bound", "at its upper bound"),
    _there_and_back("reaches its upper bound", "leaves its upper bound"),
    (-1, -1),
)
CLIP = Operation(
    "clip",
    ("at its lower bound", "between its bounds", "at its upper bound"),
    {
        (0, 1): "leaves its lower bound",
        (1, 0): "reaches its lower bound",
        (1, 2): "reaches its upper bound",
        (2, 1): "leaves its upper bound",
        (0, 2): "goes from its lower to its upper bound",
        (2, 0): "goes from its upper to its lower bound",
    },
    (1, 0, -1),
)


@final
@dataclass(frozen=True)
class Call:
    """A call of a method of ``sw``."""

    operation: Operation
    shape: tuple[int, ...]

    @property
    def size(self) -> int:
        """The number of entries, each a switch."""
        return int(np.prod(self.shape, dtype=int))

    def __str__(self) -> str:
        entries = f" of shape {self.shape}" if self.shape else ""
        return f"sw.{self.operation.name}{entries}"


@final
class Layout:
    """The switches of a function, in the order of the calls.

    Attributes
    ----------
    calls : sequence of Call
        Each once: a call that repeats the arguments of an earlier call is the same call.
    numbers : tuple of int
        The number in ``calls`` of every call that the function makes.
    forms : sequence of ndarray
        For each clip of the function, the kind of bounds of each entry.
    tests : list of ndarray of int
        The places of the tests of every switch among all tests.
    branches : ndarray of int, shape (number of switches, most modes)
        The places of the branches of every switch among all branches; a switch with fewer modes
        repeats the last place.
    """

    def __init__(
        self,
        made: Sequence[Call],
        forms: Sequence[Any],
        same: Sequence[int] | None = None,
        sizes: Sequence[float] = (),
    ) -> None:
        firsts = list(range(len(made))) if same is None else list(same)
        places = {first: number for number, first in enumerate(dict.fromkeys(firsts))}
        self.numbers = tuple(places[first] for first in firsts)
        #: The usual size of the arguments of every call, where calls may be repeated.
        self.sizes = sizes
        self.calls, self.forms = tuple(made[first] for first in places), tuple(forms)
        first = np.cumsum([0, *(call.size for call in self.calls)])
        #: The numbers of the switches of each call.
        self.slices = [slice(*ends) for ends in pairwise(first.tolist())]
        self.count = int(first[-1])
        self.operations = [call.operation for call in self.calls for _ in range(call.size)]
        self.most_modes = max((len(call.operation.modes) for call in self.calls), default=1)
        self.first_tests, self.last_tests = self._tests()
        self.branches = self._branches()
        #: The switches with two tests.
        self.three = np.flatnonzero(self.first_tests != self.last_tests)

    @property
    def number_of_tests(self) -> int:
        """The length of the vector of tests."""
        return self.count + len(self.three)

    def has(self, number: int, operation: Operation, shape: tuple[int, ...]) -> bool:
        """Tell whether call ``number`` of the function has this operation and shape."""
        if number >= len(self.numbers):
            return False
        call = self.calls[self.numbers[number]]
        return call.operation is operation and call.shape == shape

    def _offsets(self, more: int) -> list[Indices]:
        """Return the places of the tests (more = -1) or branches (more = 0) of each call."""
        places, start = [], 0
        for call in self.calls:
            parts = len(call.operation.modes) + more
            places.append(start + np.arange(parts * call.size).reshape(parts, call.size))
            start += parts * call.size
        return places

    def _tests(self) -> tuple[Indices, Indices]:
        places = self._offsets(-1)
        if not places:
            return np.zeros(0, dtype=np.intp), np.zeros(0, dtype=np.intp)
        return np.concatenate([p[0] for p in places]), np.concatenate([p[-1] for p in places])

    def _branches(self) -> Indices:
        parts = self._offsets(0)
        columns = [p[np.minimum(np.arange(self.most_modes), len(p) - 1)].T for p in parts]
        return np.vstack(columns) if columns else np.zeros((0, 1), dtype=np.intp)

    def tests_of(self, switch: int) -> tuple[int, ...]:
        """Return the places of the tests of a switch."""
        return tuple(dict.fromkeys((int(self.first_tests[switch]), int(self.last_tests[switch]))))

    @cached_property
    def switch_of(self) -> Indices:
        """The number of the switch that each test belongs to, shape (m,)."""
        owners = np.empty(self.number_of_tests, dtype=np.intp)
        owners[self.first_tests] = owners[self.last_tests] = np.arange(self.count)
        return owners

    def modes(self, signs: Signs) -> Indices:
        """Return the mode of every switch, the number of True signs of tests."""
        modes: Indices = signs[self.first_tests].astype(np.intp)
        if len(self.three):
            modes[self.three] += signs[self.last_tests[self.three]]
        return modes

    def bounding(self, character: Character) -> Signs:
        """Tell which tests bound a cell; at a lower bound the upper bound's test does not."""
        bounding = np.ones(self.number_of_tests, dtype=bool)
        if len(self.three):
            modes = self.modes(character.array)[self.three]
            bounding[self.last_tests[self.three[modes == 0]]] = False
            bounding[self.first_tests[self.three[modes == 2]]] = False
        return bounding

    def signs(self, switch: int) -> tuple[tuple[bool, ...], ...]:
        """Return the signs of the tests of a switch in each mode."""
        tests = len(self.operations[switch].modes) - 1
        return tuple(tuple(i < mode for i in range(tests)) for mode in range(tests + 1))

    def cells(self) -> Any:
        """Yield a character for every combination of modes."""
        for combination in product(*(self.signs(switch) for switch in range(self.count))):
            signs = np.zeros(self.number_of_tests, dtype=bool)
            for switch, mine in enumerate(combination):
                signs[list(self.tests_of(switch))] = mine
            yield Character(signs)

    def values(self, branches: Array, modes: Indices) -> Array:
        """Return the values of all switches, shape (count,), from branches and modes."""
        values: Array = branches[self.branches[np.arange(self.count), modes]]
        return values
