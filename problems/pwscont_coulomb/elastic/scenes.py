"""Scenes with elastic bodies. Bodies are built when a scene runs, not when scenes are listed."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, final

import numpy as np
import numpy.typing as npt

from pwscont import InvalidInputError
from pwscont.extending import Array
from pwscont_coulomb.elastic.contact_boundary import ContactBoundary
from pwscont_coulomb.elastic.elastic_body import ElasticBody
from pwscont_coulomb.elastic.loads import BodyForce, Support
from pwscont_coulomb.elastic.material import Lame, Material, Young
from pwscont_coulomb.elastic.meshes import library
from pwscont_coulomb.elastic.scene import ElasticScene


def triangle_body(material: Material | None = None, friction: float = 4.0) -> ElasticBody:
    """Return a P1 element with a free node: the paper's one-node problem.

    The node lies at the right angle of a right triangle whose other nodes are clamped. With normal
    and tangent of the horizontal side the node's stiffness is [[a, -b], [-b, a]],
    a = (lambda + 3 mu) / 2, b = (lambda + mu) / 2. A third of the body force acts on the node: here
    f_nu = 0.25 and f_t = alpha, as in Fig. 7.

    Parameters
    ----------
    material : Material, optional
        Default lambda = mu = 1, thus a = 2 and b = 1.
    friction : float
    """
    corners, element = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]), np.array([[0], [1], [2]])
    mesh = library().MeshTri(corners, element)
    return ElasticBody(
        mesh,
        Lame(1.0, 1.0) if material is None else material,
        supports=[Support(lambda x: x[0] + x[1] > 0.75)],
        contact=ContactBoundary(lambda x: x[1] < 0.25, friction=friction),
        loads=[BodyForce(constant=(0.0, -6.0 * 0.25), growing=(6.0, 0.0))],
    )


def block_body(nodes: int = 20, friction: float = 0.3) -> ElasticBody:
    """Return a rectangle on a foundation under pressure and shear at once.

    Twice as wide as high, E = 1 and nu = 0.3; the top is held 1 % of the height below and alpha
    percent of the height to the right of the unloaded place. Every alpha is a separate load: the
    law is static, and nothing is pressed first and sheared then.

    Parameters
    ----------
    nodes : int
        Number of contact nodes, at least 2.
    friction : float
    """
    _checked(nodes)
    across, up = np.linspace(0.0, 2.0, nodes), np.linspace(0.0, 1.0, max(2, nodes // 2 + 1))
    mesh = library().MeshQuad.init_tensor(across, up).with_defaults()
    return ElasticBody(
        mesh,
        Young(1.0, 0.3),
        supports=[Support("top", constant=(0.0, -0.01), growing=(0.01, 0.0))],
        contact=ContactBoundary("bottom", friction=friction),
    )


#: Most contact nodes: a body with 3000 contact nodes has ten million unknowns.
MOST_NODES = 3000
TOO_LARGE = "the mesh would have more unknowns than fit into memory"


def _checked(nodes: int) -> None:
    if nodes < 2:
        raise InvalidInputError(f"nodes must be at least 2, got {nodes}")
    if nodes > MOST_NODES:
        raise InvalidInputError(f"nodes must be at most {MOST_NODES}, got {nodes}: {TOO_LARGE}")


@final
@dataclass(frozen=True, slots=True)
class Slot:
    """A wedge of height and lower width 1 between a vertical and an inclined wall.

    Attributes
    ----------
    angle : float
        Angle between the right wall and the vertical, degrees.
    hanger : float
        Height of the soft block that holds the wedge from above.
    """

    angle: float = 15.0
    hanger: float = 0.5

    def width(self, y: Array) -> Array:
        """Return the width at a height."""
        width: Array = 1.0 + np.tan(np.radians(self.angle)) * np.minimum(y, 1.0)
        return width

    def mesh(self, nodes: int) -> Any:
        """Return a mesh of triangles with ``nodes`` nodes up each wall."""
        above = np.linspace(1.0, 1.0 + self.hanger, max(2, nodes // 2 + 1))
        heights = np.concatenate([np.linspace(0.0, 1.0, nodes), above[1:]])
        square = library().MeshTri.init_tensor(np.linspace(0.0, 1.0, nodes), heights)
        x, y = square.p
        mesh = type(square)(np.stack([x * self.width(y), y]), square.t)
        return mesh.with_subdomains(
            {"wedge": lambda x: x[1] < 1.0, "hanger": lambda x: x[1] > 1.0}
        ).with_boundaries(
            {"walls": self._on_walls, "top": lambda x: x[1] > 1.0 + 0.999 * self.hanger}
        )

    def _on_walls(self, x: Array) -> npt.NDArray[np.bool_]:
        near = 1e-9
        at_wall = (x[0] < near) | (x[0] > self.width(x[1]) - near)
        on_walls: npt.NDArray[np.bool_] = at_wall & (x[1] < 1.0)
        return on_walls

    def spread(self, x: Array) -> Array:
        """Return a force that grows outwards from the middle and presses the wedge to the walls."""
        return np.stack([0.02 * (x[0] - 0.5 * self.width(x[1])), np.zeros_like(x[1])])


def wedge_body(nodes: int = 9, friction: float = 0.5, angle: float = 15.0) -> ElasticBody:
    """Return a wedge that jams in a slot: the same pull may leave the wedge inside or outside.

    A wedge with E = 1 hangs on a soft block (E = 0.01) clamped on top. A constant body force
    spreads the wedge, which presses on the walls; alpha is a force that pulls upwards. Friction
    can hold the wedge in the slot under a pull under which the wedge can be out as well.

    Parameters
    ----------
    nodes : int
        Number of contact nodes of each wall, at least 2.
    friction : float
    angle : float
        Angle between the right wall and the vertical, in degrees, from 0 to less than 90.
    """
    _checked(nodes)
    if not 0.0 <= angle < 90.0:
        raise InvalidInputError(f"angle must be from 0 to less than 90 degrees, got {angle:g}")
    slot = Slot(angle)
    return ElasticBody(
        slot.mesh(nodes),
        {"wedge": Young(1.0, 0.3), "hanger": Young(0.01, 0.3)},
        supports=[Support("top")],
        contact=ContactBoundary("walls", friction=friction),
        loads=[BodyForce(constant=slot.spread, growing=(0.0, 0.01), subdomain="wedge")],
    )


#: The mesh that ``gmsh -2 press.geo`` makes from the file press.geo in the same folder.
PRESS_MESH = Path(__file__).parent / "data" / "press.msh"
ROUNDING = 0.4  # radius of the edges of the tool in press.geo


def press_body(friction: float = 0.3) -> ElasticBody:
    """Return a tool with rounded edges on a table, under pressure and shear at once.

    The top is held by 0.05 below and by 0.05 alpha to the right of the unloaded place.

    The mesh is read from a Gmsh file: 29 contact nodes on curved P2 elements, E = 1, nu = 0.3.
    The gap of a node on a rounded edge is the distance to the table along the node's normal.
    """
    return ElasticBody(
        PRESS_MESH,
        {"tool": Young(1.0, 0.3)},
        supports=[Support("top", constant=(0.0, -0.05), growing=(0.05, 0.0))],
        contact=ContactBoundary("sole", friction=friction, gap=_above_table),
    )


def _above_table(x: Array) -> Array:
    height = np.maximum(x[1], 0.0)
    gap: Array = height * ROUNDING / (ROUNDING - height)
    return gap


def triangle() -> ElasticScene:
    """Return the scene of :func:`triangle_body`."""
    return ElasticScene(
        "triangle", "one element: the paper's one-node problem, F = 4", triangle_body, (-2.0, 2.0)
    )


def block(nodes: int = 20, friction: float = 0.3) -> ElasticScene:
    """Return the scene of :func:`block_body`."""
    return ElasticScene(
        "block",
        f"a block on its foundation under pressure and shear, {nodes} contact nodes, "
        f"F = {friction:g}",
        partial(block_body, nodes, friction),
        (0.0, 2.0),
        at=(1.0,),
    )


def wedge(nodes: int = 9, friction: float = 0.5, angle: float = 15.0) -> ElasticScene:
    """Return the scene of :func:`wedge_body`, with ``nodes`` contact nodes on each wall."""
    return ElasticScene(
        "wedge",
        f"a wedge that jams in its slot under an upward pull, {2 * nodes} contact nodes, "
        f"F = {friction:g}",
        partial(wedge_body, nodes, friction, angle),
        (0.0, 0.2),
        at=(0.07,),
    )


def press(friction: float = 0.3) -> ElasticScene:
    """Return the scene of :func:`press_body`."""
    return ElasticScene(
        "press",
        f"a rounded tool from a Gmsh mesh, pressure and shear, 29 contact nodes, F = {friction:g}",
        partial(press_body, friction),
        (0.0, 1.0),
        at=(0.5,),
    )
