"""A user's function f(z, alpha, sw), called with true or given modes of the switches.

Failure modes and answers
-------------------------
- The function fails, or returns a wrong shape or numbers that are not real: an error names the
  mistake at the first call.
- Number, order or shapes of the switches change with z and alpha: the first call that differs is
  refused.
- Calls of sw with equal arguments are one switch. Arguments of different switches may be equal,
  too, wherever the function was tried, for example when all arguments saturate: a later call at
  which the arguments differ is refused.
- With a frozen mode, the value y of ``sw.abs`` or ``sw.relu`` is negative beyond the cell, where a
  power or root of y is not defined; at y = 0 the slope may be infinite. If a call is not finite, H
  is continued beyond zero by the mirror image 2 H(0) - H(-y), with equal value and slope at zero.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Any, final

import numpy as np
import scipy.sparse as sp

from pwscont import InvalidSystemError
from pwscont.extending import EPS, GUARD, Array, Indices, counted, generic
from pwscont.notation.array_functions import chosen, where
from pwscont.notation.dual import Dual, as_operand, is_traced, joined, value_of
from pwscont.notation.layout import ABS, RELU, Call, Layout, Operation
from pwscont.notation.switches import Switches, forms_of

#: f(z, alpha, sw) -> (n,)
Function = Callable[[Any, Any, Switches], Any]
#: Part of the arguments' magnitudes; arguments that differ by more are different arguments: half of
#: the digits leaves room for rounding.
ALIKE = EPS**0.5
#: Number of the call, tests and branches of the call -> the value of each switch of the call.
Pick = Callable[[int, Sequence[Any], Sequence[Any]], Any]


@final
@dataclass(frozen=True, slots=True, eq=False)
class Outcome:
    """The results of a call of a user's function: arrays, or Duals if called with Duals.

    Attributes
    ----------
    value : shape (n,)
    tests : shape (m,)
    branches : shape (b,)
        The branches of all switches, see :class:`Layout`.
    """

    value: Any
    tests: Any
    branches: Any

    def all(self) -> Any:
        """Return value, tests and branches in one vector."""
        return joined([self.value, self.tests, self.branches])

    def values(self, layout: Layout) -> Array:
        """Return the true value of every switch from a call with numbers."""
        return layout.values(self.branches, layout.modes(self.tests >= 0.0))


@final
class UserFunction:
    """A user's function of n unknowns."""

    def __init__(self, f: Function, size: int) -> None:
        self.f, self._size = f, size

    def surveyed(self, z: Array, alpha: float) -> tuple[Outcome, list[Any]]:
        """Return the outcome with true values, and the kinds of bounds of the clips."""
        survey = _Survey()
        return self._called(z, alpha, survey), survey.forms

    def layout(self, points: Sequence[Array], forms: Sequence[Any]) -> Layout:
        """Return the switches of the function, from calls at points and the kinds of clips' bounds.

        Calls with equal arguments, to the last digit, at every point are one switch; equality must
        hold for any values of the switches called before.
        """
        surveys = [_Survey(forms) for _ in points]
        for x, survey in zip(points, surveys, strict=True):
            self._called(x[:-1], x[-1], survey)  # powers of a numpy number are real or nan
        calls = surveys[0].calls
        prints = _prints(surveys) if len(points) > 1 else []
        if len(set(prints)) < len(prints):  # else there is nothing to tell apart
            prints = _prints([*surveys, *self._with_any_values(points, forms, len(calls))])
        sizes = list(map(max, zip(*(survey.sizes for survey in surveys), strict=False)))
        return Layout(calls, forms, [prints.index(each) for each in prints] or None, sizes)

    def _with_any_values(
        self, points: Sequence[Array], forms: Sequence[Any], calls: int
    ) -> Iterator[_Survey]:
        """Yield surveys with arbitrary values of switches, where the function is defined."""
        for x in points:
            survey = _AnyValues(forms)
            with np.errstate(all="ignore"), suppress(Exception):
                self._called(x[:-1], x[-1], survey)  # powers of a numpy number are real or nan
            if len(survey.calls) == calls:
                yield survey

    def outcome(self, z: Any, alpha: Any, layout: Layout, pick: Pick | None = None) -> Outcome:
        """Return the outcome with values of switches from ``pick``, default the true values."""
        try:
            return self._called(z, alpha, _Replay(layout, pick or _true))
        except (TypeError, InvalidSystemError):
            if type(alpha) is not float:
                raise
        with np.errstate(invalid="ignore"):  # powers of a numpy number are nan, not complex
            return self._called(z, np.float64(alpha), _Replay(layout, pick or _true))

    def _called(self, z: Any, alpha: Any, switches: _Survey | _Replay) -> Outcome:
        value = self.f(z.copy(), alpha, Switches(switches.choose, switches.forms_of))
        switches.close()
        found = one_for_each(value, self._size)
        if type(found) is not type(z) or found.dtype != z.dtype:
            _refuse_kept(z)
        return Outcome(found, joined(switches.tests), joined(switches.branches))


