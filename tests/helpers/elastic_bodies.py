"""Small elastic bodies for the tests, and a check of solutions that shares no code with them."""

import numpy as np
import skfem
from pwscont_coulomb.elastic import ContactBoundary, ElasticBody, Lame, Support

KINDS = {"P1": ("tri", 1), "P2": ("tri", 2), "Q1": ("quad", 1), "Q2": ("quad", 2)}


def square(kind, k=4, distort=0.2, seed=0):
    """Return the unit square with inner nodes moved at random, k elements along each side."""
    family = skfem.MeshTri if kind == "tri" else skfem.MeshQuad
    ticks = np.linspace(0.0, 1.0, k + 1)
    mesh = family.init_tensor(ticks, ticks)
    inner = mesh.interior_nodes()
    moves = np.random.default_rng(seed).uniform(-distort / k, distort / k, (2, len(inner)))
    points = mesh.p.copy()
    points[:, inner] += moves
    return family(points, mesh.t).with_defaults()


def strip(kind="quad", nx=6, ny=3, length=2.0, height=1.0):
    family = skfem.MeshTri if kind == "tri" else skfem.MeshQuad
    return family.init_tensor(
        np.linspace(0.0, length, nx + 1), np.linspace(0.0, height, ny + 1)
    ).with_defaults()


def pressed(mesh, friction=0.5, order=None, down=0.01, material=None, gap=0.0):
    """Return a body clamped on top, pressed down by a constant and sheared by alpha."""
    return ElasticBody(
        mesh,
        material or Lame(1.2, 0.8),
        supports=[Support("top", (0.0, -down), (down, 0.0))],
        contact=ContactBoundary("bottom", friction=friction, gap=gap),
        order=order,
    )


def jammed():
    """Return a body clamped at its left side whose load paths have up to seven solutions."""
    return ElasticBody(
        strip("tri", 3, 2, length=1.0),
        Lame(1.2, 0.8),
        supports=[Support("left", (-0.01, -0.002), (0.01, 0.0))],
        contact=ContactBoundary("bottom", friction=8.0),
    )


GAUSS = ((-np.sqrt(0.6), 5.0 / 9.0), (0.0, 8.0 / 9.0), (np.sqrt(0.6), 5.0 / 9.0))


def _gradients(corners):
    """Yield (weight, gradients (nodes, 2)) at the points of a P1 or Q1 element, textbook style."""
    if len(corners) == 3:
        M = np.column_stack([np.ones(3), corners])
        yield 0.5 * abs(np.linalg.det(M)), np.linalg.inv(M)[1:].T
        return
    signs = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    for s, ws in GAUSS:
        for t, wt in GAUSS:
            local = 0.25 * np.column_stack(
                [signs[:, 0] * (1 + signs[:, 1] * t), signs[:, 1] * (1 + signs[:, 0] * s)]
            )
            J = corners.T @ local
            yield ws * wt * abs(np.linalg.det(J)), local @ np.linalg.inv(J)


def internal_forces(mesh, lam, mu, u):
    """Return the nodal forces (k, 2) of displacements (k, 2), element by element: int B^T D B u."""
    forces = np.zeros_like(u)
    D = np.array([[lam + 2 * mu, lam, 0.0], [lam, lam + 2 * mu, 0.0], [0.0, 0.0, mu]])
    for nodes in mesh.t.T:
        for weight, g in _gradients(mesh.p[:, nodes].T):
            B = np.zeros((3, 2 * len(nodes)))
            B[0, 0::2], B[1, 1::2] = g[:, 0], g[:, 1]
            B[2, 0::2], B[2, 1::2] = g[:, 1], g[:, 0]
            f = weight * B.T @ D @ B @ u[nodes].ravel()
            forces[nodes] += f.reshape(-1, 2)
    return forces


def violations(mesh, lam, mu, u, held, contact, friction, gap, lam_nu, lam_t):
    """Return how far a solution breaks equilibrium, contact and friction, relative.

    Contact lies on the bottom: normals point down, tangents to the right.
    """
    residual = internal_forces(mesh, lam, mu, u)
    residual[contact] -= np.column_stack([lam_t, -lam_nu])
    free = np.setdiff1d(np.arange(len(u)), held)
    length = np.abs(u).max()
    force = (lam + 2 * mu) * length  # what a strain of order one would cost
    u_nu, u_t = -u[contact, 1], u[contact, 0]
    bound = friction * np.abs(lam_nu)
    slack = np.minimum(gap - u_nu, 0.0), np.minimum(-lam_nu, 0.0), np.minimum(bound - abs(lam_t), 0)
    return {
        "equilibrium": np.abs(residual[free]).max() / force,
        "penetration": np.abs(slack[0]).max() / length,
        "tension": np.abs(slack[1]).max() / force,
        "complementarity": np.abs(lam_nu * (gap - u_nu)).max() / (force * length),
        "cone": np.abs(slack[2]).max() / force,
        # F |lam_nu| |u_t| = -lam_t u_t: below the bound the node sticks, else it resists slip
        "slip": np.abs(bound * np.abs(u_t) + lam_t * u_t).max() / (force * length),
    }
