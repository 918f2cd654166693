"""All solutions of the Coulomb problem at one load and friction, by trying every contact mode.

Written from the equations of the problem alone, so that it shares no line and no idea with the
package under test: per node the modes are

- no contact: lam_nu = 0, lam_t = 0, with N u <= gap;
- stick: N u = gap, T u = 0, with lam_nu <= 0 and |lam_t| <= -F lam_nu;
- slip+: N u = gap, lam_t = F lam_nu, with lam_nu <= 0 and T u >= 0;
- slip-: N u = gap, lam_t = -F lam_nu, with lam_nu <= 0 and T u <= 0.
"""

from dataclasses import dataclass
from fractions import Fraction
from itertools import islice, product

import numpy as np

MODES = ("no contact", "stick", "slip+", "slip-")


@dataclass(frozen=True)
class Body:
    A: np.ndarray
    N: np.ndarray
    T: np.ndarray
    gap: np.ndarray

    @property
    def p(self):
        return len(self.N)

    @property
    def n(self):
        return len(self.A)


@dataclass(frozen=True)
class Found:
    z: np.ndarray
    modes: tuple[str, ...]
    det_sign: int
    margin: float  # smallest slack of the inequalities: how far from a transition


def equations(body, friction, modes):
    """Return (matrix, rhs without the load): equilibrium, normal rows, tangential rows."""
    n, p = body.n, body.p
    matrix, rhs = np.zeros((n + 2 * p, n + 2 * p)), np.zeros(n + 2 * p)
    matrix[:n] = np.hstack([body.A, -body.N.T, -body.T.T])
    for i, mode in enumerate(modes):
        normal, tangential, lam_nu, lam_t = n + i, n + p + i, n + i, n + p + i
        if mode == "no contact":
            matrix[normal, lam_nu] = matrix[tangential, lam_t] = 1.0
            continue
        matrix[normal, :n], rhs[normal] = body.N[i], body.gap[i]
        if mode == "stick":
            matrix[tangential, :n] = body.T[i]
        else:
            sign = 1.0 if mode == "slip+" else -1.0
            matrix[tangential, lam_t] = 1.0
            matrix[tangential, lam_nu] = -sign * friction[i]
    return matrix, rhs


def slacks(body, friction, modes, z):
    """Return everything that must not be negative in these modes, each a force or a length."""
    u, lam_nu, lam_t = np.split(z, [body.n, body.n + body.p])
    free, u_t = body.gap - body.N @ u, body.T @ u
    values = []
    for i, mode in enumerate(modes):
        bound = -friction[i] * lam_nu[i]
        values += {
            "no contact": [free[i]],
            "stick": [bound - lam_t[i], bound + lam_t[i]],
            "slip+": [-lam_nu[i], u_t[i]],
            "slip-": [-lam_nu[i], -u_t[i]],
        }[mode]
    return np.array(values)


def per_node(friction, p):
    return np.broadcast_to(np.asarray(friction, dtype=float), (p,))


def solve_modes(body, load, friction, modes):
    """Return z in given modes, whether or not the inequalities hold."""
    matrix, rhs = equations(body, per_node(friction, body.p), modes)
    rhs[: body.n] += load
    return np.linalg.solve(matrix, rhs)


def det_sign(body, friction, modes):
    matrix, _ = equations(body, per_node(friction, body.p), modes)
    return int(np.linalg.slogdet(matrix)[0])


def enumerate_solutions(body, load, friction, tolerance=1e-9):
    """Return every isolated solution at one load and friction, as a list of Found."""
    friction, found = per_node(friction, body.p), []
    for modes, z, sign in _promising(body, load, friction, tolerance):
        margin = slacks(body, friction, modes, z).min()
        if margin >= -tolerance:
            found.append(Found(z, modes, sign, margin))
    return found


AT_ONCE = 1024


def _promising(body, load, friction, tolerance):
    """Yield (modes, z, det_sign) of the regular choices but those with a clearly negative slack.

    The same as trying one after the other, in stacks of many.
    """
    choices = product(range(len(MODES)), repeat=body.p)
    matrices, rights = zip(*(equations(body, friction, (m,) * body.p) for m in MODES), strict=True)
    matrices, rights = np.array(matrices), np.array(rights)
    rights[:, : body.n] += load
    row = np.arange(matrices.shape[1])
    while some := list(islice(choices, AT_ONCE)):
        nodes = np.array(some)
        mode = np.hstack([np.zeros((len(some), body.n), dtype=int), nodes, nodes])  # of each row
        stack, right = matrices[mode, row], rights[mode, row]
        signs = np.linalg.slogdet(stack)[0]
        regular = np.flatnonzero(signs)
        z = np.linalg.solve(stack[regular], right[regular, :, np.newaxis])[..., 0]
        least = _least_slacks(body, friction, nodes[regular], z)
        clearly = tolerance + 1e-6 * (1.0 + np.abs(z).max(axis=1)) * (1.0 + friction.max())
        for k in np.flatnonzero(~(least < -clearly)):
            i = regular[k]
            yield tuple(MODES[m] for m in some[i]), z[k], int(signs[i])


