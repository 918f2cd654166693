"""Random circuits, and all their operating points by a way that knows no pwscont.

Each truth tries every combination of segments, with nodal equations of its own.
"""

from itertools import product

import numpy as np
from pwscont_circuits import (
    BipolarTransistor,
    Circuit,
    CurrentSource,
    Diode,
    Resistor,
    TunnelDiode,
    VoltageSource,
)

SLACK, SAME = 1e-9, 1e-7


class HandMade:
    """Kirchhoff's laws as matrices; curves are (control, intervals of (lo, hi, slope, rest))."""

    def __init__(self, nodes):
        self.nodes, self.G, self.J = nodes, np.zeros((nodes, nodes)), np.zeros(nodes)
        self.sources, self.curves = [], []

    def unit(self, plus, minus):
        e = np.zeros(self.nodes + 1)
        e[plus] += 1.0
        e[minus] -= 1.0
        return e[1:]  # node 0 is ground

    def resistor(self, a, b, r):
        e = self.unit(a, b)
        self.G += np.outer(e, e) / r

    def curve(self, leaves, control, pieces):
        self.curves.append((leaves, control, pieces))

    def solutions(self):
        found = []
        for pieces in product(*(pieces for *_, pieces in self.curves)):
            x = self._in(pieces)
            if x is not None and not any(np.abs(x - y).max() < SAME for y in found):
                found.append(x)
        return found

    def _in(self, pieces):
        A, b = self.G.copy(), -self.J.copy()
        for (leaves, control, _), (_, _, slope, rest) in zip(self.curves, pieces, strict=True):
            A += slope * np.outer(leaves, control)
            b -= rest * leaves
        k = len(self.sources)
        E = np.array([e for e, _ in self.sources]).reshape(k, self.nodes)
        whole = np.block([[A, E.T], [E, np.zeros((k, k))]])
        x = np.linalg.solve(whole, np.append(b, [v for _, v in self.sources]))[: self.nodes]
        for (_, control, _), (lo, hi, *_) in zip(self.curves, pieces, strict=True):
            if not lo - SLACK <= control @ x <= hi + SLACK:
                return None
        return x


def random_circuit(seed, kinked=None):
    """Return elements, and a function from the value of source E to the equations by hand.

    Every node has a resistor to another or to ground, so that all combinations of segments are
    regular but by accident. Nodes are n1, n2, ...; n1 is driven by E.
    """
    rng = np.random.default_rng(seed)
    count = int(rng.integers(1, 9)) if kinked is None else kinked
    nodes = int(rng.integers(2, 6))
    elements, recipe = [VoltageSource("E", "n1", "0", 0.0)], []

    def name(k):
        return f"n{k}" if k else "0"

    for k in range(2, nodes + 1):
        for other, small, large in ((int(rng.integers(0, k)), 0.5, 10.0), (0, 10.0, 100.0)):
            r = float(rng.uniform(small, large))
            elements.append(Resistor(f"R{len(elements)}", name(k), name(other), r))
            recipe.append(("resistor", k, other, r))
    if rng.random() < 0.5:
        a, value = int(rng.integers(2, nodes + 1)), float(rng.normal())
        elements.append(CurrentSource("I", name(a), "0", value))
        recipe.append(("current", a, 0, value))
    budget = 0
    for i in range(count):
        kind = rng.choice(["diode", "tunnel", "transistor"])
        if budget + {"diode": 1, "tunnel": 2, "transistor": 2}[kind] > 9:
            kind = "diode"
        budget += {"diode": 1, "tunnel": 2, "transistor": 2}[kind]
        if kind == "transistor":
            c, b, e = (int(k) for k in rng.integers(0, nodes + 1, size=3))
            if len({c, b, e}) < 3:
                kind = "diode"
            else:
                af, ar = float(rng.uniform(0.8, 0.99)), float(rng.uniform(0.1, 0.6))
                vf, vr = float(rng.uniform(0.4, 0.8)), float(rng.uniform(0.3, 0.7))
                rf, rr = float(rng.uniform(0.05, 1.0)), float(rng.uniform(0.05, 1.0))
                polarity = str(rng.choice(["npn", "pnp"]))
                elements.append(
                    BipolarTransistor(
                        f"Q{i}", name(c), name(b), name(e), polarity, af, ar, vf, vr, rf, rr
                    )
                )
                sign = 1.0 if polarity == "npn" else -1.0
                recipe.append(("transistor", c, b, e, sign, af, ar, vf, vr, rf, rr))
                continue
        a, b = (int(k) for k in rng.choice(nodes + 1, size=2, replace=False))
        if kind == "tunnel":
            vp, ip = float(rng.uniform(0.3, 1.0)), float(rng.uniform(0.05, 0.5))
            vv, iv = vp + float(rng.uniform(0.2, 1.0)), ip * float(rng.uniform(0.0, 0.5))
            r = float(rng.uniform(0.5, 5.0))
            elements.append(TunnelDiode(f"D{i}", name(a), name(b), vp, ip, vv, iv, r))
            recipe.append(("tunnel", a, b, vp, ip, vv, iv, r))
        else:
            v, r, g = float(rng.uniform(0.2, 0.9)), float(rng.uniform(0.02, 1.0)), 0.0
            elements.append(Diode(f"D{i}", name(a), name(b), v, r, g))
            recipe.append(("diode", a, b, v, r))
    return Circuit(elements), lambda value: by_hand(nodes, recipe, value)


