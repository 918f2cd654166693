"""Arrays with derivatives, against differences of the same functions of plain numbers."""

import numpy as np
import pytest
import scipy.sparse as sp

from pwscont import InvalidSystemError
from pwscont.basics.arrays import dense
from pwscont.notation import array_functions  # noqa: F401  what numpy's functions do
from pwscont.notation.arithmetic import KINKED, SMOOTH
from pwscont.notation.dual import Dual, as_operand

RNG = np.random.default_rng(0)
A, B = RNG.normal(size=(4, 4)), RNG.normal(size=(3, 4))
S, MASK = sp.csr_array(A), np.array([True, False, True, True])


def filled(z):
    out = np.zeros_like(z)
    out[0] = z[1] ** 2
    out[1:] = z[:-1]
    return out


def updated(z):
    out = 2.0 * z
    out[:-1] -= z[1:]
    out[1:] += z[:-1] * z[0]
    return out


def kept(z):
    """Change an array that is made of z: z stays as it is."""
    out = z + 1.0
    out[0] = 5.0 * z[3]
    return out + z


def summed(z):
    """Change numbers and single entries in place, as loops do."""
    out, total = 2.0 * z, 0.0
    for i in range(len(z)):
        total += z[i] * z[i]
        out[i] += z[0]
    first = z[0]
    first *= z[1]
    return out + total + first


FUNCTIONS = [
    lambda z: A @ z - z @ A + S @ z + S.T @ z,
    lambda z: B @ z + 1,
    lambda z: np.array([z[0] ** 2 - z[1], np.sin(z[2]) * z[3], 1.0, z[0]]),
    lambda z: [z[0] / z[1], 2.0 - z[2], -z[3], 1 / z[0]],
    lambda z: np.concatenate([z[1:], [0.0], z[:2] * 3]),
    lambda z: np.hstack([z, z[0], 1.0]),
    lambda z: np.append(z, [1.0, 2.0]),
    lambda z: np.stack([z, 2 * z, A[0]], axis=1),
    lambda z: np.roll(z, 1) * z[::-1] + z[[0, 0, 2, 1]],
    lambda z: np.diff(z, n=2) + z.sum() + np.mean(z),
    lambda z: np.sum(z.reshape(2, 2), axis=0) * z.reshape(2, 2),
    lambda z: z.reshape(2, 2) @ z.reshape(2, 2).T,
    lambda z: (z.reshape(2, 2) * np.ones((3, 2, 2))).sum((0, 2)),
    lambda z: np.outer(z, z).ravel() * (z @ z) + np.inner(z, z),
    lambda z: z**3 + 2**z + z**z + z**0 + z**-1.5,
    lambda z: np.where(MASK, z, 2 * z) + np.where(MASK, 1.0, z),
    lambda z: np.diag(z) @ z + np.tril(A) @ z,
    lambda z: np.pad(z, 1) + np.pad(z, 1, mode="edge") + np.pad(z, (2, 0), constant_values=0.0),
    lambda z: np.where([True, False, True, True], z, 2 * z),
    lambda z: np.inner(A, np.outer(z, z[::-1] ** 2)) + np.vdot(z.reshape(2, 2), A[:2, :2]),
    lambda z: np.array([z[0], z[1]]) * np.array([z[2], 2.0]),
    lambda z: np.sin(np.array([z[0], z[1]])) + np.float64(3.0) * z[0],
    lambda z: np.arctan2(z, z[::-1]) + np.hypot(z, 1.0),
    lambda z: z * z[0] + z[1] * z - z / 3 + (z[2] - z) * (z + z[3]) ** 2,
    lambda z: z[:1] * z[1] / 2 - z[2] + z[:1] ** -2 + (z.reshape(2, 2) - z[0]).ravel(),
    filled,
    updated,
    kept,
    summed,
]


def derivative(f, x):
    step = 1e-6
    ends = [(np.asarray(f(x + step * e)), np.asarray(f(x - step * e))) for e in np.eye(len(x))]
    return np.stack([(b - a).ravel() / (2.0 * step) for b, a in ends], axis=1)


@pytest.mark.parametrize("sparse", [False, True])
@pytest.mark.parametrize("number", range(len(FUNCTIONS)))
def test_functions_of_arrays(number, sparse):
    f, x = FUNCTIONS[number], RNG.uniform(0.2, 0.9, 4)
    rows = sp.eye_array(4, format="csr") if sparse else np.eye(4)
    found, value = as_operand(f(Dual(x, rows))), np.asarray(f(x), dtype=float)
    assert found.value.shape == value.shape
    assert found.value == pytest.approx(value, rel=1e-14)
    assert dense(found.rows) == pytest.approx(derivative(f, x), rel=1e-7, abs=1e-8)


@pytest.mark.parametrize("name", SMOOTH)
def test_smooth_functions(name):
    x = RNG.uniform(0.2, 0.9, 3) + (1.0 if name == "arccosh" else 0.0)
    found = getattr(np, name)(Dual.variables(x, 0, 3))
    assert found.rows == pytest.approx(derivative(getattr(np, name), x), rel=1e-7, abs=1e-8)


@pytest.mark.parametrize("name", sorted(KINKED))
def test_functions_with_kinks_are_refused(name):
    z = Dual.variables(np.ones(3), 0, 3)
    function = getattr(np, name)
    more = [z] * (getattr(function, "nin", 1) - 1) + [0.0, 1.0] * (name == "clip")
    with pytest.raises(InvalidSystemError, match="a kink that no switch announces"):
        function(z, *more)


@pytest.mark.parametrize("f", [abs, bool, lambda z: z[0] > 0, lambda z: max(z[0], z[1]), sorted])
def test_decisions_are_refused(f):
    with pytest.raises(InvalidSystemError, match="no switch announces"):
        f(Dual.variables(np.ones(3), 0, 3))
