"""Static problems of large bodies in the contact unknowns alone, where that saves time."""

from __future__ import annotations

from collections.abc import Callable
from typing import final

import numpy as np

from pwscont import Character, PiecewiseSystem
from pwscont.extending import Array, Indices, Recovery, Reduction, counted
from pwscont_coulomb.body import ContactBody
from pwscont_coulomb.modes import SIGNS, Mode


@final
class InteriorRecovery(Recovery):
    """Displacements of the whole body from contact displacements and forces.

    Parameters
    ----------
    whole, small : ContactBody
        The body, and the body condensed onto some of its contact nodes.
    nodes : ndarray of int, shape (q,)
        These nodes.
    load_at : callable
        alpha -> load of the whole body, shape (n,).
    ends : tuple of float or None
        Two alphas between which and beyond which the load is affine.
    """

    __slots__ = ("_ends", "_load_at", "_nodes", "_small", "_whole")

    def __init__(
        self,
        whole: ContactBody,
        small: ContactBody,
        nodes: Indices,
        load_at: Callable[[float], Array],
        ends: tuple[float, float] | None = None,
    ) -> None:
        self._whole, self._small, self._nodes, self._load_at = whole, small, nodes, load_at
        self._ends = ends

    def points(self, points: Array) -> Array:
        """Return points (..., u, lam_nu, lam_t, alpha) of the whole body."""
        flat = points.reshape(-1, points.shape[-1])
        forces, alphas = flat[:, -1 - 2 * len(self._nodes) : -1], flat[:, -1]
        if not len(flat):
            return self._placed(points, np.zeros((0, self._whole.n)))
        u = self._free(alphas) + self._small.displacements_by(forces)
        return self._placed(points, u)

    def _free(self, alphas: Array) -> Array:
        """Return the displacements without contact, shape (k, n)."""
        if self._ends is None:
            return self._small.displacements_of([self._load_at(float(a)) for a in alphas])
        lo, hi = self._ends
        first, last = self._small.displacements_of([self._load_at(lo), self._load_at(hi)])
        part = (alphas[:, np.newaxis] - lo) / (hi - lo)
        free: Array = (1.0 - part) * first + part * last
        return free

    def errors(self, errors: Array) -> Array:
        """Return errors, with that of the worst contact displacement for every displacement."""
        flat = errors.reshape(-1, errors.shape[-1])
        worst = np.abs(flat[:, : 2 * len(self._nodes)]).max(axis=1, keepdims=True)
        return self._placed(errors, np.repeat(worst, self._whole.n, axis=1))

    def _placed(self, rows: Array, u: Array) -> Array:
        """Return displacements beside the forces of all nodes, and what stands last in each row."""
        n, p, q = self._whole.n, self._whole.p, len(self._nodes)
        flat = rows.reshape(-1, rows.shape[-1])
        full = np.zeros((len(flat), n + 2 * p + 1))
        full[:, :n], full[:, -1] = u, flat[:, -1]
        full[:, n + self._nodes] = flat[:, 2 * q : 3 * q]
        full[:, n + p + self._nodes] = flat[:, 3 * q : 4 * q]
        return full.reshape(*rows.shape[:-1], full.shape[1])

    def state(self, z: Array) -> Array:
        """Return (u_nu, u_t, lam_nu, lam_t) of the nodes."""
        body, nodes = self._whole, self._nodes
        u, forces = z[: body.n], z[body.n :]
        parts = [(body.N @ u)[nodes], (body.T @ u)[nodes]]
        parts += [forces[: body.p][nodes], forces[body.p :][nodes]]
        return np.concatenate(parts)


def without_interior(
    body: ContactBody,
    nodes: Indices,
    load_at: Callable[[float], Array],
    on: Callable[[ContactBody, Indices], PiecewiseSystem],
    ends: tuple[float, float] | None,
) -> Reduction:
    """Return the problem in the contact unknowns of some nodes.

    Parameters
    ----------
    body : ContactBody
    nodes : ndarray of int
    load_at : callable
        alpha -> load of the body.
    on : callable
        Returns the problem of the condensed body, which knows how loads are reduced.
    ends : tuple of float or None
        Two alphas, if the load is affine in alpha.
    """
    small = body.with_nodes(nodes).condensed()
    recovery = InteriorRecovery(body, small, nodes, load_at, ends)
    eliminated = counted(body.n - 2 * len(nodes), "displacement")
    return Reduction(
        system=on(small, nodes),
        kept=np.zeros(0, dtype=np.intp),
        tests=(3 * nodes[:, np.newaxis] + np.arange(3)).ravel(),
        idle=Character(SIGNS[Mode.NO_CONTACT] * body.p),
        reasons=(f"{eliminated} of the interior eliminated, recovered at the end",),
        recovery=recovery,
    )
