"""The arrays that detectors return: lists, and one buffer for all readings."""

import numpy as np
import pytest
from circle import Circle
from readings import At

from pwscont import explore
from pwscont.extending import Reading


def lists(values):
    return Reading(values, [0.0, 0.0])


def one_buffer(values, buffer=np.zeros(2)):  # noqa: B008  one for all readings
    buffer[:] = values
    return Reading(buffer, np.zeros(2))


def one_reading(values, reading=Reading(np.zeros(2), np.zeros(2))):  # noqa: B008
    reading.values[:] = values
    return reading


@pytest.mark.parametrize("given", [lists, one_buffer, one_reading])
@pytest.mark.sweep(4)
def test_detectors_may_return_lists_and_one_buffer_for_all_readings(given):
    """Readings at both ends of a step are compared, and the end is read after the beginning."""

    class Somewhere(At):
        def read(self, curve, state):
            return given(super().read(curve, state).values)

    system, interval = Circle(), (-0.9, 0.9)
    marks = [
        [point.alpha for point in explore(system, interval, detectors=[detector]).special_points()]
        for detector in (At(), Somewhere())
    ]
    assert len(marks[0]) > len(explore(system, interval).special_points())
    assert marks[0] == pytest.approx(marks[1], abs=1e-12)
