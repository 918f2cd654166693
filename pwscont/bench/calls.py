"""Counts of the work of a run: calls of residuals, Jacobians, factorisations and the like.

The package itself does not count. While the context is open, the methods of the system's class and
of the factorisations are replaced by methods that count and call the originals. Counting does not
work for several threads. numpy's small dense solves in searches and at corners are not counted.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from functools import wraps
from typing import Any

from pwscont import PiecewiseSystem
from pwscont.extending import BorderedFactor, Factor, ScaledFactor

#: Methods of a system that are counted, by name.
EVALUATIONS = ("residual", "jacobian", "test_functions", "test_jacobian")
FACTORISATIONS, SOLVES, SIGNS = "factorisations", "solves", "determinant signs"
KINDS = (*EVALUATIONS, FACTORISATIONS, SOLVES, SIGNS)


@contextmanager
def counted(system: PiecewiseSystem) -> Iterator[Counter[str]]:
    """Yield a counter of calls by kind, which counts while the context is open.

    Parameters
    ----------
    system : PiecewiseSystem
        The system; evaluations of all systems of the same class are counted.

    Yields
    ------
    Counter
        Number of calls for each of :data:`KINDS`.
    """
    calls = Counter(dict.fromkeys(KINDS, 0))
    with ExitStack() as stack:
        for name in EVALUATIONS:
            stack.enter_context(_counting(type(system), name, calls, name))
        for factor in factorisations():
            stack.enter_context(_counting(factor, "__init__", calls, FACTORISATIONS))
            stack.enter_context(_counting(factor, "solve", calls, SOLVES))
            stack.enter_context(_counting(factor, "sign", calls, SIGNS))
        yield calls


def factorisations() -> list[type[Factor]]:
    """Return the classes of factorisations that are counted, if ``is_whole``.

    An LU of the part for z is not counted, neither next to the bordered matrix that contains the
    part nor along straight pieces, which have no bordered matrices.
    """
    return [ScaledFactor, BorderedFactor]


@contextmanager
def _counting(owner: type, name: str, calls: Counter[str], kind: str) -> Iterator[None]:
    """Replace a method or property of a class by a counting method while the context is open."""
    own, original = vars(owner).get(name), getattr(owner, name)
    if isinstance(original, property):
        assert original.fget is not None
        setattr(owner, name, property(_with_count(original.fget, calls, kind)))
    else:
        setattr(owner, name, _with_count(original, calls, kind))
    try:
        yield
    finally:
        if own is None:  # inherited
            delattr(owner, name)
        else:
            setattr(owner, name, own)


def _with_count(function: Callable[..., Any], calls: Counter[str], kind: str) -> Callable[..., Any]:
    @wraps(function)
    def counting(*arguments: Any, **named: Any) -> Any:
        found = function(*arguments, **named)
        calls[kind] += getattr(arguments[0], "is_whole", True)
        return found

    return counting
