"""Springs in parallel, elastic-plastic, in closed form: the model of Prandtl and Ishlinskii."""

import numpy as np
from pwscont_structures import PlasticTruss

from pwscont import LoadHistory


def springs(seed):
    """Return a random model of Prandtl and Ishlinskii, and its load."""
    rng = np.random.default_rng([7, seed])
    m = int(rng.integers(1, 6))
    k, y = rng.uniform(0.5, 2.0, m), rng.uniform(0.2, 1.5, m)
    hardening, loads = rng.uniform(0.1, 1.0, m), 3.0 * rng.normal(size=int(rng.integers(2, 7)))
    loads[0] = 0.0
    return PlasticTruss(np.ones((m, 1)), LoadHistory(loads[:, np.newaxis]), k, y, hardening)


def stops(truss, plastic=0.0):
    """Return (u, s) at the corners of the load by stop operators, in closed form.

    Between two corners the displacement is monotone and each force is a stop of its increment, so
    the displacement solves a monotone piecewise linear equation, whose kinks are tried in turn.
    """
    k, y, H = truss.stiffness, truss.strength, truss.hardening.sum()
    u, s, states = 0.0, -k * plastic, []
    for (f,) in truss.history.loads:
        kinks = np.concatenate([u + (y - s) / k, u + (-y - s) / k])
        known = np.sort(kinks)

        def force(v, u=u, s=s):
            return H * v + np.clip(s + k * (v - u), -y, y).sum()

        values = np.array([force(v) for v in known])
        right = int(np.searchsorted(values, f))
        left = known[right - 1] if right else known[0] - 1.0 - abs(f - values[0]) / H
        far = known[right] if right < len(known) else known[-1] + 1.0 + abs(f - values[-1]) / H
        slope = (force(far) - force(left)) / (far - left)
        new = left + (f - force(left)) / slope
        s, u = np.clip(s + k * (new - u), -y, y), new
        states.append(np.append(u, s))
    return states
