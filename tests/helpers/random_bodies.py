"""Random bodies, loads and points from a seed."""

import numpy as np
from pwscont_coulomb import ContactBody
from reference_enumeration import Body, enumerate_solutions


def random_body(p, seed, *, inner=1, gap=False):
    """Return a body with p contact nodes and ``inner`` further displacements.

    Stiffnesses are well conditioned but strongly coupled, so that with large friction there
    are several solutions.
    """
    rng = np.random.default_rng([seed, p, inner])
    n = 2 * p + inner
    root = rng.normal(size=(n, n))
    A = root @ root.T + 0.2 * np.eye(n)
    pick = np.eye(n)
    gaps = rng.integers(1, 3, p) / 4.0 if gap else np.zeros(p)
    return Body(A, pick[0 : 2 * p : 2], pick[1 : 2 * p : 2], gaps)


def random_vector(n, seed):
    return np.random.default_rng([*np.ravel(seed), n, 99]).normal(size=n)


def load_with_several_solutions(body, friction, seed, tries=30):
    """Return a random load with more than one solution, or just a random one."""
    loads = [random_vector(body.n, [seed, i]) for i in range(tries)]
    several = (f for f in loads if len(enumerate_solutions(body, f, friction)) > 1)
    return next(several, loads[0])


def contact_body(body):
    """Return the same body as the package's class."""
    return ContactBody(body.A, body.N, body.T, body.gap)