def random_chain(seed):
    """Return two to four tunnel diodes in series behind a resistor: up to 3^k operating points."""
    rng = np.random.default_rng(seed)
    count = int(rng.integers(2, 5))
    r = float(rng.uniform(5.0, 20.0))
    elements = [VoltageSource("E", "n1", "0", 0.0), Resistor("R", "n1", "n2", r)]
    recipe = [("resistor", 1, 2, r)]
    for i in range(count):
        a, b = i + 2, (i + 3 if i < count - 1 else 0)
        vp, ip = float(rng.uniform(0.3, 1.0)), float(rng.uniform(0.3, 0.5))
        vv, iv = vp + float(rng.uniform(0.2, 1.0)), ip * float(rng.uniform(0.0, 0.5))
        last = float(rng.uniform(0.5, 5.0))
        ends = f"n{a}", f"n{b}" if b else "0"
        elements.append(TunnelDiode(f"D{i}", *ends, vp, ip, vv, iv, last))
        recipe.append(("tunnel", a, b, vp, ip, vv, iv, last))
    return Circuit(elements), lambda value: by_hand(count + 1, recipe, value)


def by_hand(nodes, recipe, value):
    """Return the equations of a recipe with the source E at a value."""
    made, inf = HandMade(nodes), np.inf
    made.sources.append((made.unit(1, 0), value))
    for kind, *rest in recipe:
        if kind == "resistor":
            made.resistor(*rest)
        elif kind == "current":
            a, b, i = rest
            made.J += i * made.unit(a, b)
        elif kind == "diode":
            a, b, v, r = rest
            e = made.unit(a, b)
            made.curve(e, e, [(-inf, v, 0.0, 0.0), (v, inf, 1.0 / r, -v / r)])
        elif kind == "tunnel":
            a, b, vp, ip, vv, iv, r = rest
            e, fall = made.unit(a, b), (iv - ip) / (vv - vp)
            pieces = [(-inf, vp, ip / vp, 0.0), (vp, vv, fall, ip - fall * vp)]
            made.curve(e, e, [*pieces, (vv, inf, 1.0 / r, iv - vv / r)])
        else:
            c, b, e, sign, af, ar, vf, vr, rf, rr = rest
            be, bc = sign * made.unit(b, e), sign * made.unit(b, c)
            # collector takes af i_F - i_R, emitter gives i_F - ar i_R, base takes the difference
            ends = np.stack([made.unit(c, 0), made.unit(e, 0), made.unit(b, 0)])
            forward, reverse = np.array([af, -1.0, 1.0 - af]), np.array([-1.0, ar, 1.0 - ar])
            made.curve(
                sign * forward @ ends, be, [(-inf, vf, 0.0, 0.0), (vf, inf, 1.0 / rf, -vf / rf)]
            )
            made.curve(
                sign * reverse @ ends, bc, [(-inf, vr, 0.0, 0.0), (vr, inf, 1.0 / rr, -vr / rr)]
            )
    return made
