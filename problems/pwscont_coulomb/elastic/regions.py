"""Parts of a mesh by name or by predicate; errors list the names of the mesh."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from pwscont import InvalidInputError
from pwscont.extending import Array, Indices
from pwscont_coulomb.elastic.loads import Region


def facets_of(mesh: Any, what: str, region: Region) -> Indices:
    """Return the facets of a boundary, sorted, not empty.

    Parameters
    ----------
    mesh : skfem.Mesh
    what : str
        Name of the boundary's role in messages, such as ``"the contact boundary"``.
    region : Region

    Raises
    ------
    InvalidInputError
        If the name is unknown, no facet is found, or a facet lies inside the body.
    """
    if isinstance(region, str):
        facets = _named(mesh.boundaries, what, "boundary", region)
    else:
        facets = mesh.facets_satisfying(_predicate(what, region), boundaries_only=True)
    if not len(facets):
        raise InvalidInputError(f"{what} is empty: no facet of the boundary belongs to it")
    if (mesh.f2t[1, facets] >= 0).any():
        raise InvalidInputError(f"{what} has facets inside the body, between two elements")
    return np.unique(facets).astype(np.intp)


def elements_of(mesh: Any, what: str, region: Region) -> Indices:
    """Return the elements of a subdomain; parameters and errors as for :func:`facets_of`."""
    if isinstance(region, str):
        elements = _named(mesh.subdomains, what, "subdomain", region)
    else:
        elements = mesh.elements_satisfying(_predicate(what, region))
    if not len(elements):
        raise InvalidInputError(f"{what} is empty: no element belongs to it")
    return np.unique(elements).astype(np.intp)


def _named(known: Any, what: str, kind: str, name: str) -> Indices:
    there = dict(known or {})
    if name not in there:
        names = ", ".join(sorted(map(repr, there))) or "none; give a predicate instead"
        raise InvalidInputError(f"{what}: the mesh has no {kind} {name!r}; it has {names}")
    return np.asarray(there[name])


def _predicate(what: str, region: Any) -> Any:
    if not callable(region):
        raise InvalidInputError(f"{what} must be a name or a predicate, got {region!r}")

    def chosen(x: Array) -> npt.NDArray[np.bool_]:
        found = np.asarray(region(x))
        if found.dtype != bool or found.shape not in ((), x.shape[1:]):
            raise InvalidInputError(
                f"{what}: the predicate must return {x.shape[1]} truth values, one for each "
                f"midpoint, got shape {found.shape} of type {found.dtype}"
            )
        return np.broadcast_to(found, x.shape[1:])

    return chosen
