"""The base of systems written with switches: names, cells and hidden unknowns."""

from __future__ import annotations

from abc import abstractmethod
from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, final

import numpy as np

from pwscont import Character, InvalidInputError, PiecewiseSystem
from pwscont.extending import Array, HidesUnknowns, Indices, counted, generic
from pwscont.notation.layout import Layout

#: Number of points, for each alpha, at which the magnitudes of switches are measured.
SEEN = 4


@final
@dataclass(frozen=True, slots=True)
class Given:
    """What a user says of a system besides the function; see :func:`pwscont.Switched`."""

    names: tuple[str, ...] | None = None
    switches: tuple[str, ...] | None = None
    degree: int | None = None
    unique: bool = False
    bounds: tuple[Any, Any] | None = None
    periods: Any = None
    scale: Any = None


class Notated(PiecewiseSystem, HidesUnknowns):
    """A system written with switches.

    The unknowns are the user's, then the values of the switches that need an unknown (docs/theory,
    F15).

    Attributes
    ----------
    size, shown : int
        The number of all unknowns, and of the user's.
    switches : tuple of str
        The names of the switches, in the order in which the function calls them.
    """

    def __init__(
        self, shown: int, layout: Layout, hidden: Indices, given: Given, own_names: dict[int, int]
    ) -> None:
        self.shown, self.size = shown, shown + len(hidden)
        self._layout, self._hidden, self._given = layout, hidden, given
        self._names = _unknowns(given.names, shown)
        self.switches = _switches(given.switches, layout, self._names, own_names)
        self.degree, self.unique = given.degree, given.unique

    @abstractmethod
    def values_of_switches(self, z: Array, alpha: float) -> Array:
        """Return the value of each switch from the user's unknowns."""

    def with_hidden(self, z: Array, alpha: float) -> Array:
        """Return the user's unknowns, then the unknowns of hidden switches, shape (size,)."""
        if not len(self._hidden):
            return z
        return np.concatenate([z, self.values_of_switches(z, alpha)[self._hidden]])

    # -- cells ---------------------------------------------------------------------------

    def bounding_tests(self, character: Character) -> list[int]:
        """Return the tests that bound a cell: of a clip only the tests that bound the mode."""
        found: list[int] = np.flatnonzero(self._layout.bounding(character)).tolist()
        return found

    def cell(self, character: Character) -> bytes:
        """Return a key of a cell: a byte for each test, 0 if the test does not bound the cell."""
        signs = character.array.view(np.uint8) + np.uint8(1)
        return (signs * self._layout.bounding(character)).tobytes()

    def cells(self) -> Iterator[Character]:
        """Yield one character for every combination of the modes of the switches."""
        yield from self._layout.cells()

    # -- the user's numbers ----------------------------------------------------------------

    def bounds(self) -> tuple[Any, Any]:
        """Return the bounds that the user gave, infinite for the unknowns of switches."""
        if self._given.bounds is None:
            return super().bounds()
        lower, upper = self._given.bounds
        return self._padded("bounds", lower, -np.inf), self._padded("bounds", upper, np.inf)

    def periods(self) -> Any:
        """Return the periods that the user gave, infinite for the unknowns of switches."""
        if self._given.periods is None:
            return super().periods()
        return self._padded("periods", self._given.periods, np.inf)

    @property
    def gives_scale(self) -> bool:
        """Whether typical magnitudes are known, from the user or from a run."""
        measured = bool((super().scale(0.0, 0.0) != 1.0).any())
        return self._given.scale is not None or measured

    def scale(self, lo: float, hi: float) -> Array:
        """Return the magnitudes that the user gave, and measured magnitudes for switches."""
        if self._given.scale is None:
            return super().scale(lo, hi)
        shown = self._padded("scale", self._given.scale, 1.0)[: self.shown]
        return self._with_sizes_of_switches(shown, (lo, hi))

    @np.errstate(all="ignore")
    def _with_sizes_of_switches(self, shown: Array, alphas: Sequence[float]) -> Array:
        """Return the magnitudes of all unknowns; hidden switches are measured at a few points."""
        if not len(self._hidden):
            return shown
        signs = [generic(self.shown, shift) for shift in range(SEEN)]
        seen = [self.with_hidden(shown * sign, a) for sign in signs for a in alphas]
        sizes = np.abs(np.where(np.isfinite(seen), seen, 0.0)).max(axis=0)[self.shown :]
        return np.append(shown, np.where(sizes > 0.0, sizes, 1.0))

    def _padded(self, name: str, values: Any, rest: float) -> Array:
        try:
            known = np.broadcast_to(np.asarray(values, dtype=float), (self.shown,))
        except (TypeError, ValueError) as error:
            raise InvalidInputError(
                f"{name} must be numbers that broadcast to shape ({self.shown},), got {values!r}"
            ) from error
        return np.append(known, np.full(self.size - self.shown, rest))

    # -- words -------------------------------------------------------------------------------

    def names(self) -> tuple[str, ...]:
        """Return the names of the user's unknowns."""
        return self._names

    def test_name(self, test: int) -> str:
        """Return a name such as ``the kink of D3``."""
        return f"the kink of {self.switches[self._layout.switch_of[test]]}"

    def describe(self, character: Character) -> str:
        """Return the mode of every switch, such as ``D1 on, D2 off``."""
        return ", ".join(f"{name} {mode}" for name, mode in self._modes(character))

    def label(self, character: Character) -> str:
        """Return the switches in each mode, such as ``on: D1, D3; off: D2``."""
        groups: dict[str, list[str]] = defaultdict(list)
        for name, mode in self._modes(character):
            groups[mode].append(name)
        return "; ".join(f"{mode}: {', '.join(groups[mode])}" for mode in sorted(groups))

    def _modes(self, character: Character) -> Iterator[tuple[str, str]]:
        modes = self._layout.modes(character.array)
        for name, operation, mode in zip(
            self.switches, self._layout.operations, modes, strict=True
        ):
            yield name, operation.modes[mode]

    def describe_transition(self, before: Character, after: Character) -> str:
        """Return what the switches do, such as ``D3 turns on``."""
        old, new = (self._layout.modes(each.array) for each in (before, after))
        words = [
            f"{self.switches[i]} {self._layout.operations[i].changes[int(old[i]), int(new[i])]}"
            for i in np.flatnonzero(old != new)
        ]
        return ", ".join(words)

    def __repr__(self) -> str:
        switches = "switch" if self._layout.count == 1 else "switches"
        what = f"{counted(self.shown, 'unknown')}, {self._layout.count} {switches}"
        return f"{type(self).__name__}({what})"


