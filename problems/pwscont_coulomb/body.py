"""A discretised elastic body with nodes that may touch a rigid obstacle."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from copy import copy
from functools import cached_property
from itertools import chain
from typing import TYPE_CHECKING, Any, final

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp
from scipy.linalg import lapack

from pwscont import InvalidInputError
from pwscont.extending import EPS, GUARD, Array, Indices, Matrix, card, counted, finite_array
from pwscont_coulomb.condensed import Condensation, checked_load, is_worth_condensing
from pwscont_coulomb.fixed import Fixed

if TYPE_CHECKING:
    from pwscont_coulomb.elastic.elimination import Elimination

#: Largest |A - A^T| of a symmetric stiffness matrix, as a part of the largest entry of A: far above
#: the rounding of assembly.
SYMMETRIC = 1e-10
#: Pivots of a stiffness matrix below this part of the diagonal are rounding: far from the pivots of
#: slender bodies of many elements, which have no digit left at this part.
SINGULAR = GUARD * EPS
#: Number of contact nodes whose flexibility is computed at a time, to bound memory.
PART = 64


@final
class ContactBody(Fixed):
    """Stiffness, contact operators and gaps of a body with p contact nodes.

    Parameters
    ----------
    A : array_like or scipy.sparse, shape (n, n)
        Stiffness matrix, symmetric positive definite (force per length); or positive semidefinite
        if only the contact holds the body: no displacement may be free when all nodes stick.
    N, T : array_like or scipy.sparse, shape (p, n)
        Operators to the normal displacement (positive towards the obstacle) and the tangential
        displacement of each contact node; of full rank.
    gap : array_like, shape (p,), optional
        Distance of each node to the obstacle, not negative; default 0 (as in the paper).
    guided : array_like of bool, shape (p,), optional
        Nodes that a support holds along the tangent, such as nodes on an axis of symmetry: guided
        nodes touch or not, without friction. To keep T of full rank, a guided node has a tangential
        displacement that A and N couple with no other displacement and on which no load acts: the
        displacement is zero. Default none.

    Attributes
    ----------
    n, p : int
        Number of displacements and of contact nodes.
    numbers : tuple of int
        The numbers of the contact nodes in names: 1, ..., p.
    stiffness : ndarray, shape (p,)
        Stiffness of each contact node against normal displacement (force per length).
    is_clamped : bool
        Whether A is positive definite, so that the body holds still without contact.

    Raises
    ------
    InvalidInputError
        If shapes do not fit, A is not symmetric, not positive semidefinite, or leaves a
        displacement free even when all nodes stick, N or T is rank deficient,
        a gap is negative, the tangential displacement of a guided node is coupled with another
        displacement, or anything is not finite, or an attribute is set.

    Examples
    --------
    >>> from pwscont_coulomb import ContactBody
    >>> ContactBody([[2, -1], [-1, 2]], N=[[1, 0]], T=[[0, 1]])
    ContactBody(2 displacements, 1 contact node, dense)
    """

    _given = frozenset({"A", "N", "T", "gap", "guided", "stiffness", "is_clamped"})

    def __init__(self, A: Any, N: Any, T: Any, gap: Any = None, guided: Any = None) -> None:
        self.A = _symmetric(_matrix("A", A))
        n = self.A.shape[0]
        self.N, self.T = _matrix("N", N), _matrix("T", T)
        p = self.N.shape[0]
        for name, matrix in (("N", self.N), ("T", self.T)):
            if matrix.shape != (p, n):
                raise InvalidInputError(f"{name} has shape {matrix.shape}, expected ({p}, {n})")
        self.n, self.p = n, p
        self.numbers = tuple(range(1, p + 1))
        self.gap = finite_array("gap", np.zeros(p) if gap is None else gap, (p,))
        self.guided = _flags("guided", guided, p)
        #: What leads back to the body that was condensed; None for a body that was not.
        self._whole: Condensation | None = None
        self._has_guided = bool(self.guided.any())
        self.stiffness: Array = self._stiffness_along(self.N)
        #: A, or A and springs at all contact nodes if only the contact holds the body.
        self._held = self._held_stiffness()
        self.is_clamped = self._held is self.A
        self._check()

    def _sizes(self) -> str:
        kind = "sparse" if self.is_sparse else "dense"
        sizes = f"{counted(self.n, 'displacement')}, {counted(self.p, 'contact node')}"
        return f"{sizes}, {kind}"

    def __repr__(self) -> str:
        return f"ContactBody({self._sizes()})"

    def _repr_html_(self) -> str:
        return card("ContactBody", [("size", self._sizes())])

    @property
    def is_sparse(self) -> bool:
        """Whether A is a sparse matrix; the Jacobians then are, too."""
        return bool(sp.issparse(self.A))

    def condensed(self, elimination: Elimination | None = None) -> ContactBody:
        """Return the body with its contact unknowns alone, dense of size 2 p.

        The unknowns are the normal displacements of all contact nodes, then the tangential ones;
        contact forces are those of this body. Solutions are the same, and take far less time where
        n is much larger than 2 p. The condensed body turns loads into its own by :meth:`reduced`,
        and states into displacements of this body by :meth:`recover`.

        Parameters
        ----------
        elimination : Elimination, optional
            How all other unknowns are eliminated, such as ``pwscont_coulomb.elastic.Mumps()``.
            Default: a Cholesky factorisation of a dense, SuperLU of a sparse matrix.

        Examples
        --------
        >>> from pwscont import explore
        >>> from pwscont_coulomb import AffineLoad, ContactBody, CoulombLoad
        >>> A = [[2.0, -1.0, 0.0], [-1.0, 2.0, -1.0], [0.0, -1.0, 2.0]]
        >>> body = ContactBody(A, N=[[1, 0, 0]], T=[[0, 1, 0]])
        >>> f0, f1 = [1.0, 0.0, 0.5], [0.0, 1.0, 0.0]
        >>> small = body.condensed()
        >>> load = AffineLoad(small.reduced(f0), small.reduced(f1))
        >>> (state,) = explore(CoulombLoad(small, load, 0.5), (0.0, 2.0)).solutions(1.0)
        >>> small.recover(state.z, load=[1.0, 1.0, 0.5])[1:].round(6).tolist()
        [0.375, 0.4375]
        """
        self.refuse_unclamped("condensed()")
        way = self._own_condensation
        if elimination is not None:
            is_class = isinstance(elimination, type)
            if is_class or not callable(getattr(elimination, "eliminate", None)):
                raise InvalidInputError(
                    f"elimination must be an object such as Mumps(), got {elimination!r}"
                )
            way = Condensation(self.A, self.N, self.T, elimination)
        one = np.eye(2 * self.p)
        small = ContactBody(way.stiffness, one[: self.p], one[self.p :], self.gap, self.guided)
        small.numbers, small._whole = self.numbers, way
        return small

    @cached_property
    def _own_condensation(self) -> Condensation:
        """The condensation of this body, with a factorisation that is made once."""
        return Condensation(self.A, self.N, self.T)

    def reduced(self, load: Any) -> Array:
        """Return a load of the whole body as a load of this condensed body.

        Parameters
        ----------
        load : array_like, shape (n,) or (n, k)
            Forces at the displacements of the body that was condensed.

        Returns
        -------
        ndarray, shape (2 p,) or (2 p, k)

        Raises
        ------
        InvalidInputError
            If this body was not condensed, or the load does not fit.
        """
        whole = self._condensation()
        return whole.reduced(checked_load("load", load, whole.n))

    def recover(self, z: Any, load: Any) -> Array:
        """Return all displacements of the body that was condensed, shape (n,).

        Parameters
        ----------
        z : array_like, shape (4 p,)
            A state of this condensed body.
        load : array_like, shape (n,)
            The load of the whole body in that state.

        Raises
        ------
        InvalidInputError
            If this body was not condensed, or the state or the load does not fit.
        """
        whole = self._condensation()
        state = finite_array("z", z, (4 * self.p,))
        return whole.recovered(state[2 * self.p :], finite_array("load", load, (whole.n,)))

    def displacements_of(self, loads: list[Array]) -> Array:
        """Return the displacements of the body that was condensed under loads, shape (k, n)."""
        return np.atleast_2d(self._condensation().solve(np.stack(loads, axis=1)).T)

    def displacements_by(self, forces: Array) -> Array:
        """Return the displacements, shape (k, n), under contact forces, shape (k, 2 p)."""
        return self._condensation().by_forces(forces)

    def _condensation(self) -> Condensation:
        if self._whole is None:
            raise InvalidInputError("this ContactBody was not condensed; call condensed() first")
        return self._whole

    def with_nodes(self, kept: Indices) -> ContactBody:
        """Return the body with only some contact nodes."""
        body, by_node = copy(self), ("N", "T", "gap", "guided", "stiffness")
        body.__setstate__({name: getattr(self, name)[kept] for name in by_node})
        body.p, body.numbers = len(kept), tuple(self.numbers[i] for i in kept)
        body._whole = None
        if (way := vars(body).pop("_own_condensation", None)) is not None:
            vars(body)["_own_condensation"] = way.with_nodes(kept)
        return body

    def reach(self, loads: Array) -> Array:
        """Return how far each contact node can move towards the obstacle, shape (p,).

        Contact forces do no positive work: with lam_nu (N u) = lam_nu gap <= 0 and
        lam_t (T u) <= 0, equilibrium gives u.A u <= f.u. Hence |u|_A <= |f|_(A^-1), and by
        Cauchy and Schwarz (N u)_i^2 <= (N A^-1 N^T)_ii (f.A^-1 f).

        Parameters
        ----------
        loads : ndarray, shape (n, k)
            All loads that may occur, or loads whose convex hull holds all loads.
        """
        parts = (_dense(self.N[first : first + PART]).T for first in range(0, self.p, PART))
        *flexibility, energies = self._energies(chain(parts, [loads]))
        reach: Array = np.sqrt(np.concatenate(flexibility) * energies.max())
        return reach

    def least_reach(self, loads: Array) -> Array:
        """Return a lower bound of :meth:`reach`, for which nothing is factorised.

        By Cauchy and Schwarz f.A^-1 f >= (f.v)^2 / v.A v for every v, here the displacements under
        f if A were diagonal, and (N A^-1 N^T)_ii is at least (N N^T)_ii by the stiffness of node i.
        Rounding could make v.A v too small if A hardly resists v: a bound of the rounding is added,
        for |A_ij| <= (A_ii A_jj)^(1/2).

        Parameters
        ----------
        loads : ndarray, shape (n, k)
        """
        diagonal = _diagonal(self.A)
        v = loads / diagonal[:, np.newaxis]
        rounding = self.n * EPS * np.square(np.sqrt(diagonal) @ np.abs(v))
        work, stored = (loads * v).sum(axis=0), (v * (self.A @ v)).sum(axis=0) + rounding
        energies = work * np.divide(work, stored, out=np.zeros_like(work), where=stored > 0.0)
        reach: Array = np.sqrt(_diagonal(self.N @ self.N.T) / self.stiffness * energies.max())
        return reach

    def _energies(self, parts: Iterable[Array]) -> Iterator[Array]:
        """Yield v.A^-1 v of the columns v of each part; all parts share a factorisation."""
        if self.is_sparse:
            from scipy.sparse.linalg import splu  # noqa: PLC0415  only for sparse bodies

            lu = splu(self.A.tocsc())
            yield from ((part * lu.solve(part)).sum(axis=0) for part in parts)
            return
        lower = np.asfortranarray(np.linalg.cholesky(self.A))
        for part in parts:  # |L^-1 v|^2, half of the work
            yield np.square(lapack.dtrtrs(lower, part, lower=1)[0]).sum(axis=0)

    def solve(self, forces: Array) -> Array:
        """Return A^-1 forces, for a load, shape (n,), or several loads, shape (n, k).

        If only the contact holds the body, springs hold all contact nodes.
        """
        if self.is_clamped and is_worth_condensing(self.n, self.p):
            return self._own_condensation.solve(forces)
        if self.is_sparse:
            from scipy.sparse.linalg import splu  # noqa: PLC0415  only for sparse bodies

            return np.asarray(splu(self._held.tocsc()).solve(forces))
        _, solutions, failed = lapack.dposv(self._held, forces.reshape(self.n, -1))
        if failed:  # by rounding: the matrix is positive definite
            return np.asarray(np.linalg.solve(self._held, forces))
        return np.asarray(solutions).reshape(forces.shape)

    def _stiffness_along(self, rows: Matrix) -> Array:
        """Return the stiffness along rows; the largest of A where there is none."""
        lengths = _diagonal(rows @ rows.T)
        found = _diagonal(rows @ self.A @ rows.T) / np.where(lengths > 0.0, lengths, 1.0)
        largest = float(np.abs(_diagonal(self.A)).max()) or 1.0
        return np.where(found > SINGULAR * largest, found, largest)

    def _held_stiffness(self) -> Matrix:
        """Return A, or A with springs at all contact nodes if only the contact holds the body.

        Rounding may make the pivots of a singular A positive.
        """
        if _is_positive_definite(_shifted(self.A, -SINGULAR)):
            return self.A
        rows = sp.csr_matrix(_stack([self.N, self.T]))
        springs = np.concatenate([self.stiffness, self._stiffness_along(self.T)])
        lengths = _diagonal(rows @ rows.T)
        added = rows.T @ sp.diags(springs / np.where(lengths > 0.0, lengths, 1.0)) @ rows
        held = self.A + (added.tocsr() if self.is_sparse else added.toarray())
        is_held = _is_positive_definite(_shifted(held, -SINGULAR))
        if is_held and _is_positive_semidefinite(self.A):
            return held
        raise InvalidInputError(
            "A is not positive definite; is the body clamped well enough to hold still? Without "
            "clamps A must be positive semidefinite, and the contact nodes hold the body when all "
            "nodes stick"
        )

    def under(self, force: float) -> ContactBody:
        """Return the body for forces of a given size, which tell with gaps how stiff A = 0 is."""
        if abs(self.A).max() or not self.gap.any() or not force:
            return self
        body, stiffness = copy(self), np.full(self.p, force / float(self.gap.max()))
        body._held = stiffness[0] / self.stiffness[0] * self._held
        body.__setstate__({"stiffness": stiffness})
        return body

    def refuse_unclamped(self, what: str) -> None:
        """Refuse a body that only the contact holds."""
        if not self.is_clamped:
            raise InvalidInputError(f"{what} needs a body that is clamped: A is singular")

    def _check(self) -> None:
        for name, matrix in (("N", self.N), ("T", self.T)):
            if not _has_full_rank(matrix):
                raise InvalidInputError(f"{name} is rank deficient: its rows are not independent")
        if not _has_full_rank(_stack([self.N, self.T])):
            raise InvalidInputError("N and T together are rank deficient: some rows coincide")
        if (self.gap < 0.0).any():
            node = int(np.argmin(self.gap)) + 1
            raise InvalidInputError(f"gap of node {node} is negative: {self.gap.min():.6g}")
        self._check_guided()

    def _check_guided(self) -> None:
        """Refuse guided nodes whose tangential displacement is coupled with other displacements."""
        for node in np.flatnonzero(self.guided):
            t = _dense(self.T[[node]]).ravel()
            force = self.A @ t
            coupled = np.abs(force - t * (t @ force) / (t @ t)).max()
            if coupled > SYMMETRIC * np.abs(force).max() or (self.N @ t).any():
                raise InvalidInputError(
                    f"node {node + 1} is guided, but A or N couples its tangential displacement "
                    "with others: give it one of its own, with nothing but the diagonal in A"
                )

    def refuse_guided_load(self, f: Array) -> None:
        """Refuse a load, shape (n,), that would move a guided node along the tangent."""
        if self._has_guided and (pushed := (self.T @ f != 0.0) & self.guided).any():
            node = int(np.argmax(pushed)) + 1
            raise InvalidInputError(
                f"the load acts on the tangential displacement of node {node}, which is guided: "
                "the support takes this force, leave it out"
            )


def _flags(name: str, given: Any, p: int) -> npt.NDArray[np.bool_]:
    flags = np.zeros(p, dtype=bool) if given is None else np.asarray(given)
    if flags.shape != (p,) or flags.dtype != bool:
        raise InvalidInputError(f"{name} must be {p} truth values, got {given!r}")
    return flags.copy()


def _matrix(name: str, values: Any) -> Matrix:
    """Return a finite 2-d matrix, dense or in CSR format."""
    if sp.issparse(values):
        finite_array(f"{name}.data", values.tocsr().data)
        return sp.csr_matrix(values, dtype=float)
    array = finite_array(name, values)
    if array.ndim != 2 or array.size == 0:
        raise InvalidInputError(f"{name} must be a matrix, got shape {array.shape}")
    return array


def _symmetric(A: Matrix) -> Matrix:
    """Return the symmetric part of a square matrix that is symmetric up to rounding."""
    if A.shape[0] != A.shape[1]:
        raise InvalidInputError(f"A must be square, got shape {A.shape}")
    asymmetry = abs(A - A.T).max()
    if asymmetry > SYMMETRIC * abs(A).max():
        raise InvalidInputError(f"A is not symmetric: |A - A^T| reaches {asymmetry:.3g}")
    # readers of half of A have to see the same matrix
    return 0.5 * (A + A.T) if asymmetry else A


def _diagonal(matrix: Matrix) -> Array:
    diagonal: Array = np.asarray(matrix.diagonal())
    return diagonal


def _dense(matrix: Matrix) -> Array:
    return matrix.toarray() if sp.issparse(matrix) else np.asarray(matrix)


def _stack(matrices: list[Matrix]) -> Matrix:
    return sp.vstack(matrices) if any(map(sp.issparse, matrices)) else np.vstack(matrices)


def _is_positive_definite(A: Matrix) -> bool:
    if not sp.issparse(A):
        return _has_cholesky(A)
    from scipy.sparse.linalg import splu  # noqa: PLC0415  only for sparse bodies

    try:
        # symmetric pivoting on the diagonal: positive pivots are pivots of Cholesky
        lu = splu(
            A.tocsc(),
            permc_spec="MMD_AT_PLUS_A",
            diag_pivot_thresh=0.0,
            options={"SymmetricMode": True},
        )
    except RuntimeError:
        return False
    return bool((lu.U.diagonal() > 0.0).all() and (lu.perm_r == lu.perm_c).all())


def _is_positive_semidefinite(A: Matrix) -> bool:
    """Tell whether no eigenvalue is negative but for rounding; rows without a diagonal are zero."""
    empty = _diagonal(A) == 0.0
    is_idle = not abs(A)[empty].sum()
    return is_idle and _is_positive_definite(_shifted(A, SINGULAR, empty.astype(float)))


def _shifted(A: Matrix, part: float, more: Array | float = 0.0) -> Matrix:
    """Return A with a part of the diagonal, and more, added to the diagonal."""
    added = part * np.abs(_diagonal(A)) + more
    if sp.issparse(A):
        return A + sp.diags(added).tocsr()
    shifted = A.copy()
    shifted.flat[:: len(A) + 1] += added
    return shifted


def _has_cholesky(A: Array) -> bool:
    try:
        np.linalg.cholesky(A)
    except np.linalg.LinAlgError:
        return False
    return True


def _has_full_rank(matrix: Matrix) -> bool:
    """Tell whether the rows are independent, whatever the units of each row."""
    dense = matrix.toarray() if sp.issparse(matrix) else matrix
    lengths = np.linalg.norm(dense, axis=1)
    if not lengths.all():
        return False
    gram = (dense / lengths[:, np.newaxis]) @ (dense / lengths[:, np.newaxis]).T
    smallest = np.linalg.eigvalsh(gram)[0]
    return bool(smallest > len(gram) * np.finfo(float).eps)
