"""Systems from formulas with switches."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from functools import partial
from typing import Any

import numpy as np
import scipy.sparse as sp

from pwscont import InvalidInputError, InvalidSystemError
from pwscont.extending import Array, Indices, Signs, checked_magnitudes, generic
from pwscont.notation.curved import SwitchedSystem
from pwscont.notation.derivatives import coefficients, derivatives_of
from pwscont.notation.dual import Dual, as_dual
from pwscont.notation.function import Function, LiftedFunction, UserFunction
from pwscont.notation.layout import Layout
from pwscont.notation.notated import Given, Notated
from pwscont.notation.straight import ROUNDED, SwitchedLinearSystem, assembled
from pwscont.notation.switches import common_form

#: More unknowns do not fit into the memory of a computer.
MOST_UNKNOWNS = 10**7
#: Number of points of ``TRIED`` whose finite outcomes show the switches of a function.
SURVEYED = 3
#: Magnitudes of the points that are tried: a large and a small magnitude first, for tanh(100 z) is
#: 1 at any large z, and different unknowns then look equal.
TRIED = (1.0, 1e-3, 0.5, 0.1, 2.0, 10.0, 0.0)
#: Number of further points at which dependences between switches are looked for: with a large and a
#: small magnitude.
ELSEWHERE = 2
#: Change of an argument, in units of x, that shows what depends on the argument: small, because
#: functions may have narrow domains.
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
        numbers and arrays that broadcast. f is smooth except at the kinks of switches, which may be
        nested. Derivatives are exact if f is written with numpy or ``jax.numpy``; otherwise
        derivatives are differences.
    linear : bool
        The promise, which is checked, that f is affine in (z, alpha) between kinks. Branches are
        then exact polygons, and all solutions at an alpha can be listed.
    names : sequence of str, length n, optional
        The names of the unknowns.
    switches : sequence of str, optional
        The names of the switches, in the order of the calls in f: a name for each entry, or for
        each call.
    degree, unique
        As for :class:`~pwscont.PiecewiseSystem`.
    bounds : tuple of array_like, optional
        (lower, upper), each broadcastable to (n,): values between which z makes sense.
    periods : array_like, optional
        The period of each unknown, broadcastable to (n,), infinite for none.
    scale : array_like, optional
        Typical magnitudes of z, broadcastable to (n,); default the magnitudes that a run finds.

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
        number of switches that changes with z, or is not affine in spite of the promise.

    Examples
    --------
    >>> from pwscont import Switched, enumerate_solutions
    >>> game = Switched(1, lambda z, t, sw: z - sw.clip(2 * z - t, 0, 1), linear=True)
    >>> [s.z.tolist() for s in enumerate_solutions(game, 0.5)]
    [[0.0], [0.5], [1.0]]
    """
    if isinstance(n, bool) or not isinstance(n, int | np.integer) or not 1 <= n <= MOST_UNKNOWNS:
        raise InvalidInputError(f"n must be the number of unknowns, 1 or more, got {n!r}")
    if not callable(f):
        raise InvalidInputError(f"f must be a function of (z, alpha, sw), got {f!r}")
    if not isinstance(unique, bool) or isinstance(degree, str | float):
        raise InvalidInputError(
            f"unique must be True or False, and degree a whole number, got {unique!r}, {degree!r}"
        )
    texts, size = (_texts("names", names), _texts("switches", switches)), int(n)
    given = Given(*texts, degree, unique, _pair(bounds), periods, checked_magnitudes(scale, size))
    function = UserFunction(f, size)
    if linear:
        first, *others, zero = _points(size, Given())
        layout = _first_calls(function, [first, zero, *others])[1]  # bounds close by differ at zero
        return _straight(function, size, given, layout)
    return _curved(function, size, given)


def _texts(what: str, names: Any) -> tuple[str, ...] | None:
    if names is None:
        return None
    is_list = isinstance(names, Iterable) and not isinstance(names, str)
    if not (is_list and all(isinstance(name, str) for name in names)):
        raise InvalidInputError(f"{what} must be a list of texts, got {names!r}")
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


def _straight(
    function: UserFunction, size: int, given: Given, layout: Layout
) -> SwitchedLinearSystem:
    matrix, rest, is_traced = coefficients(function, size, layout)
    own = unknowns_bounded(matrix[:size, :-1], size)
    system = SwitchedLinearSystem(size, layout, assembled(matrix, rest, size, layout), given, own)
    system.inexact = system.inexact if is_traced else ROUNDED
    if len(layout.calls) < len(layout.numbers):
        apart = Layout([layout.calls[i] for i in layout.numbers], layout.forms)
        system.again = partial(_straight, function, size, given, apart)
    return system


