"""Contact nodes that cannot reach the obstacle, and the problem without such nodes."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from pwscont import Character, PiecewiseSystem
from pwscont.extending import Array, Indices, Reduction
from pwscont_coulomb.body import ContactBody
from pwscont_coulomb.modes import SIGNS, Mode

#: Relative margin of the bound by which nodes are left out, far above the rounding of the bound.
REACH_MARGIN = 1e-6


def without_far_nodes(
    body: ContactBody, loads: Array, with_nodes: Callable[[Indices], PiecewiseSystem]
) -> Reduction | None:
    """Return the reduction to the nodes that may touch, None if all nodes may touch.

    Parameters
    ----------
    body : ContactBody
    loads : ndarray, shape (n, k)
        Loads whose convex hull holds all loads.
    with_nodes : callable
        Returns the problem with only the given contact nodes.
    """
    if (body.gap <= body.least_reach(loads)).all():
        return None
    reach = body.reach(loads)
    far = body.gap > reach * (1.0 + REACH_MARGIN)
    far[np.argmin(body.gap - reach)] = False  # a node remains in any case
    if not far.any():
        return None
    n, p, kept = body.n, body.p, np.flatnonzero(~far)
    return Reduction(
        system=with_nodes(kept),
        kept=np.concatenate([np.arange(n), n + kept, n + p + kept]),
        tests=(3 * kept[:, np.newaxis] + np.arange(3)).ravel(),
        idle=Character(SIGNS[Mode.NO_CONTACT] * p),
        reasons=tuple(_reason(body, int(i), float(reach[i])) for i in np.flatnonzero(far)),
    )


def _reason(body: ContactBody, i: int, reach: float) -> str:
    return (
        f"node {body.numbers[i]} cannot touch: it moves by at most {reach:.3g} of its gap "
        f"{body.gap[i]:.3g} (energy bound)"
    )
