"""Solutions as VTU files for ParaView, written by meshio."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from pwscont.extending import Array, Indices
from pwscont_coulomb.elastic.discretised_body import DiscretisedBody
from pwscont_coulomb.elastic.libraries import loaded
from pwscont_coulomb.elastic.recovery import BodyState

#: Number of nodes of an element -> meshio's name; scikit-fem orders the nodes alike.
CELLS = {3: "triangle", 6: "triangle6", 4: "quad", 9: "quad9"}


def write_vtu(path: Path, body: DiscretisedBody, state: BodyState) -> Path:
    """Write the mesh with a solution.

    Point data: ``displacement``; of contact nodes (elsewhere 0) ``contact_pressure``,
    ``contact_shear`` and ``contact_force``; ``contact_mode``: -1 no contact node, 0 open,
    1 stick, 2 slip+, 3 slip-. Cell data: ``stress_xx``, ``stress_yy``, ``stress_xy``.
    """
    meshio = loaded("meshio")
    contact, k = body.contact, body.space.count
    force = state.normal_force * contact.normals + state.tangential_force * contact.tangents
    mode = np.full(k, -1)
    mode[contact.nodes] = state.modes
    points = {
        "displacement": _in_space(state.displacements),
        "contact_pressure": _at(contact.nodes, state.pressure, k),
        "contact_shear": _at(contact.nodes, state.shear, k),
        "contact_force": _in_space(_at(contact.nodes, force.T, k)),
        "contact_mode": mode,
    }
    cells = [(CELLS[len(body.space.element_nodes)], body.space.element_nodes.T)]
    names = ("stress_xx", "stress_yy", "stress_xy")
    stresses = {name: [values] for name, values in zip(names, state.stresses, strict=True)}
    mesh = meshio.Mesh(_in_space(body.positions.T), cells, point_data=points, cell_data=stresses)
    meshio.write(path, mesh, file_format="vtu")
    return path


def _at(nodes: Indices, values: Array, count: int) -> Array:
    found = np.zeros((count, *values.shape[1:]))
    found[nodes] = values
    return found


def _in_space(vectors: Array) -> Array:
    """Return vectors (k, 2) with a third component 0."""
    return np.column_stack([vectors, np.zeros(len(vectors))])
