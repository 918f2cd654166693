"""The starts that can be followed, among those that a search finds."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import final

import numpy as np

from pwscont.basics.guarantee import Guarantee, SearchScope
from pwscont.curve.error_samples import has_digits, is_inside
from pwscont.curve.metric import Metric
from pwscont.search.enumeration import Found
from pwscont.system.box import Box


@final
class Usable:
    """Starts within the bounds, of which at least one digit is certain; the others are counted.

    Parameters
    ----------
    starts : iterable of (x, error)
    metric : Metric
    box : Box
    """

    def __init__(self, starts: Iterable[Found], metric: Metric, box: Box) -> None:
        self._starts, self._metric, self._box = starts, metric, box
        self._uncertain = 0

    def __iter__(self) -> Iterator[Found]:
        for x, given in self._starts:
            error = np.atleast_2d(given)  # searches may give one sample as a vector
            if not has_digits(x, error, self._metric.scale):
                self._uncertain += 1
            elif is_inside(self._box, x, error, self._metric.scale):
                yield x, error

    @property
    def is_part(self) -> bool:
        """Whether some starts could not be followed."""
        return self._uncertain > 0

    def lowered(self, searched: SearchScope) -> SearchScope:
        """Return what was searched, without a promise where a start could not be followed."""
        if not self._uncertain:
            return searched
        lost = (
            f"{self._uncertain} of the points found not followed, for no digit of them is certain"
        )
        return SearchScope(f"{searched.what}; {lost}", Guarantee.NOTHING)
