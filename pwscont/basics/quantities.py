"""Quantities of a state by name: the state's unknowns, and what a user records."""

from __future__ import annotations

import unicodedata
from collections.abc import Callable, Iterable, Mapping, Sequence
from difflib import get_close_matches
from functools import cached_property
from math import isfinite
from numbers import Real
from types import MappingProxyType
from typing import Any, final

import numpy as np

from pwscont.basics.arrays import Array
from pwscont.basics.errors import InvalidInputError, InvalidSystemError, UnknownNameError
from pwscont.basics.printing import UNNAMED, state

Function = Callable[[Array, float], float]
Naming = Callable[[], Iterable[str]] | Sequence[str] | None

#: Names with another meaning in data frames, JSON or networkx: no recorded quantity has such a
#: name.
TAKEN = frozenset(
    {"alpha", "character", "component", "det_sign", "digits", "end", "error", "id", "kind", "label"}
    | {"message", "name", "piece", "points", "start", "z"}
)
#: Most names that a message lists.
MOST_NAMES = 12
ONLY_SPECIAL = (
    "the file of this graph has {0!r} at special points only; for other states give its function: "
    "BranchGraph.load(..., record={{{0!r}: ...}})"
)
CONDITION = "; a condition such as z[0] > 0.5 is no number, z[0] - 0.5 is one"


def spelled(name: str) -> str:
    """Return a name with Greek letters in words.

    Examples
    --------
    >>> from pwscont.extending import spelled
    >>> spelled("λ_t")
    'lambda_t'
    """
    letters = list(name)
    for i, letter in enumerate(letters):
        kind, _, word = unicodedata.name(letter, "").rpartition(" LETTER ")
        if kind in ("GREEK SMALL", "GREEK CAPITAL") and " " not in word:
            word = word.replace("LAMDA", "LAMBDA").lower()
            letters[i] = word.capitalize() if kind == "GREEK CAPITAL" else word
    return "".join(letters)


def as_written(name: str, known: Iterable[str]) -> str:
    """Return the known name that is meant: the same name, or the name with Greek letters.

    Examples
    --------
    >>> from pwscont.extending import as_written
    >>> as_written("lambda_t", ["u_t", "λ_t"])
    'λ_t'
    """
    names = list(known)
    meant = [other for other in names if spelled(other) == spelled(name)]
    return name if name in names or len(meant) != 1 else meant[0]


def checked_record(record: Any, names: Iterable[str] = ()) -> Mapping[str, Function]:
    """Return the functions of (z, alpha) that a user records by name, or refuse a misfit."""
    if record is None:
        return {}
    if not isinstance(record, Mapping):
        raise InvalidInputError(f"record must map names to functions of (z, alpha), got {record!r}")
    taken = TAKEN.union(names)
    for name, function in record.items():
        if not isinstance(name, str) or not name:
            raise InvalidInputError(f"record: names are texts that are not empty, got {name!r}")
        if name in taken:
            raise InvalidInputError(f"record: the name {name!r} is taken; choose another one")
        if not callable(function):
            raise InvalidInputError(f"record {name!r} must be a function of (z, alpha)")
    return dict(record)


def checked_names(names: tuple[str, ...], size: int) -> tuple[str, ...]:
    """Return the names of all unknowns, or raise an error that names the fault."""
    if len(names) != size:
        words = f"must return {size} names, one for each unknown, got {len(names)}"
        raise InvalidSystemError(f"names() {words}")
    if not all(isinstance(name, str) for name in names):
        raise InvalidSystemError("names() must return texts")
    return names


