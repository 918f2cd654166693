"""What tests of errors about input share."""

import numpy as np
from pwscont_coulomb import AffineLoad, ContactBody

A = np.array([[2.0, -1.0], [-1.0, 2.0]])


N, T = np.array([[1.0, 0.0]]), np.array([[0.0, 1.0]])


LOAD = AffineLoad([0.25, 0.0], [0.0, 1.0])


def body():
    return ContactBody(A, N, T)
