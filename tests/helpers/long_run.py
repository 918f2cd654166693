"""A run of a second or two that keeps a journal: python long_run.py JOURNAL GRAPH."""

import sys

import numpy as np
from pwscont_coulomb import AffineLoad, ContactBody, CoulombLoad

from pwscont import Journal, PseudoArclength, StepSize, trace

INTERVAL = (-5.0, 5.0)


def path(p=6, seed=1):
    """Return a random body pressed on the obstacle and dragged along it."""
    rng = np.random.default_rng(seed)
    root, picks = rng.normal(size=(2 * p, 2 * p)), np.eye(2 * p)
    body = ContactBody(root @ root.T + np.eye(2 * p), picks[0::2], picks[1::2])
    f0, f1 = rng.normal(size=2 * p) + np.tile([2.0, 0.0], p), rng.normal(size=2 * p)
    return CoulombLoad(body, AffineLoad(f0, f1), 0.5)


def run(journal=None, interval=INTERVAL):
    system = path()
    stepper = PseudoArclength(step_size=StepSize(largest=0.002))
    start = (np.zeros(system.size), interval[0])
    return trace(system, start, interval, stepper=stepper, journal=journal)


if __name__ == "__main__":
    sys.stdout.write("begun\n")
    sys.stdout.flush()
    run(Journal(sys.argv[1])).save(sys.argv[2])
