"""What each contact node does at an event, between sticking and leaving."""

from __future__ import annotations

from enum import IntEnum
from typing import final

import numpy as np

from pwscont.extending import Array, Indices
from pwscont_coulomb.modes import Mode, listed


@final
class Status(IntEnum):
    """The state of one node, as far as the ways on depend on the state."""

    FREE = 0  # apart from the obstacle
    TOUCHES = 1  # in contact without force
    STICKS = 2  # within the bound of friction
    BOUND_PLUS = 3  # lam_t = F lam_nu: may slip in the positive direction
    BOUND_MINUS = 4  # lam_t = -F lam_nu
    GLIDES = 5  # in contact with force, without friction


FREE, TOUCHES, STICKS, BOUND_PLUS, BOUND_MINUS, GLIDES = (int(status) for status in Status)
#: The direction in which a node at the bound may slip.
DIRECTION = np.array([0, 0, 0, 1, -1, 0])
#: Whether a node of a status has a normal force, and is held along the tangent.
PRESSED = np.array([False, False, True, True, True, True])
AT_BOUND = np.array([False, False, False, True, True, False])
#: The mode of a node of each status that keeps the status.
KEPT = np.array(
    [Mode.NO_CONTACT, Mode.STICK, Mode.STICK, Mode.SLIP_PLUS, Mode.SLIP_MINUS, Mode.STICK]
)


def label(modes: Indices) -> str:
    """Return the modes of all nodes: ``node 1 slip-, nodes 2 to 5 stick``."""
    return listed([Mode(mode).word for mode in modes.tolist()])


def statuses(y: Array, friction: Array, gap: Array, slack: tuple[float, float]) -> Indices:
    """Return the status of each node of a state.

    Parameters
    ----------
    y : ndarray, shape (4 p,)
        lam_nu, lam_t, u_nu, u_t.
    friction, gap : ndarray, shape (p,)
    slack : tuple of float
        Forces and displacements below these are zero.
    """
    normal, tangential, u_nu, _ = y.reshape(4, -1)
    force, length = slack
    status = np.full(len(gap), STICKS)
    at_bound = -friction * normal - np.abs(tangential) <= force * (1.0 + friction)
    status[at_bound & (tangential <= 0.0)] = BOUND_PLUS
    status[at_bound & (tangential > 0.0)] = BOUND_MINUS
    status[friction == 0.0] = GLIDES
    status[normal >= -force] = TOUCHES
    status[(gap - u_nu > length) & (normal >= -force)] = FREE
    return status
