"""An elastic body from a mesh, materials, supports, loads and a contact boundary."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import Any

import numpy as np
import scipy.sparse as sp

from pwscont import InvalidInputError
from pwscont.extending import Array, Indices, card, counted
from pwscont_coulomb.elastic.arguments import check_kind, listed
from pwscont_coulomb.elastic.contact_boundary import (
    ContactBoundary,
    ContactNodes,
    contact_nodes,
)
from pwscont_coulomb.elastic.discretisation import Discretisation
from pwscont_coulomb.elastic.loads import BodyForce, Support, Traction
from pwscont_coulomb.elastic.material import Material, PlaneState, PlaneStrain
from pwscont_coulomb.elastic.meshes import as_mesh
from pwscont_coulomb.elastic.regions import elements_of, facets_of
from pwscont_coulomb.elastic.supports import prescribed


class DiscretisedBody:
    """A body with mesh, loads and contact, before anything is eliminated.

    See :class:`pwscont_coulomb.elastic.ElasticBody`.
    """

    def __init__(
        self,
        mesh: Any,
        material: Material | Mapping[str, Material],
        *,
        supports: Sequence[Support],
        contact: ContactBoundary,
        loads: Sequence[Traction | BodyForce] = (),
        state: PlaneState | None = None,
        order: int | None = None,
    ) -> None:
        supports = listed("supports", supports, Support)
        loads = listed("loads", loads, Traction, BodyForce)
        check_kind("contact", contact, ContactBoundary)
        chosen = PlaneStrain() if state is None else state
        check_kind("state", chosen, PlaneState)
        self.space = Discretisation(as_mesh(mesh), order)
        self.held, self._given = prescribed(self.space, supports)
        self.contact = contact_nodes(self.space, contact, self.held, self._given)
        apart = _held_of(self.contact, self.held)
        self.free = np.setdiff1d(np.arange(2 * self.space.count), np.setdiff1d(self.held, apart))
        self._lame = _lame(self.space, material, chosen)
        forces = _forces(self.space, loads)
        stiffness = self.space.stiffness(*self._lame)[self.free]
        self.A = stiffness[:, self.free].tocsr()
        self.f0, self.f1 = forces[:, self.free] - (stiffness[:, self.held] @ self._given.T).T
        if len(apart):
            self._separate(np.searchsorted(self.free, apart))

    def _separate(self, apart: Indices) -> None:
        """Reduce the equations of some unknowns to the diagonal, so that the unknowns are zero."""
        kept = np.ones(len(self.free))
        kept[apart] = 0.0
        D = sp.diags(kept)
        self.A = (D @ self.A @ D + sp.diags((1.0 - kept) * self.A.diagonal())).tocsr()
        self.A.eliminate_zeros()
        self.f0, self.f1 = kept * self.f0, kept * self.f1

    def _sizes(self) -> str:
        elements = counted(self.space.mesh.nelements, "element")
        nodes = counted(self.space.count, "node")
        return f"{nodes}, {elements}, {counted(len(self.contact.nodes), 'contact node')}"

    def __repr__(self) -> str:
        return f"ElasticBody({self._sizes()})"

    def _repr_html_(self) -> str:
        return card("ElasticBody", [("size", self._sizes())])

    @property
    def grows(self) -> bool:
        """Whether loads or prescribed displacements depend on alpha."""
        return bool(self.f1.any() or self._given[1].any())

    @property
    def clamped(self) -> Indices:
        """The nodes with two prescribed displacements."""
        held = self.held // 2
        return np.intersect1d(held[self.held % 2 == 0], held[self.held % 2 == 1])

    @property
    def positions(self) -> Array:
        """The nodes, shape (2, k)."""
        return self.space.positions

    @cached_property
    def contact_unknowns(self) -> Indices:
        """The places of u_x and u_y of each contact node among the free unknowns, shape (2 p,)."""
        both = (2 * self.contact.nodes[:, np.newaxis] + np.arange(2)).ravel()
        return np.searchsorted(self.free, both)

    def load(self, alpha: float) -> Array:
        """Return the load on the free unknowns, shape (n,)."""
        load: Array = self.f0 + alpha * self.f1
        return load

    def all_displacements(self, free: Array, alpha: float) -> Array:
        """Return the displacements of all nodes, shape (k, 2), from the free unknowns."""
        u = np.empty(2 * self.space.count)
        u[self.free] = free
        u[self.held] = self._given[0] + alpha * self._given[1]
        return u.reshape(-1, 2)

    def stresses(self, displacements: Array) -> Array:
        """Return the mean stress of each element, shape (3, elements): s_xx, s_yy, s_xy."""
        xx, yy, xy = self.space.strains(displacements)
        lam, mu = self._lame
        mean = lam * (xx + yy)
        return np.stack([mean + 2.0 * mu * xx, mean + 2.0 * mu * yy, mu * xy])


def _held_of(contact: ContactNodes, held: Indices) -> Indices:
    """Return the prescribed unknowns of guided contact nodes."""
    nodes = contact.nodes[contact.guided]
    return np.intersect1d(np.concatenate([2 * nodes, 2 * nodes + 1]), held)


def _lame(
    space: Discretisation, material: Material | Mapping[str, Material], state: PlaneState
) -> tuple[Array, Array]:
    """Return lambda and mu of each element in the plane, each of shape (elements,)."""
    count = space.mesh.nelements
    if isinstance(material, Material):
        lam, mu = state.in_plane(*material.lame)
        return np.full(count, lam), np.full(count, mu)
    values, times = np.zeros((2, count)), np.zeros(count, dtype=int)
    check_kind("material", material, Material, Mapping)
    for name, part in material.items():
        check_kind(f"the material of {name!r}", part, Material)
        elements = elements_of(space.mesh, "a material", name)
        values[:, elements] = np.array(state.in_plane(*part.lame))[:, np.newaxis]
        times[elements] += 1
    _refuse_other_than_one(space, times, material)
    return values[0], values[1]


def _refuse_other_than_one(
    space: Discretisation, times: Indices, material: Mapping[str, Material]
) -> None:
    """Refuse elements without a material, and elements of overlapping subdomains."""
    for wrong, words in ((times == 0, "no material"), (times > 1, "more than one material")):
        if wrong.any():
            first, of = int(np.argmax(wrong)), space.mesh.subdomains
            x, y = space.mesh.p[:, space.mesh.t[:, first]].mean(axis=1)
            holding = [repr(name) for name in material if first in of[name]]
            raise InvalidInputError(
                f"{np.count_nonzero(wrong)} of {len(times)} elements have {words}, the first at "
                f"({x:.6g}, {y:.6g})"
                + (f", in {' and '.join(holding)}; subdomains must not overlap" if holding else "")
                + f"; materials are given for {', '.join(map(repr, material))}"
            )


def _forces(space: Discretisation, loads: Sequence[Traction | BodyForce]) -> Array:
    """Return constant and growing nodal forces, shape (2, 2 k)."""
    forces = np.zeros((2, 2 * space.count))
    for number, load in enumerate(loads):
        name = f"load {number + 1}"
        for part, field in enumerate((load.constant, load.growing)):
            if isinstance(load, Traction):
                facets = facets_of(space.mesh, f"the boundary of {name}", load.boundary)
                forces[part] += space.traction(name, field, facets)
            else:
                forces[part] += space.body_force(name, field, _elements(space, name, load))
    return forces


def _elements(space: Discretisation, name: str, load: BodyForce) -> Indices:
    if load.subdomain is None:
        return np.arange(space.mesh.nelements)
    return elements_of(space.mesh, f"the subdomain of {name}", load.subdomain)
