"""The cases of Janovsky and Ligursky (2012), built by hand from the public classes."""

import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from pwscont_coulomb import AffineLoad, ContactBody, CoulombFriction, CoulombLoad
from reference_enumeration import Body

REFERENCE = json.loads((Path(__file__).parents[1] / "reference" / "paper_cases.json").read_text())

ONE_NODE = Body(
    np.array([[2.0, -1.0], [-1.0, 2.0]]),
    np.array([[1.0, 0.0]]),
    np.array([[0.0, 1.0]]),
    np.zeros(1),
)
TWO_NODES = Body(
    np.array(
        [
            [1.0, -1.0, 0.0, 0.0],
            [-1.0, 2.0, -1.0, 0.0],
            [0.0, -1.0, 2.0, -1.0],
            [0.0, 0.0, -1.0, 2.0],
        ]
    ),
    np.eye(4)[[0, 2]],
    np.eye(4)[[1, 3]],
    np.zeros(2),
)


@dataclass(frozen=True)
class PaperCase:
    """One case: the system, and load and friction as functions of alpha for the reference."""

    name: str
    system: Any
    body: Body
    load: Callable
    friction: Callable

    @property
    def reference(self):
        return REFERENCE[self.name]

    @property
    def interval(self):
        return tuple(self.reference["interval"])


def circle(alpha):
    angle = 2.0 * np.pi * alpha - 0.45
    return np.array([0.9 * np.cos(angle) + 1.0, 0.9 * np.sin(angle) - 1.0])


def sphere(phi):
    """Return the load of Example 2, ordered (nu1, t1, nu2, t2)."""
    radius, phi0, psi0, theta0 = 2.5729, 3.9615, 1.4147, 0.9395
    nu1 = radius * np.cos(psi0)
    t1 = radius * np.cos(theta0) * np.sin(psi0)
    nu2 = radius * np.cos(phi + phi0) * np.sin(theta0) * np.sin(psi0)
    t2 = radius * np.sin(phi + phi0) * np.sin(theta0) * np.sin(psi0)
    return np.array([nu1, t1, nu2, t2])


def contact_body(body):
    return ContactBody(body.A, body.N, body.T)


def load_case(name, body, load, friction, r=None):
    system = CoulombLoad(contact_body(body), load, friction, r)
    return PaperCase(name, system, body, load, lambda alpha: friction)


def friction_case(name, body, force, r=None):
    system = CoulombFriction(contact_body(body), force, r)
    return PaperCase(name, system, body, lambda alpha: np.array(force), lambda alpha: alpha)


CASES = {
    case.name: case
    for case in (
        load_case("fig7", ONE_NODE, AffineLoad([0.25, 0.0], [0.0, 1.0]), 4.0),
        load_case("fig10", ONE_NODE, circle, 4.0),
        load_case("fig11", ONE_NODE, circle, 0.7),
        load_case("fig12", ONE_NODE, circle, 2.0),
        friction_case("fig13", ONE_NODE, [1.0, -3.0]),
        friction_case("fig14", ONE_NODE, [0.2, -1.6]),
        friction_case("fig15", ONE_NODE, [1.0, -1.0]),
        friction_case("fig16", ONE_NODE, [1.0, 10.0]),
        friction_case("fig16_as_captioned", ONE_NODE, [1.0, -10.0]),
        load_case(
            "example1", TWO_NODES, AffineLoad([0.4, 0.0, 1.8, 0.0], [0.0, 1.0, 0.2, 1.0]), 4.0
        ),
        load_case("example2", TWO_NODES, sphere, 4.0),
        friction_case("example3", TWO_NODES, [0.4, -1.4, 1.5, -1.5]),
    )
}
STRAIGHT = ("fig7", "example1")