@final
class Quantities:
    """The names of the unknowns of a system, and the quantities that a user records.

    ``naming``: a name for each unknown, or a function that returns the names, called at first use.
    ``record``: functions of (z, alpha) that return a finite float, by name.
    ``elsewhere``: names of quantities that a file has at special points only, without functions.

    Examples
    --------
    >>> import numpy as np
    >>> from pwscont.extending import Quantities
    >>> known = Quantities(("u_n", "u_t"), {"length": lambda z, alpha: float(z @ z) ** 0.5})
    >>> [known.value(name, np.array([3.0, 4.0]), 0.0) for name in ("u_t", "length")]
    [4.0, 5.0]
    """

    def __init__(
        self,
        naming: Naming = None,
        record: Mapping[str, Function] = MappingProxyType({}),
        elsewhere: Iterable[str] = (),
    ) -> None:
        #: The names of the unknowns or the function that returns the names; None for default names.
        self.naming = naming
        self.record = dict(record)
        self._elsewhere = frozenset(elsewhere)

    def __getstate__(self) -> dict[str, Any]:
        """Return names and functions: copies, also in other processes, leave the system behind."""
        naming = self._names if self.is_named else None
        return {"naming": naming, "record": self.record, "_elsewhere": self._elsewhere}

    @cached_property
    def _names(self) -> tuple[str, ...]:
        return tuple(self.naming() if callable(self.naming) else self.naming or ())

    @property
    def is_named(self) -> bool:
        """Whether the system names the unknowns."""
        return self.naming is not None

    def names(self, size: int) -> tuple[str, ...]:
        """Return the names of the unknowns of a state; by default ``z[0]``, ``z[1]``, ..."""
        if not self.is_named:
            return tuple(f"z[{i}]" for i in range(size))
        return checked_names(self._names, size)

    def in_words(self, z: Array) -> str:
        """Return the first unknowns of a state with names; names that do not fit are left out."""
        try:
            return state(self.names(len(z)), z)
        except InvalidSystemError:
            return state(UNNAMED, z)

    def value(self, name: str, z: Array, alpha: float) -> float:
        """Return an unknown, or a recorded quantity, at a state, or say why there is none.

        Greek letters may be given in words, ``lambda_t`` for ``λ_t``.
        """
        if not isinstance(name, str):
            raise UnknownNameError(_unknown(name, [*self.names(len(z)), *self.record]))
        names = () if name in self.record else self.names(len(z))
        if name not in (*self.record, *names, *self._elsewhere):
            name = as_written(name, (*names, *self.record))
        if name in self.record:
            function = self.record[name]
            if isinstance(function, Kept):
                return function(z, alpha)
            return evaluated(f"record {name!r}", function, z, alpha)
        if name in names:
            return float(z[names.index(name)])
        if name in self._elsewhere:
            raise UnknownNameError(ONLY_SPECIAL.format(name))
        raise UnknownNameError(_unknown(name, [*names, *self.record]))

    def recorded(self, z: Array, alpha: float) -> dict[str, float]:
        """Return all recorded quantities at a state; errors as for :meth:`value`."""
        return {name: self.value(name, z, alpha) for name in self.record}

    def attempted(self, z: Array, alpha: float) -> dict[str, float | str]:
        """Return all recorded quantities at a state, or the reason for each that fails."""
        found: dict[str, float | str] = {}
        for name in self.record:
            try:
                found[name] = self.value(name, z, alpha)
            except InvalidInputError as error:
                found[name] = str(error)
        return found


@final
class Kept:
    """A recorded value read from a file; a text says why there is none."""

    def __init__(self, value: float | str) -> None:
        self._value = value

    def __call__(self, z: Array, alpha: float) -> float:
        """Return the value, wherever; raises InvalidInputError where there is none."""
        if isinstance(self._value, str):
            raise InvalidInputError(self._value)
        return self._value


def evaluated(what: str, function: Callable[..., Any], z: Array, alpha: float) -> float:
    """Return the value of a user's function of (z, alpha); messages begin with ``what``."""
    try:
        value = function(z.copy(), alpha)  # a copy: users may work in place
    except Exception as error:
        why = f"{type(error).__name__}: {error}, {_words(z)}"
        raise InvalidInputError(f"{what} failed at alpha = {alpha:.8g}: {why}") from error
    if not _is_finite(value):
        hint = CONDITION if isinstance(value, bool | np.bool_) else ""
        got = f"{' '.join(repr(value).split())[:80]}, {_words(z)}{hint}"
        words = f"must return a finite float, at alpha = {alpha:.8g} it returned {got}"
        raise InvalidInputError(f"{what} {words}")
    return float(value)


def _words(z: Array) -> str:
    return f"z = {np.array2string(z, precision=6, threshold=8, edgeitems=2)}"


def _is_finite(value: Any) -> bool:
    scalar = value[()] if isinstance(value, np.ndarray) and value.ndim == 0 else value
    try:
        return isinstance(scalar, Real) and not isinstance(scalar, bool) and isfinite(scalar)
    except OverflowError:  # an integer beyond all floats
        return False


def _unknown(name: object, known: Sequence[str]) -> str:
    plain = {spelled(other).lower(): other for other in known}
    near = [plain[p] for p in get_close_matches(spelled(str(name)).lower(), plain, 3, 0.5)]
    more = ", ..." if len(known) > MOST_NAMES else ""
    hint = f"; did you mean {' or '.join(near)}?" if near else ""
    return f"there is no {name!r}; names are {', '.join(known[:MOST_NAMES])}{more}{hint}"


#: The quantities of a state that belongs to no system.
NAMELESS = Quantities()
