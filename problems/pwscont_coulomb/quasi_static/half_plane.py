"""A round body on a half-plane of the same material: the contact of Cattaneo and Mindlin.

The surface is divided into strips of width h under uniform tractions. A pressure of resultant one
on a strip at 0 moves the surface at x by

    -2 (1 - nu^2) / (pi E) (x1 log|x1| - x2 log|x2| - h) / h,    x1 = x + h / 2, x2 = x - h / 2,

up to a constant (Johnson, *Contact Mechanics*, 1985, section 2.5), and a shear moves the surface
along the tangent in the same way; pressure and shear do not couple where both bodies are of one
material. The constant is the compliance of whatever carries the bodies far away.
"""

from __future__ import annotations

import numpy as np

from pwscont_coulomb.body import ContactBody

#: The compliance far away, in units of 2 (1 - nu^2) / (pi E).
FAR = 10.0


def half_plane(nodes: int, half_width: float, radius: float, modulus: float) -> ContactBody:
    """Return strips of a half-plane under a round body, as a body of 2 p unknowns.

    Parameters
    ----------
    nodes : int
        Number of strips.
    half_width : float
        Strips lie between -half_width and half_width.
    radius : float
        Of the round body: the gap is x^2 / (2 radius).
    modulus : float
        E / (2 (1 - nu^2)), the effective modulus of two bodies of one material.

    Returns
    -------
    ContactBody
        With the normal, then the tangential displacements of the strips as unknowns.
    """
    h = 2.0 * half_width / nodes
    x = -half_width + h * (np.arange(nodes) + 0.5)
    apart = x[:, np.newaxis] - x
    left, right = apart + 0.5 * h, apart - 0.5 * h
    moved = (left * np.log(np.abs(left)) - right * np.log(np.abs(right)) - h) / h
    flexibility = (FAR - moved) / (np.pi * modulus)
    one = np.linalg.inv(0.5 * (flexibility + flexibility.T))
    stiffness = np.kron(np.eye(2), 0.5 * (one + one.T))
    picks = np.eye(2 * nodes)
    return ContactBody(stiffness, picks[:nodes], picks[nodes:], gap=x**2 / (2.0 * radius))