def _least_slacks(body, friction, modes, z):
    """Return the least of what ``slacks`` returns, for many choices of modes at once."""
    u, lam_nu, lam_t = np.split(z, [body.n, body.n + body.p], axis=1)
    free, u_t, bound = body.gap - u @ body.N.T, u @ body.T.T, -friction * lam_nu
    slip = [np.minimum(-lam_nu, u_t), np.minimum(-lam_nu, -u_t)]
    every = np.stack([free, np.minimum(bound - lam_t, bound + lam_t), *slip])
    return np.take_along_axis(every, modes[np.newaxis], axis=0)[0].min(axis=1)


def modes_of(label):
    """Return the modes that a label such as ``node 1 slip-, nodes 2 to 5 stick`` names."""
    return tuple(mode for part in label.split(", ") for mode in _modes_of_part(part))


def _modes_of_part(part):
    if part.startswith("nodes "):
        _, first, _, last, mode = part.split(" ", 4)
        return [mode] * (int(last) - int(first) + 1)
    return [part.split(" ", 2)[2] if part.startswith("node ") else part]


# -- affine load paths in rational arithmetic: no rounding at all ------------------------------


@dataclass(frozen=True)
class ExactPiece:
    modes: tuple[str, ...]
    lo: Fraction
    hi: Fraction
    det_sign: int


def exact_pieces(body, f0, f1, friction, interval):
    """Return every piece of the solution set for the load f0 + alpha f1, without rounding.

    Every float is taken as the rational number that it is. Vertical pieces are left out.
    """
    found = []
    for modes in product(MODES, repeat=body.p):
        matrix, rhs = equations(body, per_node(friction, body.p), modes)
        rest = len(rhs) - body.n
        columns = [rhs + np.append(f0, np.zeros(rest)), np.append(f1, np.zeros(rest))]
        solution, sign = exact_solve(matrix, columns)
        if sign == 0:
            continue
        lo, hi = _admissible(body, friction, modes, solution, interval)
        if lo < hi:
            found.append(ExactPiece(modes, lo, hi, sign))
    return found


def exact_solve(matrix, columns):
    """Return the solutions as lists of Fraction, and the sign of the determinant.

    Elimination without fractions (Bareiss): rows are whole numbers, and every division goes
    without remainder; in the end the diagonal holds the determinant everywhere.
    """
    size = len(matrix)
    rows = [_whole([*row, *(c[i] for c in columns)]) for i, row in enumerate(matrix)]
    sign, before = 1, 1
    for k in range(size):
        pivot = next((i for i in range(k, size) if rows[i][k] != 0), None)
        if pivot is None:
            return None, 0
        if pivot != k:
            rows[k], rows[pivot], sign = rows[pivot], rows[k], -sign
        own, rest = rows[k][k], rows[k][k + 1 :]
        for i in range(size):
            if i != k:
                factor, pairs = rows[i][k], zip(rows[i][k + 1 :], rest, strict=True)
                rows[i][k + 1 :] = [(own * a - factor * b) // before for a, b in pairs]
        before = own
    sign = sign if before > 0 else -sign
    return [[Fraction(row[size + j], before) for row in rows] for j in range(len(columns))], sign


def _whole(row):
    """Return the numbers of a row as whole ones, all multiplied by one power of two."""
    ratios = [float(value).as_integer_ratio() for value in row]
    common = max(denominator for _, denominator in ratios)
    return [numerator * (common // denominator) for numerator, denominator in ratios]


def _admissible(body, friction, modes, solution, interval):
    """Return the alphas at which z0 + alpha z1 satisfies all inequalities of the modes."""
    lo, hi = Fraction(interval[0]), Fraction(interval[1])
    bent = (np.array(column, dtype=object) for column in solution)
    z0, z1 = bent
    exact = Body(*(_exact(array) for array in (body.A, body.N, body.T, body.gap)))
    flat = Body(exact.A, exact.N, exact.T, 0 * exact.gap)
    friction = _exact(per_node(friction, body.p))
    at_zero, slope = slacks(exact, friction, modes, z0), slacks(flat, friction, modes, z1)
    for value, rate in zip(at_zero, slope, strict=True):
        if rate == 0 and value < 0:
            return hi, lo
        if rate > 0:
            lo = max(lo, -value / rate)
        if rate < 0:
            hi = min(hi, -value / rate)
    return lo, hi


def _exact(array):
    return np.vectorize(lambda value: Fraction(float(value)), otypes=[object])(array)