def _curved(function: UserFunction, size: int, given: Given) -> SwitchedSystem:
    points = list(_points(size, given))
    x, layout = _first_calls(function, points)
    hidden, own_names = _dependence(function, size, layout, x, points[1 : 1 + ELSEWHERE])
    lifted = LiftedFunction(function, size, layout, hidden)
    values = function.outcome(x[:-1], float(x[-1]), layout).values(layout)
    at = np.concatenate([x[:-1], values[hidden], x[-1:]])
    return SwitchedSystem(lifted, derivatives_of(lifted, [at]), given, own_names)


def _points(size: int, given: Given) -> Iterator[Array]:
    """Yield points (z, alpha), no two alike, within the bounds, at which to try a function."""
    bounds = given.bounds or (-np.inf, np.inf)
    for shift, reach in enumerate(TRIED):
        x = reach * generic(size + 1, shift)
        for point in (x, np.abs(x)) if reach else (x,):
            yield np.append(_within(point[:-1], generic(size, shift), *bounds), point[-1])


@np.errstate(invalid="ignore")
def _within(z: Array, generic: Array, lower: Any, upper: Any) -> Array:
    """Return generic numbers within bounds: mirrored there, or spread where bounds are narrow.

    Numbers put onto the bounds would make different unknowns look equal.
    """
    mirrored = np.where(z < lower, 2.0 * np.asarray(lower) - z, z)
    mirrored = np.where(mirrored > upper, 2.0 * np.asarray(upper) - mirrored, mirrored)
    spread = lower + (np.asarray(upper) - lower) * (0.5 + 0.5 * generic)
    inside: Array = np.where(mirrored < lower, spread, mirrored)
    return inside


def _first_calls(function: UserFunction, points: Sequence[Array]) -> tuple[Array, Layout]:
    """Return the first point at which a function is finite, and the switches of the function."""
    failure: Exception | None = None
    finite: list[tuple[Array, list[Any]]] = []
    for x in points:
        try:
            with np.errstate(all="ignore"):
                outcome, forms = function.surveyed(x[:-1], x[-1])
        except InvalidSystemError:
            raise
        except Exception as error:  # perhaps the function is not defined at x
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
        f"the function is finite at none of {tried} points of the order of one: is one of its "
        "numbers nan or infinite? (only bounds of sw.clip may be infinite); if the function makes "
        "sense elsewhere, give bounds=(lower, upper) of z"
    )


def _dependence(
    function: UserFunction, size: int, layout: Layout, x: Array, others: Sequence[Array]
) -> tuple[Indices, dict[int, int]]:
    """Return the switches on which further switches depend, and the switches that bound an unknown.

    Dependences are looked for at x, where the function is finite, and at further points if
    possible: at a single point a switch y may be zero and stand in a product, or be so large that
    exp(-y) is zero.
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
    """Tell which switches the tests or branches of any switch depend on, from all derivatives."""
    matter: Signs = abs(rows[size:, size:-1]).sum(axis=0) != 0.0
    return matter


def _matter_elsewhere(everything: LiftedFunction, x: Array, size: int) -> Signs:
    """Tell which switches matter at x, with arbitrary values of all switches; none on failure."""
    count = everything.layout.count
    values = np.abs(x).max() * np.abs(generic(count))
    try:
        rows = sp.csr_array(_slopes(everything, np.concatenate([x[:-1], values, x[-1:]])))
    except Exception:  # these values may mean nothing to the function
        return np.zeros(count, dtype=bool)
    rows.data[~np.isfinite(rows.data)] = 0.0
    return _matter(rows, size)


def unknowns_bounded(equations: Any, size: int) -> dict[int, int]:
    """Return {switch: unknown after which the switch is named} from the equations.

    In an equation z_i - y = 0 the switch y is named after z_i; a switch that is alone in equation i
    is named after z_i, too.

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
    """Return the derivatives of an outcome by x, or changes of the outcome if derivatives fail."""
    try:
        u = Dual.variables(x, 0, len(x))
        return as_dual(lifted.outcome(u, float(x[-1]), None).all(), len(x)).rows
    except InvalidSystemError:
        raise
    except Exception:  # the function does something that no Dual knows, but takes plain numbers
        here = lifted.outcome(x, float(x[-1]), None).all()
        moved = x + SMALL * np.diag(np.abs(generic(len(x))))
        return np.stack([lifted.outcome(y, float(y[-1]), None).all() - here for y in moved], axis=1)
