"""Measures by name, as the command line takes them: ``max-count``, ``count-at=0.5``."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from difflib import get_close_matches
from functools import partial
from typing import Any

from pwscont import InvalidInputError, UnknownNameError
from pwscont.extending import short
from pwscont.studies.measures import (
    CountAt,
    CriticalValue,
    FirstFold,
    MaxCount,
    Measure,
    NonUnique,
    NonUniqueLength,
    OfGraph,
    QuantityAt,
)
from pwscont.studies.problem import checked_column


def _critical(text: str, bracket: bool = False) -> Measure:
    setting, *numbers = text.split(":")
    ends_and_tolerance: Any = [*map(float, numbers), *[None] * (len(numbers) == 2)]
    lo, hi, tolerance = ends_and_tolerance
    return CriticalValue(setting, lo, hi, tolerance=tolerance, bracket=bracket)


def _extreme(of_all: Callable[[Iterable[float]], Any], text: str) -> Measure:
    name, alpha = text.rsplit("@", 1)
    return QuantityAt(name, float(alpha), of_all)


#: Names of measures without value, and names of measures with a value: the form of the value, and
#: the function that makes the measure from the value.
SIMPLE: Mapping[str, Callable[[], Measure]] = {
    "max-count": MaxCount,
    "first-fold": FirstFold,
    "non-unique": NonUnique,
    "non-unique-length": NonUniqueLength,
}
WITH_VALUE: Mapping[str, tuple[str, Callable[[str], Measure]]] = {
    "count-at": ("ALPHA", lambda text: CountAt(float(text))),
    "critical": ("SETTING:LO:HI[:TOLERANCE]", _critical),
    "critical-bracket": ("SETTING:LO:HI[:TOLERANCE]", partial(_critical, bracket=True)),
    "largest": ("QUANTITY@ALPHA", partial(_extreme, max)),
    "smallest": ("QUANTITY@ALPHA", partial(_extreme, min)),
}
#: All measures with the forms of the values, in words.
FORMS = ", ".join([*SIMPLE, *(f"{name}={form}" for name, (form, _) in WITH_VALUE.items())])


def measure_named(text: str) -> Measure:
    """Return the measure of a name, such as ``critical=friction:0.1:5``."""
    name, sign, value = text.partition("=")
    if name in SIMPLE and not sign:
        return SIMPLE[name]()
    if name in WITH_VALUE:
        form, make = WITH_VALUE[name]
        try:
            return make(value)
        except InvalidInputError:
            raise
        except ValueError as error:
            raise InvalidInputError(f"measure {text!r} is not of the form {name}={form}") from error
    if name in SIMPLE:
        raise InvalidInputError(f"measure {text!r}: {name} takes no value")
    near = get_close_matches(name, [*SIMPLE, *WITH_VALUE], n=2, cutoff=0.5)
    hint = f"; did you mean {' or '.join(near)}?" if near else ""
    raise UnknownNameError(f"there is no measure {text!r}; measures are {FORMS}{hint}")


def checked_measures(given: Mapping[str, Any] | Iterable[str]) -> dict[str, Measure]:
    """Return {name of the column: measure} for measures given by name or as objects.

    Parameters
    ----------
    given : mapping of str to Measure, callable or str, or iterable of str
        A callable takes a :class:`pwscont.BranchGraph`; a text is the name of a measure.
    """
    if isinstance(given, str):
        raise InvalidInputError(f"measure must be several names, as in [{given!r}], got a text")
    if not isinstance(given, Iterable):
        raise InvalidInputError(f"measure must be several names, got {short(repr(given))}")
    if not isinstance(given, Mapping):
        names = list(given)
        if twice := [name for i, name in enumerate(names) if name in names[:i]]:
            raise InvalidInputError(f"measure {twice[0]!r} is asked for twice")
        given = {name: name for name in names}
    if not given:
        raise InvalidInputError(f"a study needs something to measure: {FORMS}")
    return {checked_column("measure", name): _measure(name, what) for name, what in given.items()}


def _measure(name: str, what: Any) -> Measure:
    if isinstance(what, str):
        return measure_named(what)
    if isinstance(what, Measure):
        return what
    if isinstance(what, type) or not callable(what):
        words = "a Measure, a function of the graph, or the name of a measure"
        raise InvalidInputError(f"measure {name!r} must be {words}, got {short(repr(what))}")
    return OfGraph(what)
