"""Whole bodies against GetFEM, which makes mesh, stiffness, forces and solution on its own.

It runs where GetFEM is installed for the Python that the peers run in, /usr/bin/python3 or
PEER_PYTHON (Debian: apt install python3-getfem).
"""

import sys
from pathlib import Path

import numpy as np
import pytest
import skfem
from pwscont_coulomb.elastic import BodyForce, ContactBoundary, ElasticBody, Lame, Support, recover

from pwscont import explore

sys.path.append(str(Path(__file__).parents[1] / "benchmarks" / "peers"))
from ask import ask

#: Both solve one system of equations, by other factorisations.
AGREE = 2e-13

#: scikit-fem's nodes of an element in GetFEM's order.
ORDER = {3: [0, 1, 2], 6: [0, 3, 1, 5, 4, 2], 4: [0, 1, 3, 2], 9: [0, 4, 1, 7, 8, 5, 3, 6, 2]}
#: scikit-fem's quadrature under GetFEM's name, by number of points.
INTEGRATION = {
    3: "IM_TRIANGLE(2)",
    6: "IM_TRIANGLE(4)",
    9: "IM_GAUSS_PARALLELEPIPED(2,4)",
    25: "IM_GAUSS_PARALLELEPIPED(2,8)",
}
FAMILIES = {
    "P1": (skfem.MeshTri, 1),
    "P2": (skfem.MeshTri, 2),
    "Q1": (skfem.MeshQuad, 1),
    "Q2": (skfem.MeshQuad, 2),
    "curved P2": (skfem.MeshTri2, 2),
    "curved Q2": (skfem.MeshQuad2, 2),
}


def bulged(x):
    """Return positions moved so that all edges bend, the lower one too; the top stays."""
    lower = 1.0 - x[1]
    return np.stack([x[0] + 0.04 * np.sin(3.0 * x[1]), x[1] - 0.1 * lower * x[0] * (1.2 - x[0])])


def mesh_of(family):
    """Return a distorted strip of two materials; with MeshTri2 and MeshQuad2 edges are curved."""
    straight = skfem.MeshTri if issubclass(family, skfem.MeshTri1) else skfem.MeshQuad
    mesh = straight.init_tensor(np.linspace(0.0, 1.2, 5), np.linspace(0.0, 1.0, 4))
    names = {"bottom": lambda x: x[1] < 1e-9, "top": lambda x: x[1] > 1.0 - 1e-9}
    named = mesh.with_boundaries(names).with_subdomains(
        {"left": lambda x: x[0] < 0.6, "right": lambda x: x[0] > 0.6}
    )
    made = named if family is straight else family.from_mesh(named)
    return type(made)(
        bulged(made.doflocs), made.t, _boundaries=named.boundaries, _subdomains=named.subdomains
    )


def body_of(kind):
    family, order = FAMILIES[kind]
    return ElasticBody(
        mesh_of(family),
        {"left": Lame(1.2, 0.8), "right": Lame(3.0, 2.5)},
        supports=[Support("top", constant=(0.002, -0.03), growing=(0.02, 0.0))],
        contact=ContactBoundary(
            "bottom", friction=lambda x: 0.1 + 0.3 * x[0], gap=lambda x: 0.02 * x[0] ** 2
        ),
        loads=[BodyForce(constant=(0.003, -0.01))],
        order=order,
    )


def as_getfem_gets_it(body, alpha):
    space, contact = body.space, body.contact
    mesh, cells = space.mesh, space.element_nodes
    curved = mesh.doflocs.shape[1] > mesh.nvertices
    corners = len(mesh.t)
    shape = cells if curved else mesh.t
    letter, k = ("PK", order_of(len(cells))) if corners == 3 else ("QK", order_of(len(cells)))
    lam, mu = body._lame
    held = np.unique(body.held // 2)
    return {
        "points": (body.positions if curved else mesh.p).tolist(),
        "cells": shape[ORDER[len(shape)]].T.tolist(),
        "geometry": f"GT_{letter}(2,{order_of(len(shape))})",
        "element": f"FEM_{letter}(2,{k})",
        "constants": f"FEM_{letter}(2,0)",
        "integration": INTEGRATION[space._basis.dx.shape[1]],
        "lam": lam.tolist(),
        "mu": mu.tolist(),
        "force": [0.003, -0.01],
        "held": body.positions[:, held].T.tolist(),
        "given": [[0.002 + 0.02 * alpha, -0.03]] * len(held),
        "nodes": contact.positions.T.tolist(),
        "normals": contact.normals.tolist(),
        "F": contact.friction.tolist(),
        "gap": contact.gap.tolist(),
        "r": 1.0,
    }


def order_of(nodes):
    return 1 if nodes in (3, 4) else 2


@pytest.mark.parametrize("kind", FAMILIES)
def test_displacements_and_contact_forces_are_getfem_s(kind):
    """P1, P2, Q1, Q2, straight and curved, two materials, friction and gap per node."""
    body, alpha = body_of(kind), 0.5
    answer = ask("getfem_body.py", as_getfem_gets_it(body, alpha))
    if answer.get("missing", "").startswith("not on this machine"):
        pytest.skip(f"GetFEM is {answer['missing']}")
    assert "missing" not in answer, answer["missing"]
    problem = body.condensed()
    (solution,) = explore(problem.along_load(), (0.0, 2.0)).solutions(alpha)
    state = recover(problem, solution)
    assert len(set(state.modes)) >= 3  # some open, some stick, some slip
    positions, u = np.array(answer["positions"]), np.array(answer["u"]).reshape(-1, 2)
    away = np.abs(positions[:, :, np.newaxis] - body.positions[:, np.newaxis]).max(axis=0)
    same = away.argmin(axis=0)
    assert sorted(same) == list(range(len(u)))
    assert away.min(axis=0).max() < 1e-15
    off = np.abs(u[same] - state.displacements).max() / np.abs(u).max()
    assert off < AGREE, off
    for theirs, ours in (("lam_nu", state.normal_force), ("lam_t", state.tangential_force)):
        off = np.abs(answer[theirs] - ours).max() / np.abs(state.normal_force).max()
        assert off < AGREE, off
