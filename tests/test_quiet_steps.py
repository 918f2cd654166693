"""Steps on which nothing is read: nothing would have been found."""

import numpy as np
import pytest
from circle import Circle
from pwscont_coulomb.scenes import example2, example3, fig10, fig12, fig13
from test_contracts import At
from test_smooth_special_points import make, pitchfork, transcritical

from pwscont import PseudoArclength, StepSize, check_detector, explore
from pwscont.extending import Reading
from pwscont.transitions.watch import Watch, first_on_curve


def scene(make_scene):
    made = make_scene()
    return made.system, made.interval


CASES = {
    "fig10": lambda: scene(fig10),
    "fig12": lambda: scene(fig12),
    "fig13": lambda: scene(fig13),
    "example2": lambda: scene(example2),
    "example3": lambda: scene(example3),
    "circle": lambda: (Circle(), (-0.9, 0.9)),
    "transcritical": lambda: (make(transcritical), (-1.0, 1.0)),
    "pitchfork": lambda: (make(pitchfork), (-1.0, 1.0)),
}


def look_at_quiet_steps(monkeypatch, found):
    """Let every step that is quiet be looked at as if it were not."""
    quiet = Watch.is_quiet

    def looked_at(self, segment, start, end):
        is_quiet = quiet(self, segment, start, end)
        if is_quiet:
            with monkeypatch.context() as patch:
                patch.setattr(Watch, "is_quiet", lambda *_: False)
                found.append(first_on_curve(self, segment, start, end))
        return is_quiet

    monkeypatch.setattr(Watch, "is_quiet", looked_at)


@pytest.mark.parametrize("length", [0.1, 0.02])
@pytest.mark.parametrize("case", CASES)
def test_nothing_is_on_a_quiet_step(case, length, monkeypatch):
    system, interval = CASES[case]()
    found = []
    look_at_quiet_steps(monkeypatch, found)
    explore(system, interval, stepper=PseudoArclength(step_size=StepSize(largest=length)))
    assert len(found) > 10
    assert set(found) == {None}


class AlwaysQuiet(At):
    def is_quiet(self, segment):
        return True


def test_a_detector_that_is_quiet_where_its_function_vanishes():
    assert "is_quiet() must not be true" in str(check_detector(AlwaysQuiet()))


def lists(values):
    return Reading(values, [0.0, 0.0])


def one_buffer(values, buffer=np.zeros(2)):  # noqa: B008  one for all readings
    buffer[:] = values
    return Reading(buffer, np.zeros(2))


def one_reading(values, reading=Reading(np.zeros(2), np.zeros(2))):  # noqa: B008
    reading.values[:] = values
    return reading


@pytest.mark.parametrize("given", [lists, one_buffer, one_reading])
def test_detectors_may_return_lists_and_one_buffer_for_all_readings(given):
    """Readings at both ends of a step are compared, and the end is read after the beginning."""

    class Somewhere(At):
        def read(self, curve, state):
            return given(super().read(curve, state).values)

    system, interval = CASES["circle"]()
    marks = [
        [point.alpha for point in explore(system, interval, detectors=[detector]).special_points()]
        for detector in (At(), Somewhere())
    ]
    assert len(marks[0]) > len(explore(system, interval).special_points())
    assert marks[0] == pytest.approx(marks[1], abs=1e-12)
