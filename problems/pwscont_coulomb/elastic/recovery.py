"""Solutions on the whole body: displacements, stresses, pressure, contact modes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, final

import numpy as np

from pwscont import Character, InvalidInputError
from pwscont.extending import Array, Indices, Solution, card, counted
from pwscont_coulomb.elastic.arguments import check_kind
from pwscont_coulomb.elastic.problem import ElasticProblem
from pwscont_coulomb.modes import Mode, modes, modes_in

if TYPE_CHECKING:
    from pwscont.extending import EvolutionState


@final
@dataclass(frozen=True, slots=True, eq=False)
class BodyState:
    """A solution on the whole body.

    Attributes
    ----------
    alpha : float
        Parameter of the solution; the time of a state of an evolution.
    displacements : ndarray, shape (k, 2)
        Displacements of all nodes of the mesh.
    stresses : ndarray, shape (3, elements)
        Mean s_xx, s_yy, s_xy of each element.
    normal_force, tangential_force : ndarray, shape (p,)
        Contact force on the body along normal and tangent of each contact node (force per
        thickness); the normal force is negative where the node presses.
    pressure, shear : ndarray, shape (p,)
        Minus the normal, and the tangential, contact force divided by the area of the node.
    distance, slip : ndarray, shape (p,)
        Remaining distance to the obstacle, and tangential displacement.
    modes : ndarray of int, shape (p,)
        :class:`~pwscont_coulomb.modes.Mode` of each contact node.
    parameter : str
        The name of the parameter.

    Examples
    --------
    >>> from pwscont import explore
    >>> from pwscont_coulomb.elastic import recover
    >>> from pwscont_coulomb.elastic.scenes import triangle
    >>> problem = triangle().build().condensed()
    >>> state = recover(problem, explore(problem.along_load(), (-2.0, 2.0)).solutions(1.5)[0])
    >>> state.alpha, state.slip.shape
    (1.5, (1,))
    """

    alpha: float
    displacements: Array
    stresses: Array
    normal_force: Array
    tangential_force: Array
    pressure: Array
    shear: Array
    distance: Array
    slip: Array
    modes: Indices
    parameter: str = "alpha"

    def _rows(self) -> list[tuple[str, str]]:
        """Return the lines that show a state: sizes and extremes, no arrays."""
        touching = int((self.modes != Mode.NO_CONTACT).sum())
        largest = np.hypot(*self.displacements.T).max(initial=0.0)
        return [
            (self.parameter, f"{self.alpha:.10g}"),
            ("size", counted(len(self.displacements), "node")),
            ("contact", f"{touching} of {counted(len(self.modes), 'node')} in contact"),
            ("largest displacement", f"{largest:.4g}"),
            ("largest pressure", f"{self.pressure.max(initial=0.0):.4g}"),
        ]

    def __repr__(self) -> str:
        (name, alpha), (_, size), (_, contact), *extremes = self._rows()
        more = ", ".join(f"{what} {value}" for what, value in extremes)
        return f"BodyState({name}={alpha}, {size}, {contact}, {more})"

    def _repr_html_(self) -> str:
        return card("BodyState", self._rows())


def recover(
    problem: ElasticProblem, solution: Solution | EvolutionState, load_alpha: float | None = None
) -> BodyState:
    """Return a solution, or a state of an evolution, on the whole body.

    Parameters
    ----------
    problem : ElasticProblem
        The problem whose system was solved.
    solution : Solution or EvolutionState
        From ``graph.solutions(alpha)``; or from ``evolution.states(t)``, under a history of loads
        that are sums of multiples of ``problem.load.f0`` and ``problem.load.f1``.
    load_alpha : float, optional
        Parameter of the loads; default the parameter under which the solution is in equilibrium,
        which is not ``solution.alpha`` if the system's parameter is the friction coefficient.

    Raises
    ------
    InvalidInputError
        If the solution is of another size, or does not tell the load
        (:meth:`~pwscont_coulomb.elastic.ElasticProblem.load_parameter`).

    Examples
    --------
    >>> from pwscont import explore
    >>> from pwscont_coulomb.elastic import recover
    >>> from pwscont_coulomb.elastic.scenes import triangle
    >>> problem = triangle().build().condensed()
    >>> graph = explore(problem.along_load(), (-2.0, 2.0))
    >>> recover(problem, graph.solutions(-0.75)[0]).displacements.shape
    (3, 2)
    """
    check_kind("problem", problem, ElasticProblem)
    if not isinstance(solution, Solution):
        return _of_an_evolution(problem, solution)
    return state_at(problem, solution.z, solution.alpha, solution.character, load_alpha)


def _of_an_evolution(problem: ElasticProblem, state: EvolutionState) -> BodyState:
    from pwscont.extending import EvolutionState  # noqa: PLC0415  static bodies have none

    check_kind("solution", state, Solution, EvolutionState)
    _check_size(problem, state.z)
    moved = problem.displacements_under(state.z, problem.load_factors(state.z))
    return _body_state(problem, state.z, moved, modes_in(state.label, problem.body.p), state.t, "t")


def state_at(
    problem: ElasticProblem,
    z: Array,
    alpha: float,
    character: Character,
    load_alpha: float | None = None,
) -> BodyState:
    """Return a point of a piece on the whole body; see :func:`recover`."""
    _check_size(problem, z)
    load = problem.load_parameter(z, alpha) if load_alpha is None else load_alpha
    moved = problem.displacements(z, load)
    return _body_state(problem, z, moved, modes(character), alpha, "alpha")


def _check_size(problem: ElasticProblem, z: Array) -> None:
    body = problem.body
    if z.shape != (body.n + 2 * body.p,):
        raise InvalidInputError(
            f"the state has {len(z)} unknowns, the problem {body.n + 2 * body.p}: is it a solution "
            "of this problem, condensed or full as it was solved?"
        )


def _body_state(
    problem: ElasticProblem, z: Array, moved: Array, found: Indices, alpha: float, name: str
) -> BodyState:
    contact, body = problem.elastic.contact, problem.body
    (normal, tangential), u = problem.multipliers(z), z[: body.n]
    return BodyState(
        alpha,
        moved,
        problem.elastic.stresses(moved),
        normal,
        tangential,
        -normal / contact.areas,
        tangential / contact.areas,
        np.asarray(body.gap - body.N @ u),
        np.asarray(body.T @ u),
        found,
        name,
    )