def _unknowns(names: Sequence[str] | None, size: int) -> tuple[str, ...]:
    """Return the names of the user's unknowns."""
    if names is None:
        return tuple(f"z[{i}]" for i in range(size))
    if len(names) != size:
        raise InvalidInputError(f"names must be {size} texts, got {len(names)}")
    return tuple(names)


def _switches(
    given: Sequence[str] | None, layout: Layout, names: Sequence[str], own_names: dict[int, int]
) -> tuple[str, ...]:
    """Return a name for every switch: as given, or the unknown's name, or operation and number."""
    if given is None:
        return tuple(_default_names(layout, names, own_names))
    if len(given) == layout.count:
        return tuple(given)
    if len(given) == len(layout.calls):
        each = zip(given, layout.calls, strict=True)
        return tuple(_of_entry(name, i, call.size) for name, call in each for i in range(call.size))
    raise InvalidInputError(
        f"switches must be {layout.count} names, one for each switch, or {len(layout.calls)}, one "
        f"for each call of sw; got {len(given)}"
    )


def _of_entry(name: str, entry: int, size: int) -> str:
    return name if size == 1 else f"{name}[{entry}]"


def _default_names(layout: Layout, names: Sequence[str], own: dict[int, int]) -> Iterator[str]:
    """Yield for each switch the name of the unknown with that value; else operation and number."""
    numbers: dict[str, int] = defaultdict(int)
    for switch, operation in enumerate(layout.operations):
        numbers[operation.name] += 1
        known = switch in own
        yield names[own[switch]] if known else f"{operation.name} {numbers[operation.name]}"