def one_for_each(value: Any, size: int) -> Any:
    """Return what a function returned as an array or Dual of one number for each unknown."""
    if type(value) is np.ndarray and value.dtype == float and value.shape == (size,):
        return value  # nearly always
    try:
        found = as_operand(value)
    except (TypeError, ValueError) as error:
        raise InvalidSystemError(
            f"the function must return {counted(size, 'real number')}, got "
            f"{type(value).__name__}: {error}"
        ) from error
    if found.shape != (size,) and not (size == 1 and found.shape == ()):
        raise InvalidSystemError(
            f"the function returned an array of shape {found.shape}, where one number for each "
            f"of the {size} unknowns is expected, shape ({size},)"
        )
    return found if found.shape else found.reshape(1)


def _refuse_kept(z: Any) -> None:
    """Refuse values with derivatives from a call with plain numbers."""
    if type(z) is np.ndarray and z.dtype == float:
        raise InvalidSystemError(
            "the function keeps numbers of one call for the next, as a warm start does: a call "
            "with plain numbers returned what a call with derivatives had left"
        )


def _prints(surveys: Sequence[_Survey]) -> list[Any]:
    """Return the arguments of each call in all surveys, nothing if the calls differ."""
    several = all(each.calls == surveys[0].calls for each in surveys)
    return list(zip(*(each.prints for each in surveys), strict=True)) if several else []


class _Survey:
    """The switches of a function that is called for the first time, with true values."""

    def __init__(self, forms: Sequence[Any] = ()) -> None:
        self._known_forms = forms
        self.calls: list[Call] = []
        self.forms: list[Any] = []
        self.tests: list[Any] = []
        self.branches: list[Any] = []
        #: Operation and arguments of each call, to the last digit.
        self.prints: list[Any] = []
        #: The largest magnitude of the arguments of each call.
        self.sizes: list[float] = []

    def forms_of(self, lower: Any, upper: Any) -> Any:
        """Return the kinds of bounds of a clip: as given, or as the bounds are at this point."""
        i = len(self.forms)
        known = i < len(self._known_forms) and self._known_forms[i].shape == lower.shape
        self.forms.append(self._known_forms[i] if known else forms_of(lower, upper))
        return self.forms[i]

    def choose(self, operation: Operation, tests: Sequence[Any], branches: Sequence[Any]) -> Any:
        """Record the arguments of a call of sw, and return the true values."""
        self.calls.append(Call(operation, tests[0].shape))
        entries = (each.tobytes() for each in (*tests, *branches))
        self.prints.append((operation, tests[0].shape, *entries))
        self.sizes.append(max(map(_size, (*tests, *branches))))
        self.tests += tests
        self.branches += branches
        return taken(true_modes(tests), branches)

    def close(self) -> None:
        """Accept any number of switches."""


class _AnyValues(_Survey):
    """A survey with arbitrary values of switches: equal values for equal arguments."""

    def __init__(self, forms: Sequence[Any]) -> None:
        super().__init__(forms)
        self._values: dict[Any, Any] = {}

    def choose(self, operation: Operation, tests: Sequence[Any], branches: Sequence[Any]) -> Any:
        """Record the arguments of a call of sw, and return generic numbers."""
        true, key = super().choose(operation, tests, branches), self.prints[-1]
        any_values = generic(np.size(true), len(self._values)).reshape(np.shape(true))
        return self._values.setdefault(key, any_values)


