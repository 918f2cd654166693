"""One elastic body in contact with friction by GetFEM, as a program of its own.

    /usr/bin/python3 -I getfem_body.py < body.json > answer.json

The body is {"points", "cells", "geometry", "element", "constants", "integration", "lam", "mu",
"force", "held", "given", "nodes", "normals", "F", "gap", "r"}: corners and middle nodes of each
cell in GetFEM's order, names of GetFEM's geometric transformation, element, piecewise constants
and integration method, Lamé's parameters of each cell, a constant body force, and positions of the
held nodes (with their displacements) and of the contact nodes (with unit normals into the
obstacle, friction, gap). The answer is {"positions", "u", "lam_nu", "lam_t"}, or {"missing"} where
GetFEM is not on the machine.

GetFEM makes mesh, shape functions, stiffness and forces, and solves with its contact brick from
rest: nothing but the data above is taken from elsewhere.
"""

import json
import os
import sys

#: GetFEM's Newton stops below this residual. On the way there it converges at once; below 2e-13
#: it only stirs its rounding.
SMALL = 1e-12


class Body:
    """GetFEM's model of a body."""

    def __init__(self, np, getfem, given):
        self.np, self.getfem, self.given = np, getfem, given
        self.mesh = self._mesh()
        self.space = self._space(given["element"], 2)
        self.constants = self._space(given["constants"], 1)
        self.integral = getfem.MeshIm(self.mesh, getfem.Integ(given["integration"]))
        self.positions = self.space.basic_dof_nodes()[:, ::2]
        self.model = self._model()

    def _mesh(self):
        mesh, points = self.getfem.Mesh("empty", 2), self.np.array(self.given["points"])
        shape = self.getfem.GeoTrans(self.given["geometry"])
        for cell in self.given["cells"]:
            mesh.add_convex(shape, points[:, cell])
        return mesh

    def _space(self, name, dimension):
        space = self.getfem.MeshFem(self.mesh, dimension)
        space.set_fem(self.getfem.Fem(name))
        return space

    def _model(self):
        given, array = self.given, self.np.array
        model = self.getfem.Model("real")
        model.add_fem_variable("u", self.space)
        for name in ("lam", "mu"):
            model.add_initialized_fem_data(name, self.constants, array(given[name]))
        model.add_isotropic_linearized_elasticity_brick(self.integral, "u", "lam", "mu")
        model.add_initialized_data("force", given["force"])
        model.add_source_term_brick(self.integral, "u", "force")
        rows, values = self._rows(given["held"], [[1, 0], [0, 1]]), array(given["given"]).ravel()
        model.add_variable("reaction", len(values))
        model.add_constraint_with_multipliers("u", "reaction", rows, values)
        self._add_contact(model)
        return model

    def _add_contact(self, model):
        given, p = self.given, len(self.given["F"])
        normals = self.np.array(given["normals"])
        for name in ("lam_nu", "lam_t"):
            model.add_variable(name, p)
        data = {"F": given["F"], "gap": given["gap"], "r": [given["r"]], "weights": [1.0] * p}
        for name, value in data.items():
            model.add_initialized_data(name, self.np.array(value))
        tangents = self.np.stack([-normals[1], normals[0]])
        N, T = (self._rows_along(given["nodes"], v) for v in (normals, tangents))
        names = ("u", "lam_nu", "lam_t", "r", N, T, "F", "gap", "weights")
        model.add_basic_contact_brick(*names, 1)

    def node(self, position):
        """Return the node at a position."""
        away = self.positions - self.np.array(position)[:, None]
        return int((away**2).sum(axis=0).argmin())

    def _rows(self, positions, directions):
        """Return rows that pick the displacement of each node in each direction."""
        rows = self.getfem.Spmat("empty", len(positions) * len(directions), 2 * self.count)
        for i, position in enumerate(positions):
            for j, direction in enumerate(directions):
                for a in (0, 1):
                    k = i * len(directions) + j
                    rows.add(k, 2 * self.node(position) + a, float(direction[a]))
        return rows

    def _rows_along(self, positions, directions):
        """Return rows that pick the displacement of each node in its own direction."""
        rows = self.getfem.Spmat("empty", len(positions), 2 * self.count)
        for i, position in enumerate(positions):
            for a in (0, 1):
                rows.add(i, 2 * self.node(position) + a, float(directions[a, i]))
        return rows

    @property
    def count(self):
        """Number of nodes."""
        return self.positions.shape[1]

    def solve(self):
        """Return displacements of all nodes and contact forces."""
        options = ("max_res", SMALL, "max_iter", 100, "lsolver", "mumps")  # SuperLU crashes
        self.model.solve(*options)
        values = {name: self.model.variable(name).tolist() for name in ("u", "lam_nu", "lam_t")}
        return {"positions": self.positions.tolist(), **values}


def main():
    """Solve the problem on standard input."""
    answer = os.dup(1)
    os.dup2(2, 1)  # GetFEM writes messages to standard output
    result = {"missing": "not on this machine"}
    try:
        import getfem  # noqa: PLC0415  the system's Python may have neither
        import numpy as np  # noqa: PLC0415
    except ImportError:
        pass
    else:
        getfem.util_trace_level(0)
        getfem.util_warning_level(0)
        result = Body(np, getfem, json.load(sys.stdin)).solve()
    os.write(answer, (json.dumps(result) + "\n").encode())


if __name__ == "__main__":
    main()
