"""The check of a search's contract."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np

from pwscont.basics.given import checked_kind
from pwscont.basics.guarantee import SearchScope
from pwscont.continuation.kit.samples import (
    ON_CURVE,
    StateSample,
    defect,
    off_curve,
    report,
    samples,
)
from pwscont.curve.curve import Curve
from pwscont.linear.factorise import last_unit
from pwscont.search import Search
from pwscont.system.check import Report
from pwscont.system.inspection import Defect
from pwscont.system.selection import Selection


def check_search(search: Search) -> Report:
    """Check what a search promises, on known systems.

    - ``starts`` yields points, shape (n + 1,), in the interval, with errors that fit this shape.
    - The points solve the system in their cell, to within these errors.
    - ``searched`` returns a :class:`~pwscont.extending.SearchScope`.

    Returns
    -------
    Report

    Examples
    --------
    >>> from pwscont import EndPoints, check_search
    >>> bool(check_search(EndPoints()))
    True
    """
    checked_kind("search", search, Search)
    return report(
        (d for sample in samples() for d in _wrong_starts(search, sample)), len(samples())
    )


def _wrong_starts(search: Search, sample: StateSample) -> Iterator[Defect]:
    (lo, hi), metric, size = sample.interval, sample.curve.metric, sample.system.size
    system = sample.system.within(lo, hi)
    if not isinstance(search.searched(system), SearchScope):
        yield defect("searched() must return a SearchScope", sample.x)
    starts = search.starts(system, metric, sample.interval)
    if not isinstance(starts, Iterable):
        yield defect(f"starts() must yield pairs (x, error), got {starts!r}", sample.x)
        return
    for x, error in starts:
        point, samples_of_error = np.asarray(x), np.atleast_2d(error)
        if point.shape != (size + 1,) or samples_of_error.shape[1:] != (size + 1,):
            shapes = f"a start has shapes {np.shape(x)} and {np.shape(error)}"
            yield defect(f"{shapes}, where x = (z, alpha) has {size + 1} entries", sample.x)
            return
        if not lo <= point[-1] <= hi:
            yield defect("a start lies outside the interval", point)
            return
        selection = Selection(system, system.character(point[:-1], float(point[-1])))
        off = off_curve(Curve(selection, metric), point, last_unit(size + 1))
        if not off <= ON_CURVE + 10.0 * max(metric.norm(e) for e in samples_of_error):
            yield defect(f"a start is off the curve by {off:.1e}, and its error is less", point)
