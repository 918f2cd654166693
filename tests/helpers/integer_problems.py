"""Quasi-static problems in whole numbers."""

import numpy as np
from evolution_truth import Problem


def integer_problem(seed):
    """Return a history of small integers, in which many things happen at once."""
    rng = np.random.default_rng([9, seed])
    p = int(rng.integers(1, 4))
    root = rng.integers(-1, 2, (2 * p, 2 * p))
    A = root @ root.T + np.eye(2 * p) * int(rng.integers(1, 3))
    loads = rng.integers(-2, 3, (int(rng.integers(2, 5)), 2 * p)).astype(float)
    loads[0] *= rng.random() < 0.6
    gap = rng.integers(0, 2, p) * 0.5 * (rng.random() < 0.3)
    F = float(rng.choice([0.0, 0.5, 1.0, 2.0, 3.0])) * np.ones(p)
    pick = np.eye(2 * p)
    return Problem(A.astype(float), pick[0::2], pick[1::2], gap, loads, F, np.zeros(p))