class _Replay:
    """The switches of a later call of a function, which must be as in the first call."""

    __slots__ = ("_args", "_calls", "_clips", "_layout", "_pick", "_values", "branches", "tests")

    def __init__(self, layout: Layout, pick: Pick) -> None:
        self._args: list[Any] = []
        self._layout, self._pick = layout, pick
        self._calls = self._clips = 0
        self._values: list[Any] = []
        self.tests: list[Any] = []
        self.branches: list[Any] = []

    def forms_of(self, lower: Any, upper: Any) -> Any:
        """Return the kinds of bounds of a clip at the first call."""
        number, forms = self._clips, self._layout.forms
        self._clips += 1
        if number >= len(forms) or forms[number].shape != lower.shape:
            self._refuse(f"a clip of shape {lower.shape} is number {number + 1} of its clips")
        return forms[number]

    def choose(self, operation: Operation, tests: Sequence[Any], branches: Sequence[Any]) -> Any:
        """Record the arguments of a call of sw, and return the values that ``pick`` gives."""
        made, layout, shape = self._calls, self._layout, tests[0].shape
        self._calls += 1
        if not layout.has(made, operation, shape):
            self._refuse(f"{Call(operation, shape)} is number {made + 1} of its switches")
        number = layout.numbers[made]
        if number < len(self._values):  # a call with these arguments was made before
            self._check_repeated(made, number, (*tests, *branches))
            return self._values[number]
        self.tests += tests
        self.branches += branches
        self._args.append((*tests, *branches))
        self._values.append(self._pick(number, tests, branches))
        return self._values[number]

    def _check_repeated(self, made: int, number: int, args: Sequence[Any]) -> None:
        """Refuse a call that counts as repeated and has different arguments here."""
        rounding = GUARD * EPS * self._layout.sizes[made]
        if any(_differ(a, b, rounding) for a, b in zip(args, self._args[number], strict=True)):
            first = self._layout.numbers.index(number)
            raise InvalidSystemError(
                f"calls {first + 1} and {made + 1} of sw have had the same arguments wherever the "
                "function was tried, but they differ: give bounds within which they are not alike "
                "(arguments may saturate), or write one call where only one is meant"
            )

    def close(self) -> None:
        """Refuse a call of the function with fewer calls of sw than the first call."""
        if self._calls != len(self._layout.numbers):
            self._refuse(f"it has {self._calls} calls of sw")

    def _refuse(self, now: str) -> None:
        numbers, calls = self._layout.numbers, self._layout.calls
        first, more = ", ".join(str(calls[i]) for i in numbers[:6]), ", ..." * (len(numbers) > 6)
        raise InvalidSystemError(
            f"the switches of the function change with its arguments: {now}, where it had "
            f"{len(numbers)} calls before ({first}{more}); their number, order and shapes must be "
            "the same for all z and alpha"
        )


def _size(numbers: Array) -> float:
    return float(np.abs(numbers).max(initial=0.0, where=np.isfinite(numbers)))


def _differ(a: Any, b: Any, rounding: float) -> bool:
    """Tell whether arguments of two calls differ by more than rounding of usual arguments."""
    if is_traced(a) or is_traced(b):
        return False
    one, other = value_of(a), value_of(b)
    sizes = np.abs(one) + np.abs(other)
    with np.errstate(invalid="ignore"):
        least = ALIKE * (sizes + sizes.max(initial=0.0)) + rounding
        return bool((np.abs(one - other) > least).any())


def _true(number: int, tests: Sequence[Any], branches: Sequence[Any]) -> Any:
    """Return the true values of the switches of a call from tests and branches."""
    return taken(true_modes(tests), branches)


def true_modes(tests: Sequence[Any]) -> Any:
    """Return the mode of each entry of a call: the number of tests that are not negative."""
    modes = value_of(tests[0]) >= 0.0
    return modes if len(tests) == 1 else modes.astype(int) + (value_of(tests[1]) >= 0.0)


