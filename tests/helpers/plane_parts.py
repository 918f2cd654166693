"""What tests of the plane of two parameters share."""

from paper_systems import TWO_NODES, contact_body
from pwscont_coulomb import AffineLoad, ContactBody, CoulombLoad

CLOSE = {"rtol": 0.0, "atol": 1e-9}


def plane_family(a, b, friction):
    body = ContactBody([[a, -b], [-b, a]], [[1.0, 0.0]], [[0.0, 1.0]])
    return lambda f_t: CoulombLoad(body, AffineLoad([0.0, f_t], [1.0, 0.0]), friction)


# -- two nodes: the critical friction ----------------------------------------------------------


ALPHAS, PATH = (-8.0, 2.0), AffineLoad([0.4, 0.0, 1.8, 0.0], [0.0, 1.0, 0.2, 1.0])


BODY = contact_body(TWO_NODES)


def family(friction):
    return CoulombLoad(BODY, PATH, friction)
