"""Scenes with elastic bodies.  Bodies are built when a scene runs, not when it is listed."""

from __future__ import annotations

import numpy as np

from pwscont_coulomb.elastic.contact_boundary import ContactBoundary
from pwscont_coulomb.elastic.elastic_body import ElasticBody
from pwscont_coulomb.elastic.loads import BodyForce, Support
from pwscont_coulomb.elastic.material import Lame, Material, Young
from pwscont_coulomb.elastic.meshes import library
from pwscont_coulomb.elastic.scene import ElasticScene

#: Each side of the block's mesh has elements of about this aspect ratio.
TALL = 0.5


def triangle_body(material: Material | None = None, friction: float = 4.0) -> ElasticBody:
    """Return one P1 element with one free node: the paper's one-node problem.

    The node lies at the right angle of a right triangle whose other nodes are clamped. With
    normal and tangent of its horizontal side its stiffness is [[a, -b], [-b, a]],
    a = (lambda + 3 mu) / 2, b = (lambda + mu) / 2. A third of the body force acts on it: here
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
    """Return a rectangle on a foundation, clamped on top, compressed, then sheared by alpha.

    Twice as wide as high, E = 1 and nu = 0.3; the top is pressed down by 1 % of the height and
    moves to the right by alpha percent of it.

    Parameters
    ----------
    nodes : int
        Number of contact nodes, at least 2.
    friction : float
    """
    across, up = np.linspace(0.0, 2.0, nodes), np.linspace(0.0, 1.0, max(2, nodes // 2 + 1))
    mesh = library().MeshQuad.init_tensor(across, up).with_defaults()
    return ElasticBody(
        mesh,
        Young(1.0, 0.3),
        supports=[Support("top", constant=(0.0, -0.01), growing=(0.01, 0.0))],
        contact=ContactBoundary("bottom", friction=friction),
    )


def triangle() -> ElasticScene:
    """Return the scene of :func:`triangle_body`."""
    return ElasticScene(
        "triangle", "one element: the paper's one-node problem, F = 4", triangle_body, (-2.0, 2.0)
    )


def block() -> ElasticScene:
    """Return the scene of :func:`block_body` with 20 contact nodes."""
    return ElasticScene(
        "block",
        "a block compressed, then sheared on its foundation, 20 contact nodes, F = 0.3",
        block_body,
        (0.0, 2.0),
        at=(1.0,),
    )
