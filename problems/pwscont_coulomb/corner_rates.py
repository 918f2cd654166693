"""Whether a corner of a static problem has one ray at most to either side of alpha.

The rays of a corner are the solutions of the rate problem of the nodes whose tests vanish there
(docs/theory, F16), and the condition for one rate at most (F17) needs no enumeration.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from pwscont.extending import Array, Indices, dense
from pwscont_coulomb.body import ContactBody
from pwscont_coulomb.modes import Mode
from pwscont_coulomb.quasi_static.rates import RateProblem

SLIP_SIGN = {Mode.SLIP_PLUS: 1, Mode.SLIP_MINUS: -1}


def has_one_ray(body: ContactBody, friction: Array, modes: Indices, zero: frozenset[int]) -> bool:
    """Tell whether at most one ray leads to each side of alpha; False where that is not known.

    Parameters
    ----------
    body : ContactBody
    friction : ndarray, shape (p,)
    modes : ndarray of int, shape (p,)
        The modes by the signs at the corner, of nodes none of whose tests vanish.
    zero : frozenset of int
        The tests that vanish.
    """
    parts = _Parts()
    for i in range(body.p):
        which = frozenset(k for k in range(3) if 3 * i + k in zero)
        if not parts.add(i, which, Mode(modes[i]), friction[i] > 0.0):
            return False
    return parts.problem(body, friction).doubt(parts.fixed) is None


@dataclass(slots=True)
class _Parts:
    """What nodes bring into the rate problem; each entry is (node, unknown or row, sign)."""

    touching: list[int] = field(default_factory=list)
    holding: list[int] = field(default_factory=list)
    open_normal: list[int] = field(default_factory=list)
    open_tangent: list[int] = field(default_factory=list)
    rubbing: list[tuple[int, int]] = field(default_factory=list)
    slipping: list[tuple[int, int]] = field(default_factory=list)

    def add(self, i: int, zero: frozenset[int], mode: Mode, rubs: bool) -> bool:
        """Add a node; tell whether the kind of its corner is known."""
        open_ = 0 in zero
        if mode == Mode.NO_CONTACT and not open_:
            return not zero
        self.touching.append(i)
        if not rubs:
            return self._without_friction(i, open_)
        self.holding.append(i)
        if zero == {0, 1, 2}:
            self.open_normal.append(i)
            self.open_tangent.append(i)
            return True
        if len(zero) > 1:
            return False
        if zero in ({1}, {2}):
            self.rubbing.append((i, 1 if zero == {1} else -1))
        elif open_ or mode in SLIP_SIGN:
            self._slips(i, mode, open_)
        return not (open_ and mode not in SLIP_SIGN)

    def _without_friction(self, i: int, is_open: bool) -> bool:
        if is_open:
            self.open_normal.append(i)
        return True

    def _slips(self, i: int, mode: Mode, is_open: bool) -> None:
        self.slipping.append((i, SLIP_SIGN.get(mode, 1)))
        if is_open:
            self.open_normal.append(i)

    @property
    def fixed(self) -> dict[int, int]:
        """The modes of the nodes that slip whatever happens, which come last."""
        first = len(self.open_normal) + len(self.rubbing)
        modes = [Mode.SLIP_PLUS if s > 0 else Mode.SLIP_MINUS for _, s in self.slipping]
        return {first + k: int(mode) for k, mode in enumerate(modes)}

    def problem(self, body: ContactBody, friction: Array) -> RateProblem:
        """Return the rate problem, without load."""
        p, moving = body.p, [*self.rubbing, *self.slipping]
        columns = [*self.open_normal, *(p + i for i in self.open_tangent)]
        columns += [p + i for i, _ in moving]
        rows = columns + [i for i, _ in moving if i not in self.open_normal]
        place = {j: k for k, j in enumerate(rows)}
        nodes = [*self.open_normal, *(i for i, _ in moving)]
        rubs = [i in self.open_tangent for i in self.open_normal] + [True] * len(moving)
        tangent = [place[p + i] if r else -1 for i, r in zip(nodes, rubs, strict=True)]
        sign = [0] * len(self.open_normal) + [s for _, s in moving]
        K = self._stiffness(body)
        return RateProblem(
            K[np.ix_(rows, columns)],
            np.zeros(len(rows)),
            friction[nodes],
            np.array(sign, dtype=np.intp),
            np.array([place[i] for i in nodes], dtype=np.intp),
            np.array(tangent, dtype=np.intp),
        )

    def _stiffness(self, body: ContactBody) -> Array:
        """Return the forces by the displacements in contact, zero at all other unknowns."""
        active = np.array([*self.touching, *(body.p + i for i in self.holding)], dtype=np.intp)
        picks = np.vstack([dense(body.N), dense(body.T)])[active]
        K = np.zeros((2 * body.p, 2 * body.p))
        if len(active):
            K[np.ix_(active, active)] = np.linalg.inv(picks @ body.solve(picks.T))
        return K
