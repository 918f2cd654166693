"""Solutions on an elastic body, for a view in the browser."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import final

import numpy as np

from pwscont import Character
from pwscont.extending import Array, BodyPicture, Indices, Shapes
from pwscont_coulomb.coulomb import Coulomb
from pwscont_coulomb.elastic.placement import Placement, magnified
from pwscont_coulomb.elastic.problem import ElasticProblem
from pwscont_coulomb.elastic.units import UNITLESS, Units
from pwscont_coulomb.modes import Mode, modes


@final
@dataclass(frozen=True, slots=True, eq=False)
class ElasticPicture(BodyPicture):
    """The deformed body with contact states, pressure and shear.

    Displacements are magnified alike in all states, so that the largest can be seen.

    Attributes
    ----------
    problem : ElasticProblem
        The problem whose system was solved.
    units : Units
        The units of lengths and stresses.
    scale : float, optional
        Factor by which displacements are enlarged; the default makes small displacements visible.
    system : Coulomb, optional
        The system that was solved, which knows the friction; default ``problem.along_load()``.

    Examples
    --------
    >>> from pwscont import View, explore
    >>> from pwscont_coulomb.elastic import ElasticPicture
    >>> from pwscont_coulomb.elastic.scenes import triangle
    >>> problem = triangle().build().condensed()
    >>> view = View(explore(problem.along_load(), (-2.0, 2.0)), "u_t", body=ElasticPicture(problem))
    """

    problem: ElasticProblem
    units: Units = UNITLESS
    scale: float | None = None
    system: Coulomb | None = None

    def shapes(self, points: Array) -> Shapes:
        """Return the body in several states (z, alpha), shape (states, n + 2 p + 1)."""
        body, contact = self.problem.elastic, self.problem.elastic.contact
        moved = np.array([self._displacements(x) for x in points])
        largest = float(np.abs(moved).max(initial=0.0))
        placement = Placement.of(body, self.scale or magnified(body, largest))
        normal, tangential = self.problem.multipliers(points[:, :-1].T)
        pressure = -normal.T / contact.areas
        return Shapes(
            corners=self._corners(),
            positions=placement.rest + placement.factor * moved.transpose(0, 2, 1),
            shade=np.array([_shear(body.stresses(some)) for some in moved]),
            contact=contact.nodes,
            tangents=contact.tangents,
            pressure=pressure,
            shear=tangential.T / contact.areas,
            bound=self._friction(points) * pressure,
            arc=contact.arc,
            part=contact.part,
            obstacles=tuple(outline for _, outline in placement.outlines()),
            held=body.clamped,
            note=placement.words(),
            shade_label=self.units.with_stress("largest shear stress"),
            arc_label=self.units.with_length("length along the boundary"),
            force_label=self.units.with_stress("force per area"),
        )

    def contact_states(self, character: Character) -> Sequence[str]:
        """Return what each contact node does in a cell."""
        return [Mode(mode).word for mode in modes(character)]

    def _displacements(self, x: Array) -> Array:
        z, alpha = x[:-1], float(x[-1])
        return self.problem.displacements(z, self.problem.load_parameter(z, alpha))

    def _corners(self) -> Indices:
        space = self.problem.elastic.space
        corners: Indices = space.element_nodes[: space.mesh.t.shape[0]].T
        return corners

    def _friction(self, points: Array) -> Array:
        """Return the friction coefficient of each contact node in each state."""
        if self.system is None:
            return np.broadcast_to(self.problem.friction, (len(points), self.problem.body.p))
        return np.array([self.system.friction_at(float(alpha)) for alpha in points[:, -1]])


def _shear(stresses: Array) -> Array:
    """Return two components for each element whose norm is the largest shear stress."""
    xx, yy, xy = stresses
    return np.stack([0.5 * (xx - yy), xy])
