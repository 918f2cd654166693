"""Systems from formulas with switches."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import Any

import numpy as np
import scipy.sparse as sp

from pwscont.basics.arrays import Array, Indices, Signs, generic
from pwscont.basics.errors import InvalidInputError, InvalidSystemError
from pwscont.notation.curved import SwitchedSystem
from pwscont.notation.derivatives import coefficients, derivatives_of
from pwscont.notation.dual import Dual, as_dual
from pwscont.notation.function import Function, LiftedFunction, UserFunction
from pwscont.notation.layout import Layout
from pwscont.notation.notated import Given, Notated
from pwscont.notation.straight import SwitchedLinearSystem, assembled
from pwscont.notation.switches import common_form
from pwscont.system.contract import MOST_UNKNOWNS, checked_magnitudes

#: Points at which the function must be finite.
SURVEYED = 3
#: Sizes of those that are tried: a large and a small one at first, for tanh(100 z) is 1 at any
#: large z, whatever unknown z is.
TRIED = (1.0, 1e-3, 0.5, 0.1, 2.0, 10.0, 0.0)
#: At how many others it is seen which switches depend on each other: a large and a small one.
ELSEWHERE = 2
#: By how much an argument is changed to see what depends on it: functions may have narrow domains.
SMALL = 1e-4


def Switched(  # noqa: N802  used like a class
    n: int,
    f: Function,
    *,
    linear: bool = False,
    names: Sequence[str] | None = None,
    switches: Sequence[str] | None = None,
    degree: int | None = None,
    unique: bool = False,
    bounds: tuple[Any, Any] | None = None,
    periods: Any = None,
    scale: Any = None,
) -> Notated:
    """Return the system f(z, alpha, sw) = 0, where ``sw`` has max, min, abs, relu, clip and where.

    Parameters
    ----------
    n : int
        The number of unknowns.
    f : callable
        (z, alpha, sw) -> (n,). z has shape (n,); ``sw`` is a :class:`Switches`, whose methods take
        numbers and arrays that broadcast. It is to be smooth but for its switches, which may be
        nested. Written with numpy it is differentiated exactly, and so is one written with
        ``jax.numpy``; otherwise by differences.
    linear : bool
        The promise that f is affine in (z, alpha) between its kinks. It is checked. Paths are then
        exact polygons, and all solutions at one alpha can be listed.
    names : sequence of str, length n, optional
        The names of the unknowns.
    switches : sequence of str, optional
        The names of the switches, in the order in which f calls them: one for each entry, or one
        for each call.
    degree, unique
        As for :class:`~pwscont.PiecewiseSystem`.
    bounds : tuple of array_like, optional
        Between which values z makes sense: (lower, upper), each broadcastable to (n,).
    periods : array_like, optional
        After what each unknown repeats itself.
    scale : array_like, optional
        Typical magnitudes of z, broadcastable to (n,); default what a run finds.

    Returns
    -------
    PiecewiseSystem
        A :class:`~pwscont.PiecewiseLinearSystem` if ``linear``.

    Raises
    ------
    InvalidInputError
        If n is no positive whole number, f cannot be called, or names, bounds, periods or scale do
        not fit.
    InvalidSystemError
        If f fails, returns something else than n real numbers, has a kink without a switch, a
        number of switches that changes with z, or is not affine where that is promised.

    Examples
    --------
    >>> from pwscont import Switched, enumerate_solutions
    >>> game = Switched(1, lambda z, t, sw: z - sw.clip(2 * z - t, 0, 1), linear=True)
    >>> [s.z.tolist() for s in enumerate_solutions(game, 0.5)]
    [[0.0], [0.5], [1.0]]
    """
    if isinstance(n, bool) or not isinstance(n, int | np.integer) or not 1 <= n <= MOST_UNKNOWNS:
        raise InvalidInputError(f"n must be the number of unknowns, got {n!r}")
    if not callable(f):
        raise InvalidInputError(f"f must be a function of (z, alpha, sw), got {f!r}")
    texts, size = (_texts(names), _texts(switches)), int(n)
    given = Given(*texts, degree, unique, _pair(bounds), periods, checked_magnitudes(scale, size))
    function = UserFunction(f, size)
    if linear:
        _, layout = _first_calls(function, list(_points(size, Given())))
        matrix, rest = coefficients(function, size, layout)
        own = unknowns_bounded(matrix[:size, :-1], size)
        rows = assembled(matrix, rest, size, layout)
        return SwitchedLinearSystem(size, layout, rows, given, own)
    return _curved(function, size, given)


def _texts(names: Any) -> tuple[str, ...] | None:
    if names is None:
        return None
    is_list = isinstance(names, Iterable) and not isinstance(names, str)
    if not (is_list and all(isinstance(name, str) for name in names)):
        raise InvalidInputError(f"names must be a list of texts, got {names!r}")
    return tuple(names)


def _pair(bounds: Any) -> tuple[Any, Any] | None:
    if bounds is None:
        return None
    try:
        lower, upper = (np.asarray(bound, dtype=float) for bound in bounds)
    except (TypeError, ValueError) as error:
        raise InvalidInputError(
            f"bounds must be a pair (lower, upper) of numbers, got {bounds!r}"
        ) from error
    return lower, upper


def _curved(function: UserFunction, size: int, given: Given) -> SwitchedSystem:
    points = list(_points(size, given))
    x, layout = _first_calls(function, points)
    hidden, own_names = _dependence(function, size, layout, x, points[1 : 1 + ELSEWHERE])
    lifted = LiftedFunction(function, size, layout, hidden)
    values = function.outcome(x[:-1], float(x[-1]), layout).values(layout)
    at = np.concatenate([x[:-1], values[hidden], x[-1:]])
    return SwitchedSystem(lifted, derivatives_of(lifted, [at]), given, own_names)


def _points(size: int, given: Given) -> Iterator[Array]:
    """Yield points at which to try a function, within the bounds; no two of them are alike."""
    bounds = given.bounds or (-np.inf, np.inf)
    for shift, reach in enumerate(TRIED):
        x = reach * generic(size + 1, shift)
        for point in (x, np.abs(x)) if reach else (x,):
            yield np.append(_within(point[:-1], generic(size, shift), *bounds), point[-1])


@np.errstate(invalid="ignore")
def _within(z: Array, generic: Array, lower: Any, upper: Any) -> Array:
    """Return generic numbers within bounds: mirrored there, or spread where bounds are narrow.

    Were they put on the bounds, unknowns that differ would be taken for equal.
    """
    mirrored = np.where(z < lower, 2.0 * np.asarray(lower) - z, z)
    mirrored = np.where(mirrored > upper, 2.0 * np.asarray(upper) - mirrored, mirrored)
    spread = lower + (np.asarray(upper) - lower) * (0.5 + 0.5 * generic)
    inside: Array = np.where(mirrored < lower, spread, mirrored)
    return inside


def _first_calls(function: UserFunction, points: Sequence[Array]) -> tuple[Array, Layout]:
    """Return a point where a function is finite, and its switches.

    Raises
    ------
    InvalidSystemError
        If it fails, or is finite at none of the points.
    """
    failure: Exception | None = None
    finite: list[tuple[Array, list[Any]]] = []
    for x in points:
        try:
            with np.errstate(all="ignore"):
                outcome, forms = function.surveyed(x[:-1], float(x[-1]))
        except InvalidSystemError:
            raise
        except Exception as error:  # perhaps it is not defined there
            failure = failure or error
            continue
        if np.isfinite(outcome.all()).all():
            finite.append((x, forms))
        if len(finite) == SURVEYED:
            break
    if not finite:
        raise _undefined(failure, len(points))
    x, first = finite[0]
    if len({tuple(form.shape for form in forms) for _, forms in finite}) > 1:
        raise InvalidSystemError("the calls of sw.clip change with z or alpha")
    forms = [common_form(np.array([f[k] for _, f in finite])) for k in range(len(first))]
    return x, function.layout([x for x, _ in finite], forms)


def _undefined(failure: Exception | None, tried: int) -> InvalidSystemError:
    if failure is not None:
        error = InvalidSystemError(f"the function fails: {type(failure).__name__}: {failure}")
        error.__cause__ = failure
        return error
    return InvalidSystemError(
        f"the function is finite at none of {tried} points of the order of one; an argument of sw "
        "may be infinite, where only sw.clip takes infinite bounds; or give bounds within which it "
        "makes sense"
    )


def _dependence(
    function: UserFunction, size: int, layout: Layout, x: Array, others: Sequence[Array]
) -> tuple[Indices, dict[int, int]]:
    """Return on which switches other switches depend, and which are one unknown each.

    What depends is seen at x, where the function is finite, and at other points if it can be: at
    one point a switch may be zero and stand in a product, or be so large that exp(-y) is zero.
    """
    everything = LiftedFunction(function, size, layout, np.arange(layout.count))
    with np.errstate(all="ignore"):
        values = function.outcome(x[:-1], float(x[-1]), layout).values(layout)
        at = np.concatenate([x[:-1], values, x[-1:]])
        rows = sp.csr_array(_slopes(everything, at))
        is_inner = _matter(rows, size)
        for other in others:
            is_inner |= _matter_elsewhere(everything, other, size)
    return np.flatnonzero(is_inner), unknowns_bounded(rows[:size, :-1], size)


def _matter(rows: Any, size: int) -> Signs:
    """Tell on which switches tests or branches of others depend, by derivatives of all of them."""
    matter: Signs = abs(rows[size:, size:-1]).sum(axis=0) != 0.0
    return matter


def _matter_elsewhere(everything: LiftedFunction, x: Array, size: int) -> Signs:
    """Tell the same at another point, with other values of all switches; nothing if that fails."""
    count = everything.layout.count
    values = np.abs(x).max() * np.abs(generic(count))
    try:
        rows = sp.csr_array(_slopes(everything, np.concatenate([x[:-1], values, x[-1:]])))
    except Exception:  # these values may mean nothing to the function
        return np.zeros(count, dtype=bool)
    rows.data[~np.isfinite(rows.data)] = 0.0
    return _matter(rows, size)


def unknowns_bounded(equations: Any, size: int) -> dict[int, int]:
    """Return after which unknown a switch is called, by the equation in which it stands.

    That is the unknown whose value the switch is, in z_i - y = 0; or, where an equation is a switch
    and nothing else, the unknown of the same number.

    Parameters
    ----------
    equations : csr array, shape (n, n + number of switches)
        Derivatives of the equations by the unknowns and by the values of the switches.
    """
    own: dict[int, int] = {}
    for row in range(size):
        entries = slice(equations.indptr[row], equations.indptr[row + 1])
        values = dict(zip(equations.indices[entries], equations.data[entries], strict=True))
        places = sorted(place for place, value in values.items() if value != 0.0)
        if len(places) == 1 and places[0] >= size:
            own[int(places[0]) - size] = row
        elif len(places) == 2 and places[0] < size <= places[1] and not sum(values.values()):
            own[int(places[1]) - size] = int(places[0])
    return own


def _slopes(lifted: LiftedFunction, x: Array) -> Any:
    """Return derivatives by all switches, or changes where there are no derivatives."""
    try:
        u = Dual.variables(x, 0, len(x))
        return as_dual(lifted.outcome(u, float(x[-1]), None).all(), len(x)).rows
    except InvalidSystemError:
        raise
    except Exception:  # it does what Duals do not know; numbers it can do
        here = lifted.outcome(x, float(x[-1]), None).all()
        moved = x + SMALL * np.diag(np.abs(generic(len(x))))
        return np.stack([lifted.outcome(y, float(y[-1]), None).all() - here for y in moved], axis=1)
