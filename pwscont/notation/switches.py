"""The switches that a user's function is given: max, min, abs, relu, clip and where."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, final

import numpy as np

from pwscont import InvalidSystemError
from pwscont.notation.array_functions import chosen
from pwscont.notation.dual import as_operand, joined, spread, value_of
from pwscont.notation.layout import ABS, CLIP, LOWER, MAX, MIN, RELU, UPPER, WHERE, Operation

#: Operation, tests and branches, all of one shape -> the value of the switches.
Choose = Callable[[Operation, Sequence[Any], Sequence[Any]], Any]
#: Bounds of a clip -> the kind of bounds of each entry, a number of the next line: no bound, a
#: lower bound, an upper bound, two bounds, two equal bounds, a lower bound above the upper bound.
Forms = Callable[[Any, Any], Any]
FREE, BELOW, ABOVE, BOTH, FIXED, CROSSED = range(6)


@final
class Switches:
    """The switches ``sw`` of a function f(z, alpha, sw), for numbers and arrays that broadcast.

    Each switch announces kinks, entry by entry. Switches may be nested, stand in loops and in
    expressions of any kind; but number and order of the calls must not depend on the values of z
    and alpha.
    """

    __slots__ = ("_choose", "_forms")

    def __init__(self, choose: Choose, forms: Forms) -> None:
        self._choose, self._forms = choose, forms

    def __getattr__(self, name: str) -> Any:
        """Raise an error that lists the switches."""
        raise AttributeError(f"sw has no {name!r}; it has max, min, abs, relu, clip and where")

    def max(self, a: Any, b: Any) -> Any:
        """Return the larger of two quantities."""
        a, b = _alike("max", a, b)
        return self._choose(MAX, [a - b], [b, a])

    def min(self, a: Any, b: Any) -> Any:
        """Return the smaller of two quantities."""
        a, b = _alike("min", a, b)
        return self._choose(MIN, [a - b], [a, b])

    def abs(self, a: Any) -> Any:
        """Return the magnitude of a quantity."""
        (a,) = _alike("abs", a)
        return self._choose(ABS, [a], [-a, a])

    def relu(self, a: Any) -> Any:
        """Return ``a`` where ``a`` is positive, and zero elsewhere."""
        (a,) = _alike("relu", a)
        return self._choose(RELU, [a], [np.zeros(a.shape), a])

    def where(self, s: Any, a: Any, b: Any) -> Any:
        """Return ``a`` where ``s >= 0``, ``b`` elsewhere; ``a`` equals ``b`` where ``s`` is 0.

        ``a`` and ``b`` are evaluated for either sign of ``s``.
        """
        s, a, b = _alike("where", s, a, b)
        return self._choose(WHERE, [s], [b, a])

    def clip(self, a: Any, lower: Any, upper: Any) -> Any:
        """Return a quantity clipped to bounds, which may be infinite: at most three modes."""
        a, lower, upper = _alike("clip", a, lower, upper)
        forms = self._forms(lower, upper)
        if (forms == BOTH).all():  # nearly always
            return self._choose(CLIP, [a - lower, a - upper], [lower, a, upper])
        parts, places = [], []
        for form in np.unique(forms):
            where = np.flatnonzero(forms.ravel() == form)
            some = (each.reshape(-1)[where] for each in (a, lower, upper))
            parts.append(self._clipped(int(form), *some))
            places.append(where)
        order = np.argsort(np.concatenate(places)) if places else np.zeros(0, dtype=np.intp)
        return chosen(joined(parts), order.reshape(a.shape))

    def _clipped(self, form: int, a: Any, lower: Any, upper: Any) -> Any:
        """Return clipped entries, all with the same kind of bounds."""
        if form == BELOW:
            return self._choose(LOWER, [a - lower], [lower, a])
        if form == ABOVE:
            return self._choose(UPPER, [a - upper], [a, upper])
        if form in (BOTH, CROSSED):
            return self._choose(CLIP, [a - lower, a - upper], [lower, a, upper])
        return lower if form == FIXED else a


def forms_of(lower: Any, upper: Any) -> Any:
    """Return the kind of bounds of each entry, FREE to CROSSED, which nan counts as."""
    lower, upper = value_of(lower), value_of(upper)
    forms = BELOW * (lower > -np.inf) + ABOVE * (upper < np.inf)
    forms = np.where((forms == BOTH) & (lower == upper), FIXED, forms)
    return np.where(lower <= upper, forms, CROSSED)


def common_form(forms: Any) -> Any:
    """Return the kinds of bounds of each entry from the kinds at points, shape (points, entries).

    Bounds that meet, or cross, at some points only count as two bounds.
    """
    if (forms == CROSSED).all(axis=0).any():
        raise InvalidSystemError(
            "sw.clip and Complementarity need lower <= upper, but lower is larger"
        )
    same = (forms == forms[0]).all(axis=0)
    if (forms < BOTH)[:, ~same].any():
        raise InvalidSystemError("bounds of sw.clip must not become infinite with z or alpha")
    return np.where(same, forms[0], BOTH)


def _alike(name: str, *arguments: Any) -> list[Any]:
    """Return the arguments of a switch, broadcast to a common shape."""
    operands = [_operand(name, each) for each in arguments]
    if len({each.shape for each in operands}) == 1:
        return operands
    try:
        shape = np.broadcast_shapes(*(each.shape for each in operands))
    except ValueError as error:
        raise InvalidSystemError(f"arguments of sw.{name}: {error}") from error
    return [spread(each, shape) for each in operands]


def _operand(name: str, thing: Any) -> Any:
    if type(thing) is np.ndarray and thing.dtype == float:
        return thing  # nearly always
    try:
        return as_operand(thing)
    except TypeError as error:
        raise InvalidSystemError(
            f"arguments of sw.{name} must be real numbers or arrays of them, got {error}"
        ) from error
