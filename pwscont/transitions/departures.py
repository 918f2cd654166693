"""All rays that leave a given solution."""

from __future__ import annotations

import numpy as np

from pwscont.foundation.arrays import Array
from pwscont.foundation.kind import Kind
from pwscont.foundation.outcome import Trouble
from pwscont.model.selection import Selection
from pwscont.model.system import PiecewiseSystem
from pwscont.numerics.curve import Curve, State
from pwscont.numerics.linalg import bordered, last_unit
from pwscont.numerics.metric import Metric
from pwscont.transitions.detector import Arrival
from pwscont.transitions.rays import Ray, beyond, inward_ray, vanishing


def departures(system: PiecewiseSystem, metric: Metric, x: Array, error: Array) -> Arrival:
    """Return the special point that a solution ``x`` is, with its rays.

    A point inside a cell has two rays on one curve and the kind START.
    """
    selection = Selection(system, system.character(x[:-1], float(x[-1])))
    zero = vanishing(selection, x, error)
    if len(zero) == 0:
        return _inside(Curve(selection, metric), x, error)
    if len(zero) == 1:
        return _on_interface(Curve(selection, metric), x, error, int(zero[0]))
    return Arrival(Kind.CORNER, x, f"{len(zero)} test functions vanish at the start", ())


def _inside(curve: Curve, x: Array, error: Array) -> Arrival:
    tangent = _null_vector(curve, x)
    if tangent is None:
        return Arrival(Kind.STOPPED, x, str(Trouble.SINGULAR.value), ())
    border = bordered(curve.selection.jacobian(x), curve.metric.covector(tangent))
    forth = Ray(curve, State(x, tangent, error, border.sign))
    return Arrival(Kind.START, x, f"start in {curve.selection.label}", (forth, forth.reversed()))


def _null_vector(curve: Curve, x: Array) -> Array | None:
    """Return the unit tangent, by bordering with each unit vector until one is regular.

    The border e_alpha fails exactly at a fold, another one at most at a branch point.
    """
    jacobian, size = curve.selection.jacobian(x), len(x)
    for j in range(size - 1, -1, -1):
        row = np.zeros(size)
        row[j] = 1.0
        factor = bordered(jacobian, row)
        if not factor.is_singular():
            return curve.metric.normalised(factor.solve(last_unit(size)))
    return None


def _on_interface(curve: Curve, x: Array, error: Array, test: int) -> Arrival:
    other = Curve(Selection(curve.selection.system, beyond(curve.selection, x, test)), curve.metric)
    rays = [inward_ray(side, x, error, test) for side in (curve, other)]
    found = tuple(ray for ray in rays if ray is not None)
    message = curve.selection.system.describe_transition(
        curve.selection.character, other.selection.character
    )
    return Arrival(Kind.TRANSITION, x, message, found)
