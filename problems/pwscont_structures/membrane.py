"""A membrane over an obstacle, on a mesh of scikit-fem (the optional extra ``fem``)."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from pwscont import InvalidInputError, MissingPackageError
from pwscont.extending import Array, Indices
from pwscont_structures.obstacle import ObstacleProblem


def membrane(
    mesh: Any,
    obstacle: Callable[[Array], Any],
    *,
    tension: float = 1.0,
    load: float = 1.0,
) -> tuple[ObstacleProblem, Indices]:
    """Return a membrane with a fixed boundary over an obstacle, by linear elements.

    Parameters
    ----------
    mesh : skfem.MeshTri or another mesh of scikit-fem
    obstacle : callable
        Places, shape (2, nodes) -> heights there; negative below the membrane at rest.
    tension : float
        Per unit of length.
    load : float
        Per unit of area at alpha = 1, positive downwards.

    Returns
    -------
    problem : ObstacleProblem
    nodes : ndarray of int
        The node of the mesh for each unknown.

    Raises
    ------
    MissingPackageError
        If scikit-fem is not installed.
    InvalidInputError
        If the tension is not positive, or no node is inside.

    Examples
    --------
    >>> import skfem
    >>> from pwscont_structures import membrane
    >>> mesh = skfem.MeshTri.init_tensor([0.0, 0.5, 1.0], [0.0, 0.5, 1.0])
    >>> sheet, inside = membrane(mesh, lambda x: -0.02 + 0.0 * x[0])
    >>> sheet.size, inside.tolist()
    (1, [4])
    """
    skfem, poisson = _scikit_fem()
    if not tension > 0.0:
        raise InvalidInputError(f"tension must be positive, got {tension}")
    basis = skfem.Basis(mesh, mesh.elem())
    inside = basis.complement_dofs(basis.get_dofs())
    if not len(inside):
        raise InvalidInputError("no node of the mesh is inside: refine it")
    K = tension * poisson.laplace.assemble(basis)
    weight = load * poisson.unit_load.assemble(basis)
    heights = np.broadcast_to(obstacle(basis.doflocs[:, inside]), inside.shape)
    return ObstacleProblem(K[inside][:, inside], heights, weight[inside]), inside


def _scikit_fem() -> tuple[Any, Any]:
    try:
        import skfem  # noqa: PLC0415  an optional package
        from skfem.models import poisson  # noqa: PLC0415
    except ImportError as error:
        raise MissingPackageError("membranes need scikit-fem: pip install '.[fem]'") from error
    return skfem, poisson