def taken(modes: Any, branches: Sequence[Any]) -> Any:
    """Return for each entry the branch that belongs to the mode of the entry."""
    if not branches[0].ndim and not is_traced(modes):
        branch = branches[int(modes)]
        return branch[()] if type(branch) is np.ndarray else branch
    found = branches[0]
    for mode, branch in enumerate(branches[1:], start=1):
        found = where(modes >= mode, branch, found)
    return found


#: The smallest normal number stands for y = 0, at which a slope may be infinite; for derivatives
#: where y is rounding, that rounding: with larger slopes, all of H would look like rounding.
ZERO = sys.float_info.min


@final
class LiftedFunction:
    """A user's function of x = (z, y, alpha), y the values of the hidden switches."""

    def __init__(self, function: UserFunction, size: int, layout: Layout, hidden: Indices) -> None:
        self.function, self.size, self.layout, self.hidden = function, size, layout, hidden
        is_hidden = np.zeros(layout.count, dtype=bool)
        is_hidden[hidden] = True
        self._is_hidden = [is_hidden[mine] for mine in layout.slices]
        self._all_hidden = [bool(some.all()) for some in self._is_hidden]
        self._none_hidden = [not some.any() for some in self._is_hidden]
        first = size + np.cumsum(is_hidden) - 1
        #: Places in x of the hidden switches of each call; any place for switches that are not
        #: hidden.
        self._places = [np.where(is_hidden[mine], first[mine], 0) for mine in layout.slices]
        self._is_magnitude = [call.operation in (ABS, RELU) for call in layout.calls]

    def outcome(self, x: Any, alpha: Any, modes: Indices | None) -> Outcome:
        """Return the outcome at x; ``modes`` of the switches not hidden, None for true modes."""
        pick = self._pick(x, modes)
        if modes is None or not any(self._is_magnitude):
            return self.function.outcome(x[: self.size], alpha, self.layout, pick)
        with np.errstate(invalid="ignore", divide="ignore"):  # mended below
            found = self.function.outcome(x[: self.size], alpha, self.layout, pick)
        if _is_finite(found):
            return found
        rounding = EPS * np.abs(x.value).max() if isinstance(x, Dual) else 0.0
        picks = (self._beyond(pick, sign, rounding) for sign in (0.0, -1.0))
        at_zero, mirrored = (
            self.function.outcome(x[: self.size], alpha, self.layout, each) for each in picks
        )
        pairs = zip(_parts(at_zero), _parts(mirrored), strict=True)
        return Outcome(*(2.0 * a - b for a, b in pairs))

    def _beyond(self, pick: Pick, sign: float, rounding: float) -> Pick:
        """Return a ``Pick`` that replaces magnitudes y <= 0 by zero (sign 0) or by -y."""

        def beyond(number: int, tests: Sequence[Any], branches: Sequence[Any]) -> Any:
            y = pick(number, tests, branches)
            if not self._is_magnitude[number]:
                return y
            near = np.abs(value_of(y)) <= GUARD * rounding
            other = ZERO + rounding - y if sign else ZERO + rounding * near
            return where(value_of(y) <= 0.0, other, y)

        return beyond

    def _pick(self, x: Any, modes: Indices | None) -> Pick:
        def pick(number: int, tests: Sequence[Any], branches: Sequence[Any]) -> Any:
            shape = self.layout.calls[number].shape
            if self._all_hidden[number]:
                return chosen(x, self._places[number].reshape(shape))
            mine = self.layout.slices[number]
            mode = true_modes(tests) if modes is None else modes[mine].reshape(shape)
            value = taken(mode, branches)
            if self._none_hidden[number]:
                return value
            hidden = self._is_hidden[number]
            return where(
                hidden.reshape(shape), chosen(x, self._places[number].reshape(shape)), value
            )

        return pick


def _parts(outcome: Outcome) -> tuple[Any, Any, Any]:
    return outcome.value, outcome.tests, outcome.branches


def _is_finite(outcome: Outcome) -> bool:
    """Tell whether all numbers and derivatives are finite; arrays traced by JAX count as finite."""
    for part in _parts(outcome):
        known: list[Any] = [part] if type(part) is np.ndarray else []
        if type(part) is Dual:
            known = [part.value, part.rows.data if sp.issparse(part.rows) else part.rows]
        if not all(np.isfinite(numbers).all() for numbers in known):
            return False
    return True
